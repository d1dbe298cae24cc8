"""The cheapest ways over the grid, against trying all there are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.navigation.route import STEPS, Grid, path_to

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
    factors=st.lists(st.sampled_from([1.0, 1.3, 4.0, np.inf]), min_size=4 * COUNT**2, max_size=4 * COUNT**2),
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
