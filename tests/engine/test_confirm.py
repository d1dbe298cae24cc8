"""What early stop may never do: call a world minimal that full runs contradict."""

import tempfile
from pathlib import Path
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.engine.journal import Journal
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from tests.engine.fake import ELEMENTS, FakePool, drive, new_run
from tests.engine.test_driver import Killed, _kill, flaky, needs, story
from tests.tiers import examples

METHODS = [{}, {"algorithm": "splitting"}, {"pair": "learner/timestep", "growth": "steady", "skip": "implied"}]


def as_it_is(oracle):
    """Cuts every run that fails, and what it shows then is what the full run shows."""

    def cut(keep, seed):
        shown = oracle(keep, seed)
        return "" if shown == "pass" else shown

    return cut


def wrong(salt, often):
    """Cuts `often` of ten runs, and shows then whatever it likes."""

    def cut(keep, seed):
        luck = crc32(f"cut {salt} {sorted(keep)} {seed}".encode())
        return ("similar", "other")[luck // 10 % 2] if luck % 10 < often else ""

    return cut


def contradicted(state, oracle) -> bool:
    """Whether full runs with the seeds of the run show something else than that what is left is minimal."""
    reduction, kept = state.scenario["reduction"], frozenset(state.environment)
    seeds = range(reduction["seed"], reduction["seed"] + 1 + reduction["iterations"])
    # The whole world showed f in the baseline, which has more runs.
    shows = kept == frozenset(state.elements) or any(oracle(kept, seed) == "similar" for seed in seeds)
    return not shows or any(oracle(kept - {name}, seed) == "similar" for name in kept for seed in seeds)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: "-".join(method.values()) or "own")
@given(salt=st.integers(0, 200), often=st.integers(0, 10), jobs=st.integers(1, 3), iterations=st.integers(0, 2))
@examples(0.15)
def test_what_full_runs_contradict_is_never_minimal(method, salt, often, jobs, iterations):
    oracle = flaky(salt, "wall", "beam")
    with tempfile.TemporaryDirectory() as folder:
        path = new_run(Path(folder), early_stop=True, iterations=iterations, **method)
        state = drive(path, FakePool(oracle, jobs, salt, wrong(salt, often)))
    assert state.status == "finished"
    if state.baseline is not None:
        assert state.confirming
        assert state.minimal == (not contradicted(state, oracle))
        assert state.minimal or "run again with --no-early-stop" in state.reason


def test_cut_runs_that_show_what_full_ones_do_lead_to_the_same_end(tmp_path):
    for salt in range(5):
        oracle = flaky(salt, "wall", "ball")
        full = drive(new_run(tmp_path), FakePool(oracle, 2))
        early = drive(new_run(tmp_path, early_stop=True), FakePool(oracle, 2, cut=as_it_is(oracle)))
        assert story(early) == story(full)


def test_the_baseline_and_the_confirmation_are_never_cut(tmp_path):
    state = drive(new_run(tmp_path, early_stop=True), FakePool(flaky(1, "wall"), 2, cut=wrong(1, 10)))
    assert {test.phase for test in state.tests} == {"baseline", "round", "confirm"}
    assert all(test.cut == (test.phase == "round") for test in state.finished_tests)


def test_only_what_rests_on_cut_runs_is_run_in_full(tmp_path):
    """The wall is needed. Without it a run that may be cut is, at another place; all other runs end by themselves."""

    def cut(keep, seed):
        return "" if "wall" in keep else "other"

    state = drive(new_run(tmp_path, early_stop=True), FakePool(needs("wall", "beam"), 1, cut=cut))
    assert state.minimal
    assert [(test.without, test.run) for test in state.confirm_tests] == [("wall", 0), ("wall", 1)]


def test_without_early_stop_nothing_is_cut_or_confirmed(tmp_path):
    state = drive(new_run(tmp_path), FakePool(needs("wall"), 2, cut=wrong(1, 10)))
    assert state.minimal
    assert not state.confirming
    assert not any(test.cut or test.phase == "confirm" for test in state.tests)


def test_a_contradiction_names_the_model_and_the_way_out(tmp_path):
    # Cut, a run without the beam shows something else; in full it shows f.
    def cut(keep, seed):
        return "" if "beam" in keep else "other"

    state = drive(new_run(tmp_path, early_stop=True), FakePool(needs("wall"), 2, cut=cut))
    assert set(state.environment) == {"wall", "beam"}
    assert (state.status, state.minimal) == ("finished", False)
    assert "f shows in a full run without 'beam', too; run again with --no-early-stop" in state.reason


