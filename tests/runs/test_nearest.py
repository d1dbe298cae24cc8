"""The nearest world that passes, in words: each number is that of the runs."""

import sqlite3

import pytest

from ddenv.errors import UserError
from ddenv.runs.reasons import nearest, removed_in_passing
from tests.workbench import fake_moments


def read(run):
    return run.state, nearest(run.file, run.state)


def test_it_says_what_goes_and_what_fresh_runs_show_with_and_without_it(run):
    state, found = read(fake_moments.isolated(run))
    assert found.gone == removed_in_passing(state, run.path) == ("crate_00",)
    assert found.shown
    assert found.words == (
        "a nearest world that passes lacks 1 model of 11 (crate_00): without it the robot reaches "
        "its goal in 20 of 20 fresh runs (84 % to 100 %), tested above 45 %; with it put back in "
        "0 of 9 fresh runs (0 % to 30 %)"
    )
    # The reduction is as it was.
    assert (state.status, state.minimal, state.certified) == ("finished", True, True)


def test_two_runs_with_one_seed_show_where_the_worlds_part(run):
    state, found = read(fake_moments.isolated(run))
    one = found.parting
    failing, passing = (state.tests[test - 1] for test in (one.with_test, one.without_test))
    assert failing.seed == passing.seed == one.seed
    assert (failing.outcome, failing.phase, passing.outcome) == ("similar", "baseline", "pass")
    assert found.sentences.startswith("A nearest world")
    assert f"With seed {one.seed} the two runs differ after {one.equal:.1f} s" in found.sentences


def test_where_trajectories_are_damaged_the_rest_is_said(run):
    fake_moments.isolated(run)
    with sqlite3.connect(run.path) as database:
        database.execute("UPDATE motion SET samples = x'00'")
    database.close()
    found = read(run)[1]
    assert (found.gone, found.shown, found.parting) == (("crate_00",), True, None)
    assert found.sentences.startswith("A nearest world that passes lacks 1 model")
    assert "Where the paths diverge is not known: " in found.sentences
    assert found.lacks in found.sentences


def test_before_it_has_ended_nothing_is_claimed(run):
    state, found = read(fake_moments.isolating(run))
    assert found is None
    assert state.isolating is not None
    with pytest.raises(UserError, match="find the nearest one first: ddenv isolate"):
        removed_in_passing(state, run.path)


def ended(run, claims, removal):
    """What is said of an isolation that ends with these claims about the world without the first
    three models.
    """
    fake_moments.finished(run).start_isolation(2)
    gone = run.remove("crate_00", "crate_01", "crate_02")
    run.isolate_all(gone, "e")
    low_high = {"low": 0.1, "high": 0.9}
    said = [
        {"back": back, "verdict": verdict, "reached": reached, "runs": runs, **low_high}
        for back, verdict, reached, runs in claims
    ]
    if claims:
        run.write("isolation_checked", removal=gone, claims=said, tests=[])
    run.write("isolation_finished", removal=removal)
    return read(run)[1]


PASSES, EACH_NEEDED = (None, "passes", 20, 20), [(back, "needed", 0, 9) for back in range(3)]
ENDS = {
    "not shown": (
        (PASSES, EACH_NEEDED[0], (1, "not shown", 3, 9), EACH_NEEDED[2]),
        1,
        False,
        "; not shown that each of them has to go: undecided with crate_01 put back",
    ),
    "the worst": (
        (PASSES, *EACH_NEEDED),
        1,
        True,
        "with any one of these 3 put back in at most 0 of 9 fresh runs",
    ),
    "no world": ((), None, False, "no passing world was found: the robot does not reach its goal"),
    "no world of all": ((), None, False, "all 11 models that may be removed"),
}


@pytest.mark.parametrize(("claims", "removal", "shown", "words"), ENDS.values(), ids=ENDS)
def test_nothing_is_claimed_but_what_is_shown(run, claims, removal, shown, words):
    found = ended(run, claims, removal)
    assert (bool(found.gone), found.shown) == (removal is not None, shown)
    assert words in found.words


def test_where_fresh_runs_do_not_show_that_it_passes_it_says_so(run):
    found = ended(run, ((None, "not shown", 12, 20),), None)
    assert found.words.startswith("no world is shown to pass: without 3 models of 11")
    with pytest.raises(UserError, match="no world is shown to pass"):
        removed_in_passing(read(run)[0], run.path)
