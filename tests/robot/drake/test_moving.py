"""Worlds with models that move."""

from __future__ import annotations

import numpy as np
import pytest

from ddenv.robot.simulation.template import Template
from ddenv.world.model import World

BOARD = "0.9 0.09 0.04"


SECTIONS = {"failure": {"timeout": 4.0}, "goal": {"x": 9, "y": 0}}


@pytest.fixture(scope="module")
def boards_world(world_of, box) -> World:
    """A board in the robot's way, a pile of two beside it, a crate far away."""
    return world_of(
        box("in_the_way", "1.2 0 0.02 0 0 1.57", BOARD, mass=2.0),
        box("lower", "1 3 0.02 0 0 0", BOARD, mass=2.0),
        box("upper", "1 3 0.06 0 0 0.6", BOARD, mass=2.0),
        box("crate", "1.6 -3 0.25 0 0 0", "0.5 0.5 0.5", mass=10.0),
    )


@pytest.fixture(scope="module")
def boards(boards_world, husky, scenario_of) -> Template:
    return Template(boards_world, husky, scenario_of(**SECTIONS))


ALL = frozenset({"in_the_way", "lower", "upper", "crate"})


def test_a_board_that_is_hit_moves_and_its_motion_is_recorded(boards):
    result = boards.run(ALL, seed=1)
    rows = result.motions["in_the_way"]
    assert rows[:, 0] == pytest.approx(result.trajectory[:, 0])
    assert rows[0, 1:4] == pytest.approx([1.2, 0, 0.02])
    assert np.linalg.norm(rows[-1, 1:4] - rows[0, 1:4]) > 0.001
    assert "crate" not in result.motions


def test_a_removed_board_is_passed_through_and_carries_nothing(boards):
    result = boards.run(ALL - {"in_the_way", "lower"}, seed=1)
    assert set(result.motions) == {"upper"}
    # Nothing carries the upper board any more: it lies on the ground.
    assert result.motions["upper"][-1, 3] == pytest.approx(0.02, abs=0.003)
    assert abs(result.trajectory[1:, 3] - 0.1323).max() < 0.01


def test_a_model_of_several_links_moves_as_one(world_of, husky, scenario_of, box):
    inertia = "<inertial><mass>1</mass><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>"
    side = "<collision name='c'><geometry><box><size>0.2 0.2 0.2</size></box></geometry></collision>"
    pair = (
        f"<model name='pair'><pose>0 3 1 0 0 0</pose><link name='a'>{inertia}{side}</link>"
        f"<link name='b'><pose>0 0 0.2 0 0 0</pose>{inertia}{side}</link>"
        "<joint name='j' type='fixed'><parent>a</parent><child>b</child></joint></model>"
    )
    template = Template(world_of(pair), husky, scenario_of(failure={"timeout": 2.0}))
    rows = template.run(frozenset({"pair"}), seed=1).motions["pair"]
    assert rows[0, 1:4] == pytest.approx([0, 3, 1])
    assert rows[-1, 3] == pytest.approx(0.1, abs=0.005)
    assert "pair" not in template.run(frozenset(), seed=1).motions
