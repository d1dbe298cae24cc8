"""Shapes of collisions: the robot runs into them, moving ones lie without creeping, and wheels grip
them as in Gazebo.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.multibody.plant import CalcContactFrictionFromSurfaceProperties, CoulombFriction

from ddenv.robot.drake.shapes import (
    CORNER_RADIUS,
    corners_of,
    resting_corners,
    wheel_friction,
    world_friction,
)
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.world.drive import find_drive
from ddenv.world.extent import shape_bounds
from ddenv.world.model import Box, Capsule, Collision, Cylinder, Ellipsoid, Mesh, Sphere
from ddenv.world.pose import Pose
from ddenv.world.whole import whole_of
from tests.robot.conftest import link_of, model_of, wedge

CUBE = np.array([(x, y, z) for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-0.2, 0.2)])
SQUARES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
HULL = Mesh(
    "cube", CUBE, np.array([face for a, b, c, d in SQUARES for face in ((a, b, c), (a, c, d))])
)
ACROSS = Pose.from_rpy(0, 0, 0, np.pi / 2, 0, 0)


@pytest.mark.parametrize(
    ("shape", "turn", "front"),
    [
        (Mesh("wall", CUBE * (1, 10, 5), HULL.faces), Pose(), 0.2),
        (Capsule(0.3, 3.0), ACROSS, 0.3),
        (Ellipsoid((0.2, 2.0, 1.5)), Pose(), 0.2),
        (Cylinder(0.3, 3.0), ACROSS, 0.3),
    ],
    ids=["mesh", "capsule", "ellipsoid", "cylinder"],
)
def test_the_robot_is_stopped(world_of, add, husky, scenario_of, shape, turn, front):
    wall = model_of("wall", link_of("link", shape, Pose((2.0, 0.0, 0.35)) @ turn, mass=None))
    template = Plant(add(world_of(), wall), husky, scenario_of(failure={"timeout": 5.0}))
    blocked = template.run(frozenset({"wall"}), seed=1)
    assert (blocked.outcome, blocked.failure) == ("failed", "stuck")
    # The robot reaches 0.5 m ahead of its frame; it comes up to the wall, and not through it.
    assert 2.0 - front - 0.7 < blocked.trajectory[:, 1].max() < 2.0 - front - 0.3
    assert template.run(frozenset(), seed=1).outcome == "pass"


def test_the_robot_drives_up_a_mesh(world_of, add, husky, scenario_of):
    ramp = model_of(
        "ramp", link_of("link", wedge(3.0, 3.0, 0.5), Pose((2.5, 0.0, 0.25)), mass=None, mu=1.5)
    )
    template = Plant(
        add(world_of(), ramp), husky, scenario_of(goal={"x": 3.0, "y": 0.0, "tolerance": 0.3})
    )
    end = template.run(frozenset({"ramp"}), seed=1)
    assert end.outcome == "pass"
    assert end.end_pose[:3][2] > 0.4


@pytest.mark.parametrize(
    ("shape", "turn", "height"),
    [
        (Box((0.4, 0.4, 0.4)), Pose(), 0.2),
        (Cylinder(0.2, 0.3), Pose(), 0.15),
        (Sphere(0.2), Pose(), 0.2),
        (Capsule(0.2, 0.4), ACROSS, 0.2),
        (Ellipsoid((0.3, 0.2, 0.1)), Pose(), 0.1),
        (HULL, Pose(), 0.2),
    ],
    ids=["box", "cylinder", "sphere", "capsule", "ellipsoid", "mesh"],
)
def test_a_moving_shape_falls_and_then_rests_on_the_ground(
    world_of, add, husky, scenario_of, shape, turn, height
):
    thing = model_of("thing", link_of("link", shape, Pose((0.0, 3.0, height + 0.02)) @ turn))
    template = Plant(
        add(world_of(), thing), husky, scenario_of(failure={"timeout": 3.0}, goal={"x": 9, "y": 0})
    )
    template._sleeping = False
    rows = template.run(frozenset({"thing"}), seed=1).motions["thing"]
    assert rows[-1, 1:4] == pytest.approx([0.0, 3.0, height], abs=0.003)
    # Where it came to rest it stays, although nothing lets it sleep here.
    assert np.linalg.norm(rows[-1, 1:4] - rows[10, 1:4]) < 0.002


def test_the_floor_is_below_the_lowest_surface_of_the_world(world_of, add, scenario_of):
    pit = model_of("pit", link_of("link", wedge(1.0, 1.0, 1.0), Pose((0.0, 0.0, -4.0)), mass=None))
    assert whole_of(add(world_of(), pit), scenario_of()).floor == pytest.approx(-6.5)
    assert whole_of(world_of(), scenario_of()).floor == -2.0


coefficients = st.floats(0, 1e6) | st.sampled_from([0.0, 1e-300, 1.0, 1000.0])


def combined(a: float, b: float) -> float:
    """What Drake makes of two surfaces."""
    return CalcContactFrictionFromSurfaceProperties(
        CoulombFriction(a, a), CoulombFriction(b, b)
    ).static_friction()


@given(coefficients, st.floats(0.01, 10))
def test_between_a_wheel_and_the_world_the_smaller_coefficient_counts(mu, wheels):
    assert combined(world_friction(mu, wheels), wheels) == pytest.approx(min(mu, wheels), abs=1e-12)


@given(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6), st.floats(0.01, 10))
def test_within_the_world_at_least_half_the_smaller_and_at_most_the_smaller(a, b, wheels):
    smaller = min(a, b, wheels)
    assert (
        0.499 * smaller
        <= combined(world_friction(a, wheels), world_friction(b, wheels))
        <= 1.001 * smaller
    )


@given(st.floats(1e-6, 1e6), st.floats(1e-6, 10), st.floats(0.01, 10))
def test_of_the_rest_of_the_robot_at_least_half_the_smaller_and_at_most_twice(mu, part, wheels):
    smaller = min(mu, part, wheels)
    assert 0.499 * smaller <= combined(world_friction(mu, wheels), part)
    assert combined(world_friction(mu, wheels), part) <= 2.001 * min(mu, part)


def test_wheels_without_friction_make_all_ground_slippery():
    assert world_friction(1.0, 0.0) == 0.0
    assert combined(world_friction(1.0, 0.0), 0.0) == 0.0


def test_the_grippiest_wheel_counts_and_the_hull_does_not(husky):
    def with_mu(link, mu):
        return replace(link, collisions=tuple(replace(one, mu=mu) for one in link.collisions))

    links = tuple(
        with_mu(
            link, {"front_left_wheel_link": 0.7, "rear_right_wheel_link": 0.9}.get(link.name, 0.5)
        )
        if "wheel" in link.name
        else with_mu(link, 7.0)
        for link in husky.links
    )
    assert wheel_friction(replace(husky, links=links), find_drive(husky)) == 0.9
    assert wheel_friction(husky, find_drive(husky)) == 1.5


def drive(
    world_of, husky, scenario_of, box, mu: float, speed: float = 5.0, time_step: float = 0.005
):
    """A run that speeds up as hard as the ground of friction `mu` lets it."""
    ground = box("floor", "0 0 0.05 0 0 0", "60 20 0.1", mu=mu)
    scenario = scenario_of(
        failure={"timeout": 3.0},
        goal={"x": 90, "y": 0},
        robot={"model": "husky.sdf", "spawn": {"x": 0, "y": 0, "z": 0.24}},
        controller={"speed": speed, "acceleration": 5.0},
        simulation={"time_step": time_step},
    )
    return Plant(world_of(ground), husky, scenario).run(frozenset({"floor"}), seed=1)


# The spheres of a fast wheel come and go within few steps, and each grips a step late: the faster,
# the smaller the steps must be.
@pytest.mark.parametrize(
    ("mu", "speed", "time_step"),
    [(0.0, 5.0, 0.005), (0.02, 1.0, 0.005), (0.02, 5.0, 0.0005), (0.1, 5.0, 0.0005)],
)
def test_spinning_wheels_push_with_mu_times_the_weight(
    world_of, husky, scenario_of, box, mu, speed, time_step
):
    rows = drive(world_of, husky, scenario_of, box, mu, speed, time_step).trajectory
    speeds = np.gradient(rows[:, 1], rows[:, 0])
    push = (speeds[25] - speeds[10]) / (rows[25, 0] - rows[10, 0])
    assert push == pytest.approx(mu * 9.81, rel=0.035, abs=1e-3)


def test_ground_that_is_rougher_than_the_wheels_is_all_the_same(world_of, husky, scenario_of, box):
    runs = [
        drive(world_of, husky, scenario_of, box, mu).trajectory.tobytes()
        for mu in (1.5, 100.0, 1000.0)
    ]
    assert runs[0] == runs[1] == runs[2]


@pytest.mark.parametrize(
    "shape", [Box((0.4, 0.3, 0.2)), Cylinder(0.2, 0.3), HULL, wedge(0.4, 0.5, 0.3)]
)
def test_corner_spheres_lie_just_inside(shape):
    low, high = shape_bounds(shape, Pose())
    corners = np.array(corners_of(shape))
    assert (corners.min(axis=0) - CORNER_RADIUS >= low - 1e-9).all()
    assert (corners.max(axis=0) + CORNER_RADIUS <= high + 1e-9).all()
    assert corners.min(axis=0) - CORNER_RADIUS == pytest.approx(low, abs=0.007)
    assert corners.max(axis=0) + CORNER_RADIUS == pytest.approx(high, abs=0.007)


def test_a_mesh_of_many_corners_gets_32_spread_over_it():
    turns = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    rim = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(100)])
    vertices = np.vstack([rim, rim + np.array([0, 0, 1])])
    number = np.arange(100)
    after = (number + 1) % 100
    sides = [
        np.column_stack(three)
        for three in ((number, after, after + 100), (number, after + 100, number + 100))
    ]
    caps = [np.column_stack([np.full(98, 0), number[2:], number[1:-1]])]
    caps += [np.column_stack([np.full(98, 100), number[1:-1] + 100, number[2:] + 100])]
    corners = np.array(corners_of(Mesh("drum", vertices, np.vstack([*sides, *caps]))))
    assert len(corners) == 32
    assert np.linalg.norm(corners[:, :2], axis=1) == pytest.approx(np.ones(32), abs=0.01)
    for end in (corners[corners[:, 2] < 0.5], corners[corners[:, 2] > 0.5]):
        angles = np.sort(np.arctan2(end[:, 1], end[:, 0]))
        assert np.diff([*angles, angles[0] + 2 * np.pi]).max() < 1.0


def tile(across: int) -> list[Collision]:
    """A tile of `across` times `across` boxes, 0.5 m apart, with every other one a step higher."""
    places = [(0.5 * i, 0.5 * j, 0.1 * ((i + j) % 2)) for i in range(across) for j in range(across)]
    return [
        Collision(name="box", shape=Box((0.5, 0.5, 0.2)), pose=Pose(place), mu=0.5)
        for place in places
    ]


def test_a_link_of_few_shapes_rests_on_all_of_their_corners():
    collisions = tile(2)
    assert resting_corners(collisions) == [corners_of(each.shape) for each in collisions]


def test_a_link_of_many_shapes_rests_on_the_outermost_corners():
    collisions = tile(6)
    rests = resting_corners(collisions)
    assert len(rests) == 36
    assert all(
        set(some) <= set(corners_of(each.shape))
        for some, each in zip(rests, collisions, strict=True)
    )
    places = np.array(
        [
            (each.pose @ Pose(corner)).position
            for each, some in zip(collisions, rests, strict=True)
            for corner in some
        ]
    )
    every = np.array(
        [
            (each.pose @ Pose(corner)).position
            for each in collisions
            for corner in corners_of(each.shape)
        ]
    )
    assert len(places) < 64
    # As wide as the whole tile, on top and below.
    assert places.min(axis=0) == pytest.approx(every.min(axis=0)) and places.max(
        axis=0
    ) == pytest.approx(every.max(axis=0))
    low = places[places[:, 2] == every[:, 2].min()]
    assert np.ptp(low[:, 0]) > 2 and np.ptp(low[:, 1]) > 2
