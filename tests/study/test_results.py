"""The result of a cell is read from its run file, and from any other file a problem at most."""

import json
import sqlite3

import pytest

from ddenv import __version__
from ddenv.study.plan import run_path
from ddenv.study.results import read_cell
from tests.study.made import (
    FRESH,
    LEFT,
    TESTS,
    begun,
    certified,
    crates,
    ended,
    holds,
    plan_of,
    reduced,
)
from tests.workbench import fake_moments


@pytest.fixture
def cell(tmp_path):
    (cell,) = plan_of(crates(tmp_path), pairs="model2model/failure-proximal").cells
    return cell


@pytest.fixture
def done(tmp_path, cell):
    """The folder of a minimal cell, and the cell."""
    reduced(tmp_path, cell)
    return tmp_path, cell


@pytest.fixture
def run(tmp_path, cell):
    made = begun(tmp_path, cell)
    yield made
    made.close()


def test_a_minimal_cell(done):
    result = read_cell(*done)
    assert (result.minimal, result.problem, result.left) == (True, "", LEFT)
    assert len(result.elements) == 11 and result.smaller == 1 - 2 / 11
    # The baseline, a reduction of one test, and two vain candidates with three re-runs each; every
    # test took 2 s.
    assert (result.tests, result.reruns, result.seconds, result.misses) == (
        TESTS,
        6,
        2.0 * TESTS,
        4,
    )
    assert (result.certificate_tests, result.certificate_seconds) == (FRESH, 2.0 * FRESH)
    assert result.sizes == ((4, 11), (5, 2), (13, 2))
    # One fresh run was ahead of time.
    assert (result.ahead, result.taken_over, result.steps_back, result.version) == (
        1,
        0,
        0,
        __version__,
    )
    assert (result.baseline.failures, result.baseline.runs) == (3, 4)
    assert (result.whole_f, result.whole_runs) == (3, 4)


def test_tests_made_ahead_of_time_do_not_count(tmp_path, cell, run):
    """The first candidate shows f while re-runs and the second one are on already: one worker would
    have made one test.
    """
    run.created().baseline()
    run.start_round(3)
    first, second, rerun, third = run.start(0), run.start(1), run.start(0, 1), run.start(2)
    run.finish(second, "pass")
    run.finish(first, "similar", 0.1, failure="stuck")
    run.finish(rerun, "similar", 0.1, failure="stuck")
    run.judge(0, "similar", [first])
    run.reduce(0, list(LEFT), first)
    run.write("test_lost", test=third)
    run.start_round(2, list(LEFT))
    # Known from before: its tests count now, and the new one only once.
    more = [second, *(run.test(0, "pass", run=number) for number in (1, 2, 3))]
    run.judge(0, "dissimilar", more, known=1)
    run.write("finished", minimal=True, reason="no candidate showed f")
    result = read_cell(tmp_path, cell)
    assert (result.tests, result.reruns, result.ahead) == (4 + 1 + 4, 3, 1)
    assert result.sizes == ((4, 11), (5, 2), (9, 2))
    assert result.seconds == 2.0 * result.tests


def test_steps_back_are_counted_with_all_their_tests(tmp_path, cell, run):
    """The first certificate shows that the rate is lost; the second one holds."""
    run.created().baseline()
    run.start_round(2)
    run.reduce(0, list(LEFT), run.similar(0))
    run.start_round(2, list(LEFT))
    run.reduce(0, ["crate_00"], run.similar(0))
    certified(run, {None: ("lost", "spppppp")})
    earlier = run.tests
    run.write("rate_lost", node=1, lost=2, again=[], tests=[earlier - 1, earlier])
    run.write("leg_started", round=3, n_partitions=2)
    certified(run, holds(LEFT))
    assert read_cell(tmp_path, cell).problem == "has not ended"
    ended(run)
    result = read_cell(tmp_path, cell)
    assert (result.minimal, result.left, result.steps_back) == (True, LEFT, 1)
    assert result.sizes == ((4, 11), (5, 2), (6, 1), (6, 2), (6, 2))
    # The second test named by the step back had been ahead of time before.
    assert (result.tests, result.certificate_tests) == (6, 2 + 7 + 1 + FRESH)


