"""The robot of the lessons on flaky failures and on certificates: luck is part of its rule.

It drives along a quay, straight on. Now and then it comes off its line by itself; oil and ramp make
that much likelier. Off its line it gets stuck at the gate; without the gate it gets stuck at the
crate behind it; without both it arrives all the same.
"""

from __future__ import annotations

import random
from collections.abc import Iterable

STEP = 0.5  # s
START, GOAL, OFF = (-6.0, 0.0), (6.0, 0.0), 0.5
# Where a robot off its line stops: x, m.
GATE_STOP, CRATE_STOP = 1.8, 3.9
# The chance to come off the line, and what oil and ramp add to it.
BY_ITSELF, BY_OIL, BY_RAMP = 0.1, 0.4, 0.4


def off_line(models: Iterable[str]) -> float:
    """The chance that the robot comes off its line among these models."""
    there = frozenset(models)
    return BY_ITSELF + BY_OIL * ("oil" in there) + BY_RAMP * ("ramp" in there)


def rate(models: Iterable[str]) -> float:
    """The rate of f among these models: stuck at the gate."""
    there = frozenset(models)
    return off_line(there) if "gate" in there else 0.0


def way(models: Iterable[str], seed: int) -> tuple[list[tuple[float, float]], bool]:
    """The corners of the robot's path among these models, m, and whether it reaches the goal."""
    there = frozenset(models)
    # Every model changes the drive a little, so the dice fall otherwise in every part of the world.
    is_off = random.Random(f"{seed} {' '.join(sorted(there))}").random() < off_line(there)
    if not is_off:
        return [START, GOAL], True
    begin = [START, (-3.0, 0.0), (GATE_STOP, OFF)]
    if "gate" in there:
        return begin, False
    if "crate" in there:
        return [*begin, (CRATE_STOP, OFF)], False
    return [*begin, GOAL], True
