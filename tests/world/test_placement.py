"""What stands inside what, and how deep: no robot starts inside something, or in the air,
unnoticed.
"""

import math
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from ddenv.cli.world import world_lines
from ddenv.errors import UserError
from ddenv.world.load import SDF
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Link,
    Mesh,
    Model,
    Plane,
    Shape,
    Sphere,
    Terrain,
    World,
)
from ddenv.world.placement import (
    DROP,
    INSIDE,
    Hull,
    check_spawn,
    drop,
    hull,
    inside,
    note_floor,
    note_inside,
    note_unseen,
    notes_on_start,
    overlap,
)
from ddenv.world.pose import Pose
from ddenv.world.scenario import Goal, Spawn
from ddenv.world.sdf.read import parse_world, read_model, read_world
from tests.conftest import DATA
from tests.robot.conftest import GROUND, box_model

turned = st.tuples(*[st.floats(-3, 3)] * 3)


def body(shape, position=(0, 0, 0), rpy=(0, 0, 0)) -> Hull:
    return hull(Collision(name="c", shape=shape, pose=Pose.from_rpy(*position, *rpy), mu=1.0))


def mesh_of(points: np.ndarray) -> Mesh:
    """The convex hull of points around zero."""
    faces = ConvexHull(points).simplices
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * corners[:, 0]).sum(axis=1) < 0
    return Mesh("m", points, np.where(inward[:, None], faces[:, ::-1], faces))


def stone(count: int, radius: float = 0.4) -> Mesh:
    points = np.random.default_rng(count).normal(size=(count, 3))
    return mesh_of(radius * points / np.linalg.norm(points, axis=1, keepdims=True))


CUBE = mesh_of(np.array(list(product((-0.2, 0.2), repeat=3))))
SHAPES = (
    Box((0.4, 0.6, 0.8)),
    Cylinder(0.25, 0.5),
    Ellipsoid((0.3, 0.2, 0.5)),
    CUBE,
    stone(12),
    stone(40),
)
ROUND = (Sphere(0.3), Capsule(0.2, 0.6))


def true_depth(a: Hull, b: Hull) -> float:
    """How far zero is inside the hull of all differences between points of both bodies: slow, and
    the definition.
    """
    differences = (a.vertices[:, None] - b.vertices[None]).reshape(-1, 3)
    return max(0.0, float((-ConvexHull(differences).equations[:, 3]).min()))


@given(
    st.sampled_from(SHAPES),
    st.sampled_from(SHAPES),
    turned,
    turned,
    st.tuples(*[st.floats(-0.5, 0.5)] * 3),
)
def test_the_depth_of_bodies_with_faces_is_exact(first, second, rpy, other, at):
    a, b = body(first, (0, 0, 0), rpy), body(second, at, other)
    assert overlap(a, b) == pytest.approx(true_depth(a, b), abs=1e-4)
    assert overlap(b, a) == pytest.approx(overlap(a, b), abs=1e-4)


@given(
    st.sampled_from(SHAPES + ROUND),
    st.sampled_from(SHAPES + ROUND),
    turned,
    turned,
    turned,
    st.floats(0.01, 5),
)
def test_bodies_apart_do_not_overlap(first, second, rpy, other, direction, gap):
    length = math.sqrt(sum(part * part for part in direction))
    if length < 0.1:
        return
    # Every one of them is inside a ball of radius 0.55 around its place.
    away = tuple(part / length * (1.1 + gap) for part in direction)
    assert overlap(body(first, (0, 0, 0), rpy), body(second, away, other)) == 0.0


def test_the_depth_is_what_must_be_moved():
    box, ball = Box((1, 1, 1)), Sphere(0.5)
    assert overlap(body(box), body(box, (0.9, 0, 0))) == pytest.approx(0.1)
    assert overlap(body(box), body(ball, (0.9, 0, 0))) == pytest.approx(0.1)
    assert overlap(body(ball), body(ball, (0.8, 0, 0))) == pytest.approx(0.2)
    assert overlap(body(ball), body(ball)) == pytest.approx(1.0)
    assert overlap(body(box), body(Capsule(0.2, 1.0), (0, 0, 1.1))) == pytest.approx(0.1)
    assert overlap(body(box), body(Capsule(0.2, 1.0), (0.6, 0, 0))) == pytest.approx(0.1)
    assert overlap(
        body(Capsule(0.2, 2.0)), body(Capsule(0.1, 2.0), (0.25, 0, 0), (1.2, 0, 0))
    ) == pytest.approx(0.05)


