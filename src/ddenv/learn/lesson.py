"""A lesson: texts and questions, each at its place in a recorded run. Plain frozen data;
`ddenv.learn.reading` makes it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import yaml

from ddenv.text import Names

Foretold = Literal["outcome", "winner", "parts"]


@dataclass(frozen=True, slots=True)
class Answer:
    """A possible answer. `why` says what is right or wrong about it; `misconception` is a name of
    `MISCONCEPTIONS`, or "".
    """

    text: str
    right: bool
    why: str
    misconception: str = ""


@dataclass(frozen=True, slots=True)
class Question:
    """A question with its answers, of which one is right. `hint` is "" if there is none."""

    text: str
    answers: tuple[Answer, ...]
    hint: str = ""

    @property
    def right(self) -> int:
        return next(place for place, answer in enumerate(self.answers) if answer.right)


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A step of a lesson: a Markdown `text`, then maybe a question, something to foretell, or
    something to do.

    `at` is the event of the run that is shown; None leaves it where it is. `budget` is how many
    tests a student has to search alone, `race` names the algorithms or pairs that race. `line` is
    the line in the lesson's file.
    """

    text: str
    at: int | None = None
    question: Question | None = None
    foretell: Foretold | None = None
    budget: int | None = None
    race: Names = ()
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Lesson:
    """`name` is its file's, without number and ending; `minutes` is how long it takes. `oracle` is
    None without one.

    `beside` are other runs by name, for figures to compare with.
    """

    file: Path
    title: str
    aim: str
    minutes: int
    run: Path
    oracle: Path | None
    steps: tuple[Step, ...]
    beside: Mapping[str, Path] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return self.file.stem.lstrip("0123456789-")


# What students often believe, and what is right instead, by name.
MISCONCEPTIONS: dict[str, tuple[str, str]] = {
    name: (each["belief"], each["right"])
    for name, each in yaml.safe_load(
        Path(__file__).with_name("misconceptions.yaml").read_text()
    ).items()
}


Style = Literal["", "strong", "emphasis", "code"]
_SPAN = re.compile(r"\*\*(.+?)\*\*|\*(.+?)\*|`(.+?)`")


@dataclass(frozen=True, slots=True)
class Block:
    """A paragraph, or an entry of a list; `spans` are its words with their styles."""

    spans: tuple[tuple[str, Style], ...]
    listed: bool = False


def blocks(text: str) -> tuple[Block, ...]:
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
        style: Style = "code"
        if found[1]:
            style = "strong"
        elif found[2]:
            style = "emphasis"
        spans.append((found[1] or found[2] or found[3], style))
        begin = found.end()
    return tuple(span for span in (*spans, (text[begin:], "")) if span[0])
