"""What a cell came to is read of its run file, and of any file a problem at the most."""

import json
import shutil
import sqlite3

import pytest

from ddenv import __version__
from ddenv.study.plan import RUNS, run_path
from ddenv.study.results import read_cell
from tests.study.made import FRESH, LEFT, TESTS, begun, certified, crates, ended, holds, never_failed, plan_of, reduced
from tests.workbench import fake_moments


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a minimal cell, and the cell."""
    folder = tmp_path_factory.mktemp("made")
    (cell,) = plan_of(crates(folder), pairs="model2model/failure-proximal").cells
    reduced(folder, cell)
    return folder, cell


@pytest.fixture
def done(made, tmp_path):
    """A copy of it: its folder, and the cell."""
    shutil.copytree(made[0] / RUNS, tmp_path / RUNS)
    return tmp_path, made[1]


@pytest.fixture
def cell(tmp_path):
    (cell,) = plan_of(crates(tmp_path), pairs="model2model/failure-proximal").cells
    return cell


@pytest.fixture
def run(tmp_path, cell):
    made = begun(tmp_path, cell)
    yield made
    made.close()


def test_a_minimal_cell(done):
    found = read_cell(*done)
    assert (found.minimal, found.problem, found.left) == (True, "", LEFT)
    assert len(found.elements) == 11 and found.smaller == 1 - 2 / 11
    # The baseline, a reduction of one test, and two vain candidates with three re-runs each; every test took 2 s.
    assert (found.tests, found.reruns, found.seconds, found.misses) == (TESTS, 6, 2.0 * TESTS, 4)
    assert (found.certificate_tests, found.certificate_seconds) == (FRESH, 2.0 * FRESH)
    assert found.sizes == ((4, 11), (5, 2), (13, 2))
    # One fresh run was ahead of time.
    assert (found.ahead, found.taken_over, found.steps_back, found.version) == (1, 0, 0, __version__)
    assert (found.baseline.failures, found.baseline.runs) == (3, 4)
    assert (found.whole_f, found.whole_runs) == (3, 4)


def test_tests_made_ahead_of_time_do_not_count(tmp_path, cell, run):
    """The first candidate shows f while re-runs and the second one are on already: one worker would have made one test."""
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
    found = read_cell(tmp_path, cell)
    assert (found.tests, found.reruns, found.ahead) == (4 + 1 + 4, 3, 1)
    assert found.sizes == ((4, 11), (5, 2), (9, 2))
    assert found.seconds == 2.0 * found.tests


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
    found = read_cell(tmp_path, cell)
    assert (found.minimal, found.left, found.steps_back) == (True, LEFT, 1)
    assert found.sizes == ((4, 11), (5, 2), (6, 1), (6, 2), (6, 2))
    # The second test named by the step back had been ahead of time before.
    assert (found.tests, found.certificate_tests) == (6, 2 + 7 + 1 + FRESH)


@pytest.mark.parametrize(
    ("claims", "problem"),
    [
        (
            {None: ("lost", "ssppppppppppp")},
            "what is left keeps less than 80 % of the whole world's rate: f in 2 of 13 fresh runs (1 % to 56 %)",
        ),
        (
            {None: ("not shown", "sssp")},
            "not shown that what is left keeps 67 % of the whole world's rate; it keeps at least 10 %: f in 3 of 4",
        ),
        (holds(LEFT) | {"crate_01": ("not shown", "sppp")}, "undecided without crate_01"),
        (holds(LEFT) | {"crate_01": ("unknown", "eppp")}, "tests broke without crate_01"),
        (holds(LEFT) | {"crate_01": ("not needed", "ssss")}, "not minimal: f shows about as often without crate_01"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_not_certified_is_not_minimal_and_says_why(tmp_path, cell, claims, problem):
    found = reduced(tmp_path, cell, claims=claims)
    assert not found.minimal
    assert problem in found.problem
    assert found.certificate is not None and found.tests == TESTS


def test_without_a_certificate_nothing_is_minimal(tmp_path, cell, run):
    run.created().baseline()
    run.write("finished", minimal=True, reason="no candidate showed f")
    found = read_cell(tmp_path, cell)
    assert (found.minimal, found.problem, found.certificate) == (False, "it has no certificate", None)


def test_tests_that_were_taken_over_count_as_any_other(tmp_path, cell, run):
    run.created().baseline()
    test = run.start_round(2) or run.start(0)
    data = {"outcome": "similar", "failure": "stuck", "distance": 0.1, "end_pose": None, "simulated_seconds": 1.0}
    data |= {"first_sensed": [], "first_touched": [], "cut": False}
    run.write("test_finished", test=test, **data, wall_seconds=5.0, taken="another")
    run.judge(0, "similar", [test])
    found = read_cell(tmp_path, cell)
    assert (found.tests, found.taken_over, found.seconds) == (5, 1, 13.0)


PROBLEMS = {
    "begun": (lambda run: run.created(), "has not ended"),
    "under way": (fake_moments.mid_round, "has not ended"),
    "stopped": (
        lambda run: run.created().baseline().write("engine_stopped", reason="as you asked"),
        "as you asked",
    ),
    "failed": (lambda run: run.created().write("engine_failed", reason="no disk"), "no disk"),
    "never failed": (
        lambda run: run.created().write("finished", minimal=False, reason="no run failed"),
        "no run failed",
    ),
}


@pytest.mark.parametrize(("write", "problem"), PROBLEMS.values(), ids=PROBLEMS.keys())
def test_what_is_not_minimal_says_why(tmp_path, cell, run, write, problem):
    write(run)
    found = read_cell(tmp_path, cell)
    assert (found.minimal, found.problem) == (False, problem)


def test_what_was_not_made_says_so(tmp_path, cell):
    found = read_cell(tmp_path, cell)
    assert (found.minimal, found.problem, found.tests, found.smaller) == (False, "not made yet", 0, 0.0)


def test_what_is_no_run_file_is_a_problem(tmp_path, cell):
    run_path(tmp_path, cell).parent.mkdir()
    run_path(tmp_path, cell).write_text("no run file")
    found = read_cell(tmp_path, cell)
    assert not found.minimal and "is not a ddenv run file" in found.problem


DAMAGED = {
    "unknown event": ("juggled", {}),
    "no such model": ("reduced", {"candidate": 0, "environment": [77], "evidence_test": 1}),
    "no such test": ("test_finished", {"test": 99}),
    "no such candidate": ("candidate_judged", {"candidate": 7, "verdict": "similar", "tests": [], "known": 0}),
    "tests that are not there": ("candidate_judged", {"candidate": 0, "verdict": "similar", "tests": [99], "known": 0}),
    "test zero": ("candidate_judged", {"candidate": 0, "verdict": "similar", "tests": [0], "known": 0}),
    "a certificate of tests that are not there": ("certificate_finished", {"claims": [], "tests": [99]}),
    "a certificate of no tests": ("certificate_finished", {"claims": [], "tests": [None]}),
    "tests that are no numbers": (
        "candidate_judged",
        {"candidate": 0, "verdict": "similar", "tests": [[1]], "known": 0},
    ),
}


@pytest.mark.parametrize(("kind", "data"), DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_run_is_a_problem(done, kind, data):
    with sqlite3.connect(run_path(*done)) as db:
        db.execute("INSERT INTO event (time, kind, data) VALUES (0, ?, ?)", (kind, json.dumps(data)))
    found = read_cell(*done)
    assert not found.minimal and "damaged run file" in found.problem


def test_a_run_without_events_is_a_problem(done):
    with sqlite3.connect(run_path(*done)) as db:
        db.execute("DELETE FROM event")
    assert not read_cell(*done).minimal and "damaged run file" in read_cell(*done).problem


def test_a_cell_whose_robot_did_not_fail_has_no_sizes(tmp_path, cell):
    found = never_failed(tmp_path, cell)
    assert (found.minimal, found.problem, found.baseline) == (False, "there is no failure to reduce", None)
    assert found.tests == 1