@pytest.mark.parametrize(
    ("claims", "problem"),
    [
        (
            {None: ("lost", "ssppppppppppp")},
            (
                "what is left keeps less than 80 % of the whole world's rate: f in 2 of 13 fresh "
                "runs (1 % to 56 %)"
            ),
        ),
        (
            {None: ("not shown", "sssp")},
            (
                "not shown that what is left keeps 66 % of the whole world's rate; it keeps at "
                "least 9 %: f in 3 of 4"
            ),
        ),
        (holds(LEFT) | {"crate_01": ("not shown", "sppp")}, "undecided without crate_01"),
        (holds(LEFT) | {"crate_01": ("unknown", "eppp")}, "tests broke without crate_01"),
        (
            holds(LEFT) | {"crate_01": ("not needed", "ssss")},
            "not minimal: f seems to show about as often without crate_01",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_not_certified_is_not_minimal_and_says_why(tmp_path, cell, claims, problem):
    result = reduced(tmp_path, cell, claims=claims)
    assert not result.minimal
    assert problem in result.problem
    assert result.certificate is not None and result.tests == TESTS


def test_tests_that_were_taken_over_count_as_any_other(tmp_path, cell, run):
    run.created().baseline()
    test = run.start_round(2) or run.start(0)
    data = {
        "outcome": "similar",
        "failure": "stuck",
        "distance": 0.1,
        "end_pose": None,
        "simulated_seconds": 1.0,
    }
    data |= {"first_sensed": [], "first_touched": [], "cut": False}
    run.write("test_finished", test=test, **data, wall_seconds=5.0, taken="another")
    run.judge(0, "similar", [test])
    result = read_cell(tmp_path, cell)
    assert (result.tests, result.taken_over, result.seconds) == (5, 1, 13.0)


FINISHED = {"minimal": False, "reason": "no run failed"}
PROBLEMS = {
    "has not ended": lambda run: run.created(),
    "has not ended ": fake_moments.mid_round,
    "as you asked": lambda run: (
        run.created().baseline().write("engine_stopped", reason="as you asked")
    ),
    "no disk": lambda run: run.created().write("engine_failed", reason="no disk"),
    "no run failed": lambda run: run.created().write("finished", **FINISHED),
    "it has no certificate": lambda run: (
        run.created().baseline().write("finished", **FINISHED | {"minimal": True})
    ),
}


@pytest.mark.parametrize("problem", PROBLEMS)
def test_what_is_not_minimal_says_why(tmp_path, cell, run, problem):
    PROBLEMS[problem](run)
    result = read_cell(tmp_path, cell)
    assert (result.minimal, result.problem, result.certificate) == (False, problem.strip(), None)


JUDGED = {"candidate": 0, "verdict": "similar", "known": 0}
DAMAGED = {
    "unknown event": ("juggled", {}),
    "no such test": ("test_finished", {"test": 99}),
    "no such candidate": ("candidate_judged", JUDGED | {"candidate": 7, "tests": []}),
    "tests that are not there": ("candidate_judged", JUDGED | {"tests": [99]}),
    "a certificate of tests that are not there": (
        "certificate_finished",
        {"claims": [], "tests": [99]},
    ),
    "no events": ("", {}),
}


@pytest.mark.parametrize(("kind", "data"), DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_run_is_a_problem(done, kind, data):
    with sqlite3.connect(run_path(*done)) as db:
        if kind:
            db.execute(
                "INSERT INTO event (time, kind, data) VALUES (0, ?, ?)", (kind, json.dumps(data))
            )
        else:
            db.execute("DELETE FROM event")
    result = read_cell(*done)
    assert not result.minimal and "damaged run file" in result.problem
