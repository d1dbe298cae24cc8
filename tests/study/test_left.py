"""How long a study will take still."""

from dataclasses import replace

import pytest

from ddenv.runfile.fold import fold
from ddenv.runfile.persistent import PersistentTuple
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.study.conduct import Work, seconds_left, sizes
from ddenv.study.plan import RUNS, run_path
from tests.study.made import FRESH, TESTS, crates, plan_of, reduced

# One test was ahead of time.
MADE = TESTS + FRESH + 1


@pytest.fixture
def made(tmp_path):
    """A plan of two cells, and what was made of the first: `MADE` tests of 2 s."""
    plan = plan_of(crates(tmp_path))
    (tmp_path / RUNS).mkdir()
    reduced(tmp_path, plan.cells[0])
    path = run_path(tmp_path, plan.cells[0])
    with RunFile(path) as file:
        state = fold(file.events())
        tests = PersistentTuple.of(replace(test, wall_seconds=2.0) for test in state.tests)
        yield plan, Work(plan.cells[0], path, 2, file, RunState(), state.changed(tests=tests))


def left(plan, ended, jobs=2, running=()):
    return seconds_left(running, plan.cells[1:], ended, sizes(plan), jobs)


def with_tests(work, tests, **changes):
    return replace(work, state=work.state.changed(tests=PersistentTuple.of(tests), **changes))


def test_another_pair_takes_what_the_first_one_took_itself(made):
    plan, first = made
    assert left(plan, [first]) == pytest.approx(MADE * 2.0 / 2)
    assert left(plan, [first], jobs=1) == pytest.approx(MADE * 2.0)
    taken = with_tests(first, (replace(test, taken=number < 4) for number, test in enumerate(first.state.tests)))
    assert left(plan, [taken]) == pytest.approx((MADE - 4) * 2.0 / 2)


def test_without_a_test_nothing_tells_and_one_that_failed_only_what_a_test_takes(made):
    plan, first = made
    assert left(plan, [], running=[with_tests(first, (), status="running")]) is None
    assert left(plan, [with_tests(first, first.state.tests, status="failed")], jobs=1) > MADE * 2.0
