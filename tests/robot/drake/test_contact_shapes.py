"""What stands for wheels, cylinders, capsules and meshes: as large as the file says, and exact in
Drake against boxes.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from ddenv.robot.drake.contact_shapes import Wheel, contact_shapes, cylinder, prism, tyre, wheel_of
from ddenv.robot.drake.mesh_pieces import LONGEST, pieces
from ddenv.world.extent import shape_bounds
from ddenv.world.hull import convex_hull
from ddenv.world.model import Box, Capsule, Collision, Cylinder, Ellipsoid, Mesh, Sphere
from ddenv.world.pose import Pose
from tests.robot.conftest import joint_of, link_of, model_of, wedge

ACROSS = Pose.from_rpy(0.0, 0.0, 0.0, math.pi / 2, 0.0, 0.0)
AXLE = joint_of("continuous", "base", "wheel", (0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
PLACE = np.array([1.0, 2.0, 3.0])
radii = st.floats(0.01, 2.0)
shares = st.floats(0.05, 6.0)


def mesh(points: np.ndarray) -> Mesh:
    return Mesh("mesh", *convex_hull(np.asarray(points)))


def drum(radius: float, length: float, sides: int) -> np.ndarray:
    angles = math.tau * np.arange(sides) / sides
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles)])
    return np.vstack([np.column_stack([rim, np.full(sides, end * length / 2)]) for end in (-1, 1)])


def rolling_radius(wheel: Wheel) -> float:
    """The mean distance of the axle from a plane that the wheel rolls on, over one turn, m."""
    places = np.array([part.pose.position for part in tyre(wheel)])
    widths = np.array([part.shape.radius for part in tyre(wheel)])
    turns = np.linspace(0.0, math.tau, 7201)
    return float(
        np.mean(
            [(places[:, :2] @ (math.cos(turn), math.sin(turn)) + widths).max() for turn in turns]
        )
    )


@given(radii, shares)
def test_a_wheel_rolls_on_the_files_radius(radius, share):
    wheel = Wheel(radius, share * radius)
    assert rolling_radius(wheel) == pytest.approx(radius, abs=1e-4, rel=1e-4)


@given(radii, shares)
def test_a_wheel_is_as_wide_as_the_file_says_unless_it_is_thin(radius, share):
    parts = tyre(Wheel(radius, share * radius))
    assert all(isinstance(part.shape, Sphere) for part in parts)
    reach = max(abs(part.pose.position[2]) + part.shape.radius for part in parts)
    assert reach == pytest.approx(max(share * radius / 2, radius / 12))
    assert len(parts) <= 300


def test_the_huskys_wheel_is_one_ring_of_24_spheres(husky):
    wheel = next(link for link in husky.links if "wheel" in link.name)
    (parts,) = contact_shapes(husky, wheel, robot=True)
    assert len(parts) == 24
    assert {part.shape for part in parts} == {Sphere(0.1143 / 2)}


@pytest.mark.parametrize(
    ("shape", "pose", "width"),
    [
        (Cylinder(0.2, 0.1), ACROSS, 0.1),
        (Ellipsoid((0.2, 0.2, 0.1)), ACROSS, 0.1),
        (mesh(drum(0.2, 0.1, 40)), ACROSS, 0.1),
        (mesh(drum(0.2, 0.1, 40) + np.array([0.0, 0.0, 0.3])), ACROSS, 0.1),
        (mesh(drum(0.2, 0.1, 5000)), ACROSS, 0.1),
    ],
    ids=["cylinder", "ellipsoid", "mesh", "mesh beside its frame", "mesh of 10,000 vertices"],
)
def test_what_turns_about_its_own_axis_is_a_wheel(shape, pose, width):
    wheel = wheel_of(Collision(name="c", shape=shape, pose=pose, mu=1.0), AXLE)
    assert wheel is not None
    assert (wheel.radius, wheel.width) == pytest.approx((0.2, width), rel=0.01)


@pytest.mark.parametrize(
    ("shape", "pose"),
    [
        (Cylinder(0.2, 0.1), Pose()),
        (Cylinder(0.2, 0.1), Pose((0.05, 0.0, 0.0), ACROSS.quaternion)),
        (Box((0.2, 0.2, 0.2)), Pose()),
        (Sphere(0.2), Pose()),
        (wedge(1.0, 1.0, 1.0), Pose()),
    ],
    ids=["another axis", "off its axis", "box", "sphere", "wedge"],
)
def test_what_does_not_roll_is_no_wheel(shape, pose):
    assert wheel_of(Collision(name="c", shape=shape, pose=pose, mu=1.0), AXLE) is None


@given(radii, st.floats(0.01, 3.0), st.booleans())
def test_a_prism_of_boxes_fills_a_cylinder(radius, length, rolls):
    boxes = prism(radius, length, rolls)
    corners = [
        (box.pose @ Pose((sx * box.shape.size[0] / 2, sy * box.shape.size[1] / 2, 0.0))).position
        for box in boxes
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    hull = ConvexHull(np.array(corners)[:, :2])
    # All corners lie on one circle, and the boxes cover all that is within.
    far = np.linalg.norm(np.array(corners)[:, :2], axis=1)
    assert far == pytest.approx(np.full(len(far), far[0]))
    assert far[0] <= radius * (1.0 + 1e-9) if rolls else far[0] >= radius
    assert hull.volume == pytest.approx(math.pi * radius**2, rel=0.03)
    assert all(box.shape.size[2] == length for box in boxes)


def test_spheres_see_a_static_cylinder_and_boxes_a_prism():
    round_one, flat_one = cylinder(0.3, 1.0, "static")
    assert (round_one.shape, round_one.touches, flat_one.touches) == (
        Cylinder(0.3, 1.0),
        "spheres",
        "others",
    )
    low, high = shape_bounds(flat_one.shape, Pose())
    assert high == pytest.approx([0.3, 0.3, 0.5], abs=0.001) and low == pytest.approx(-high)


@pytest.mark.parametrize("shape", [Cylinder(0.1, 0.5), Cylinder(0.3, 0.2), Capsule(0.1, 0.5)])
def test_what_rolls_stays_within_its_own_size(shape):
    model = model_of("thing", link_of("link", shape, Pose()))
    (parts,) = contact_shapes(model, model.links[0], robot=False)
    low, high = shape_bounds(shape, Pose())
    boxes = [shape_bounds(part.shape, part.pose) for part in parts]
    # A box's own box is wider than the box where it is turned: only the spheres are compared.
    spheres = [
        box for box, part in zip(boxes, parts, strict=True) if isinstance(part.shape, Sphere)
    ]
    assert spheres
    assert (np.min([one for one, _ in spheres], axis=0) > low - 5e-4).all()
    assert (np.max([one for _, one in spheres], axis=0) < high + 5e-4).all()


turns = st.tuples(*[st.floats(-1, 1)] * 4).filter(
    lambda parts: sum(part**2 for part in parts) > 0.01
)
sizes = st.tuples(*[st.floats(0.02, 5.0)] * 3)


@given(sizes, turns)
def test_a_mesh_that_is_a_box_becomes_one(size, turn):
    corners = (
        np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    )
    ((shape, pose),) = pieces.__wrapped__(mesh(Rotation.from_quat(turn).apply(corners) + PLACE))
    assert isinstance(shape, Box)
    assert sorted(shape.size) == pytest.approx(sorted(size), rel=1e-6)
    assert pose.position == pytest.approx(PLACE, abs=1e-6)


@pytest.mark.parametrize("sides", [12, 16, 33, 64])
def test_a_mesh_that_is_a_drum_becomes_a_cylinder(sides):
    turned = Rotation.from_euler("xyz", (0.3, 1.0, 2.0)).apply(drum(0.3, 1.0, sides))
    ((shape, pose),) = pieces.__wrapped__(mesh(turned + PLACE))
    assert isinstance(shape, Cylinder)
    assert (shape.radius, shape.length) == pytest.approx((0.3, 1.0), rel=0.02)
    assert pose.position == pytest.approx(PLACE)


@given(st.integers(0, 1000), st.floats(0.1, 12.0))
def test_other_meshes_are_cut_into_short_pieces_without_a_loss(seed, size):
    points = np.random.default_rng(seed).normal(size=(30, 3)) * size / 5
    whole = mesh(points)
    found = pieces.__wrapped__(whole)
    volumes = [ConvexHull(piece.vertices).volume for piece, _ in found]
    assert sum(volumes) == pytest.approx(ConvexHull(whole.vertices).volume, rel=1e-6)
    longest = max(np.ptp(piece.vertices, axis=0).max() for piece, _ in found)
    assert longest <= LONGEST + 1e-9