def test_f_that_only_cut_runs_show_is_a_contradiction(tmp_path):
    def cut(keep, seed):
        return "similar" if "wall" in keep else ""

    oracle = needs("wall", "beam")
    state = drive(new_run(tmp_path, early_stop=True), FakePool(oracle, 2, cut=cut))
    assert state.environment == ("wall",)
    assert not state.minimal
    assert "f does not show in full runs of what is left; run again with --no-early-stop" in state.reason


def test_full_runs_that_all_break_prove_nothing(tmp_path):
    # Cut, a run without the wall shows something else; in full it breaks.
    def oracle(keep, seed):
        return "similar" if "wall" in keep else "error"

    def cut(keep, seed):
        return "" if "wall" in keep else "other"

    state = drive(new_run(tmp_path, early_stop=True), FakePool(oracle, 2, cut=cut))
    assert state.environment == ("wall",)
    assert not state.minimal
    assert "may not be needed: all tests without them broke" in state.reason


def test_what_is_left_and_breaks_in_full_is_told(tmp_path):
    def oracle(keep, seed):
        return "similar" if keep == frozenset(ELEMENTS) else "error" if "wall" in keep else "pass"

    def cut(keep, seed):
        return "similar" if "wall" in keep else ""

    state = drive(new_run(tmp_path, early_stop=True), FakePool(oracle, 2, cut=cut))
    assert state.environment == ("wall",)
    assert not state.minimal
    assert state.reason == "all full runs of what is left broke; run again with --no-early-stop"


@given(salt=st.integers(0, 30), moments=st.lists(st.integers(1, 60), min_size=1, max_size=4), jobs=st.integers(1, 3))
@examples(0.1)
def test_killed_at_any_moment_it_resumes_to_the_same_end(salt, moments, jobs):
    oracle, cut = flaky(salt, "wall", "beam"), wrong(salt, 6)
    with tempfile.TemporaryDirectory() as folder:
        undisturbed = drive(new_run(Path(folder), early_stop=True), FakePool(oracle, jobs, cut=cut))
        path = new_run(Path(folder), early_stop=True)
        _killed(path, FakePool(oracle, jobs, salt, cut), moments)
        state = _resumed(path, FakePool(oracle, jobs, cut=cut))
        assert (*story(state), state.reason) == (*story(undisturbed), undisturbed.reason)
        _made_once(path)


@pytest.mark.parametrize("made", [0, 1, 2, 3])
def test_killed_while_it_confirms_it_goes_on_there(tmp_path, made):
    """So many of the full runs were made when the engine was killed: one of what is left, two without each of two models."""
    oracle = needs("wall", "beam")

    def cut(keep, seed):
        return "similar" if {"wall", "beam"} <= keep else "other"

    path = new_run(tmp_path, early_stop=True)
    with pytest.raises(Killed):
        drive(path, FakePool(oracle, 1, cut=cut), prepare=lambda file: _kill_in_confirmation(file, made))
    state = drive(path, pool := FakePool(oracle, 1, cut=cut))
    assert state.minimal
    assert len(pool.made) == 5 - made
    _made_once(path)


def _kill_in_confirmation(file, made):
    append, count = file.append, [0]

    def limited(kind, data, *rest):
        if kind == "test_started" and data["phase"] == "confirm":
            count[0] += 1
            if count[0] > made:
                raise Killed
        return append(kind, data, *rest)

    file.append = limited


def _killed(path, pool, moments):
    for moment in moments:
        pool.running.clear()
        try:
            drive(path, pool, prepare=lambda file, after=moment: _kill(file, after))
        except Killed:
            continue
        return


def _resumed(path, pool):
    with RunFile(path) as file:
        state = fold(file.events())
    return state if state.status == "finished" else drive(path, pool)


def _made_once(path):
    with RunFile(path) as file:
        journal = Journal(file)
    done = journal.state.finished_tests
    made = [(journal._keeps[test.id], test.run, test.phase == "confirm") for test in done]
    assert len(made) == len(set(made))
    assert all(test.is_finished or test.outcome == "lost" for test in journal.state.tests)
