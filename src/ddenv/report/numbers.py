"""Numbers and moments as a report words them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any


def percent(part: float) -> str:
    """A fraction as a whole percentage that is never rounded to certainty."""
    value = round(100 * part)
    if value == 0 and part > 0:
        return "<1 %"
    if value == 100 and part < 1:
        return ">99 %"
    return f"{value} %"


def duration(seconds: float) -> str:
    """`seconds` as 7 s, 1 min 40 s or 2 h 05 min."""
    whole = max(0, round(seconds)) if math.isfinite(seconds) else 0
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02} min"


def moment(time: float) -> str:
    """Unix time, s, as date and time in UTC: a report is read anywhere. "" for what is no time."""
    try:
        return f"{datetime.fromtimestamp(time, UTC):%Y-%m-%d %H:%M:%S}"
    except (OverflowError, OSError, ValueError):
        return ""


def place(values: tuple[float, ...]) -> str:
    """x, y and z in m."""
    # Adding zero makes -0.0 the same as 0.0.
    return ", ".join(f"{round(value, 2) + 0.0:.2f}" for value in values[:3])


def thousands(number: int) -> str:
    """12 345."""
    return f"{number:,}".replace(",", " ")


def section(data: Mapping[str, Any], key: str) -> dict[str, Any]:
    """A part of a scenario; an empty one where a damaged file has something else."""
    value = data.get(key)
    return value if isinstance(value, dict) else {}
