"""Rows of a map as the text that Textual shows."""

from __future__ import annotations

from functools import lru_cache

from rich.color import Color
from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip

from ddenv.map.paint import NUMBERED, Canvas


def strip(canvas: Canvas, row: int) -> Strip:
    """One row of `canvas`."""
    segments = [Segment(run.text, _style(run.fore, run.back, run.bold)) for run in canvas.runs(row)]
    return Strip(segments, canvas.chars.shape[1])


@lru_cache(maxsize=4096)
def _style(fore: int, back: int, bold: bool) -> Style:
    return Style(color=_color(fore), bgcolor=_color(back), bold=bold)


def _color(value: int) -> Color:
    if value < 0:
        return Color.default()
    if value >= NUMBERED:
        return Color.from_ansi(value - NUMBERED)
    return Color.from_rgb(value >> 16, value >> 8 & 255, value & 255)
