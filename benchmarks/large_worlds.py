"""Worlds of any size: a scenario's own, with crates, walls and piles of boards around it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ddenv.robot.drake.region import WIDTH, Region
from ddenv.world.extent import model_bounds
from ddenv.world.model import Plane, World
from ddenv.world.pose import Pose
from ddenv.world.scenario import Scenario

SIZE, MASS = (0.9, 0.09, 0.04), 2.0  # of a board, m and kg
GAP = 2.0  # m between the middles of two things
CRATE, WALL = (0.8, 0.8, 0.8), (1.8, 0.2, 1.2)  # m
# No thing is nearer to the straight way to the goal than this, and none to a model of the scenario
# than that, m.
CLEAR, APART = 7.0, 1.5
# One place in so many has a wall, and one in so many a pile of three boards.
WALLS, PILES = 20, 400
# How high a thing begins above the ground, which may slope, m.
ABOVE = 0.02


def among_things(scenario: Scenario, world: World, models: int) -> bytes:
    """The text of the `world` of a scenario with things around it, nearest first, so that it has
    `models` elements in all.
    """
    missing = models - len(world.elements())
    text = "".join(text for _, text in zip(range(missing), things(scenario, world), strict=False))
    return world.text.replace(b"</world>", text.encode() + b"</world>")


def things(scenario: Scenario, world: World) -> Iterator[str]:
    """One model after another."""
    ground = ground_of(world)
    for number, (x, y) in enumerate(places(scenario, world)):
        z = height(ground, x, y) + ABOVE
        if number % WALLS == 0:
            yield still(f"wall_{number:04}", WALL, x, y, z, yaw=number)
        elif number % PILES == 21:
            low = z + SIZE[2] / 2
            for side in (0.0, 0.3):
                yield board(10 * number + round(10 * side), x, y + side, low, 0.0)
            yield board(10 * number + 9, x, y + 0.15, low + SIZE[2] + 0.01, math.pi / 2)
        else:
            yield still(f"crate_{number:04}", CRATE, x, y, z, yaw=0.0)


def places(scenario: Scenario, world: World) -> Iterator[tuple[float, float]]:
    """Places on a grid, nearest to the straight way first, that are clear of it and of all
    models.
    """
    spawn, goal = scenario.robot.spawn, scenario.goal
    way = Region.of((spawn.x, spawn.y), (goal.x, goal.y), ())
    found = (box for model in world.models if (box := model_bounds(model)) is not None)
    low, high = (np.array(corners)[:, :2] for corners in zip(*found, strict=True))
    grid = [(GAP * i, GAP * j) for i in range(-60, 61) for j in range(-60, 61)]
    depths = {place: WIDTH - way.depth(place) for place in grid}
    for place in sorted(grid, key=lambda one: (depths[one], one)):
        gaps = np.maximum(low - place, place - high).max(axis=1)
        if depths[place] >= CLEAR and gaps.min() >= APART:
            yield place


def ground_of(world: World) -> Pose:
    """Where the world's plane lies."""
    return next(
        one.pose
        for model in world.models
        for one in model.collisions
        if isinstance(one.shape, Plane)
    )


def height(ground: Pose, x: float, y: float) -> float:
    """How high (m) a plane is at `x`, `y` (m)."""
    (nx, ny, nz), (px, py, pz) = ground.rotation()[:, 2], ground.position
    return float(pz - ((x - px) * nx + (y - py) * ny) / nz)


def still(
    name: str, size: tuple[float, float, float], x: float, y: float, z: float, yaw: float
) -> str:
    """A box that never moves and stands on `z` (m)."""
    box = f"<box><size>{size[0]} {size[1]} {size[2]}</size></box>"
    link = f'<link name="link"><collision name="box"><geometry>{box}</geometry></collision></link>'
    return (
        f'<model name="{name}"><static>true</static><pose>{x} {y} {z + size[2] / 2} 0 0 '
        f"{yaw}</pose>{link}</model>\n"
    )


def board(number: int, x: float, y: float, z: float, yaw: float) -> str:
    """A loose board."""
    a, b, c = SIZE
    inertia = [
        MASS * (b * b + c * c) / 12,
        MASS * (a * a + c * c) / 12,
        MASS * (a * a + b * b) / 12,
    ]
    moments = "".join(
        f"<{name}>{value}</{name}>"
        for name, value in zip(("ixx", "iyy", "izz"), inertia, strict=True)
    )
    return (
        f'<model name="board_{number}"><pose>{x} {y} {z} 0 0 {yaw}</pose><link '
        f'name="link"><inertial><mass>{MASS}</mass>'
        f'<inertia>{moments}</inertia></inertial><collision name="c"><geometry><box><size>{a} '
        f"{b} {c}</size></box></geometry>"
        "</collision></link></model>"
    )
