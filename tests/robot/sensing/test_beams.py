"""Casting beams: as far as the slow way says, for every shape and from everywhere."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ddenv.world import scenario
from ddenv.world.files.meshes import convex_hull
from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Mesh, Model, Plane, Shape, Sphere
from ddenv.world.pose import Pose
from tests.robot.sensing.conftest import lidar_of, loose, scan, still
from tests.robot.sensing.slow import first_met
from tests.tiers import examples

# How deep a beam has to get into a shape, or how far to pass it, for both ways to agree on whether it meets it.
CLEAR = 1e-6
# Of a plane, which is the top of a very large box: where it is all but parallel to the beams, how far they go is lost in rounding.
CLEAR_OF_PLANES = 1e-3


def of(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


def mesh(seed: int, count: int) -> Mesh:
    points = np.random.default_rng(seed).standard_normal((count, 3))
    return Mesh(str(seed), *convex_hull(points + np.array([1.0, -2.0, 0.5])))


length, angle = of(0.02, 3.0), of(-math.pi, math.pi)
shapes = st.one_of(
    st.builds(Box, st.tuples(length, length, length)),
    st.builds(Sphere, length),
    st.builds(Ellipsoid, st.tuples(length, length, length)),
    st.builds(Cylinder, length, length),
    st.builds(Capsule, length, length),
    st.builds(mesh, st.integers(0, 1000), st.integers(4, 60)),
    st.just(Plane((1.0, 1.0))),
)
turned = st.builds(Pose.from_rpy, of(-8, 8), of(-8, 8), of(-1, 1), angle, angle, angle)
# Much in the real world is parallel or at right angles to all else.
upright = st.builds(
    Pose.from_rpy, *[st.sampled_from([-3.0, 0.0, 0.5, 2.0])] * 3, *[st.sampled_from([0.0, math.pi / 2, math.pi])] * 3
)
poses = turned | upright
lidars = st.builds(
    scenario.Lidar,
    beams=st.integers(2, 50),
    angle=of(0.1, math.tau) | st.just(math.tau),
    range=of(2.0, 30.0),
    nearest=st.just(0.0),
    noise=st.just(0.0),
    x=of(-1, 1) | st.just(0.0),
    y=of(-1, 1) | st.just(0.0),
    z=of(-1, 1) | st.just(0.0),
)


def slowly(lidar: scenario.Lidar, robot: Pose, placed: list[tuple[Shape, Pose]]) -> tuple[np.ndarray, np.ndarray]:
    """The ranges (N,) m and which of them (N,) are clear."""
    sensor = robot @ Pose((lidar.x, lidar.y, lidar.z))
    angles = np.linspace(-lidar.angle / 2, lidar.angle / 2, lidar.beams)
    ways = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))]) @ sensor.rotation().T
    found = [first_met(shape, pose, np.array(sensor.position), ways, lidar.range) for shape, pose in placed]
    ranges = np.min([ranges for ranges, _ in found], axis=0)
    needed = [CLEAR_OF_PLANES if isinstance(shape, Plane) else CLEAR for shape, _ in placed]
    clear = np.all([clear > least for (_, clear), least in zip(found, needed, strict=True)], axis=0)
    return ranges, clear & (np.abs(ranges - lidar.range) > CLEAR)


def agree(ranges: np.ndarray, expected: np.ndarray, clear: np.ndarray) -> None:
    np.testing.assert_allclose(ranges[clear], expected[clear], rtol=1e-7, atol=1e-6)


@examples(2)
@given(lidars, turned | st.just(Pose()), st.lists(st.tuples(shapes, poses), min_size=1, max_size=4))
def test_beams_go_as_far_as_the_slow_way_says(lidar, robot, around):
    placed = [(shape, robot @ pose) for shape, pose in around]
    models = [still(f"m{number}", *one) for number, one in enumerate(placed)]
    agree(scan(lidar_of(*models, settings=lidar), robot).ranges, *slowly(lidar, robot, placed))


@given(lidars, turned, st.lists(st.tuples(shapes, turned, poses), min_size=1, max_size=3))
def test_what_moves_is_met_where_it_is_now(lidar, robot, around):
    models = [loose(f"m{number}", shape, first) for number, (shape, first, _) in enumerate(around)]
    now = [robot @ pose for _, _, pose in around]
    ranges = scan(lidar_of(*models, settings=lidar), robot, *now).ranges
    agree(ranges, *slowly(lidar, robot, [(shape, pose) for (shape, _, _), pose in zip(around, now, strict=True)]))


@given(lidars, turned, st.lists(st.tuples(shapes, poses), min_size=2, max_size=5), st.integers(1, 4))
def test_what_is_absent_or_never_met_changes_no_bit(lidar, robot, around, count):
    models = [still(f"m{number}", shape, robot @ pose) for number, (shape, pose) in enumerate(around)]

    def measured(*models: Model, present: list[str] | None = None) -> tuple[bytes, dict[str, float]]:
        sensor = lidar_of(*models, settings=lidar, present=present)
        return scan(sensor, robot).ranges.tobytes(), sensor.first_seen

    ranges, seen = measured(*models)
    assert measured(*models, present=list(seen)) == (ranges, seen)
    some = models[:count]
    assert measured(*models, present=[model.name for model in some]) == measured(*some)


def test_each_range_has_the_same_bits_among_many_shapes_as_alone():
    random = np.random.default_rng(3)
    kinds = [
        Box((0.5, 0.4, 0.9)),
        Sphere(0.3),
        Ellipsoid((0.2, 0.4, 0.6)),
        Cylinder(0.3, 1.0),
        Capsule(0.2, 0.5),
        mesh(4, 20),
    ]
    rows = np.column_stack(
        [random.uniform(-6, 6, (60, 2)), random.uniform(-0.3, 0.3, 60), random.uniform(-3, 3, (60, 3))]
    )
    models = [still(f"m{number}", kinds[number % 6], Pose.from_rpy(*row)) for number, row in enumerate(rows)]
    robot = Pose.from_rpy(0.1, -0.2, 0.05, 0.02, -0.03, 0.5)
    together = scan(lidar_of(*models), robot).ranges
    alone = [scan(lidar_of(*models, present={model.name}), robot).ranges for model in models]
    assert np.isfinite(together).sum() > 300
    assert together.tobytes() == np.min(alone, axis=0).tobytes()
