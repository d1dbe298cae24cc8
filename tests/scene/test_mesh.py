"""Triangles of shapes: closed, facing outwards, with the right volume, at the right place."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.scene import mesh
from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Mesh, Plane, Sphere
from ddenv.world.pose import Pose

size = st.floats(0.01, 50.0)
place = st.floats(-30.0, 30.0)
angle = st.floats(-math.pi, math.pi)
pose = st.builds(Pose.from_rpy, place, place, place, angle, angle, angle)


def volume(shape: mesh.Surface) -> float:
    """By the divergence theorem: above zero only if the faces close up and face outwards."""
    a, b, c = np.moveaxis(shape.triangles - shape.vertices.mean(axis=0), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@given(st.tuples(size, size, size), pose)
def test_box_has_its_volume_and_place(sides, at):
    shape = mesh.of_shape(Box(sides)).at(at)
    assert len(shape.faces) == 12
    assert volume(shape) == pytest.approx(math.prod(sides), rel=1e-6)
    assert shape.vertices.mean(axis=0) == pytest.approx(at.position, abs=1e-9)
    back = shape.at(at.inverse()).vertices
    assert np.abs(back).max(axis=0) == pytest.approx(np.array(sides) / 2, rel=1e-6)


@given(size, size, pose)
def test_cylinder_lies_along_z(radius, length, at):
    shape = mesh.of_shape(Cylinder(radius, length)).at(at)
    polygon = mesh.SIDES / 2 * math.sin(2 * math.pi / mesh.SIDES) * radius**2
    assert volume(shape) == pytest.approx(polygon * length, rel=1e-6)
    own = shape.at(at.inverse()).vertices
    assert np.abs(own).max(axis=0) == pytest.approx((radius, radius, length / 2), rel=1e-6)


@given(st.tuples(size, size, size), size)
def test_round_shapes_are_almost_round(radii, length):
    radius, ball = radii[0], 4 / 3 * math.pi
    for shape, exact, reach in (
        (Sphere(radius), ball * radius**3, (radius,) * 3),
        (Ellipsoid(radii), ball * math.prod(radii), radii),
        (
            Capsule(radius, length),
            math.pi * radius**2 * length + ball * radius**3,
            (radius, radius, length / 2 + radius),
        ),
    ):
        surface = mesh.of_shape(shape)
        assert 0.95 < volume(surface) / exact < 1.0
        assert np.abs(surface.vertices).max(axis=0) == pytest.approx(reach, rel=1e-6)
        if not isinstance(shape, Capsule):
            assert np.linalg.norm(surface.vertices / reach, axis=1) == pytest.approx(
                np.ones(len(surface.vertices))
            )


def as_mesh(surface: mesh.Surface) -> Mesh:
    """With every place once, as the reader gives meshes."""
    vertices, places = np.unique(np.round(surface.vertices, 9), axis=0, return_inverse=True)
    return Mesh("m", vertices, places.reshape(-1)[surface.faces])


@pytest.mark.parametrize("from_file", [False, True])
def test_sharp_corners_are_not_shared(from_file):
    cube = mesh.box((1, 2, 3))
    shape = mesh.of_shape(as_mesh(cube)) if from_file else cube
    assert np.allclose(shape.triangles, cube.triangles)
    a, b, c = np.moveaxis(shape.triangles, 1, 0)
    normals = np.cross(b - a, c - a)
    for vertex in range(len(shape.vertices)):
        around = normals[(shape.faces == vertex).any(axis=1)]
        assert np.cross(around, around[0]) == pytest.approx(np.zeros((len(around), 3)))


def test_round_meshes_keep_their_corners():
    ball = as_mesh(mesh.sphere(1.0))
    shape = mesh.of_shape(ball)
    assert len(shape.vertices) == len(ball.vertices)
    assert volume(shape) == pytest.approx(volume(mesh.sphere(1.0)))


@given(st.lists(st.tuples(size, pose), max_size=5))
def test_merged_meshes_keep_all_faces(parts):
    meshes = [mesh.box((side, side, side)).at(at) for side, at in parts]
    corners = [part.triangles for part in meshes] or [np.zeros((0, 3, 3))]
    assert np.allclose(mesh.merge(meshes).triangles, np.concatenate(corners))


def test_ring_is_closed_and_faces_outwards():
    shape = mesh.ring(1.0, 0.1)
    assert 0.8 < volume(shape) / (2 * math.pi**2 * 0.05**2) < 1.0
    a, b, c = np.moveaxis(shape.triangles, 1, 0)
    # The sum of the faces' normals, times area, is zero for a closed surface.
    assert np.cross(b - a, c - a).sum(axis=0) == pytest.approx([0, 0, 0], abs=1e-9)


@pytest.mark.parametrize("axis", [0, 2], ids=["level", "vertical"])
def test_tube_follows_the_path(axis):
    points = np.ones((101, 3))
    points[:, axis] = np.linspace(0, 2, 101)
    shape = mesh.tube(points, 0.02)
    assert shape.vertices[:, axis].min() == pytest.approx(0.0)
    assert shape.vertices[:, axis].max() == pytest.approx(2.0, abs=mesh.TUBE_STEP)
    across = np.delete(shape.vertices, axis, axis=1) - 1
    assert np.linalg.norm(across, axis=1) == pytest.approx(np.full(len(shape.vertices), 0.02))
    assert volume(shape) > 0


@pytest.mark.parametrize("count", [0, 1, 50])
def test_what_has_no_extent_has_no_faces(count):
    assert len(mesh.tube(np.ones((count, 3)), 0.02).faces) == 0
    assert len(mesh.of_shape(Plane((1.0, 1.0))).faces) == 0


@given(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.floats(-0.5, 0.5))
def test_height_of_a_slope(x, y, pitch):
    slope = mesh.box((4, 4, 0.2)).at(Pose.from_rpy(0, 0, 1, 0, pitch, 0))
    expected = 1 - x * math.tan(pitch) + 0.1 / math.cos(pitch)
    assert mesh.height_at(slope, x, y) == pytest.approx(expected, abs=1e-6)
    assert mesh.height_at(slope, 30, 0) is None and mesh.height_at(mesh.EMPTY, 0, 0) is None
