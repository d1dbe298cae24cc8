"""Which failures are the same one, and what each is called."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from ddenv.runfile.events import named
from ddenv.runfile.failures import alike, grouped

EPSILON = 1.0
# A small grid, so that ends are often together and distances often equal.
places = st.tuples(st.integers(0, 6), st.integers(0, 3), st.just(0)).map(
    lambda place: tuple(each / 2 for each in place)
)
ENDS = st.lists(places, max_size=30)


@given(ENDS)
def test_each_run_is_in_one_group_and_close_to_its_centre(ends):
    groups = alike(ends, EPSILON)
    assert sorted(one for group in groups for one in group) == list(range(len(ends)))
    assert all(math.dist(ends[group[0]], ends[one]) <= EPSILON for group in groups for one in group)
    assert sorted(map(len, groups), reverse=True) == list(map(len, groups))


@given(ENDS)
def test_the_first_centre_has_the_most_others_around_it_then_the_nearest_ones_then_it_is_the_earliest(ends):
    def rank(one: int) -> tuple[int, float, int]:
        around = [distance for other in ends if (distance := math.dist(ends[one], other)) <= EPSILON]
        return -len(around), math.fsum(around), one

    groups = alike(ends, EPSILON)
    if ends:
        assert groups[0][0] == min(range(len(ends)), key=rank)
        # The next ones are found in the same way among the rest.
        rest = [one for one in range(len(ends)) if one not in groups[0]]
        assert [[rest[one] for one in group] for group in alike([ends[one] for one in rest], EPSILON)] == groups[1:]


def test_a_group_is_found_among_scattered_ends():
    """The medoid of these is a scattered one."""
    together = [(0.05 * number, 0.0, 0.0) for number in range(4)]
    scattered = [(2.0, 2.0, 0.0), (3.0, -2.0, 0.0), (4.0, 1.5, 0.0), (5.0, -1.0, 0.0), (3.5, 4.0, 0.0)]
    assert alike([*scattered, *together], 0.33)[0] == [6, 5, 7, 8]


def test_what_is_no_distance_is_another_failure():
    assert grouped(3, lambda first, second: 0.0 if (first, second) == (0, 2) else None) == [[0, 2], [1]]
    assert grouped(0, lambda *_: 0.0) == []


def test_a_failure_is_called_by_what_the_robot_did_and_where():
    assert named(("stuck",), (5.421, -0.557, 2.0)) == "stuck at (5.42, -0.56)"
    assert named(("stuck", "out of time"), (-0.001, 0, 0)) == "stuck or out of time at (0.00, 0.00)"
    assert named(("exit 3",), (1, 2, 3)) == named((), (1, 2, 3)) == "failed at (1.00, 2.00)"
