"""The arguments of `ddenv.reduce`: what they must be. Wrong ones raise UserError, in one line."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from numbers import Integral, Real

import numpy as np

from ddenv.arrays import Floats
from ddenv.errors import UserError
from ddenv.reduction.evidence import Place, Traits

# Larger numbers are a mistake, and their squares could be infinite.
LARGEST = 1e9


def checked_names(elements: Iterable[str]) -> tuple[str, ...]:
    """The elements as a tuple. Raises UserError if they are no names, or if a name occurs twice."""
    try:
        names = tuple(elements)
        different = len(set(names))
    except TypeError:
        raise UserError(f"elements: expected names, found {elements!r}") from None
    if different != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise UserError(f"elements: {twice!r} occurs twice; give each element its own name")
    return names


def checked_positions(names: tuple[str, ...], positions: Mapping[str, Place] | None) -> dict[str, Place] | None:
    """The position of each name, m. Raises UserError."""
    if positions is None:
        return None
    _check_mapping("positions", positions)
    return {name: _place(f"positions[{name!r}]", positions.get(name)) for name in names}


def checked_trajectory(trajectory: Floats | None) -> Floats | None:
    """The trajectory, shape (N, 5). Raises UserError."""
    if trajectory is None:
        return None
    try:
        path = np.asarray(trajectory)
        path = path.astype(float, casting="safe" if path.dtype.kind in "cOSU" else "unsafe")
    except (TypeError, ValueError):
        raise UserError("trajectory: expected finite numbers of shape (N, 5)") from None
    if path.ndim != 2 or path.shape[1] != 5 or not len(path) or not (np.abs(path) <= LARGEST).all():
        raise UserError(f"trajectory: expected finite numbers of shape (N, 5), found shape {path.shape}")
    if (np.diff(path[:, 0]) < 0).any():
        raise UserError("trajectory: its times, in the first column, must not decrease")
    return path


def checked_failure(failure_pose: Iterable[float] | None, path: Floats | None) -> Place | None:
    """The position of the failure, m: given, or the end of the path (N, 5). Raises UserError."""
    if failure_pose is not None:
        return _place("failure_pose", failure_pose)
    if path is None:
        return None
    x, y, z = path[-1, 1:4].tolist()
    return x, y, z


def checked_times(first_sensed: Mapping[str, float] | None) -> dict[str, float] | None:
    """The time of each name that was sensed, s. Raises UserError."""
    if first_sensed is None:
        return None
    _check_mapping("first_sensed", first_sensed)
    for name, at in first_sensed.items():
        if not isinstance(at, Real) or not 0 <= at <= LARGEST:
            raise UserError(f"first_sensed[{name!r}]: expected a time in s, found {at!r}")
    return {name: float(at) for name, at in first_sensed.items()}


def checked_traits(names: tuple[str, ...], traits: Mapping[str, Traits] | None) -> Mapping[str, Traits] | None:
    """The traits of each name. Raises UserError."""
    if traits is None:
        return None
    _check_mapping("traits", traits)
    for name in names:
        if not isinstance(traits.get(name), Traits):
            raise UserError(f"traits[{name!r}]: expected ddenv.Traits, found {traits.get(name)!r}")
    return traits


def checked_number(what: str, value: float, most: float = LARGEST) -> float:
    """`value` as a number above 0, at most `most`. Raises UserError."""
    if not isinstance(value, Real) or not 0 < value <= most:
        limit = "" if most == LARGEST else f", at most {most:g}"
        raise UserError(f"{what}: expected a number above 0{limit}, found {value!r}")
    return float(value)


def checked_count(what: str, value: int, least: int) -> int:
    """`value` as a whole number, `least` or more. Raises UserError."""
    if not isinstance(value, Integral) or not least <= value < 2**31:
        raise UserError(f"{what}: expected {least} or more, found {value!r}")
    return int(value)


def checked_choice(what: str, value: str, allowed: tuple[str, ...]) -> None:
    """Raises UserError if `value` is not allowed."""
    if value not in allowed:
        raise UserError(f"{what}: {value!r} is not allowed; use one of {', '.join(allowed)}")


def _check_mapping(what: str, value: object) -> None:
    if not isinstance(value, Mapping):
        raise UserError(f"{what}: expected a mapping from names to values, found {type(value).__name__}")


def _place(what: str, values: Iterable[float] | None) -> Place:
    if values is None:
        raise UserError(f"{what}: is missing")
    try:
        numbers = [] if isinstance(values, str) else [float(value) for value in values][:3]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) < 3 or not all(math.isfinite(number) and abs(number) <= LARGEST for number in numbers):
        raise UserError(f"{what}: expected x, y, z m, found {values!r}")
    return numbers[0], numbers[1], numbers[2]
