"""A finished test is played back from the run file alone; what the file lacks of it is said, and
the rest is there.
"""

import math
import sqlite3
from array import array

import pytest

from ddenv.errors import UserError
from ddenv.runfile.position import Position
from ddenv.runs.playback import played
from tests.workbench import fake_moments, fake_run


@pytest.fixture
def finished(run):
    return fake_moments.finished(run)


def at_end(run):
    position = Position(run.file.events)
    position.catch_up()
    return position


def put(run, test, model, samples):
    with sqlite3.connect(run.path) as database:
        database.execute("INSERT OR REPLACE INTO motion VALUES (?, ?, ?)", (test, model, samples))
    database.close()


def way(*rows):
    return array(
        "d", [value for time, x in rows for value in (time, x, 0, 0, 1, 0, 0, 0)]
    ).tobytes()


def test_the_robot_and_the_models_that_moved_are_where_they_were(finished):
    put(finished, 38, "crate_01", way((0, 1.0), (10, 2.0)))
    one = played(finished.file, at_end(finished), 38)
    assert one.length == 45.0
    assert one.pose(0.0).position[:2] == (-6.0, 0.0)
    assert one.pose(22.5).position[0] == pytest.approx(-2.0)
    assert (one.words, one.models) == ("what is left, in full", ("crate_00", "crate_01"))
    assert list(one.moving) == ["crate_01"]
    assert one.lacks == ()


def test_an_implied_test_has_the_motions_of_the_one_that_implies_it(run):
    fake_moments.sliced(run)
    implied = next(test for test in run.state.tests if test.implied_by is not None)
    assert played(run.file, at_end(run), implied.id).length == 45.0


@pytest.mark.parametrize(
    "samples",
    [
        b"",
        way((0, 0), (2, 1), (1, 2)),
        way((0, 0), (1, math.nan)),
        way((0, 0), (1, 1e300)),
        way((-1, 0), (1, 0)),
        way((0, 0), (1e12, 0)),
    ],
    ids=["empty", "back in time", "nan", "far", "before the start", "for ever"],
)
@pytest.mark.parametrize("model", ["", "crate_01"], ids=["robot", "model"])
def test_motions_that_make_no_sense_are_told_and_the_rest_is_shown(finished, model, samples):
    put(finished, 38, model, samples)
    one = played(finished.file, at_end(finished), 38)
    assert one.models == ("crate_00", "crate_01")
    assert one.moving == {}
    assert bool(one.rows) == bool(model)
    assert model or one.pose(1.0) is None
    assert any("damaged" in line for line in one.lacks)


def test_a_run_without_trajectories_says_so(finished):
    with sqlite3.connect(finished.path) as database:
        database.execute("DELETE FROM motion")
    database.close()
    one = played(finished.file, at_end(finished), 38)
    assert one.length == 0.0
    assert one.lacks == (
        (
            "The run file has no path of the robot in test 38 (bundles leave paths out): nothing "
            "moves here."
        ),
    )


def test_of_another_simulator_only_the_robot_moves_and_it_says_so(tmp_path):
    data = fake_run.scenario() | {"oracle": {"command": "true"}}
    run = fake_moments.finished(fake_run.FakeRun(tmp_path / "one.ddenv", data))
    assert "only the robot's path is stored" in played(run.file, at_end(run), 1).lacks[0]
    run.close()


@pytest.mark.parametrize(
    ("number", "what"),
    [(0, "test 0"), (-1, "run 1 with a changed number"), (10**9, "test 1000000000")],
)
def test_there_is_no_such_test(finished, number, what):
    with pytest.raises(UserError, match=f"there is no {what}"):
        played(finished.file, at_end(finished), number)


def test_a_test_that_runs_is_not_stored_yet(run):
    fake_moments.mid_round(run)
    last = run.tests
    with pytest.raises(UserError, match=f"test {last} is still running"):
        played(run.file, at_end(run), last)
