"""A run file recorded in format 4, with decisions of a user and commands not yet obeyed: it must stay readable.

`tests/data/format4.ddenv` is never written again: when the format changes, this one is read beside the new one.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ddenv.runfile.fold import fold
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.runs.export import export_world
from ddenv.runs.subject import read_parts

RECORDED = Path(__file__).parents[1] / "data" / "format4.ddenv"


@pytest.fixture
def run(tmp_path) -> Path:
    return Path(shutil.copy(RECORDED, tmp_path / "recorded.ddenv"))


def ddenv(*words: str | Path) -> str:
    """What a command prints."""
    done = subprocess.run([sys.executable, "-m", "ddenv", *words], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def state_of(run: Path) -> RunState:
    with RunFile(run) as file:
        return fold(file.events())


def test_it_folds_to_the_same_state(run):
    state = state_of(run)
    assert (state.status, state.minimal, state.environment) == ("finished", True, ("deck", "wall"))
    assert (state.tests_done, state.deflake_runs, state.rounds_done) == (21, 9, 8)
    assert state.outcomes() == {"similar": 9, "other": 0, "pass": 12, "error": 0, "timeout": 0}
    assert [node.parent for node in state.nodes] == [None, 0, 1, 0, 3]
    assert [one.kind for one in state.decisions] == ["change", "try", "go_back", "pin", "undo"]
    assert [trial.verdict for trial in state.trials] == ["similar"]
    assert state.pinned == {"wall"}
    assert dict(state.tests[0].first_touched).keys() == {"deck", "wall"}


def test_its_world_trajectories_and_commands_are_read(run, tmp_path):
    with RunFile(run) as file:
        scenario, world, robot = read_parts(file)
        assert (scenario.name, len(world.models), robot.name) == ("wall", 7, "husky")
        assert [each.kind for each in file.commands()][-3:] == ["adopt", "go_back", "veto"]
        assert len(file.trajectory(21)) > 0
    export_world(run, tmp_path / "left.sdf", None)
    assert b"wall" in (tmp_path / "left.sdf").read_bytes()


def test_it_is_reported(run, tmp_path):
    ddenv("report", run, "-o", tmp_path / "report.md")
    text = (tmp_path / "report.md").read_text()
    assert "2 of 6 models are enough to make the robot fail" in text
    assert "21 tests" in text or "| 21 |" in text


@pytest.mark.programs
def test_an_engine_obeys_its_waiting_commands_and_goes_on(run):
    with RunFile(run) as file:
        # The recorded budget has no room for a certificate.
        file.send("change", settings={"budget": None})
    ddenv("resume", run, "--jobs", "1")
    state = state_of(run)
    assert (state.status, state.environment, state.minimal) == ("finished", ("deck", "wall"), True)
    assert state.last_command >= 12 and state.refusal[0] == 12
    assert len(state.certificates) == 1
    assert state.trials[0].adopted and len(state.nodes) == 8
