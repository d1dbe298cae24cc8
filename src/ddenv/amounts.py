"""The format of numbers, times and lists of names in all views."""

from __future__ import annotations

import math
from collections.abc import Sequence


def count(number: int, word: str) -> str:
    """1 model, 2 models."""
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


def first_of(names: Sequence[str], most: int) -> str:
    """a, b and 3 more: at most `most` of them by name."""
    left = len(names) - most
    return ", ".join(names[:most]) + (f" and {left} more" if left > 0 else "")


def duration(seconds: float) -> str:
    """`seconds` as 7 s, 1 min 40 s or 2 h 05 min."""
    whole = max(0, round(seconds)) if math.isfinite(seconds) else 0
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02} min"


def percent(part: float) -> str:
    """A fraction as a whole percentage that is never rounded to certainty."""
    value = round(100 * part)
    if value == 0 and part > 0:
        return "<1 %"
    if value == 100 and part < 1:
        return ">99 %"
    return f"{value} %"
