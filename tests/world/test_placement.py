"""No robot starts inside something."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.errors import UserError
from ddenv.world.bundled import SDF
from ddenv.world.model import Box, Collision, Cylinder, Sphere
from ddenv.world.placement import check_spawn, hull, overlap
from ddenv.world.pose import Pose
from ddenv.world.read import read_model, read_world
from ddenv.world.scenario import Spawn
from tests.conftest import DATA

HUSKY = read_model(SDF / "robots" / "husky.sdf")
WALL = read_world(DATA / "wall.sdf")


def test_a_free_place_is_fine():
    check_spawn(WALL, HUSKY, Spawn(x=0, y=0, z=0.45))


@pytest.mark.parametrize(
    ("spawn", "model"),
    [
        (Spawn(x=2, y=0, z=0.45), "wall"),
        (Spawn(x=1.5, y=0, z=0.45), "wall"),
        (Spawn(x=0, y=0, z=0.15), "deck"),
        (Spawn(x=0, y=-4.4, z=0.15), "post"),
        (Spawn(x=4, y=3.6, z=0.15), "ball"),
        (Spawn(x=-4, y=0, z=-0.5), "ground_plane"),
    ],
)
def test_a_spawn_inside_a_model_names_it(spawn, model):
    with pytest.raises(UserError, match=f"inside model '{model}' by"):
        check_spawn(WALL, HUSKY, spawn)


def test_turning_can_make_room():
    check_spawn(WALL, HUSKY, Spawn(x=1.45, y=0, z=0.45, yaw=math.pi / 2))


def test_above_a_wall_is_free():
    check_spawn(WALL, HUSKY, Spawn(x=2, y=0, z=1.7))


turned = st.tuples(*[st.floats(-3, 3)] * 3)


def body(shape, position, rpy):
    return hull(Collision("c", shape, Pose.from_rpy(*position, *rpy), 1.0))


@given(rpy=turned, other=turned, direction=turned, gap=st.floats(0.01, 5))
def test_bodies_apart_do_not_overlap(rpy, other, direction, gap):
    length = math.sqrt(sum(part * part for part in direction))
    if length < 0.1:
        return
    away = tuple(part / length * (1.0 + gap) for part in direction)
    # A box in a sphere of radius 0.5 around its centre, beside a cylinder in another, their centres over 1 m apart.
    side = 1 / math.sqrt(3)
    a, b = body(Box((side,) * 3), (0, 0, 0), rpy), body(Cylinder(0.3, 0.8), away, other)
    assert overlap(a, b) == 0.0


@given(rpy=turned, other=turned, at=st.tuples(*[st.floats(-0.19, 0.19)] * 3))
def test_bodies_that_share_a_point_overlap(rpy, other, at):
    # Each holds a ball of radius 0.2 around its centre; the centres are closer than 0.4.
    for shape in (Box((0.4, 0.6, 0.8)), Cylinder(0.25, 0.5), Sphere(0.2)):
        assert overlap(body(Box((0.4, 0.4, 0.4)), (0, 0, 0), rpy), body(shape, at, other)) > 0


def test_the_depth_is_what_must_be_moved():
    a, b = body(Box((1, 1, 1)), (0, 0, 0), (0, 0, 0)), body(Box((1, 1, 1)), (0.9, 0, 0), (0, 0, 0))
    assert overlap(a, b) == pytest.approx(0.1)
    assert overlap(a, body(Sphere(0.5), (0.9, 0, 0), (0, 0, 0))) == pytest.approx(0.1)
    assert overlap(body(Sphere(0.5), (0, 0, 0), (0, 0, 0)), body(Sphere(0.5), (0.8, 0, 0), (0, 0, 0))) == pytest.approx(
        0.2
    )


def test_round_bodies_are_not_their_boxes():
    box = body(Box((1, 1, 1)), (0, 0, 0), (0, 0, 0))
    corner = np.array([0.5, 0.5, 0.0]) + 0.25 / math.sqrt(2) * np.array([1, 1, 0])
    assert overlap(box, body(Cylinder(0.2, 1), tuple(corner), (0, 0, 0))) == 0.0
