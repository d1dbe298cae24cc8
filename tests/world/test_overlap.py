"""How deep convex bodies stand in each other."""

import math
import time
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from ddenv.world.load import SDF
from ddenv.world.model import Box, Capsule, Collision, Cylinder, Ellipsoid, Mesh, Sphere
from ddenv.world.placement import Hull, distance, hull, overlap
from ddenv.world.pose import Pose
from ddenv.world.sdf.read import read_model

turned = st.tuples(*[st.floats(-3, 3)] * 3)


def body(shape, position=(0, 0, 0), rpy=(0, 0, 0)) -> Hull:
    return hull(Collision("c", shape, Pose.from_rpy(*position, *rpy), 1.0))


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
SHAPES = (Box((0.4, 0.6, 0.8)), Cylinder(0.25, 0.5), Ellipsoid((0.3, 0.2, 0.5)), CUBE, stone(12), stone(40))
ROUND = (Sphere(0.3), Capsule(0.2, 0.6))


def true_depth(a: Hull, b: Hull) -> float:
    """How far zero is inside the hull of all differences between points of both bodies: slow, and the definition."""
    differences = (a.vertices[:, None] - b.vertices[None]).reshape(-1, 3)
    return max(0.0, float((-ConvexHull(differences).equations[:, 3]).min()))


@given(st.sampled_from(SHAPES), st.sampled_from(SHAPES), turned, turned, st.tuples(*[st.floats(-0.5, 0.5)] * 3))
def test_the_depth_of_bodies_with_faces_is_exact(first, second, rpy, other, at):
    a, b = body(first, (0, 0, 0), rpy), body(second, at, other)
    assert overlap(a, b) == pytest.approx(true_depth(a, b), abs=1e-4)
    assert overlap(b, a) == pytest.approx(overlap(a, b), abs=1e-4)


@given(st.sampled_from(SHAPES + ROUND), st.sampled_from(SHAPES + ROUND), turned, turned, turned, st.floats(0.01, 5))
def test_bodies_apart_do_not_overlap(first, second, rpy, other, direction, gap):
    length = math.sqrt(sum(part * part for part in direction))
    if length < 0.1:
        return
    # Every one of them is inside a ball of radius 0.55 around its place.
    away = tuple(part / length * (1.1 + gap) for part in direction)
    assert overlap(body(first, (0, 0, 0), rpy), body(second, away, other)) == 0.0


@given(st.sampled_from(SHAPES[:4] + ROUND), turned, turned, st.tuples(*[st.floats(-0.15, 0.15)] * 3))
def test_bodies_that_share_a_point_overlap(shape, rpy, other, at):
    # Each holds a ball of radius 0.19 around its place, and these are closer than 0.38.
    assert overlap(body(Box((0.4, 0.4, 0.4)), (0, 0, 0), rpy), body(shape, at, other)) > 0


def test_the_depth_is_what_must_be_moved():
    box, ball = Box((1, 1, 1)), Sphere(0.5)
    assert overlap(body(box), body(box, (0.9, 0, 0))) == pytest.approx(0.1)
    assert overlap(body(box), body(ball, (0.9, 0, 0))) == pytest.approx(0.1)
    assert overlap(body(ball), body(ball, (0.8, 0, 0))) == pytest.approx(0.2)
    assert overlap(body(ball), body(ball)) == pytest.approx(1.0)
    assert overlap(body(box), body(Capsule(0.2, 1.0), (0, 0, 1.1))) == pytest.approx(0.1)
    assert overlap(body(box), body(Capsule(0.2, 1.0), (0.6, 0, 0))) == pytest.approx(0.1)
    assert overlap(body(Capsule(0.2, 2.0)), body(Capsule(0.1, 2.0), (0.25, 0, 0), (1.2, 0, 0))) == pytest.approx(0.05)


@pytest.mark.parametrize("shape", [Sphere(1.0), Capsule(1.0, 0.5), Capsule(1.0, 3.0)], ids=repr)
def test_round_bodies_beside_an_edge_are_not_inside(shape):
    edge = body(Box((1, 1, 6)))
    beside = 0.5 + 1.01 / math.sqrt(2)
    assert overlap(edge, body(shape, (beside, beside, 0.3))) == 0.0
    assert overlap(edge, body(shape, (beside - 0.05, beside - 0.05, 0.3))) == pytest.approx(0.05 * 2**0.5 - 0.01)


def test_prisms_are_not_their_boxes():
    corner = np.array([0.5, 0.5, 0.0]) + 0.25 / math.sqrt(2) * np.array([1, 1, 0])
    assert overlap(body(Box((1, 1, 1))), body(Cylinder(0.2, 1), tuple(corner))) == 0.0


def test_the_distance_of_bodies():
    assert distance(body(Box((1, 1, 1))), body(Box((1, 1, 1)), (2, 2, 0))) == pytest.approx(math.sqrt(2))
    assert distance(body(Box((1, 1, 1))), body(stone(40))) == pytest.approx(0.0, abs=1e-12)


def test_a_detailed_mesh_costs_no_time():
    robot = read_model(SDF / "robots" / "husky.sdf")
    stone_ahead = Collision("c", stone(500, 1.0), Pose(), 1.0)
    started = time.process_time()
    depths = [overlap(hull(collision), hull(stone_ahead)) for collision in robot.collisions]
    # 8 ms were measured; a busy machine shall not fail.
    assert time.process_time() - started < 0.5
    assert min(depths) > 0.5
