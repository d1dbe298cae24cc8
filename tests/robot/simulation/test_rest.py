"""A run ends early only where its verdict can no longer change: on Drake, and by the rule alone."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.navigation import navigate
from ddenv.robot.oracle import Failure, ends_of, judge
from ddenv.robot.result import Ends
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.robot.simulation.rest import SECONDS, Rest
from ddenv.world.scenario import Goal
from ddenv.world.sdf.read import parse_world
from tests.robot.conftest import box_model

WALL = box_model("wall", "1.2 0 0.5 0 0 0", "0.2 4 1")
EVERYTHING = frozenset({"wall"})


def failure(result, *, away=0.0, epsilon=0.33):
    """f, `away` (m) to the left of where a run ended."""
    x, y, z, *_ = result.end_pose
    return Failure((x, y + away, z), result.trajectory, epsilon)


@pytest.fixture(scope="module")
def at_the_wall(world_of, husky, scenario_of):
    """A robot spins its wheels at a wall for 3 s; then its estimate says that it is at the goal,
    and it stops.
    """
    return Plant(world_of(WALL), husky, scenario_of(failure={"timeout": 20.0}))


@pytest.fixture(scope="module")
def in_full(at_the_wall):
    return at_the_wall.run(EVERYTHING, seed=1)


@pytest.mark.parametrize("away", [0.0, 2.0], ids=["f", "another failure"])
def test_a_robot_at_rest_for_good_is_not_watched_to_the_end(at_the_wall, in_full, away):
    f = failure(in_full, away=away)
    early = at_the_wall.run(EVERYTHING, seed=1, ends=ends_of([f]))
    assert early.cut and not in_full.cut
    assert SECONDS < early.simulated_seconds < 15.0
    # It is the beginning of the same run, to the last bit, and is called the same.
    assert np.array_equal(in_full.trajectory[: len(early.trajectory)], early.trajectory)
    assert (early.outcome, early.failure) == (in_full.outcome, in_full.failure)
    assert judge(early, f).outcome == judge(in_full, f).outcome


def test_at_the_border_of_f_a_robot_is_watched_to_the_end(at_the_wall, in_full):
    f = failure(in_full, away=0.33)
    assert not at_the_wall.run(EVERYTHING, seed=1, ends=ends_of([f])).cut


def test_while_its_controller_still_drives_a_robot_is_not_at_rest(world_of, husky, scenario_of):
    """It stands at a wall for longer than any patience, with wheels that spin towards a goal far
    away.
    """
    template = Plant(
        world_of(WALL), husky, scenario_of(goal={"x": 90.0, "y": 0.0}, failure={"timeout": 14.0})
    )
    result = template.run(EVERYTHING, seed=1)
    late = result.trajectory[result.trajectory[:, 0] > 4.0, 1:4]
    assert np.linalg.norm(late - late[-1], axis=1).max() < 0.05
    assert not template.run(EVERYTHING, seed=1, ends=ends_of([failure(result)])).cut


def test_a_robot_that_slides_slowly_is_not_stuck(husky, scenario_of, monkeypatch):
    """It stops at once on a slight slope, on which its wheels creep: 1 cm in 8 s, then 9 cm in 30
    s.
    """
    monkeypatch.setattr(navigate, "ARRIVED", 1e6)
    gravity = f"<gravity>{-9.81 * math.sin(0.06)} 0 {-9.81 * math.cos(0.06)}</gravity>"
    floor = box_model("floor", "0 0 -0.5 0 0 0", "60 20 1")
    text = f'<sdf version="1.9"><world name="w">{gravity}{floor}</world></sdf>'
    scenario = scenario_of(goal={"x": 40.0, "y": 0.0}, failure={"timeout": 40.0})
    template, keep = (
        Plant(parse_world(text.encode(), Path("w.sdf")), husky, scenario),
        frozenset({"floor"}),
    )
    result = template.run(keep, seed=1)
    places = {at: result.trajectory[10 * at, 1:4] for at in (2, 10, 40)}
    assert math.dist(places[2], places[10]) < 0.05 < math.dist(places[10], places[40])
    for place in places.values():
        f = Failure(tuple(place.tolist()), result.trajectory, epsilon=0.05)
        assert (
            judge(template.run(keep, seed=1, ends=ends_of([f])), f).outcome
            == judge(result, f).outcome
        )


numbers = st.floats(-2.0, 2.0)


@given(
    f=st.tuples(numbers, numbers),
    goal=st.tuples(numbers, numbers),
    start=st.floats(0.0, 30.0),
    speed=st.floats(0.0, 0.02),
    grows=st.floats(0.0, 0.01),
    suffice=st.booleans(),
)
def test_whatever_slides_on_as_it_began_ends_in_the_verdict_that_it_got(
    f, goal, start, speed, grows, suffice
):
    """It slides along x from `start` (s) on, at `speed` (m/s) that grows by `grows` (m/s^2)."""
    ends, until = Ends(((*f, 0.0),), 0.33, suffice), 45.0
    rest = Rest(ends, Goal(x=goal[0], y=goal[1], tolerance=0.5), until)

    def place(now):
        since = max(0.0, now - start)
        return speed * since + grows * since**2 / 2, 0.0, 0.0

    def near(now):
        return math.dist(place(now), (*f, 0.0)) <= 0.33

    for now in np.arange(0.0, until, 0.1):
        if rest.update(now, place(now), still=now >= start):
            assert now - start >= SECONDS - 0.01
            assert near(now) == near(until)
            assert suffice or not near(now)
            assert math.dist(place(until)[:2], goal) > 0.5
            return


def test_whoever_moves_again_has_to_rest_anew():
    rest = Rest(Ends(((0.0, 0.0, 0.0),), 0.33), Goal(x=9.0, y=0.0), 45.0)
    still = [now for now in range(10) if rest.update(now, (0.0, 0.0, 0.0), still=now != 3)]
    assert still == [2, 6, 7, 8, 9]
