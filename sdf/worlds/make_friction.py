"""Writes friction.sdf: construction barrels on a sloping road, with patches of slippery and of
rough ground.

    python sdf/worlds/make_friction.py

The road leads along the x axis and falls to the right. Red patches have a thousand times the
friction of green ones; the asphalt, which is the ground, lies in between.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pieces

CROSSFALL = 0.035  # m down for each m to the right
ASPHALT_MU = 0.8
RED_MU, GREEN_MU = 1.5, 0.0015
RED, GREEN = "0.70 0.16 0.12 1", "0.20 0.58 0.28 1"
PROUD = 0.004  # m, how far a patch stands out of the asphalt: a wheel on it touches nothing else
BARREL_RADIUS, BARREL_HEIGHT = 0.29, 1.0  # m
BARREL_MU = 0.5
ORANGE, WHITE = "0.95 0.42 0.05 1", "0.93 0.93 0.90 1"
STRIPES = (ORANGE, WHITE, ORANGE, WHITE, ORANGE)  # of a barrel, from below

BARRELS = [
    (3.0, -0.55), (1.9, -1.15), (-1.5, 1.6), (-1.2, -1.7), (0.6, 2.4), (0.4, -2.5), (3.4, 2.6), (3.6, -2.4),
    (2.4, 1.2), (5.2, 0.9),
]  # fmt: skip
# Patches: x, y, heading in degrees, length, width.
REDS = [
    (-2.6, 0.1, 0, 0.9, 0.7), (-0.9, -0.8, 20, 0.8, 0.8), (0.2, 1.2, 45, 0.7, 0.7), (-3.0, -2.0, 10, 0.9, 0.6),
    (1.2, -2.2, 30, 0.8, 0.8), (5.8, 1.8, 0, 0.8, 0.8), (2.0, 2.4, 60, 0.7, 0.6),
]  # fmt: skip
GREENS = [
    (1.8, -0.2, 0, 2.8, 2.0), (-1.9, 0.9, 15, 0.6, 0.5), (-0.8, 0.3, 30, 0.5, 0.4), (-0.4, -1.6, 70, 0.5, 0.5),
    (-3.1, 1.6, 40, 0.6, 0.6), (4.8, -0.9, 0, 0.5, 0.4), (5.6, -2.0, 25, 0.8, 0.6), (-0.6, 2.6, 80, 0.7, 0.5),
]  # fmt: skip


def on_road(x: float, y: float, degrees: float = 0.0) -> tuple[float, ...]:
    """The pose (m, rad) of something that lies on the road."""
    slope, yaw = math.atan(CROSSFALL), math.radians(degrees)
    # Turned about the vertical first, then laid on the slope.
    roll = math.atan2(math.sin(slope) * math.cos(yaw), math.cos(slope))
    pitch = -math.asin(math.sin(slope) * math.sin(yaw))
    heading = math.atan2(math.cos(slope) * math.sin(yaw), math.cos(yaw))
    return x, y, CROSSFALL * y, roll, pitch, heading


def patch(name: str, mu: float, color: str, place: tuple[float, ...]) -> str:
    x, y, degrees, length, width = place
    parts = pieces.box("patch", (0, 0, 0), (length, width, 2 * PROUD), mu, color)
    return pieces.model(name, on_road(x, y, degrees), parts)


def barrel(number: int, x: float, y: float) -> str:
    whole = pieces.round_shape(BARREL_RADIUS, BARREL_HEIGHT)
    parts = pieces.collision("barrel", (0, 0, BARREL_HEIGHT / 2), whole, BARREL_MU)
    high = BARREL_HEIGHT / len(STRIPES)
    for stripe, color in enumerate(STRIPES):
        middle = (0, 0, high * (stripe + 0.5))
        parts += pieces.visual(
            f"stripe_{stripe + 1}", middle, pieces.round_shape(BARREL_RADIUS, high), color
        )
    return pieces.model(f"barrel_{number:02d}", on_road(x, y), parts)


def models(repaired: bool) -> Iterator[str]:
    yield pieces.ground(pieces.ASPHALT, ASPHALT_MU, on_road(0, 0))
    for number, place in enumerate(BARRELS, start=1):
        yield barrel(number, *place)
    for name, mu, color, places in (("red", RED_MU, RED, REDS), ("green", GREEN_MU, GREEN, GREENS)):
        for number, place in enumerate(places, start=1):
            yield patch(f"{name}_patch_{number:02d}", ASPHALT_MU if repaired else mu, color, place)


def friction(repaired: bool = False) -> str:
    """The world, or the world with patches as rough as the asphalt."""
    return pieces.world("friction", models(repaired))


if __name__ == "__main__":
    Path(__file__).with_name("friction.sdf").write_text(friction(), encoding="utf-8")
