"""Which robot gets to the goal, as far as walls tell; and where a start inside a wall is moved
to.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ddenv.world.hull import convex_hull
from ddenv.world.load import SDF
from ddenv.world.model import Box, Collision, Cylinder, Link, Mesh, Model, Plane, World
from ddenv.world.passage import CELL, clearance
from ddenv.world.placement import note_passage, stands_inside
from ddenv.world.pose import Pose
from ddenv.world.scenario import Goal, Spawn
from ddenv.world.sdf.read import read_model

HUSKY = read_model(SDF / "robots" / "husky.sdf")
WIDTH, HEIGHT = 0.685, 0.38  # of the robot, m
START = Spawn(x=-2.4, y=0.0, z=0.2)
AHEAD = Goal(x=2.4, y=0.0, tolerance=0.3)
FAR = Goal(x=6.0, y=0.0)


def block(
    x: float, y: float, *size: float, z: float = 0.0, yaw: float = 0.0, pitch: float = 0.0
) -> Collision:
    """A box that stands at the height `z`."""
    return Collision(
        name="c",
        shape=Box(size),
        pose=Pose.from_rpy(x, y, z + size[2] / 2, 0.0, pitch, yaw),
        mu=1.0,
    )


def world_of(*shapes: Collision, static: bool = True, yaw: float = 0.0) -> World:
    """The ground, and one model of these shapes, turned about the origin."""
    turn = Pose.from_rpy(0.0, 0.0, 0.0, 0.0, 0.0, yaw)
    turned = tuple(replace(one, pose=turn @ one.pose) for one in shapes)
    ground = (Collision(name="c", shape=Plane((1.0, 1.0)), pose=Pose(), mu=1.0),)
    models = (
        Model(
            name=name,
            pose=Pose(),
            static=still,
            links=(Link(name="l", pose=Pose(), inertia=None, collisions=own, visuals=()),),
            joints=(),
            spans=(),
            line=1,
        )
        for name, still, own in (("ground", True, ground), ("house", static, turned))
    )
    return World(
        path=Path("w.sdf"), name="w", text=b"", gravity=(0.0, 0.0, -9.8), models=tuple(models)
    )


def room(*between: Collision, thick: float = 0.1) -> list[Collision]:
    """Walls around 6 m x 4 m without a door, with something between."""
    sides = [block(x, 0.0, thick, 4.0 + thick, 2.0) for x in (-3.0, 3.0)]
    return [*sides, *(block(0.0, y, 6.0, thick, 2.0) for y in (-2.0, 2.0)), *between]


def door(width: float, at: float = 0.0, thick: float = 0.1) -> list[Collision]:
    """A wall across the room with a door, and its lintel."""
    low, high = at - width / 2, at + width / 2
    walls = [
        block(0.0, (-2.0 + low) / 2, thick, low + 2.0, 2.0),
        block(0.0, (high + 2.0) / 2, thick, 2.0 - high, 2.0),
    ]
    return [*walls, block(0.0, at, thick, width, 0.1, z=1.9)]


def said(world: World, goal: Goal = AHEAD) -> list[str]:
    return [words for _, words in note_passage(world, HUSKY, START, goal)]


@settings(max_examples=25)
@given(
    st.floats(0.2, 2.0),
    st.floats(-0.8, 0.8),
    st.sampled_from((0.005, 0.1, 0.5)),
    st.floats(-3.0, 3.0),
)
def test_the_widest_way_is_as_wide_as_the_door(width, at, thick, yaw):
    world = world_of(*room(*door(width, at, thick)), yaw=yaw)
    start, end = ((math.cos(yaw) * x, math.sin(yaw) * x) for x in (-1.5, 1.5))
    free = clearance(world, WIDTH, HEIGHT, 0.0, [start, end])
    assert free.widest(free.near(start, 0.1), free.near(end, 0.1)) == pytest.approx(
        width, abs=2 * CELL
    )


def test_a_robot_that_does_not_fit_is_told_how_wide_the_door_is():
    (words,) = said(world_of(*room(*door(WIDTH - 0.05))))
    assert words.startswith("no way from start to goal is wider than 0.6")
    assert words.endswith(f"the robot is {WIDTH:.2f} m wide")
    assert said(world_of(*room(*door(WIDTH + 0.1)))) == []
    assert said(world_of(*room()), FAR) == ["no way leads from start to goal"]
    # What moves can be pushed away.
    assert said(world_of(*room(), static=False), FAR) == []


def roof(height: float) -> list[Collision]:
    """A mesh across the room, 2 m wide, that rises to this height, m, on both sides."""
    corners = [(x, y, z) for y in (-2.0, 2.0) for x, z in ((-1.0, 0.0), (1.0, 0.0), (0.0, height))]
    return [
        Collision(
            name="c", shape=Mesh("roof", *convex_hull(np.array(corners))), pose=Pose(), mu=1.0
        )
    ]


RAMP = [
    block(0.0, 0.0, 1.0, 4.0, 0.5),
    *(block(x, 0.0, 2.0, 4.0, 0.01, z=0.2, pitch=x / 3) for x in (-1.2, 1.2)),
]


@pytest.mark.parametrize(
    ("between", "blocks"),
    {
        "lip": ([block(0.0, 0.0, 1.0, 4.0, 0.1)], False),
        "kerb": ([block(0.0, 0.0, 1.0, 4.0, 0.5)], True),
        "ramp": (RAMP, False),
        "lintel": ([block(0.0, 0.0, 1.0, 4.0, 0.5, z=0.5)], False),
        "table": ([block(0.0, 0.0, 1.0, 4.0, 0.05, z=0.3)], True),
        "slope": (roof(0.8), False),
        "pillar": (
            [Collision(name="c", shape=Cylinder(1.5, 2.0), pose=Pose((0.0, 0.0, 1.0)), mu=1.0)],
            True,
        ),
    }.values(),
)
def test_what_is_driven_over_or_under_does_not_block(between, blocks):
    assert bool(said(world_of(*room(*between)))) == blocks


@pytest.mark.parametrize("x", [-3.0, -3.02, 2.98, 3.0])
def test_a_start_in_a_wall_is_moved_into_the_room_of_the_goal(x):
    # Without the goal the place outside would do as well.
    found = stands_inside(world_of(*room()), HUSKY, START.model_copy(update={"x": x}), AHEAD)
    assert found is not None and found[1] is not None
    assert abs(found[1].x) < 3.0 and abs(found[1].y) < 2.0
    found = stands_inside(world_of(*room()), HUSKY, START.model_copy(update={"x": x}), FAR)
    assert found is not None and found[1] is not None and abs(found[1].x) > 3.0


def test_it_stays_indoors_where_the_door_to_the_outside_is_open():
    front = [block(-3.0, -1.3, 0.1, 1.4, 2.0), block(-3.0, 1.3, 0.1, 1.4, 2.0)]
    walls = [one for one in room(*door(1.2, at=-1.0)) if one.pose.position[0] != -3.0]
    start = START.model_copy(update={"x": -3.3, "y": 1.3})
    found = stands_inside(world_of(*walls, *front), HUSKY, start, AHEAD)
    assert found is not None and found[1] is not None and found[1].x > -3.0
