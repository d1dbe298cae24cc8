"""What a cell came to is read of its run file, and of any file a problem at the most."""

import json
import math
import shutil
import sqlite3

import pytest

from ddenv.study.results import read_cell
from ddenv.study.study_folder import RUNS, check_path, run_path
from ddenv.version import __version__
from tests.study.made import LEFT, TESTS, begun, checked, crates, never_failed, plan_of, reduced
from tests.workbench import fake_run


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


def test_a_minimal_cell(tmp_path, cell, run):
    fake_run.finished(run)
    found = read_cell(tmp_path, cell)
    assert (found.minimal, found.problem, found.left) == (True, "", LEFT)
    assert len(found.elements) == 11 and found.smaller == 1 - 2 / 11
    # The baseline, two reductions of one test, and two vain candidates with three re-runs each; every test took 2 s.
    assert (found.tests, found.reruns, found.seconds) == (4 + 2 + 8, 6, 28.0)
    assert found.sizes == ((4, 11), (5, 6), (6, 2), (14, 2))
    assert (found.ahead, found.taken, found.version) == (0, 0, __version__)
    assert (found.baseline.failures, found.baseline.runs) == (3, 4)


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


def test_full_runs_at_the_end_count(tmp_path, cell, run):
    fake_run.confirming(run)
    for test in (17, 18):
        run.finish(test, "pass")
    run.write("finished", minimal=True, reason="no candidate showed f")
    found = read_cell(tmp_path, cell)
    assert (found.tests, found.reruns) == (14 + 4, 6)
    assert found.sizes[-1] == (18, 2)


def test_tests_that_were_taken_over_count_as_any_other(tmp_path, cell, run):
    run.created().baseline()
    test = run.start_round(2) or run.start(0)
    data = {"outcome": "similar", "failure": "stuck", "distance": 0.1, "end_pose": None, "simulated_seconds": 1.0}
    data |= {"first_sensed": [], "first_touched": [], "cut": False}
    run.write("test_finished", test=test, **data, wall_seconds=5.0, taken="another")
    run.judge(0, "similar", [test])
    found = read_cell(tmp_path, cell)
    assert (found.tests, found.taken, found.seconds) == (5, 1, 13.0)


PROBLEMS = {
    "begun": (lambda run: run.created(), "has not ended"),
    "under way": (fake_run.mid_round, "has not ended"),
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


def test_what_came_of_leaving_each_out_once_more(done):
    assert read_cell(*done).check is None
    checked(*done, 4, {"crate_00": 0, "crate_01": 0})
    check = read_cell(*done).check
    assert (check.seed, check.runs, check.shown, check.without) == (100_000, 4, 4, {"crate_00": 0, "crate_01": 0})
    assert check.holds


def test_f_that_is_a_matter_of_chance_is_told(done):
    for shown, without in ((0, 0), (4, 1)):
        checked(*done, shown, {"crate_00": 0, "crate_01": without})
        assert not read_cell(*done).check.holds


def test_what_is_no_check_of_these_models_is_none(done):
    right = {"seed": 100_000, "runs": 4, "all": 4, "without": {"crate_00": 0, "crate_01": 0}}
    wrong = (
        *({"without": {"crate_00": 0, "crate_05": 0}}, {"seed": 3}, {"runs": 1}),
        *({"without": None}, {"without": {"crate_00": [], "crate_01": 0}}, {"all": "many"}, {"seed": math.inf}),
    )
    texts = ["", "[]", "3", "{", "[" * 100_000, *(json.dumps(right | each) for each in wrong)]
    for text in texts:
        check_path(*done).write_text(text)
        found = read_cell(*done)
        assert (found.check, found.minimal, found.tests) == (None, True, TESTS)


def test_a_cell_whose_robot_did_not_fail_has_no_sizes(tmp_path, cell):
    found = never_failed(tmp_path, cell)
    assert (found.minimal, found.problem, found.baseline) == (False, "there is no failure to reduce", None)
    assert found.tests == 1
