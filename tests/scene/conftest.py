"""Run files for the scene's tests: a small world, and the events of a reduction up to a stage of
it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ddenv.runfile.store import Motions, RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.experiment import scenario_for_world
from ddenv.world.sdf.read import parse_world
from tests.shorthand import Writing

NAMES = ("left wall", "tile/é <b>1</b>", "board", "asphalt")


def _box(name: str, pose: str, size: str, static: bool) -> str:
    shape = f"<geometry><box><size>{size}</size></box></geometry>"
    escaped = name.replace("<", "&lt;").replace(">", "&gt;")
    return (
        f'<model name="{escaped}"><static>{str(static).lower()}</static><pose>{pose}</pose><link '
        'name="link">'
        f'<collision name="c">{shape}</collision></link></model>'
    )


WORLD = f"""<?xml version="1.0"?>
<sdf version="1.9"><world name="small">
<model name="ground_plane"><static>true</static><link name="link">
<collision name="c"><geometry><plane><normal>0 0 1</normal></plane></geometry></collision></link></model>
{_box(NAMES[0], "2 1.5 0.5 0 0 0.4", "2 0.2 1", True)}
{_box(NAMES[1], "3 0 0.05 0 0 0", "1 1 0.1", True)}
{_box(NAMES[2], "1 -1.5 0.1 0 0 0", "1 0.3 0.2", False)}
{_box(NAMES[3], "6 0 0.25 0 0 0", "2 4 0.5", True)}
</world></sdf>
""".encode()


@pytest.fixture
def small_world():
    return parse_world(WORLD, Path("small.sdf"))


def straight(end: float, seconds: float = 8.0) -> np.ndarray:
    """Rows of a robot that drives along x from 0 to `end` m."""
    time = np.linspace(0.0, seconds, 81)
    rows = np.zeros((81, 8))
    rows[:, 0], rows[:, 1], rows[:, 3], rows[:, 4] = time, time / seconds * end, 0.132, 1.0
    return rows


class Writer:
    """Writes the events that an engine would write."""

    def __init__(self, path: Path, folder: Path) -> None:
        world = folder / "small.sdf"
        world.write_bytes(WORLD)
        create_run(scenario_for_world(world, (0.0, 0.0, 0.14, 0.0), (6.0, 0.0)), path)
        self.path, self.run = path, RunFile(path)
        self.run.own()
        self._writing = Writing(self.run)
        scenario = json.loads(self.run.document("scenario"))
        self.append("created", {"scenario": scenario, "elements": list(NAMES)})

    def append(self, kind: str, data: dict, motions: Motions | None = None) -> None:
        """An event in short, see `tests.shorthand`."""
        self._writing.write(kind, data, motions)

    def start_test(self, test: int, *, candidate: int | None = None, run: int = 0) -> None:
        place = (
            {"phase": "baseline", "round": None}
            if candidate is None
            else {"phase": "round", "round": 1}
        )
        self.append(
            "test_started", place | {"test": test, "candidate": candidate, "run": run, "seed": run}
        )

    def finish_test(self, test: int, outcome: str, end: float = 3.0) -> None:
        rows, board = straight(end), straight(0.5)
        noticed = {"first_sensed": [], "first_touched": [], "cut": False}
        values = {
            "failure": "out of time",
            "distance": None,
            "end_pose": [*rows[-1, 1:]],
            **noticed,
        }
        seconds = {"simulated_seconds": 8.0, "wall_seconds": 0.1}
        motions = {"": rows.tobytes(), "board": board.tobytes()}
        self.append("test_finished", {"test": test, "outcome": outcome} | values | seconds, motions)

    def start_engine(self) -> None:
        self.append("engine_started", {"pid": 1, "jobs": 1, "version": "0", "simulator": "none"})

    def baseline(self) -> None:
        self.start_engine()
        self.start_test(1)
        self.finish_test(1, "failed")
        numbers = {
            "runs": 1,
            "failures": 1,
            "rate": 1.0,
            "low": 0.2,
            "high": 1.0,
            "miss_chance": 0.0,
        }
        place = {"failure_test": 1, "position": [3.0, 0.0, 0.132], "iterations_95": 0}
        known = {"outcomes": {"1": "similar"}, "distances": {"1": 0.0}}
        self.append("baseline_finished", numbers | place | known)

    def round(self) -> None:
        candidates = [["partition", 0, 1.0], ["partition", 1, 2.0]]
        parts = {"partitions": [[0, 1], [2, 3]], "candidates": candidates}
        self.append(
            "round_started", {"round": 1, "n_partitions": 2, "environment": [0, 1, 2, 3]} | parts
        )

    def reduce(self) -> None:
        """Candidate 0 shows the failure in test 2, and is taken."""
        self.start_test(2, candidate=0)
        self.finish_test(2, "similar", end=3.1)
        self.append(
            "candidate_judged", {"candidate": 0, "verdict": "similar", "tests": [2], "known": 0}
        )
        self.append("reduced", {"candidate": 0, "environment": [0, 1], "evidence_test": 2})
        self.append("round_finished", {})


@pytest.fixture
def writer(tmp_path, monkeypatch) -> Writer:
    # The scene remembers its address there.
    monkeypatch.setenv("DDENV_HOME", str(tmp_path / "home"))
    return Writer(tmp_path / "a.ddenv", tmp_path)


@pytest.fixture
def in_round(writer) -> Writer:
    """The first round has begun."""
    writer.baseline()
    writer.round()
    return writer


@pytest.fixture
def reduced(in_round) -> Writer:
    """The first round has reduced the world."""
    in_round.reduce()
    return in_round


@pytest.fixture
def start_scene():
    """Starts the program with these words; what still runs at the end of the test is ended."""
    started = []

    def start(*words: str | Path) -> subprocess.Popen:
        command = [sys.executable, "-m", "ddenv.scene", *map(str, words)]
        pipe = subprocess.PIPE
        environment = os.environ | {"PYTHONUNBUFFERED": "1"}
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True, env=environment
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()
