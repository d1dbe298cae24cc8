"""Values of events, checked. All raise ValueError, TypeError, IndexError or OverflowError for what makes no sense."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

# What an event holds; which fields of the state it gives other values.
Data = dict[str, Any]
Changes = dict[str, Any]
Names = tuple[str, ...]
# In the year 5138, s.
LATEST = 1e11


def number(value: Any) -> float:
    """A finite number."""
    finite = float(value)
    if not math.isfinite(finite):
        raise ValueError(value)
    return finite


def chance(value: Any) -> float:
    """A number from 0 to 1."""
    part = number(value)
    if not 0 <= part <= 1:
        raise ValueError(value)
    return part


def moment(value: Any) -> float:
    """A Unix time, s, that a calendar can show."""
    time = number(value)
    if not 0 <= time < LATEST:
        raise ValueError(value)
    return time


def one_of(value: Any, *words: str) -> str:
    """One of these words."""
    if value not in words:
        raise ValueError(value)
    return value


def vector(values: Iterable[Any], length: int) -> tuple[float, ...]:
    """`length` finite numbers."""
    numbers = tuple(number(value) for value in values)
    if len(numbers) != length:
        raise ValueError(values)
    return numbers


def names(elements: Names, numbers: list[int]) -> Names:
    """The models with these numbers."""
    if min(numbers, default=0) < 0:
        raise IndexError(numbers)
    return tuple(elements[index] for index in numbers)


def moments(elements: Names, pairs: Iterable[Any]) -> tuple[tuple[str, float], ...]:
    """(name, s) for each pair of a model's number and a time, s, from the start of a test on."""
    found = [(index, float(time)) for index, time in pairs]
    if not all(index >= 0 and 0 <= time < math.inf for index, time in found):
        raise ValueError(pairs)
    return tuple((elements[index], time) for index, time in found)
