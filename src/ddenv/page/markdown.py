"""A report as Markdown, with its pictures as SVG files beside it."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import quote

from ddenv.page.blocks import (
    Block,
    Cell,
    Code,
    Name,
    Paragraph,
    Part,
    Picture,
    Report,
    Section,
    Strong,
    Table,
    parts,
)
from ddenv.text import plain, printable

HERE = Path(__file__).parent
_MARKUP = re.compile(r"([\\`*_\[\]<>|~$&])")
# Characters that start a heading, a list or a quotation at the beginning of a line.
_BEGINNING = re.compile(r"^(\d*)([#+=.)-])")


def markdown(report: Report, stem: str) -> str:
    """The text; its pictures are `pictures` of the same `stem`."""
    figures = Table(
        tuple(what for _, what in report.figures),
        (tuple(number for number, _ in report.figures),),
        range(len(report.figures)),
    )
    lines = [f"# {_name(report.name)}: {_text(report.verdict)}", ""]
    opening = Section("", (*report.lead, figures))
    for section in (opening, *report.sections):
        lines += [f"## {_text(section.title)}", ""] if section.title else []
        for block in section.blocks:
            lines += [*_block(block, stem), ""]
    return "\n".join([*lines, "---", "", _text(report.foot), ""])


def pictures(report: Report, stem: str) -> dict[str, str]:
    """The SVG files that the text of the same `stem` shows, by name."""
    style = (HERE / "style.css").read_text()
    ground = '<rect width="100%" height="100%" style="fill: var(--page)"/>'
    found = {}
    for block in (block for section in report.sections for block in section.blocks):
        if isinstance(block, Picture):
            # It contains its own colours.
            start = block.svg.index(">") + 1
            svg = f"{block.svg[:start]}\n<style>\n{style}</style>\n{ground}{block.svg[start:]}\n"
            found[_file(stem, block)] = svg
    return found


def _file(stem: str, picture: Picture) -> str:
    return f"{stem}.{picture.name}.svg"


def _block(block: Block, stem: str) -> list[str]:
    match block:
        case Paragraph():
            words = "".join(map(_part, block.parts))
            return [f"> {words}" if block.notice else _BEGINNING.sub(r"\1\\\2", words)]
        case Table():
            sides = (
                "---:" if column in block.right else "---" for column in range(len(block.head))
            )
            rows = (_row(row, number in block.strong) for number, row in enumerate(block.rows))
            return [_row(block.head, False), f"| {' | '.join(sides)} |", *rows]
        case Picture():
            return [f"![{_text(block.alternative)}]({quote(_file(stem, block))})"]
        case Code():
            fence = "`" * max(
                3,
                1 + max((len(run) for run in re.findall("`+", "\n".join(block.lines))), default=0),
            )
            shown = [fence, *map(printable, block.lines), fence]
            fold = ["<details>", f"<summary>{block.folded}</summary>", "", *shown, "", "</details>"]
            if block.folded:
                return fold
            return shown


def _row(row: tuple[Cell, ...], strong: bool) -> str:
    cells = ["".join(map(_part, parts(cell))) for cell in row]
    return f"| {' | '.join(f'**{cell}**' if strong and cell else cell for cell in cells)} |"


def _part(part: Part) -> str:
    match part:
        case Name(text):
            return _name(text)
        case Strong(text):
            return f"**{_text(text)}**"
    lead = part[: len(part) - len(part.lstrip(" "))]
    tail = part[len(part.rstrip(" ")) :] if part.strip() else ""
    return f"{lead}{_text(part)}{tail}"


def _name(text: str) -> str:
    """As code, without markup and mentions; in a table a bar still needs an escape."""
    text = plain(text)
    fence = "`" * (1 + max((len(run) for run in re.findall("`+", text)), default=0))
    space = " " if text.startswith("`") or text.endswith("`") else ""
    if text:
        return f"{fence}{space}{text}{space}{fence}".replace("|", "\\|")
    return ""


def _text(text: str) -> str:
    return _MARKUP.sub(r"\\\1", plain(text))
