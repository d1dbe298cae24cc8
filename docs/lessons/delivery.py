#!/usr/bin/env python3
"""The robot of the first lesson: it follows a rule that anybody can follow on the map.

It drives to where the road parts. If the sign stands there it takes the left lane, otherwise the right one. It gets stuck where
its lane is closed. The wide crate closes the left lane; right behind it, so do the barrel and the cone, side by side. The pallet
closes the right one.

    delivery.py WORLD     prints the pose log; exit codes: 0 goal reached, 1 time is up
"""

from __future__ import annotations

import os
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from itertools import pairwise

SPEED, STEP = 0.5, 0.1  # m/s, s
START, FORK, LANE, GOAL = (-6.0, 0.0), (-3.0, 0.0), 1.4, (6.0, 0.0)
# Where a robot stops in front of what closes its lane: x, m.
CRATE_STOP, PAIR_STOP, PALLET_STOP = 0.15, 0.55, 0.9


def way(models: Iterable[str]) -> tuple[list[tuple[float, float]], bool]:
    """The corners of the robot's way among these models, m, and whether it reaches the goal."""
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
    """How a test with these models ends: "similar" (stuck in the left lane), "other" (in the right one) or "pass"."""
    corners, reached = way(models)
    return "pass" if reached else "similar" if corners[-1][1] > 0 else "other"


def places(corners: list[tuple[float, float]], seconds: float) -> Iterator[tuple[float, float, float]]:
    """Time (s), x and y (m) along the way, until the robot is there or time is up."""
    time = 0.0
    for (x, y), (to_x, to_y) in pairwise(corners):
        count = max(1, round(((to_x - x) ** 2 + (to_y - y) ** 2) ** 0.5 / (SPEED * STEP)))
        for number in range(count):
            yield time, x + (to_x - x) * number / count, y + (to_y - y) * number / count
            time += STEP
    x, y = corners[-1]
    yield time, x, y
    while corners[-1] != GOAL and time < seconds:
        time += 1.0
        yield time, x, y


def main() -> int:
    models = [model.get("name", "") for model in ET.parse(sys.argv[1]).getroot().iter("model")]
    corners, reached = way(models)
    print("t,x,y,z,qx,qy,qz,qw")
    for time, x, y in places(corners, float(os.environ["DDENV_TIMEOUT"])):
        print(f"{time:.1f},{x:.3f},{y:.3f},0.2,0,0,0,1")
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
