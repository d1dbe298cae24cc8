"""Writes ditch.sdf: two asphalt platforms with a gap between them, forty tiles of rough terrain and
a cinder block.

    python sdf/worlds/make_ditch.py

The gap lies across the y axis at x = 0, across the path of a robot that comes along the x axis: a
little too wide for its wheels.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from pathlib import Path

import pieces

GAP = 0.41  # m
TOP = 2.0  # m above the ground
PLATFORM = (8.0, 9.0)  # m along and across the way
TILE = (1.27, 0.6)  # m
PLATE = 0.01  # m
ROWS, COLUMNS = 4, 8
BLOCK = 0.076  # m
BLOCK_HEIGHTS = (0.025, 0.038, 0.05)  # m
SETBACK = 0.1  # m between the edge tile and the gap

MU = 1.2  # rubber on dry asphalt and wood
SOIL = "0.45 0.47 0.42 1"

# Places of tiles on one side: distance from the gap's edge to the tile's centre, offset to the
# left, heading in degrees.
NEAR = [
    (1.75, 0.15, 90), (2.75, -0.2, 80), (7.55, 0.1, 90),
    (0.5, 2.4, 90), (0.55, 3.77, 84), (0.5, -2.4, 92), (0.6, -3.8, 90),
    (1.5, 2.0, 75), (1.6, 3.5, 100), (1.5, -2.1, 90), (1.7, -3.5, 95),
    (SETBACK + TILE[1] / 2, 0.0, 90),
    (2.9, 1.9, 20), (3.0, 3.4, 90), (3.1, -1.9, 0), (3.0, -3.5, 60),
    (4.9, 2.4, 40), (5.2, -2.6, 15), (6.3, 3.2, 90), (6.5, -3.3, 120),
]  # fmt: skip
FAR = [
    (1.3, -0.1, 90), (2.2, 0.3, 100),
    (0.5, 2.5, 90), (0.6, 3.8, 95), (0.5, -2.4, 88), (0.55, -3.75, 90),
    (1.5, 1.9, 80), (1.6, 3.3, 90), (1.5, -2.0, 100), (1.7, -3.4, 90),
    (2.8, 2.2, 10), (2.9, 3.6, 90), (3.0, -2.0, 0), (2.8, -3.6, 70),
    (4.6, 1.2, 45), (4.8, -1.1, 30), (5.0, 3.1, 90), (5.1, -3.0, 110),
    (6.6, 2.0, 0), (6.7, -1.8, 60),
]  # fmt: skip


def tile(rng: random.Random) -> str:
    """A plate with rows of blocks; neighbours in a row differ in height. Its frame lies on its
    underside.
    """
    boxes = pieces.box("plate", (0, 0, PLATE / 2), (*TILE, PLATE), MU, pieces.PLYWOOD)
    for row in range(ROWS):
        shift = rng.randrange(len(BLOCK_HEIGHTS))
        for column in range(COLUMNS):
            height = BLOCK_HEIGHTS[(column + shift) % len(BLOCK_HEIGHTS)]
            x = (column - (COLUMNS - 1) / 2) * TILE[0] / COLUMNS
            y = (row - (ROWS - 1) / 2) * TILE[1] / ROWS
            place, size = (x, y, PLATE + height / 2), (BLOCK, BLOCK, height)
            boxes += pieces.box(f"block_{row + 1}_{column + 1}", place, size, MU, pieces.PINE)
    return boxes


def cinder_block() -> str:
    """A hollow block, 0.39 x 0.19 x 0.19 m, standing on its frame."""
    boxes = ""
    for name, y in (("left", 0.0793), ("right", -0.0793)):
        boxes += pieces.box(name, (0, y, 0.095), (0.39, 0.0314, 0.19), MU, pieces.CONCRETE)
    for name, x in (("front", 0.1793), ("middle", 0.0), ("back", -0.1793)):
        boxes += pieces.box(name, (x, 0, 0.095), (0.0314, 0.1272, 0.19), MU, pieces.CONCRETE)
    return boxes


def platform(side: int) -> str:
    name = "asphalt_near" if side < 0 else "asphalt_far"
    x = side * (GAP + PLATFORM[0]) / 2
    parts = pieces.box("asphalt", (0, 0, 0), (*PLATFORM, TOP), MU, pieces.ASPHALT)
    return pieces.model(name, (x, 0, TOP / 2, 0, 0, 0), parts)


def models(repaired: bool) -> Iterator[str]:
    yield pieces.ground(SOIL)
    yield platform(-1)
    yield platform(1)
    if repaired:
        parts = pieces.box("asphalt", (0, 0, 0), (GAP, PLATFORM[1], TOP), MU, pieces.ASPHALT)
        yield pieces.model("filling", (0, 0, TOP / 2, 0, 0, 0), parts)
    places = [(-1, *place) for place in NEAR] + [(1, *place) for place in FAR]
    # Tiles are numbered from one end of the world to the other, as a person would lay them.
    places.sort(key=lambda place: (place[0] * place[1], place[2]))
    for number, (side, distance, y, degrees) in enumerate(places, start=1):
        x = side * (GAP / 2 + distance)
        parts = tile(random.Random(number))
        yield pieces.model(
            f"rough_tile_{number:02d}", (x, y, TOP, 0, 0, math.radians(degrees)), parts
        )
    yield pieces.model("cinder_block", (GAP / 2 + 3.4, -0.9, TOP, 0, 0, 0.4), cinder_block())


def ditch(repaired: bool = False) -> str:
    """The world, or the world with its ditch filled."""
    return pieces.world("ditch", models(repaired))


if __name__ == "__main__":
    Path(__file__).with_name("ditch.sdf").write_text(ditch(), encoding="utf-8")
