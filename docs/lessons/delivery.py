"""The robot of the first lesson: it follows a rule that anybody can follow on the map.

It drives to where the road forks. If the sign stands there it takes the left lane, otherwise the
right one. It gets stuck where its lane is closed. The wide crate closes the left lane; right behind
it, so do the barrel and the cone, side by side. The pallet closes the right one.
"""

from __future__ import annotations

from collections.abc import Iterable

STEP = 0.1  # s
START, FORK, LANE, GOAL = (-6.0, 0.0), (-3.0, 0.0), 1.4, (6.0, 0.0)
# Where a robot stops in front of what closes its lane: x, m.
CRATE_STOP, PAIR_STOP, PALLET_STOP = 0.15, 0.55, 0.9


def way(models: Iterable[str], seed: int = 0) -> tuple[list[tuple[float, float]], bool]:
    """The corners of the robot's path among these models, m, and whether it reaches the goal; the
    same for every `seed`.
    """
    there = frozenset(models)
    left = "sign" in there
    y = LANE if left else -LANE
    begin = [START, FORK, (-2.0, y)]
    if left and "crate" in there:
        return [*begin, (CRATE_STOP, y)], False
    if left and there.issuperset({"barrel", "cone"}):
        return [*begin, (PAIR_STOP, y)], False
    if not left and "pallet" in there:
        return [*begin, (PALLET_STOP, y)], False
    return [*begin, (4.0, y), GOAL], True


def outcome(models: Iterable[str]) -> str:
    """How a test with these models ends: "similar" (stuck in the left lane), "other" (in the right
    one) or "pass".
    """
    corners, reached = way(models)
    return "pass" if reached else "similar" if corners[-1][1] > 0 else "other"
