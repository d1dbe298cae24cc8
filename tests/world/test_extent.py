"""The boxes around shapes are as small as can be; infinite planes become boxes that reach as far as
anything does.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.world.extent import (
    bounds,
    center,
    corners,
    model_bounds,
    shape_bounds,
    with_ground_boxes,
)
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
    Sphere,
)
from ddenv.world.pose import Pose
from ddenv.world.sdf.read import parse_world
from tests.conftest import ROOT

ROUND = 60
TURNS = np.arange(ROUND) * 2 * np.pi / ROUND
CIRCLE = np.column_stack([np.cos(TURNS), np.sin(TURNS), np.zeros(ROUND)])
TILTS = np.linspace(0, np.pi, ROUND)
BALL = np.array([[np.sin(t) * x, np.sin(t) * y, np.cos(t)] for t in TILTS for x, y, _ in CIRCLE])
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
UP = np.array([0.0, 0.0, 1.0])
FACES = np.array([[0, 1, 2]])

# Shapes with points of their surfaces.
SHAPES = [
    (Box((1, 2, 3)), CORNERS * (1, 2, 3)),
    (Cylinder(0.5, 2), np.vstack([0.5 * CIRCLE + UP, 0.5 * CIRCLE - UP])),
    (Capsule(0.5, 2), np.vstack([0.5 * BALL + UP, 0.5 * BALL - UP])),
    (Sphere(0.7), 0.7 * BALL),
    (Ellipsoid((1, 0.5, 0.2)), BALL * (1, 0.5, 0.2)),
    (Mesh("m", CORNERS + 1, FACES), CORNERS + 1),
]
angle = st.floats(-3, 3)


@given(st.sampled_from(SHAPES), st.builds(Pose.from_rpy, angle, angle, angle, angle, angle, angle))
def test_every_point_is_in_the_box_and_some_are_on_each_side(case, pose):
    shape, surface = case
    points = surface @ pose.rotation().T + pose.position
    low, high = shape_bounds(shape, pose)
    assert (points >= low - 1e-9).all() and (points <= high + 1e-9).all()
    assert points.min(axis=0) == pytest.approx(low, abs=0.01)
    assert points.max(axis=0) == pytest.approx(high, abs=0.01)


def model(*collisions: Collision) -> Model:
    return Model(
        name="m",
        pose=Pose((7, 8, 9)),
        static=True,
        links=(Link(name="l", pose=Pose(), inertia=None, collisions=collisions, visuals=()),),
        joints=(),
        spans=(),
        line=1,
    )


def test_a_model_is_the_box_around_all_its_shapes_but_planes():
    boxes = [
        Collision(name="c", shape=Box((1, 1, 1)), pose=Pose((x, 0, 0)), mu=1.0) for x in (0, 4)
    ]
    plane = Collision(name="p", shape=Plane((1, 1)), pose=Pose((90, 0, 0)), mu=1.0)
    low, high = model_bounds(model(*boxes, plane))
    assert (low.tolist(), high.tolist()) == ([-0.5, -0.5, -0.5], [4.5, 0.5, 0.5])
    assert center(model(*boxes)) == (2, 0, 0)
    assert bounds((plane,)) is model_bounds(model()) is None
    # A model without shapes is where its frame is.
    assert center(model()) == (7, 8, 9)


def world(*places):
    box = "<collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision>"
    models = "".join(
        (
            f"<model name='m{n}'><static>1</static><pose>{x} {y} 0.5 0 0 0</pose><link "
            f"name='l'>{box}</link></model>"
        )
        for n, (x, y) in enumerate(places)
    )
    plane = "<collision name='c'><geometry><plane/></geometry></collision>"
    ground = (
        "<model name='g'><static>1</static><pose>0 0 0.25 0 0 1</pose><link "
        f"name='l'>{plane}</link></model>"
    )
    text = f"<sdf version='1.9'><world name='w'>{ground}{models}</world></sdf>"
    return parse_world(text.encode(), ROOT / "w.sdf")


def extent(world):
    """Half sizes and middle of the ground's box."""
    (collision,) = world.model("g").collisions
    return collision.shape.size, collision.pose.position


def test_its_top_is_the_plane():
    size, middle = extent(with_ground_boxes(made := world((3, 4)), corners(made)))
    assert size == (200, 200, 1)
    assert middle == pytest.approx((0, 0, -0.25))


@pytest.mark.parametrize(
    "places", [((300.0, 0.0),), ((0.0, 0.0), (-1000.0, 5000.0)), ((90.0, 0.0),)]
)
def test_it_reaches_beyond_everything(places):
    made = with_ground_boxes(world(*places), corners(world(*places)), [(0.0, 150.0, 0.0)])
    (collision,) = made.model("g").collisions
    for x, y in (*places, (0.0, 150.0)):
        local = collision.pose.inverse().rotate(
            tuple(a - b for a, b in zip((x, y, 0.0), collision.pose.position, strict=True))
        )
        assert all(
            abs(part) + 20 < size / 2
            for part, size in zip(local[:2], collision.shape.size[:2], strict=True)
        )
    assert made.model("m0") == world(*places).model("m0")
