"""The lidar of a run: limits, noise, what is there, what moves, and what was seen when."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from ddenv.robot.sensing.lidar import Lidar
from ddenv.world.model import Box, Cylinder, Model, Plane, Sphere
from ddenv.world.pose import Pose
from tests.robot.conftest import joint_of, link_of, model_of
from tests.robot.sensing.conftest import lidar_of, loose, plain, scan, still

AHEAD = 270
WALL = still("wall", Box((0.2, 40.0, 2.0)), Pose((3.1, 0.0, 0.0)))


def ahead(lidar: Lidar, *poses: Pose) -> float:
    """The range of the middle beam, with the robot and the moving links at `poses`."""
    return float(scan(lidar, *poses).ranges[AHEAD])


def ball(name: str, x: float) -> Model:
    return still(name, Sphere(0.5), Pose((x, 0.0, 0.0)))


def test_points_are_on_the_wall_seen_from_the_robot():
    settings = plain(x=0.3, y=0.1, z=0.36)
    robot = Pose.from_rpy(1.0, 0.5, 0.0, 0.0, 0.0, 0.4)
    points = scan(lidar_of(WALL, settings=settings), robot).points()
    assert len(points) > 200
    world = points @ robot.rotation().T + robot.position
    np.testing.assert_allclose(world[:, 0], 3.0, atol=1e-9)
    np.testing.assert_allclose(world[:, 2], 0.36, atol=1e-9)


def test_a_scan_has_its_time_and_the_beams_of_the_settings():
    taken = scan(lidar_of(WALL, settings=plain(beams=5, angle=2.0, x=0.2)), now=1.5)
    assert (taken.time, taken.origin) == (1.5, (0.2, 0.0, 0.0))
    np.testing.assert_allclose(taken.angles, [-1.0, -0.5, 0.0, 0.5, 1.0])


@pytest.mark.parametrize(
    ("x", "seen"), [(20.4, True), (20.6, False), (0.6, True), (0.54, False), (0.2, False)]
)
def test_only_what_is_neither_too_far_nor_too_near_is_measured(x, seen):
    lidar = lidar_of(ball("ball", x), settings=plain(angle=0.01))
    assert ahead(lidar) == (pytest.approx(x - 0.5) if seen else math.inf)
    assert set(lidar.first_seen) == ({"ball"} if seen else set())


def test_noise_takes_out_of_range_and_brings_nothing_into_it():
    taken = scan(
        lidar_of(
            still("wall", Box((0.2, 40.0, 2.0)), Pose((19.1, 0.0, 0.0))), settings=plain(noise=1.0)
        )
    )
    within = np.abs(taken.angles) <= math.acos(19.0 / 20.0)
    measured = taken.ranges[within][np.isfinite(taken.ranges[within])]
    assert 0 < len(measured) < within.sum()
    assert measured.max() <= 20.0
    assert np.isinf(taken.ranges[~within]).all()


def test_what_is_too_near_to_be_measured_still_hides_what_is_behind():
    lidar = lidar_of(ball("ball", 0.54), WALL, settings=plain(angle=0.01))
    assert np.isinf(scan(lidar).ranges).all()
    assert lidar.first_seen == {}


def test_noise_is_as_large_as_it_is_set():
    # Beams that are not cut off by the range, however much the noise adds.
    noisy, exact = (
        lidar_of(WALL, settings=plain(noise=0.02, angle=2.0)),
        scan(lidar_of(WALL, settings=plain(angle=2.0))),
    )
    errors = np.array([scan(noisy).ranges - exact.ranges for _ in range(50)])
    assert abs(errors.mean()) < 0.001
    assert errors.std() == pytest.approx(0.02, rel=0.03)


def test_the_noise_of_a_beam_does_not_depend_on_what_others_meet():
    near = still("near", Box((0.2, 0.2, 0.2)), Pose((1.0, 0.0, 0.0)))
    settings = plain(noise=0.01)
    alone, both = (lidar_of(*models, settings=settings) for models in ((WALL,), (WALL, near)))
    for _ in range(3):
        first, second = scan(alone), scan(both)
        past = np.abs(first.angles) > 0.2
        assert first.ranges[past].tobytes() == second.ranges[past].tobytes()
        assert first.ranges[AHEAD] > second.ranges[AHEAD] + 1.0


def test_a_scan_is_the_same_whatever_else_is_asked_for():
    settings, hidden = plain(noise=0.01, angle=1.0), ball("hidden", 6.0)
    first, second = (lidar_of(ball("ball", 1.5), hidden, WALL, settings=settings) for _ in range(2))
    poses = [Pose((0.3 * number, 0.02 * number, 0.0)) for number in range(40)]
    all_ = [scan(first, pose, now=float(number)).ranges for number, pose in enumerate(poses)]
    some = [scan(second, pose, now=float(number)) for number, pose in enumerate(poses)]
    for number in (39, 7, 23):
        np.testing.assert_array_equal(some[number].ranges, all_[number])
    assert first.first_seen == second.first_seen
    assert set(first.first_seen) == {"ball", "hidden", "wall"}


def test_a_scan_can_be_copied_and_stored():
    taken = scan(lidar_of(WALL, settings=plain(noise=0.01)))
    nearer = replace(taken, ranges=taken.ranges / 2)
    stored = pickle.loads(pickle.dumps(taken))
    np.testing.assert_array_equal(stored.ranges, taken.ranges)
    np.testing.assert_array_equal(nearer.ranges * 2, taken.ranges)


def test_links_are_where_their_poses_say_in_the_order_of_the_models():
    # The shape is not in its link's origin, and the first link has none.
    two = model_of(
        "two",
        link_of("empty", None, Pose()),
        link_of("arm", Box((0.2, 0.2, 0.2)), Pose((9.0, 9.0, 0.0))),
    )
    one = loose("one", Cylinder(0.5, 1.0), Pose((-8.0, 0.0, 0.0)))
    poses = Pose(), Pose((2.1, 0.0, 0.0)), Pose((5.0, 0.0, 0.0))
    lidar = lidar_of(two, WALL, one)
    assert ahead(lidar, Pose(), *poses) == pytest.approx(2.0)
    away = Pose((-2.1, 0.0, 0.0))
    assert ahead(lidar, Pose(), Pose(), away, Pose((2.0, 0.0, 0.0))) == pytest.approx(1.5)
    assert ahead(lidar, Pose(), Pose(), away, Pose((5.0, 0.0, 0.0))) == pytest.approx(3.0)
    # Without the first model the second one's links come first.
    assert ahead(
        lidar_of(two, WALL, one, present={"one"}), Pose(), Pose((2.0, 0.0, 0.0))
    ) == pytest.approx(1.5)


def test_a_link_that_is_fixed_in_the_world_stays():
    post = link_of("post", Box((0.2, 0.2, 1.0)), Pose((2.1, 0.0, 0.0)))
    gate = link_of("gate", Box((0.2, 0.2, 1.0)), Pose((4.1, 0.0, 0.0)))
    joints = (
        joint_of("fixed", "world", "post", (0.0, 0.0, 0.0)),
        joint_of("revolute", "post", "gate", (2.0, 0.0, 0.0)),
    )
    lidar = lidar_of(model_of("barrier", post, gate, joints=joints))
    nowhere = Pose((50.0, 0.0, 0.0))
    assert ahead(lidar, Pose(), nowhere, nowhere) == pytest.approx(2.0)
    assert ahead(lidar, Pose(), nowhere, Pose((1.1, 0.0, 0.0))) == pytest.approx(1.0)


def test_models_are_seen_when_a_beam_first_ends_on_them():
    floor = still("floor", Plane((1.0, 1.0)), Pose((0.0, 0.0, -0.5)))
    hidden, board = ball("hidden", 6.0), loose("board", Box((0.2, 1.0, 0.2)), Pose())
    lidar = lidar_of(floor, hidden, board, WALL, settings=plain(angle=0.4))
    scan(lidar, Pose((-2.0, 0.0, 0.0)), Pose((30.0, 0.0, 0.0)), now=0.1)
    assert lidar.first_seen == {"wall": 0.1}
    scan(lidar, Pose(), Pose((2.0, 0.0, 0.0)), now=0.2)
    scan(lidar, Pose.from_rpy(0.0, 0.0, 0.0, 0.0, 0.3, 0.0), Pose((2.0, 0.0, 0.0)), now=0.3)
    scan(lidar, Pose(), Pose((2.0, 0.0, 0.0)), now=0.4)
    assert lidar.first_seen == {"wall": 0.1, "board": 0.2, "floor": 0.3}
    scan(lidar, Pose((4.0, 0.0, 0.0)), Pose((2.0, 0.0, 0.0)), now=0.5)
    assert lidar.first_seen["hidden"] == 0.5
