"""No robot starts inside something."""

import math
from pathlib import Path

import pytest

from ddenv.errors import UserError
from ddenv.world.load import SDF
from ddenv.world.model import Capsule, Collision, Ellipsoid, Link, Model, Plane, Shape, World
from ddenv.world.placement import check_spawn
from ddenv.world.pose import Pose
from ddenv.world.scenario import Spawn
from ddenv.world.sdf.read import read_model, read_world
from tests.conftest import DATA
from tests.world.test_overlap import stone

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


def world_with(shape: Shape, pose: Pose) -> World:
    link = Link("l", pose, None, (Collision("c", shape, pose, 1.0),), ())
    model = Model("thing", pose, True, (link,), (), (), 1)
    return World(Path("w.sdf"), "w", b"", (0.0, 0.0, -9.8), (model,))


@pytest.mark.parametrize(
    "shape", [Capsule(0.3, 1.0), Ellipsoid((0.3, 0.3, 0.8)), stone(60)], ids=lambda shape: type(shape).__name__
)
def test_round_things_and_meshes_are_in_the_way_too(shape):
    with pytest.raises(UserError, match=r"inside .*model 'thing' by"):
        check_spawn(world_with(shape, Pose((0.5, 0.2, 0.3))), HUSKY, Spawn(x=0, y=0, z=0.2))
    check_spawn(world_with(shape, Pose((2.0, 0.2, 0.3))), HUSKY, Spawn(x=0, y=0, z=0.2))


def test_a_robot_in_the_hollow_of_a_mesh_is_told_of_the_hull():
    with pytest.raises(UserError, match="stands inside the convex hull of model 'thing' by"):
        check_spawn(world_with(stone(60), Pose((0.5, 0.2, 0.3))), HUSKY, Spawn(x=0, y=0, z=0.2))


def test_a_slope_is_below_the_robot_where_it_goes_down():
    slope = world_with(Plane((1.0, 1.0)), Pose.from_rpy(0, 0, 0, 0, 0.5, 0))
    check_spawn(slope, HUSKY, Spawn(x=5, y=0, z=0.2))
    with pytest.raises(UserError, match="inside model 'thing' by"):
        check_spawn(slope, HUSKY, Spawn(x=-5, y=0, z=0.2))


def test_a_robot_without_shapes_cannot_start():
    ghost = Model("ghost", Pose(), False, (Link("l", Pose(), None, (), ()),), (), (), 1)
    with pytest.raises(UserError, match="'ghost' has no collision shapes"):
        check_spawn(WALL, ghost, Spawn(x=0, y=0, z=1))
