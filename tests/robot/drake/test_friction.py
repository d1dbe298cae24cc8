"""Friction: wheels grip the world as they do in Gazebo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.multibody.plant import CalcContactFrictionFromSurfaceProperties, CoulombFriction

from ddenv.robot.drake.shapes import wheel_friction, world_friction
from ddenv.robot.simulation.template import Template
from ddenv.world.drive import find_drive

coefficients = st.floats(0, 1e6) | st.sampled_from([0.0, 1e-300, 1.0, 1000.0])


def combined(a: float, b: float) -> float:
    """What Drake makes of two surfaces."""
    return CalcContactFrictionFromSurfaceProperties(CoulombFriction(a, a), CoulombFriction(b, b)).static_friction()


@given(coefficients, st.floats(0.01, 10))
def test_between_a_wheel_and_the_world_the_smaller_coefficient_counts(mu, wheels):
    assert combined(world_friction(mu, wheels), wheels) == pytest.approx(min(mu, wheels), abs=1e-12)


@given(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6), st.floats(0.01, 10))
def test_within_the_world_at_least_half_the_smaller_and_at_most_the_smaller(a, b, wheels):
    smaller = min(a, b, wheels)
    assert 0.499 * smaller <= combined(world_friction(a, wheels), world_friction(b, wheels)) <= 1.001 * smaller


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
        with_mu(link, {"front_left_wheel_link": 0.7, "rear_right_wheel_link": 0.9}.get(link.name, 0.5))
        if "wheel" in link.name
        else with_mu(link, 7.0)
        for link in husky.links
    )
    assert wheel_friction(replace(husky, links=links), find_drive(husky)) == 0.9
    assert wheel_friction(husky, find_drive(husky)) == 1.5


def drive(world_of, husky, scenario_of, box, mu: float):
    """A run that speeds up as hard as the ground of friction `mu` lets it."""
    ground = box("floor", "0 0 0.05 0 0 0", "60 20 0.1", mu=mu)
    scenario = scenario_of(
        failure={"timeout": 3.0},
        goal={"x": 90, "y": 0},
        robot={"model": "husky.sdf", "spawn": {"x": 0, "y": 0, "z": 0.24}},
        controller={"speed": 5.0, "acceleration": 5.0},
    )
    return Template(world_of(ground), husky, scenario).run(frozenset({"floor"}), seed=1)


@pytest.mark.parametrize("mu", [0.0, 0.02, 0.1])
def test_spinning_wheels_push_with_mu_times_the_weight(world_of, husky, scenario_of, box, mu):
    rows = drive(world_of, husky, scenario_of, box, mu).trajectory
    speed = np.gradient(rows[:, 1], rows[:, 0])
    assert (speed[25] - speed[10]) / (rows[25, 0] - rows[10, 0]) == pytest.approx(mu * 9.81, rel=0.01, abs=1e-3)


def test_ground_that_is_rougher_than_the_wheels_is_all_the_same(world_of, husky, scenario_of, box):
    runs = [drive(world_of, husky, scenario_of, box, mu).trajectory.tobytes() for mu in (1.5, 100.0, 1000.0)]
    assert runs[0] == runs[1] == runs[2]
