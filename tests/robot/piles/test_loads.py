"""Loads: a model at rest wakes when what it bears changes by more than it is known to bear."""

from __future__ import annotations

import numpy as np
import pytest

from ddenv.robot.piles.sleep import BEARS, BORE, GRAVITY, Loads
from ddenv.robot.simulation.template import Template
from ddenv.world.model import Box
from ddenv.world.pose import Pose
from tests.robot.conftest import link_of, model_of

MASS = 2.0
WEIGHT = MASS * GRAVITY
YES, NO = np.array([True]), np.array([False])


class Pressed(Loads):
    """One model on which the robot presses with `force`, N."""

    force = 0.0

    def _forces(self):
        return np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, -self.force]]])

    def lie_down(self) -> None:
        self.note(NO, YES)
        self.note(YES, NO)


@pytest.fixture
def loads(world_of, add, husky, scenario_of):
    board = model_of("board", link_of("link", Box((0.9, 0.1, 0.04)), Pose((3.0, 0.0, 0.02)), MASS))
    context = Template(add(world_of(), board), husky, scenario_of()).context
    loads = Pressed(context, list(context.built.moving.values()))
    loads.lie_down()
    return loads


def wakes(loads: Pressed, force: float) -> bool:
    loads.force = force
    return bool(loads.changed(seconds=1.0)[0])


def test_a_model_bears_a_few_times_its_weight(loads):
    assert not wakes(loads, 0.9 * BEARS * WEIGHT)
    assert wakes(loads, 1.1 * BEARS * WEIGHT)


@pytest.mark.parametrize("stayed", [True, False])
def test_a_change_that_moved_nothing_wakes_the_model_no_second_time(loads, stayed):
    change = 2 * BEARS * WEIGHT
    assert wakes(loads, change)
    loads.woke(YES, YES)
    if stayed:
        loads.bore(YES)
    loads.lie_down()
    # It lies under that load now; it changes back, and by a little more than it is known to bear.
    assert wakes(loads, 0.0) != stayed
    assert wakes(loads, (1 + 1.1 * BORE) * change)


def test_what_woke_otherwise_is_not_known_to_bear_more(loads):
    assert wakes(loads, 2 * BEARS * WEIGHT)
    loads.woke(YES, NO)
    loads.bore(YES)
    loads.lie_down()
    assert wakes(loads, 0.0)
