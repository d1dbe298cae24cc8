"""Numbers and moments as a report words them."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from ddenv.words import duration as duration
from ddenv.words import percent as percent


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
