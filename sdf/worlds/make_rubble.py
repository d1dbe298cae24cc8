"""Writes rubble.sdf: a pile of loose 2x4 boards with a narrow path through it, and two cinder
blocks hidden in the path.

    python sdf/worlds/make_rubble.py

The path leads along the x axis between two cribs of boards. Each block carries the ends of two
boards: they make a ramp.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pieces

THICK, WIDE = 0.038, 0.089  # m, a dressed 2x4
DENSITY = 450.0  # kg/m^3, pine
MU = 0.6  # wood on wood, on stone and on asphalt
BLOCK = (0.19, 0.39, 0.19)  # m along and across the path, and up
BLOCK_MU = 0.8
CRIB = 1.2  # m, length of a crib's boards
REACH = 0.585  # m, from its middle to where boards cross: right at their ends, where they rest on four corners
LAYERS = 5
RAMP = 1.5  # m, length of a ramp's boards
# Places of the blocks in the path.
BLOCKS = [(0.0, 0.0), (2.4, 0.05)]
# Loose boards: x, y, heading in degrees, length.
LOOSE = [
    (-2.4, 0.45, 8, 0.9), (-1.6, 2.4, 30, 1.8), (-1.4, -2.6, 115, 1.6), (1.3, 2.8, 10, 2.0), (1.2, -0.6, 170, 0.8),
    (3.9, 1.7, 60, 1.5), (3.7, -1.5, 140, 1.8), (4.4, 0.8, 20, 1.2), (-3.2, -1.2, 70, 1.4), (2.6, -2.9, 5, 1.8),
]  # fmt: skip


def board(
    name: str, x: float, y: float, z: float, pitch: float, yaw: float, length: float, on_edge: bool
) -> str:
    """A board with its centre at (x, y, z)."""
    size = (length, THICK, WIDE) if on_edge else (length, WIDE, THICK)
    mass = DENSITY * length * THICK * WIDE
    parts = pieces.box("board", (0, 0, 0), size, MU, pieces.PINE)
    return pieces.model(name, (x, y, z, 0, pitch, yaw), parts, pieces.box_inertial(mass, size))


def crib(side: int) -> Iterator[str]:
    """Boards on edge, two in a layer, crosswise: taller than the plane of the lidar."""
    name = "left" if side > 0 else "right"
    y = side * 1.55
    for layer in range(LAYERS):
        for number, offset in enumerate((-REACH, REACH)):
            across = layer % 2 == 1
            place = (offset, y) if across else (0.0, y + offset)
            yaw = math.pi / 2 if across else 0.0
            z = WIDE * (layer + 0.5)
            yield board(
                f"crib_{name}_{2 * layer + number + 1:02d}", *place, z, 0.0, yaw, CRIB, on_edge=True
            )


def block(number: int, x: float, y: float) -> str:
    parts = pieces.box("block", (0, 0, 0), BLOCK, BLOCK_MU, pieces.CONCRETE)
    return pieces.model(f"cinder_block_{number}", (x, y, BLOCK[2] / 2, 0, 0, 0), parts)


def ramp(number: int, x: float, y: float) -> Iterator[str]:
    """Two boards that lie on the block's front edge and on the ground before it."""
    # The underside goes through the block's upper front edge and ends on the ground.
    beyond = 0.08
    pitch = math.asin(BLOCK[2] / (RAMP - beyond))
    front = x - BLOCK[0] / 2
    # The middle of the underside, then half a board's thickness up along its normal.
    along = RAMP / 2 - beyond
    mx, mz = front - along * math.cos(pitch), BLOCK[2] - along * math.sin(pitch)
    mx, mz = mx - math.sin(pitch) * THICK / 2, mz + math.cos(pitch) * THICK / 2
    for half, offset in (("a", 0.11), ("b", -0.11)):
        yield board(
            f"ramp_{number}{half}", mx, y + offset, mz + 0.002, -pitch, 0.0, RAMP, on_edge=False
        )


def models(repaired: bool) -> Iterator[str]:
    yield pieces.ground(pieces.ASPHALT, 0.9)
    for number, place in enumerate(BLOCKS, start=1):
        if not repaired:
            yield block(number, *place)
        yield from ramp(number, *place)
    yield from crib(1)
    yield from crib(-1)
    for number, (x, y, degrees, length) in enumerate(LOOSE, start=1):
        yield board(
            f"board_{number:02d}",
            x,
            y,
            THICK / 2,
            0.0,
            math.radians(degrees),
            length,
            on_edge=False,
        )


def rubble(repaired: bool = False) -> str:
    """The world, or the world without its cinder blocks."""
    return pieces.world("rubble", models(repaired))


if __name__ == "__main__":
    Path(__file__).with_name("rubble.sdf").write_text(rubble(), encoding="utf-8")
