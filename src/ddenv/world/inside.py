"""Which models start inside others, and how far the robot would drop: a world as its file has it, without any simulation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ddenv.amounts import count
from ddenv.world.extent import shape_bounds
from ddenv.world.model import Collision, Model, Plane, World
from ddenv.world.overlap import hull, overlap
from ddenv.world.placement import spawn_pose
from ddenv.world.scenario import Spawn

# Models at rest in a saved world overlap by millimetres; this is more, m.
INSIDE = 0.03
# A robot that starts higher than this above what is below it drops, m.
DROP = 0.15


@dataclass(frozen=True, slots=True)
class Inside:
    """The model `name` starts `depth` (m) deep inside `other`."""

    name: str
    other: str
    depth: float


def notes_on_start(world: World, robot: Model, spawn: Spawn) -> Iterator[tuple[str, str]]:
    """What is wrong with the start of the robot in `world`: a word and a sentence for each."""
    height = drop(world, robot, spawn)
    if height > DROP:
        yield "drop", f"the robot starts {height:.2f} m above what is below it, and drops; lower the spawn's z"
    yield from note_inside(world)


def note_inside(world: World) -> Iterator[tuple[str, str]]:
    """What is wrong with the start of the models alone."""
    pairs = inside(world)
    if pairs:
        deepest = max(pairs, key=lambda pair: pair.depth)
        more = f", and {count(len(pairs) - 1, 'more pair')}" if len(pairs) > 1 else ""
        yield (
            "inside",
            f"{deepest.name} starts {deepest.depth:.2f} m inside {deepest.other}{more}: they push each other apart",
        )


def inside(world: World) -> list[Inside]:
    """Models that can move and start deeper than `INSIDE` in another one."""
    shapes = [(model, one) for model in world.models for one in model.collisions]
    if not shapes:
        return []
    boxes = [shape_bounds(one.shape, one.pose) for _, one in shapes]
    low, high = (np.array([box[side] for box in boxes]) for side in (0, 1))
    planes = np.array([isinstance(one.shape, Plane) for _, one in shapes])
    owners = np.array([number for number, model in enumerate(world.models) for _ in model.collisions])
    free = np.array([not model.static for model, _ in shapes])
    deepest: dict[tuple[str, str], float] = {}
    for number in np.flatnonzero(free & ~planes):
        model, shape = shapes[number]
        deep = (np.minimum(high[number], high) - np.maximum(low[number], low)).min(axis=1) > INSIDE
        others = (deep & ~planes | planes) & (owners != owners[number])
        # Of two models that can move, the pair is looked at once.
        others[:number] &= ~free[:number]
        for other in np.flatnonzero(others):
            owner, obstacle = shapes[other]
            depth = _depth(shape, obstacle)
            if depth > INSIDE:
                pair = model.name, owner.name
                deepest[pair] = max(depth, deepest.get(pair, 0.0))
    return [Inside(*pair, depth) for pair, depth in deepest.items()]


def _depth(shape: Collision, obstacle: Collision) -> float:
    """How deep a shape is inside an obstacle, m."""
    body = hull(shape)
    if not isinstance(obstacle.shape, Plane):
        return overlap(body, hull(obstacle))
    up = np.array([obstacle.pose.rotate((0.0, 0.0, 1.0))])
    return float(up[0] @ obstacle.pose.position) - float(body.span(up)[0][0])


def drop(world: World, robot: Model, spawn: Spawn) -> float:
    """How far the robot falls at least when it starts, m; 0 where nothing is below it: then the test says that it fell.

    Everything is taken as large as the box around it.
    """
    place = spawn_pose(spawn) @ robot.pose.inverse()
    boxes = [shape_bounds(one.shape, place @ one.pose) for one in robot.collisions if not isinstance(one.shape, Plane)]
    heights = []
    for collision in (one for model in world.models for one in model.collisions):
        low, high = shape_bounds(collision.shape, collision.pose)
        endless = isinstance(collision.shape, Plane)
        below = (bottom for bottom, top in boxes if endless or ((bottom < high)[:2].all() and (low < top)[:2].all()))
        # What is above the robot does not stop its fall.
        heights += [float(bottom[2] - high[2]) for bottom in below if low[2] <= bottom[2]]
    return max(0.0, min(heights, default=0.0))
