"""What views say of slices, in a run that the engine made with a simulator that costs nothing."""

import json
import re

import pytest

from ddenv.cli.summary import summary, summary_lines
from ddenv.report.report import content
from ddenv.report.run_data import read_run
from ddenv.runfile.fold import apply
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.words.explain import explain
from ddenv.words.news import news
from ddenv.words.slices import slice_in_short
from ddenv.workbench.run.candidate_rows import listed, words
from tests.command import in_process
from tests.engine.fake import drive
from tests.engine.participation import MODELS, Participation, sliced_run
from tests.engine.reading import state_of

SIMULATOR = Participation(2, ("box_1", "box_7", "box_12"), ties=(("box_1", "box_20"),))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = sliced_run(tmp_path_factory.mktemp("sliced"), accept_rate="first")
    drive(path, SIMULATOR.pool())
    return path


@pytest.fixture(scope="module")
def moments(run):
    """Each event with the states before and after it."""
    found, before = [], RunState()
    with RunFile(run) as file:
        for event in file.events():
            after = apply(before, event)
            found.append((event, before, after))
            before = after
    return found


def first(moments, kind):
    return next(moment for moment in moments if moment[0].kind == kind)


def test_a_slice_is_told_with_the_chance_that_a_fresh_run_meets_what_went(moments):
    _, before, after = first(moments, "sliced")
    gone = len(before.environment) - len(after.environment)
    line = news("sliced", before, after)
    assert line.startswith(
        f"  reduced to {len(after.environment)} models: {gone} models cannot have affected any "
        "of the 3 runs"
    )
    assert "the chance that a fresh run meets a model not met before is " in line
    assert slice_in_short(after, after.here).startswith(
        f"none of 3 runs met the other {gone}; a fresh run meets one: "
    )


def test_the_workbench_teaches_what_is_implied(moments):
    _, _, sliced = first(moments, "sliced")
    said = " ".join(explain(Snapshot(state=sliced, live=(), engine="alive")).sentences)
    assert "Removing models that cannot have affected a run changes no bit of it" in said
    assert "u takes it back" in said
    recorded, _, implied = first(moments, "implied")
    said = " ".join(explain(Snapshot(state=implied, live=(), engine="alive")).sentences)
    assert (
        f"Test {recorded.event.test} is implied by test {recorded.event.by}: no model it lacks "
        "affected that run."
    ) in said


def test_the_row_of_a_candidate_names_the_run_that_implies_its_test(moments):
    event = first(moments, "implied")[0].event
    judged = next(
        after
        for each, _, after in moments
        if each.kind == "candidate_judged" and event.test in each.event.tests
    )
    shown = Snapshot(state=judged, live=(), engine="alive")
    listing = listed(shown)
    rows = [words(shown, listing, row) for row in range(len(listing))]
    by = rf"tests? (\d+, )*{event.by}\b"
    assert any(re.match(f"○ dissimilar, implied by {by}", row["verdict"]) for row in rows)


def test_a_program_gets_the_number_of_simulated_tests(run, moments):
    state = moments[-1][2]
    told = summary(state, run)
    search = [test for test in state.tests if test.phase != "certify"]
    assert told["simulated"] == sum(test.implied_by is None for test in search) < len(search)
    assert any(
        f"{state.implied} implied, not simulated" in line for line in summary_lines(state, run)
    )
    json.dumps(told, allow_nan=False)


def test_a_report_says_what_was_known_and_what_went_without_a_test(run):
    text = str(content(read_run(run)))
    assert "of the tests were not simulated: finished runs imply them" in text
    assert "without a test" in text


def test_the_map_of_a_run_shows_what_took_part(run, monkeypatch, capsys):
    said = in_process(monkeypatch, capsys, "world", "show", run, "--took-part")
    assert said.returncode == 0
    state = state_of(run)
    met = set().union(
        *(test.took_part.names(state.elements) for test in state.tests if test.phase == "baseline")
    )
    for name in MODELS:
        assert (f"  {name}: " in said.stdout) == (name in met)
    assert f"{len(met)} models of {len(state.elements)} may have affected the runs" in said.stdout


def test_a_run_that_does_not_know_what_took_part_says_so(tmp_path, monkeypatch, capsys):
    path = sliced_run(tmp_path)
    pool = SIMULATOR.pool()
    pool.took_part = lambda *_: None
    drive(path, pool)
    said = in_process(monkeypatch, capsys, "world", "show", path, "--took-part")
    assert said.returncode == 2
    assert "does not record which models affected its runs" in said.stderr
    assert said.stderr.count("\n") == 1
