"""A whole reduction guided by hand, with keys alone, in a real terminal and on Drake."""

import pytest

from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.store import RunFile
from tests.conftest import DATA
from tests.end_to_end.terminal import DDENV, state_of
from tests.waiting import wait_until


@pytest.fixture
def baseline(terminal, tmp_path):
    """A run of all six models that is paused after its baseline."""
    first = terminal(
        80, 24, "run", DATA / "wall.yaml", "--name", "one", "--jobs", "1", "--no-slice"
    )
    first.see("baseline")
    run = tmp_path / "runs" / "one.ddenv"
    with RunFile(run) as viewer:
        viewer.send("step", unit="round")
    wait_until(lambda: state_of(run).status == "paused" and state_of(run).round is not None)
    return run


@pytest.mark.terminal
def test_a_reduction_is_guided_by_keys_alone(terminal, baseline, tmp_path):
    run = baseline
    bench = terminal(80, 24, "open", "one")
    bench.see("paused")
    _veto_and_take_it_back(bench, run)
    _pin(bench, run)
    _try_and_adopt(bench, run)
    bench.press("Space")
    wait_until(lambda: state_of(run).status == "finished")
    first = state_of(run)
    assert first.minimal
    assert {"deck", "wall", "ball"} == set(first.environment)
    _undo(bench, run)
    _branch(bench, run)
    _export(bench, tmp_path)
    bench.press("q")
    bench.see("Keep it running")
    bench.press("l")
    # Whoever comes back finds all of it.
    kinds = [one.kind for one in state_of(run).decisions]
    for kind in ("veto", "unveto", "pin", "try", "adopt", "undo", "go_back"):
        assert kind in kinds


def _veto_and_take_it_back(bench, run):
    bench.press("v")
    bench.see("⊘ vetoed")
    bench.press("v")
    wait_until(lambda: not state_of(run).round.candidates[0].verdict)


def _pin(bench, run):
    bench.press("p")
    bench.see("part of a name")
    bench.press("b", "a", "l", "l", "Tab", "Enter")
    # The engine may pin it before the list has closed, and keys typed then go to the list.
    bench.see("Pinned ball")
    assert state_of(run).pinned == {"ball"}


def _try_and_adopt(bench, run):
    bench.press("w")
    bench.see("part of a name")
    bench.press("f", "a", "r", "Tab", "Enter")
    wait_until(lambda: state_of(run).trials and state_of(run).trials[0].verdict == "similar")
    bench.see("● a adopts")
    # The trials are the first rows of the table.
    bench.press("Home", "a")
    wait_until(lambda: state_of(run).here.how == "adopted")


def _undo(bench, run):
    bench.see("finished")
    left = len(state_of(run).nodes)
    bench.press("u")
    wait_until(lambda: state_of(run).nodes[left - 1].rejected)
    wait_until(lambda: state_of(run).status == "finished")


def _branch(bench, run):
    bench.see("finished")
    bench.press("h")
    bench.see("Reductions")
    bench.see("deck, wall, post, ball")
    bench.press("Home")
    bench.see("where the run began")
    bench.press("Enter")
    bench.see("The run pauses there")
    bench.press("y")
    wait_until(lambda: state_of(run).node == 0 and state_of(run).status == "paused")
    bench.see("A B parts")


def _export(bench, folder):
    bench.press("E")
    bench.see("report (HTML)")
    bench.press("C-s")
    wait_until(lambda: (folder / "one.html").exists() and (folder / "one.minimal.sdf").exists())
    bench.press("Escape")
    bench.see("A B parts")


@pytest.mark.terminal
def test_suspended_and_back_in_front(terminal, baseline):
    shell = terminal(80, 24, program=("bash", "--norc", "-i"))
    shell.press(f"PS1='$ '; {DDENV} open one", "Enter")
    shell.see("paused")
    shell.press("C-z")
    shell.see("Stopped")
    assert engine_is_alive(baseline)
    shell.press("fg", "Enter")
    # The whole screen is there again, and answers.
    shell.see("What is happening")
    shell.press("v")
    shell.see("⊘ vetoed")
    shell.press("C-q")
    shell.see("ddenv open one")
