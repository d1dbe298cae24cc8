"""A report as one HTML page that needs nothing else: no script, no other file; and what our pages
may load and run.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping
from html import escape
from pathlib import Path

from ddenv.page.blocks import (
    Block,
    Code,
    Name,
    Paragraph,
    Part,
    Picture,
    Report,
    Strong,
    Table,
    parts,
)
from ddenv.text import plain, printable

HERE = Path(__file__).parent


def html(report: Report) -> str:
    style = "\n" + (HERE / "style.css").read_text() + (HERE / "page.css").read_text()
    lines = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        (
            '<meta http-equiv="Content-Security-Policy" '
            f'content="{policy({"style-src": hashed(style)})}">'
        ),
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{_text(report.name)}: {_text(report.verdict)}</title>",
        f"<style>{style}</style></head><body><main>",
        f'<header><p class="of"><bdi>{_text(report.name)}</bdi></p>',
        f"<h1>{_text(report.verdict)}</h1>",
        *(_paragraph(each) for each in report.lead),
        '<dl class="figures">',
        *(
            f"<div><dt>{_text(what)}</dt><dd>{_text(number)}</dd></div>"
            for number, what in report.figures
        ),
        "</dl>",
        "</header>",
    ]
    for section in report.sections:
        lines += [
            f"<section><h2>{_text(section.title)}</h2>",
            *map(_block, section.blocks),
            "</section>",
        ]
    return "\n".join(
        [*lines, f"<footer>{_text(report.foot)}</footer>", "</main></body></html>", ""]
    )


def _block(block: Block) -> str:
    match block:
        case Paragraph():
            return _paragraph(block)
        case Table():
            return _table(block)
        case Picture():
            words = escape(plain(block.alternative))
            return f'<figure class="{block.name}" aria-label="{words}">\n{block.svg}\n</figure>'
        case Code():
            text = escape("\n".join(map(printable, block.lines)))
            shown = f"<pre>{text}</pre>"
            if block.folded:
                return f"<details><summary>{_text(block.folded)}</summary>{shown}</details>"
            return shown


def _paragraph(block: Paragraph) -> str:
    notice = ' class="notice"' if block.notice else ""
    return f"<p{notice}>{''.join(map(_part, block.parts))}</p>"


def _table(table: Table) -> str:
    sides = [
        ' class="number"' if column in table.right else "" for column in range(len(table.head))
    ]
    head = "".join(
        f"<th{side}>{_text(title)}</th>" for side, title in zip(sides, table.head, strict=True)
    )
    rows = []
    for number, row in enumerate(table.rows):
        strong = ' class="strong"' if number in table.strong else ""
        cells = (
            f"<td{side}>{''.join(map(_part, parts(cell)))}</td>"
            for side, cell in zip(sides, row, strict=True)
        )
        rows.append(f"<tr{strong}>{''.join(cells)}</tr>\n")
    body = "".join(rows)
    markup = f"<table><thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody></table>"
    return f'<div class="table">{markup}</div>'


def _part(part: Part) -> str:
    match part:
        case Name(text):
            return f"<bdi>{_text(text)}</bdi>"
        case Strong(text):
            return f"<strong>{_text(text)}</strong>"
    return escape(part)


def _text(text: str) -> str:
    return escape(plain(text))


# Nothing that is not named, whatever a run file contains.
_NOTHING = {"default-src": "'none'", "base-uri": "'none'", "form-action": "'none'"}


def policy(allowed: Mapping[str, str]) -> str:
    """A Content-Security-Policy that allows only what `allowed` names, by directive."""
    return "; ".join(
        f"{directive} {sources}" for directive, sources in {**_NOTHING, **allowed}.items()
    )


def of_scripts(page: str) -> str:
    """The sources of the `<script>` elements that a page has itself."""
    return " ".join(hashed(text) for text in re.findall(r"<script>(.*?)</script>", page, re.DOTALL))


def hashed(text: str) -> str:
    """The source that allows exactly `text`."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