@pytest.mark.parametrize("shape", [Sphere(1.0), Capsule(1.0, 0.5), Capsule(1.0, 3.0)], ids=repr)
def test_round_bodies_beside_an_edge_are_not_inside(shape):
    edge = body(Box((1, 1, 6)))
    beside = 0.5 + 1.01 / math.sqrt(2)
    assert overlap(edge, body(shape, (beside, beside, 0.3))) == 0.0
    assert overlap(edge, body(shape, (beside - 0.05, beside - 0.05, 0.3))) == pytest.approx(
        0.05 * 2**0.5 - 0.01
    )


HUSKY = read_model(SDF / "robots" / "husky.sdf")
WALL = read_world(DATA / "wall.sdf")


def test_a_free_place_is_fine():
    check_spawn(WALL, HUSKY, Spawn(x=0, y=0, z=0.45))
    # Above a wall; beside it, turned.
    check_spawn(WALL, HUSKY, Spawn(x=2, y=0, z=1.7))
    check_spawn(WALL, HUSKY, Spawn(x=1.45, y=0, z=0.45, yaw=math.pi / 2))


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


@pytest.mark.parametrize("z", [0.45, -1.5], ids=["beside", "above"])
def test_the_place_that_the_error_names_is_free_and_near(z):
    start = Spawn(x=1.5, y=0, z=z)
    with pytest.raises(UserError, match="free nearby: --spawn=") as told:
        check_spawn(WALL, HUSKY, start)
    named = str(told.value).partition("--spawn=")[2]
    x, y, z, yaw = map(float, named.split(","))
    assert (x, y, z) != (start.x, start.y, start.z) and math.dist((x, y), (start.x, start.y)) <= 3
    check_spawn(WALL, HUSKY, Spawn(x=x, y=y, z=z, yaw=yaw))


def world_with(shape: Shape, pose: Pose) -> World:
    link = Link(
        name="l",
        pose=pose,
        inertia=None,
        collisions=(Collision(name="c", shape=shape, pose=pose, mu=1.0),),
        visuals=(),
    )
    model = Model(name="thing", pose=pose, static=True, links=(link,), joints=(), spans=(), line=1)
    return World(path=Path("w.sdf"), name="w", text=b"", gravity=(0.0, 0.0, -9.8), models=(model,))


@pytest.mark.parametrize(
    "shape",
    [Capsule(0.3, 1.0), Ellipsoid((0.3, 0.3, 0.8)), stone(60)],
    ids=lambda shape: type(shape).__name__,
)
def test_round_things_and_meshes_are_in_the_way_too(shape):
    # A mesh may be hollow.
    what = "the convex hull of model" if isinstance(shape, Mesh) else "model"
    with pytest.raises(UserError, match=f"stands inside {what} 'thing' by"):
        check_spawn(world_with(shape, Pose((0.5, 0.2, 0.3))), HUSKY, Spawn(x=0, y=0, z=0.2))
    check_spawn(world_with(shape, Pose((2.0, 0.2, 0.3))), HUSKY, Spawn(x=0, y=0, z=0.2))


def test_a_slope_is_below_the_robot_where_it_goes_down():
    slope = world_with(Plane((1.0, 1.0)), Pose.from_rpy(0, 0, 0, 0, 0.5, 0))
    check_spawn(slope, HUSKY, Spawn(x=5, y=0, z=0.2))
    with pytest.raises(UserError, match="inside model 'thing' by"):
        check_spawn(slope, HUSKY, Spawn(x=-5, y=0, z=0.2))


