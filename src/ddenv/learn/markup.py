"""The little Markdown of a lesson's texts: paragraphs, lists, **strong**, *emphasis* and `code`. Anything else is plain text."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

Style = Literal["", "strong", "emphasis", "code"]
_SPAN = re.compile(r"\*\*(.+?)\*\*|\*(.+?)\*|`(.+?)`")


@dataclass(frozen=True, slots=True)
class Block:
    """A paragraph, or an entry of a list; `spans` are its words with their styles."""

    spans: tuple[tuple[str, Style], ...]
    listed: bool = False


def blocks(text: str) -> tuple[Block, ...]:
    """The paragraphs and entries of a text."""
    found: list[tuple[bool, list[str]]] = []
    fresh = True
    for line in text.splitlines():
        words = line.strip()
        listed = words.startswith(("- ", "* "))
        if not words:
            fresh = True
        elif listed or fresh:
            found.append((listed, [words[2:] if listed else words]))
            fresh = False
        else:
            found[-1][1].append(words)
    return tuple(Block(_spans(" ".join(lines)), listed) for listed, lines in found)


def _spans(text: str) -> tuple[tuple[str, Style], ...]:
    spans: list[tuple[str, Style]] = []
    begin = 0
    for found in _SPAN.finditer(text):
        spans.append((text[begin : found.start()], ""))
        style: Style = "strong" if found[1] else "emphasis" if found[2] else "code"
        spans.append((found[1] or found[2] or found[3], style))
        begin = found.end()
    return tuple(span for span in (*spans, (text[begin:], "")) if span[0])
