"""Ways around what is on the map: the cheapest over the grid, against trying all there are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.navigation.route import STEPS, Grid, Planner, path_to
from tests.robot.navigation.toy import HUSKY, setup

COUNT = 4
GRID = Grid(COUNT)


def best_lengths(factors: np.ndarray, start: int) -> np.ndarray:
    """By going on from every cell until nothing becomes shorter."""
    lengths = np.full(COUNT * COUNT, np.inf)
    lengths[start] = 0.0
    while True:
        before = lengths.copy()
        for cell in range(COUNT * COUNT):
            for axis, (dx, dy) in enumerate(STEPS):
                x, y = cell // COUNT + dx, cell % COUNT + dy
                if 0 <= x < COUNT and 0 <= y < COUNT:
                    to = x * COUNT + y
                    step = np.hypot(dx, dy) * (factors[axis % 4, cell] + factors[axis % 4, to]) / 2
                    lengths[to] = min(lengths[to], lengths[cell] + step)
        if (lengths == before).all():
            return lengths


@given(
    factors=st.lists(
        st.sampled_from([1.0, 1.3, 4.0, np.inf]), min_size=4 * COUNT**2, max_size=4 * COUNT**2
    ),
    start=st.integers(0, COUNT**2 - 1),
)
def test_no_way_is_shorter(factors, start):
    factors = np.array(factors).reshape(4, -1)
    lengths, sources = GRID.search(factors, start)
    assert lengths == pytest.approx(best_lengths(factors, start))
    for cell in np.flatnonzero(np.isfinite(lengths)):
        way = path_to(int(cell), sources)
        assert way[0] == start
        assert way[-1] == cell
        assert np.abs(np.diff(np.divmod(way, COUNT))).max(initial=0) <= 1


def wall(ax: float, ay: float, bx: float, by: float) -> np.ndarray:
    count = max(round(math.hypot(bx - ax, by - ay) / 0.1), 1) + 1
    return np.column_stack([np.linspace(ax, bx, count), np.linspace(ay, by, count)])


def test_straight_where_nothing_is():
    planner = Planner(setup((20.0, 3.0)))
    assert planner.plan(np.empty((0, 2)), 1.0, 0.0).corners == [(1.0, 0.0), (20.0, 3.0)]
    assert planner.plan(wall(-3, -3, -3, 3), 1.0, 0.0).corners == [(1.0, 0.0), (20.0, 3.0)]


def test_around_a_wall():
    points = wall(3, -1, 3, 1)
    planner = Planner(setup((5.5, 0.0)))
    path = planner.plan(points, 0.0, 0.0)
    assert path.final
    assert path.end == (5.5, 0.0)
    assert planner.room(path, points) >= HUSKY[2] + 0.05 - 1e-6
    shortest = 2 * math.hypot(1.45, 3) + 0.1
    assert path.left <= 1.2 * shortest


def test_to_the_border_when_the_goal_is_beyond():
    points = wall(3, -2, 3, 2)
    path = Planner(setup((30.0, 0.0))).plan(points, 0.0, 0.0)
    assert not path.final
    assert path.end[0] == pytest.approx(5.8, abs=0.3)


def test_as_near_as_it_counts_to_a_goal_that_is_not_free():
    planner = Planner(setup((4.0, 0.0), tolerance=0.8))
    path = planner.plan(np.array([[4.0, 0.0]]), 0.0, 0.0)
    assert path.final
    assert 0.39 <= math.dist(path.end, (4.0, 0.0)) <= 0.8
    assert Planner(setup((4.0, 0.0), tolerance=0.3)).plan(np.array([[4.0, 0.0]]), 0.0, 0.0) is None


def test_a_path_in_which_something_stands_now():
    planner = Planner(setup((5.0, 0.0)))
    path = planner.plan(np.empty((0, 2)), 0.0, 0.0)
    path.locate(1.0, 0.0)
    assert planner.room(path, np.array([[3.0, 0.45]])) == pytest.approx(0.45)
    assert planner.room(path, np.array([[3.0, 0.3]])) is None
    assert planner.room(path, np.array([[0.2, 0.0]])) is not None, "it has passed there"
