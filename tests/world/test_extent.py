"""The boxes around shapes are as small as can be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.world.extent import bounds, center, model_bounds, shape_bounds
from ddenv.world.model import Box, Capsule, Collision, Cylinder, Ellipsoid, Link, Mesh, Model, Plane, Sphere
from ddenv.world.pose import Pose

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
    return Model("m", Pose((7, 8, 9)), True, (Link("l", Pose(), None, collisions, ()),), (), (), 1)


def test_a_model_is_the_box_around_all_its_shapes_but_planes():
    boxes = [Collision("c", Box((1, 1, 1)), Pose((x, 0, 0)), 1.0) for x in (0, 4)]
    plane = Collision("p", Plane((1, 1)), Pose((90, 0, 0)), 1.0)
    low, high = model_bounds(model(*boxes, plane))
    assert (low.tolist(), high.tolist()) == ([-0.5, -0.5, -0.5], [4.5, 0.5, 0.5])
    assert center(model(*boxes)) == (2, 0, 0)
    assert bounds((plane,)) is None


def test_a_model_without_shapes_is_where_its_frame_is():
    assert model_bounds(model()) is None
    assert center(model()) == (7, 8, 9)
