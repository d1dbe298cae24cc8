"""The parts of a report in any format: headings, sentences, tables, pictures. Plain frozen data."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from ddenv.text import Data
from ddenv.text import duration as duration
from ddenv.text import percent as percent


@dataclass(frozen=True, slots=True)
class Name:
    """A name from a file: it may hold anything, and is shown as it is."""

    text: str


@dataclass(frozen=True, slots=True)
class Strong:
    """Words in bold."""

    text: str


Part = str | Name | Strong
Cell = Part | tuple[Part, ...]


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Sentences. A `notice` says what the reader must not overlook, such as that a run has not
    ended.
    """

    parts: tuple[Part, ...]
    notice: bool = False


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells below a `head`. Columns with a number in `right` are aligned to the right;
    `strong` rows stand out.
    """

    head: tuple[str, ...]
    rows: Sequence[tuple[Cell, ...]]
    right: Collection[int] = ()
    strong: Collection[int] = ()


@dataclass(frozen=True, slots=True)
class Picture:
    """A drawing. `svg` takes its colours from the classes of `style.css`; `alternative` describes
    it in words.
    """

    name: str
    svg: str
    alternative: str


@dataclass(frozen=True, slots=True)
class Code:
    """Lines shown as they are, such as commands. With a `folded` title, they open on a click."""

    lines: tuple[str, ...]
    folded: str = ""


Block = Paragraph | Table | Picture | Code


@dataclass(frozen=True, slots=True)
class Section:
    """A heading with its blocks."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A whole report: its name, the result in a few words, `figures` (number, what it counts), and
    its sections.
    """

    name: str
    verdict: str
    lead: tuple[Paragraph, ...]
    figures: tuple[tuple[str, str], ...]
    sections: tuple[Section, ...]
    foot: str


def parts(cell: Cell) -> tuple[Part, ...]:
    if isinstance(cell, tuple):
        return cell
    return (cell,)


def say(*words: Part, notice: bool = False) -> Paragraph:
    return Paragraph(words, notice)


def named(models: Sequence[str], most: int) -> tuple[Part, ...]:
    """a, b and 3 more: at most `most` of the models by name."""
    words = [part for name in models[:most] for part in (", ", Name(name))][1:]
    more = len(models) - most
    if more > 0:
        return (*words, f" and {more} more")
    return tuple(words)


def moment(time: float) -> str:
    """Unix time, s, as date and time in UTC: a report is read anywhere. "" for an invalid time."""
    try:
        return f"{datetime.fromtimestamp(time, UTC):%Y-%m-%d %H:%M:%S}"
    except (OverflowError, OSError, ValueError):
        return ""


def thousands(number: int) -> str:
    """12 345."""
    return f"{number:,}".replace(",", " ")


def section(data: Mapping[str, Any], key: str) -> Data:
    """A part of a scenario; empty if a damaged file has something else."""
    value = data.get(key)
    if isinstance(value, dict):
        return value
    return {}