def test_the_start_on_terrain_is_at_its_height():
    slope = Terrain((20.0, 20.0), np.broadcast_to(np.linspace(0.0, 4.0, 11), (11, 11)), "slope")
    hill = world_with(slope, Pose((0.0, 0.0, 1.0)))
    with pytest.raises(UserError, match=r"inside model 'thing' by .*free nearby: ") as caught:
        check_spawn(hill, HUSKY, Spawn(x=0, y=0, z=0.2))
    free = Spawn(
        **dict(
            zip(
                "xyz",
                map(float, str(caught.value).partition("--spawn=")[2].split(",")),
                strict=False,
            )
        )
    )
    check_spawn(hill, HUSKY, free)
    assert (free.x, free.y) == (0, 0)
    assert drop(hill, HUSKY, free) < 0.03
    assert drop(hill, HUSKY, free.model_copy(update={"z": free.z + 1})) == pytest.approx(
        1.0, abs=0.03
    )
    # Beyond its edge there is nothing.
    assert drop(hill, HUSKY, Spawn(x=15, y=0, z=9)) == 0.0


def test_a_robot_without_shapes_cannot_start():
    ghost = Model(
        name="ghost",
        pose=Pose(),
        static=False,
        links=(Link(name="l", pose=Pose(), inertia=None, collisions=(), visuals=()),),
        joints=(),
        spans=(),
        line=1,
    )
    with pytest.raises(UserError, match="'ghost' has no collision shapes"):
        check_spawn(WALL, ghost, Spawn(x=0, y=0, z=1))


def world(*models):
    text = f'<sdf version="1.9"><world name="w">{GROUND}{"".join(models)}</world></sdf>'
    return parse_world(text.encode(), DATA)


def box(name, x, z=0.5, mass=1.0):
    return box_model(name, f"{x} 0 {z} 0 0 0", "1 1 1", mass)


def test_each_pair_is_found_once_with_its_depth():
    pairs = inside(
        world(
            box("first", 0),
            box("second", 0.8),
            box("apart", 3),
            box("sunk", 6, z=0.3),
            box("post", 0.8, mass=None),
        )
    )
    assert {(pair.name, pair.other) for pair in pairs} == {
        ("first", "second"),
        ("first", "post"),
        ("second", "post"),
        ("sunk", "ground"),
    }
    depths = {(pair.name, pair.other): pair.depth for pair in pairs}
    assert depths["first", "second"] == pytest.approx(0.2)
    assert depths["second", "post"] == pytest.approx(1.0)
    assert depths["sunk", "ground"] == pytest.approx(0.2)


@pytest.mark.parametrize(("x", "mass"), [(1.0, 1.0), (1.0 - 0.9 * INSIDE, 1.0), (0.5, None)])
def test_what_touches_is_not_inside_and_what_never_moves_may_overlap(x, mass):
    assert inside(world(box("first", 0, mass=mass), box("second", x, mass=mass))) == []


def test_one_line_says_it_all():
    ((_, words),) = note_inside(world(box("first", 0), box("second", 0.8), box("third", 0.9)))
    assert (
        words == "second starts 0.90 m inside third, and 2 more pairs: they push each other apart"
    )
    assert list(note_inside(WALL)) == []


@pytest.mark.parametrize(
    ("spawn", "height"),
    [
        # On the deck, which is 0.3 m high; above it; beside it; above the wall.
        (Spawn(x=0, y=0, z=0.45), 0.0),
        (Spawn(x=0, y=0, z=1.45), 1.0),
        (Spawn(x=-4, y=4, z=1.15), 1.0),
    ],
)
def test_the_way_down_is_measured_to_what_is_below(spawn, height):
    assert drop(WALL, HUSKY, spawn) == pytest.approx(height, abs=0.05)
    told = [about for about, _ in notes_on_start(WALL, HUSKY, spawn)]
    assert told == (["drop"] if height > DROP else [])


