"""Outlines of shapes seen from above."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.map.footprints import ROUND, footprint
from ddenv.world.extent import polygon_area, shape_bounds
from ddenv.world.model import Box, Capsule, Collision, Cylinder, Ellipsoid, Link, Mesh, Model, Plane, Shape, Sphere
from ddenv.world.pose import Pose

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
SHAPES = (
    Box((1, 2, 3)),
    Cylinder(0.5, 2),
    Capsule(0.5, 2),
    Sphere(0.7),
    Ellipsoid((1, 0.5, 0.2)),
    Mesh("m", CORNERS * (1, 2, 3), np.array([[0, 1, 2]])),
)
angle = st.floats(-3, 3)


def print_of(shape: Shape, pose: Pose = Pose(), corners: int = ROUND):  # noqa: B008
    collisions = (Collision("c", shape, pose, 1.0),)
    return footprint(Model("m", Pose((4, 5, 6)), True, (Link("l", Pose(), None, collisions, ()),), (), (), 1), corners)


@given(st.sampled_from(SHAPES), st.builds(Pose.from_rpy, angle, angle, angle, angle, angle, angle))
def test_an_outline_is_as_large_as_its_shape(shape, pose):
    low, high = shape_bounds(shape, pose)
    seen = print_of(shape, pose, corners=90)
    assert seen.low == pytest.approx(low[:2], abs=0.01)
    assert seen.high == pytest.approx(high[:2], abs=0.01)
    assert all(polygon_area(polygon) > 0 for polygon in seen.polygons)


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        (Sphere(2), np.pi * 4),
        (Ellipsoid((3, 1, 9)), np.pi * 3),
        (Capsule(1, 5), np.pi),
        (Mesh("m", CORNERS, np.array([[0, 1, 2]])), 1),
    ],
    ids=repr,
)
def test_areas_from_above(shape, area):
    (polygon,) = print_of(shape, corners=200).polygons
    assert polygon_area(polygon) == pytest.approx(area, rel=1e-3)


def test_a_lying_capsule_is_a_rectangle_with_round_ends():
    lying = print_of(Capsule(0.5, 2), Pose.from_rpy(1, 1, 0, 0, np.pi / 2, 0))
    assert lying.low == pytest.approx((-0.5, 0.5), abs=1e-6)
    assert lying.high == pytest.approx((2.5, 1.5), abs=1e-6)


def test_a_model_without_shapes_is_a_point():
    seen = print_of(Plane((1, 1)))
    assert seen.polygons == ()
    assert seen.center == (4, 5)
    assert seen.area == 0


def test_a_model_that_moved_and_tipped_over_covers_what_it_lies_on():
    upright = Pose((1.0, 0.0, 1.0))
    link = Link("link", upright, None, (Collision("post", Box((0.2, 0.2, 2.0)), upright, 1.0),), ())
    model = Model("post", upright, False, (link,), (), (), 1)
    there = Pose.from_rpy(4.0, 0.0, 0.1, 0.0, math.pi / 2, 0.0)
    moved = footprint(model, moved=there @ model.links[0].pose.inverse())
    assert (*moved.low, *moved.high) == pytest.approx((3.0, -0.1, 5.0, 0.1), abs=1e-6)
