import numpy as np
import pytest

from ddenv.world import hull
from ddenv.world.hull import convex_hull, convex_outline, half_spaces, outermost


def test_the_hull_of_many_points_keeps_their_extent(monkeypatch):
    ball = np.random.default_rng(1).normal(size=(3000, 3))
    monkeypatch.setattr(hull, "MANY_POINTS", 1000)
    monkeypatch.setattr(hull, "CHUNK", 700)
    for points in (ball, ball / np.linalg.norm(ball, axis=1)[:, None], ball * [5, 1, 1e-9]):
        vertices, _ = convex_hull(points)
        assert np.allclose(
            [vertices.min(axis=0), vertices.max(axis=0)],
            [points.min(axis=0), points.max(axis=0)],
            atol=0.01,
        )


def test_all_hulls_of_a_box_say_the_same():
    corners = np.array([[x, y, z] for x in (0, 4) for y in (-1, 1) for z in (2, 2.5)], dtype=float)
    points = np.vstack(
        [np.random.default_rng(2).uniform([0, -1, 2], [4, 1, 2.5], (200, 3)), corners]
    )
    assert outermost(points).tolist() == list(range(200, 208))
    vertices, faces = convex_hull(points)
    assert sorted(vertices.tolist()) == sorted(corners.tolist()) and len(faces) == 12
    spaces = half_spaces(points)
    assert np.abs((vertices @ spaces[:, :3].T + spaces[:, 3]).max(axis=1)).max() < 1e-9
    assert convex_outline(points[:, :2]).tolist() == [[0, -1], [4, -1], [4, 1], [0, 1]]


def test_points_in_one_plane():
    square = np.array([[0, 0, 1], [2, 0, 1], [2, 2, 1], [0, 2, 1]], dtype=float)
    assert np.ptp(convex_hull(square)[0], axis=0) == pytest.approx([2, 2, 1e-3])
    for refused in (outermost, half_spaces):
        with pytest.raises(ValueError, match="has no convex hull"):
            refused(square)
    assert np.abs(half_spaces(square, joggle=True)[:, 2]).max() == pytest.approx(1.0)