def test_wheels_in_the_air_and_a_world_that_pulls_nothing_down_are_noted():
    # Between the wheels a block of 0.3 m stands on the deck.
    block = world(box_model("block", "0 0 0.45 0 0 0", "0.3 0.3 0.3", None)).models[-1]
    ((about, words),) = notes_on_start(
        replace(WALL, models=(*WALL.models, block)), HUSKY, Spawn(x=0, y=0, z=0.65)
    )
    assert about == "wheels" and "no wheel touches anything" in words
    for gravity in (0.0, 9.81):
        floating = replace(WALL, gravity=(0.0, 0.0, gravity))
        assert [about for about, _ in notes_on_start(floating, HUSKY, Spawn(x=0, y=0, z=0.45))] == [
            "gravity"
        ]


def test_a_goal_inside_a_post_is_noted():
    start = Spawn(x=0, y=0, z=0.45)
    assert [about for about, _ in notes_on_start(WALL, HUSKY, start, Goal(x=0, y=-4))] == [
        "goal",
        "passage",
    ]
    assert list(notes_on_start(WALL, HUSKY, start, Goal(x=0, y=-3))) == []


@pytest.mark.parametrize(
    ("width", "top", "ground", "removable", "offered"),
    [
        (12, 0.0, "", {"floor", "crate"}, ["floor"]),
        (12, 0.0, "", {"crate"}, []),
        (2, 0.0, "", {"floor"}, []),
        (12, 1.0, "", {"floor"}, []),
        (12, 0.0, GROUND, {"floor"}, []),
    ],
    ids=["a floor", "protected", "too small", "a table", "above ground"],
)
def test_a_floor_that_carries_everything_is_offered_to_stay(width, top, ground, removable, offered):
    floor = box_model("floor", f"0 0 {top - 0.05} 0 0 0", f"{width} {width} 0.1", None)
    text = f'<sdf version="1.9"><world name="w">{ground}{floor}{box("crate", 3)}</world></sdf>'
    notes = list(
        note_floor(parse_world(text.encode(), DATA), HUSKY, Spawn(x=0, y=0, z=0.2), removable)
    )
    assert [about for about, _ in notes] == offered
    assert all("--protect 'floor'" in words for _, words in notes)


def seen_as(*visuals):
    """A world of a post that all can see, and one with a collision of 1.5 m that is drawn in these
    `visuals`.
    """
    box = "<geometry><box><size>{0} {0} 2</size></box></geometry>"
    link = "<link name='l'><collision name='c'>{}</collision>{}</link>"
    models = [
        f"<model name='{name}'><static>1</static>{link.format(box.format(1.5), drawn)}</model>"
        for name, drawn in (
            ("post", f"<visual name='v'>{box.format(1)}</visual>"),
            (
                "odd",
                "".join(f"<visual name='{size}'>{box.format(size)}</visual>" for size in visuals),
            ),
        )
    ]
    return parse_world(
        f"<sdf version='1.9'><world name='w'>{''.join(models)}</world></sdf>".encode(),
        Path("w.sdf"),
    )


def test_what_can_be_hit_where_nothing_is_seen_is_named():
    names = ("post", "odd")
    assert list(note_unseen(seen_as(1.0), names)) == []
    assert list(note_unseen(seen_as(), names)) == [
        ("unseen", "models without a visual, which can be hit but not seen: odd")
    ]
    assert list(note_unseen(seen_as(0.05), names)) == [
        ("larger", "models whose collision is more than 3 times as wide as what is seen: odd")
    ]
    assert list(note_unseen(seen_as(0.05), ("post",))) == []
    assert "models without a visual, which can be hit but not seen: odd" in world_lines(seen_as())


@pytest.mark.parametrize(("height", "named"), [(1.0, ["sheet"]), (0.01, [])])
def test_what_is_seen_and_cannot_be_hit_is_named_unless_it_is_flat(height, named):
    drawn = f"<visual name='v'><geometry><box><size>1 1 {height}</size></box></geometry></visual>"
    sheet = f"<model name='sheet'><static>1</static><link name='l'>{drawn}</link></model>"
    text = seen_as(1.0).text.replace(b"</world>", f"{sheet}</world>".encode())
    notes = list(note_unseen(parse_world(text, Path("w.sdf")), ("post", "odd", "sheet")))
    words = "models without a collision, which can be seen but not hit"
    assert notes == [("passable", f"{words}: {name}") for name in named]
