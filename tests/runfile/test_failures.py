"""Which failures are the same one, what each is called, and those other than f that a run met."""

from __future__ import annotations

import math
import tempfile
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.environment import Environment
from ddenv.runfile.failure_words import named
from ddenv.runfile.failures import CHUNK, alike, atlas, grouped
from ddenv.runfile.state import RunState, Test
from tests.engine.fake import new_run
from tests.engine.guided import COMMANDS, Disturbed
from tests.engine.killing import killed
from tests.engine.oracles import flaky
from tests.engine.reading import state_of
from tests.tiers import examples

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
def test_the_first_centre_has_the_most_others_around_it_then_the_nearest_ones_then_it_is_the_earliest(
    ends,
):
    def rank(one: int) -> tuple[int, float, int]:
        around = [
            distance for other in ends if (distance := math.dist(ends[one], other)) <= EPSILON
        ]
        return -len(around), math.fsum(around), one

    groups = alike(ends, EPSILON)
    if ends:
        assert groups[0][0] == min(range(len(ends)), key=rank)
        # The next ones are found in the same way among the rest.
        rest = [one for one in range(len(ends)) if one not in groups[0]]
        assert [
            [rest[one] for one in group] for group in alike([ends[one] for one in rest], EPSILON)
        ] == groups[1:]


def test_a_group_is_found_among_scattered_ends():
    """The medoid of these is a scattered one."""
    together = [(0.05 * number, 0.0, 0.0) for number in range(4)]
    scattered = [
        (2.0, 2.0, 0.0),
        (3.0, -2.0, 0.0),
        (4.0, 1.5, 0.0),
        (5.0, -1.0, 0.0),
        (3.5, 4.0, 0.0),
    ]
    assert alike([*scattered, *together], 0.33)[0] == [6, 5, 7, 8]


def test_what_is_no_distance_is_another_failure():
    assert grouped(3, lambda first, second: 0.0 if (first, second) == (0, 2) else None) == [
        [0, 2],
        [1],
    ]
    assert grouped(0, lambda *_: 0.0) == []


def test_a_failure_is_called_by_what_the_robot_did_and_where():
    assert named(("stuck",), (5.421, -0.557, 2.0)) == "stuck at (5.42, -0.56)"
    assert named(("stuck", "out of time"), (-0.001, 0, 0)) == "stuck or out of time at (0.00, 0.00)"
    assert named(("exit 3",), (1, 2, 3)) == named((), (1, 2, 3)) == "failed at (1.00, 2.00)"


Test.__test__ = False


@examples(0.3)
@given(
    salt=st.integers(0, 5),
    plan=st.lists(st.tuples(st.integers(0, 20), COMMANDS), max_size=4),
    moment=st.integers(20, 200),
    early_stop=st.booleans(),
)
def test_each_other_failure_is_found_with_the_smallest_environment_that_showed_it(
    salt, plan, moment, early_stop
):
    with tempfile.TemporaryDirectory() as folder:
        path = new_run(Path(folder), early_stop=early_stop)
        pool = Disturbed(
            path, flaky(salt, "wall", "beam"), 2, sorted(plan, key=lambda one: one[0]), salt
        )
        with closing(pool.viewer):
            killed(path, pool, [moment])
        state = state_of(path)
    others = [test.id for test in state.tests if test.outcome == "other"]
    found = atlas(state)
    assert sorted(test for each in found for test in each.tests) == others
    for each in found:
        sizes = {test: len(state.models_of(state.tests[test - 1])) for test in each.tests}
        assert (each.size, each.smallest) == min((size, test) for test, size in sizes.items())


def met(*ends: tuple[str, float]) -> RunState:
    tests = [
        Test(
            id=id,
            environment=0,
            phase="baseline",
            round=None,
            candidate=None,
            run=id,
            seed=id,
            outcome="other",
            failure=kind,
            end_pose=(x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
        )
        for id, (kind, x) in enumerate(ends, 1)
    ]
    empty = RunState()
    return empty.changed(
        tests=empty.tests.of(tests),
        tally=empty.tally | {"other": len(tests)},
        elements=("a", "b"),
        environments=empty.environments.of([Environment.whole(2)]),
        scenario={"failure": {"epsilon": 0.5}},
    )


def test_failures_are_told_apart_by_end_and_by_kind():
    found = atlas(
        met(
            ("stuck", 1.0),
            ("fell", 1.1),
            ("stuck", 5.0),
            ("stuck", 1.4),
            ("stuck", 1.3),
            ("fell", 1.2),
        )
    )
    assert [(each.name, each.tests) for each in found] == [
        ("stuck at (1.30, 0.00)", (1, 4, 5)),
        ("fell at (1.10, 0.00)", (2, 6)),
        ("stuck at (5.00, 0.00)", (3,)),
    ]
    assert [(each.smallest, each.size) for each in found] == [(1, 2), (2, 2), (3, 2)]
    assert atlas(RunState()) == ()


@pytest.mark.parametrize("number", [3 * CHUNK])
def test_many_failures_are_grouped_as_few_are(number):
    ends = [("stuck", 10.0 * (id % 3) + 0.001 * (id % 7)) for id in range(number)]
    assert [len(each.tests) for each in atlas(met(*ends))] == [number // 3] * 3
    assert len(atlas(met(*(("stuck", 10.0 * id) for id in range(CHUNK + 50))))) == CHUNK + 50
