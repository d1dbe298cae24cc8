"""Casting beams: as far as the slow way says, for every shape and from everywhere."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from ddenv.world import scenario
from ddenv.world.extent import vertices_of
from ddenv.world.files.boxes import box_of
from ddenv.world.files.pieces import convex_pieces, extruded
from ddenv.world.hull import convex_hull
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Mesh,
    Model,
    Piece,
    Plane,
    Shape,
    Sphere,
    Terrain,
)
from ddenv.world.pose import Pose
from tests.robot.sensing.conftest import lidar_of, loose, plain, scan, still
from tests.tiers import examples

# How deep a beam has to get into a shape, or how far to pass it, for both ways to agree on whether
# it meets it.
CLEAR = 1e-6
# Of a plane, which is the top of a very large box: where it is all but parallel to the beams, how
# far they go is lost in rounding.
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
    Pose.from_rpy,
    *[st.sampled_from([-3.0, 0.0, 0.5, 2.0])] * 3,
    *[st.sampled_from([0.0, math.pi / 2, math.pi])] * 3,
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


def slowly(
    lidar: scenario.Lidar, robot: Pose, placed: list[tuple[Shape, Pose]]
) -> tuple[np.ndarray, np.ndarray]:
    """The ranges (N,) m and which of them (N,) are clear."""
    sensor = robot @ Pose((lidar.x, lidar.y, lidar.z))
    angles = np.linspace(-lidar.angle / 2, lidar.angle / 2, lidar.beams)
    ways = (
        np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
        @ sensor.rotation().T
    )
    found = [
        first_met(shape, pose, np.array(sensor.position), ways, lidar.range)
        for shape, pose in placed
    ]
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
    agree(
        ranges,
        *slowly(
            lidar, robot, [(shape, pose) for (shape, _, _), pose in zip(around, now, strict=True)]
        ),
    )


@given(
    lidars, turned, st.lists(st.tuples(shapes, poses), min_size=2, max_size=5), st.integers(1, 4)
)
def test_what_is_absent_or_never_met_changes_no_bit(lidar, robot, around, count):
    models = [
        still(f"m{number}", shape, robot @ pose) for number, (shape, pose) in enumerate(around)
    ]

    def measured(
        *models: Model, present: list[str] | None = None
    ) -> tuple[bytes, dict[str, float]]:
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
        [
            random.uniform(-6, 6, (60, 2)),
            random.uniform(-0.3, 0.3, 60),
            random.uniform(-3, 3, (60, 3)),
        ]
    )
    models = [
        still(f"m{number}", kinds[number % 6], Pose.from_rpy(*row))
        for number, row in enumerate(rows)
    ]
    robot = Pose.from_rpy(0.1, -0.2, 0.05, 0.02, -0.03, 0.5)
    together = scan(lidar_of(*models), robot).ranges
    alone = [scan(lidar_of(*models, present={model.name}), robot).ranges for model in models]
    assert np.isfinite(together).sum() > 300
    assert together.tobytes() == np.min(alone, axis=0).tobytes()


# Each leaves two thirds of the way, or half of it.
STEPS = 80


def outside(shape: Shape, points: np.ndarray) -> np.ndarray:
    """How far (N,) `points` (N, 3) in the shape's frame are outside: 0 on the surface, below 0
    inside, convex; no distance.
    """
    x, y, z = points.T
    match shape:
        case Box(size):
            return (np.abs(points) - np.array(size) / 2).max(axis=1)
        case Sphere(radius):
            return np.linalg.norm(points, axis=1) - radius
        case Ellipsoid(radii):
            return np.linalg.norm(points / np.array(radii), axis=1) - 1.0
        case Cylinder(radius, length):
            return np.maximum(np.hypot(x, y) - radius, np.abs(z) - length / 2)
        case Capsule(radius, length):
            return np.linalg.norm([x, y, np.maximum(np.abs(z) - length / 2, 0.0)], axis=0) - radius
        case Plane():
            return z
        case Mesh():
            faces = ConvexHull(shape.vertices).equations
            return (points @ faces[:, :3].T + faces[:, 3]).max(axis=1)


def first_met(
    shape: Shape, pose: Pose, origin: np.ndarray, ways: np.ndarray, farthest: float
) -> tuple[np.ndarray, np.ndarray]:
    """How far (N,) beams from `origin` along `ways` (N, 3) go until `shape` at `pose`, and how
    clear that is (N,).

    Infinite for those that miss it, and where `origin` is inside. It is clear by how deep a beam
    gets into the shape, or by how far it stays outside.
    """
    turn = pose.rotation()
    start, ways = (origin - pose.position) @ turn, ways @ turn

    def at(way: np.ndarray) -> np.ndarray:
        return outside(shape, start + way[:, None] * ways)

    low, high = np.zeros(len(ways)), np.full(len(ways), farthest)
    for _ in range(STEPS):
        third = (high - low) / 3
        falls = at(low + third) > at(high - third)
        low, high = np.where(falls, low + third, low), np.where(falls, high, high - third)
    deepest, depth = low, at(low)
    low, high = np.zeros(len(ways)), deepest
    for _ in range(STEPS):
        middle = (low + high) / 2
        in_it = at(middle) <= 0
        low, high = np.where(in_it, low, middle), np.where(in_it, middle, high)
    begins = at(np.zeros(len(ways)))
    return np.where((depth <= 0) & (begins > 0), high, np.inf), np.minimum(
        np.abs(depth), np.abs(begins)
    )


def test_beams_end_on_the_slope_of_terrain_and_pass_over_what_is_lower():
    slope = np.broadcast_to(np.linspace(-2.0, 2.0, 9), (5, 9))
    ground = still("slope", Terrain((8.0, 8.0), slope, "slope"), Pose((1.0, 0.0, 0.0)))
    lidar = scenario.Lidar(x=0.0, z=0.0, noise=0.0, angle=math.tau, beams=9, range=12.0)
    # At a height of 1 m the slope is met at x = 3 m, along the diagonals too.
    found = scan(lidar_of(ground, settings=lidar), Pose((0.0, 0.0, 1.0)))
    ahead = np.cos(found.angles) > 0.5
    assert found.ranges[ahead] == pytest.approx(3.0 / np.cos(found.angles[ahead]), abs=1e-6)
    assert np.isinf(found.ranges[~ahead]).all()
    # Not from below, and not above its end.
    assert np.isinf(scan(lidar_of(ground, settings=lidar), Pose((4.0, 0.0, 1.0))).ranges).all()
    assert np.isinf(scan(lidar_of(ground, settings=lidar), Pose((0.0, 0.0, 2.1))).ranges).all()


def room(turn: float) -> tuple[Model, np.ndarray]:
    """A house of one room, cut in pieces, with two pillars along each of its five walls; and these
    walls as half planes (5, 3).
    """
    corners = np.array([[-3.0, -2.0], [2.5, -2.5], [4.0, 0.5], [0.3, 3.5], [-3.5, 2.0]])
    cosine, sine = math.cos(turn), math.sin(turn)
    corners @= np.array([[cosine, sine], [-sine, cosine]])
    outline = []
    for start, end in pairwise([*corners, corners[0]]):
        inward = np.array([start[1] - end[1], end[0] - start[0]]) / np.linalg.norm(end - start)
        outline.append(start)
        for share, depth in (
            (0.2, 0.0),
            (0.2, 0.3),
            (0.3, 0.3),
            (0.3, 0.0),
            (0.7, 0.0),
            (0.7, 0.1),
            (0.8, 0.1),
            (0.8, 0.0),
        ):
            outline.append(start + share * (end - start) + depth * inward)
    vertices, faces = extruded([1.1 * corners, np.array(outline)], 2.0)
    whole = Mesh("house", vertices, faces)
    pieces = [Mesh("piece", *piece) for piece in convex_pieces(vertices, faces, 64)]
    collisions = [
        Collision(name="c", shape=shape, pose=pose, mu=1.0, piece=Piece(whole, pose))
        for shape, pose in (box_of(piece) or (piece, Pose()) for piece in pieces)
    ]
    house = still("house", Box((1.0, 1.0, 1.0)), Pose())
    links = (replace(house.links[0], collisions=tuple(collisions)),)
    return replace(house, links=links), ConvexHull(corners).equations


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.0])
def test_no_beam_passes_between_two_pieces_of_a_wall(turn):
    house, walls = room(turn)
    assert len(house.collisions) >= 15
    sensor = lidar_of(house, settings=plain(beams=721, angle=math.tau, range=30.0))

    def beyond(x: float, y: float, yaw: float) -> np.ndarray:
        """How much farther than the walls beams (N,) go, m; less than 0 for those that end on a
        pillar.
        """
        found = scan(sensor, Pose.from_rpy(x, y, 1.0, 0.0, 0.0, yaw))
        ways = np.stack([np.cos(found.angles + yaw), np.sin(found.angles + yaw)])
        rise = walls[:, :2] @ ways
        distances = -(walls[:, :2] @ (x, y) + walls[:, 2])[:, None]
        return found.ranges - np.where(rise > 1e-9, distances / np.maximum(rise, 1e-9), np.inf).min(
            axis=0
        )

    def agrees(*pose: float) -> None:
        more = beyond(*pose)
        assert more.max() < 1e-5
        assert np.median(more) > -5e-4

    random = np.random.default_rng(5)
    for _ in range(20):
        agrees(*random.uniform(-1.5, 1.5, 2), random.uniform(-math.pi, math.pi))
    # A beam along each face of a piece, or micrometres beside it, from where there is no pillar:
    # some of them are seams.
    checked = 0
    for piece in house.collisions:
        corners, _ = vertices_of(piece.shape)
        for x, y, up, offset in ConvexHull(
            corners @ piece.pose.rotation().T + piece.pose.position
        ).equations:
            for beside in (0.0, *random.normal(0.0, 3e-6, 4)):
                start = random.uniform(-1.0, 1.0, 2)
                start -= (start @ (x, y) + offset + beside) * np.array([x, y])
                inside = (walls[:, :2] @ start + walls[:, 2]).max() < -0.35
                if abs(up) < 1e-6 and inside:
                    agrees(*start, math.atan2(x, -y))
                    checked += 1
    assert checked >= 20
