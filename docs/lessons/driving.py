#!/usr/bin/env python3
"""The simulator of the lessons' toy worlds: it drives a robot as the rule in RULE.py says.

driving.py RULE WORLD SEED     prints the pose log; exit codes: 0 goal reached, 1 time is up
"""

from __future__ import annotations

import os
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from importlib import import_module
from itertools import pairwise

SPEED = 0.5  # m/s


def places(
    corners: list[tuple[float, float]], step: float, waits: float
) -> Iterator[tuple[float, float, float]]:
    """Time (s), x and y (m) along the corners of a path, every `step` s; at its end the robot
    stands until the time `waits`.
    """
    time = 0.0
    for (x, y), (to_x, to_y) in pairwise(corners):
        count = max(1, round(((to_x - x) ** 2 + (to_y - y) ** 2) ** 0.5 / (SPEED * step)))
        for number in range(count):
            yield time, x + (to_x - x) * number / count, y + (to_y - y) * number / count
            time += step
    x, y = corners[-1]
    yield time, x, y
    while time < waits:
        time += 1.0
        yield time, x, y


def main(name: str, world: str, seed: str) -> int:
    rule = import_module(name)
    models = [model.get("name", "") for model in ET.parse(world).getroot().iter("model")]
    corners, reached = rule.way(models, int(seed))
    print("t,x,y,z,qx,qy,qz,qw")
    for time, x, y in places(
        corners, rule.STEP, 0.0 if reached else float(os.environ["DDENV_TIMEOUT"])
    ):
        print(f"{time:.1f},{x:.3f},{y:.3f},0.2,0,0,0,1")
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
