"""The failures other than f that a run met."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.environment import Environment
from ddenv.runfile.failures import CHUNK, atlas
from ddenv.runfile.fold import fold
from ddenv.runfile.state import RunState, Test
from ddenv.runfile.store import RunFile
from tests.engine.fake import drive, new_run
from tests.engine.guided import COMMANDS, Disturbed
from tests.engine.killing import Killed, kill_after
from tests.engine.oracles import flaky
from tests.tiers import examples

Test.__test__ = False


@examples(0.3)
@given(
    salt=st.integers(0, 5),
    plan=st.lists(st.tuples(st.integers(0, 20), COMMANDS), max_size=4),
    moment=st.integers(20, 200),
    early_stop=st.booleans(),
)
def test_each_other_failure_is_found_with_the_smallest_environment_that_showed_it(salt, plan, moment, early_stop):
    with tempfile.TemporaryDirectory() as folder:
        path = new_run(Path(folder), early_stop=early_stop)
        pool = Disturbed(path, flaky(salt, "wall", "beam"), 2, sorted(plan, key=lambda one: one[0]), salt)
        try:
            drive(path, pool, prepare=lambda file: kill_after(file, moment))
        except Killed:
            pass
        finally:
            pool.viewer.close()
        with RunFile(path) as file:
            state = fold(file.events())
    others = [test.id for test in state.tests if test.outcome == "other"]
    found = atlas(state)
    assert sorted(test for each in found for test in each.tests) == others
    for each in found:
        sizes = {test: len(state.models_of(state.tests[test - 1])) for test in each.tests}
        assert (each.size, each.smallest) == min((size, test) for test, size in sizes.items())


def state_of(*ends: tuple[str, float]) -> RunState:
    tests = [
        Test(id, 0, "baseline", None, None, id, id, "other", kind, end_pose=(x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
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
        state_of(("stuck", 1.0), ("fell", 1.1), ("stuck", 5.0), ("stuck", 1.4), ("stuck", 1.3), ("fell", 1.2))
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
    assert [len(each.tests) for each in atlas(state_of(*ends))] == [number // 3] * 3
    assert len(atlas(state_of(*(("stuck", 10.0 * id) for id in range(CHUNK + 50))))) == CHUNK + 50
