"""Engines and workers are killed at random moments: the run ends as if nothing had happened."""

import math
import os
import random
import signal
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import pytest

from ddenv.runfile.state import BROKEN
from ddenv.runs.creation import create_run
from ddenv.runs.engine_job import EngineOptions
from ddenv.runs.programs import last_words, start_engine
from ddenv.runs.trust import program_of, trust
from ddenv.world.scenario import Oracle
from tests.engine.killing import story
from tests.engine.reading import models_in, state_of, told
from tests.waiting import PATIENCE, PERIOD
from tests.wall import wall

KILLS = int(os.environ.get("DDENV_KILLS", "6"))
# An engine is killed within this time after its first test began, and so is one of its workers, s.
# One engine in so many dies before that, within this time after its workers were started.
LIFE = 3.0
EARLY, ONE_IN = 1.5, 5

# Fails where the deck and the wall are. It starts no Python: a test takes a few hundredths of a
# second.
ROBOT = """
echo 0,0,0,0,0,0,0,1
grep -q 'model name="deck"' "$1" && grep -q 'model name="wall"' "$1" && exit 1
exit 0
"""


def new_run(folder: Path, name: str) -> Path:
    (folder / "robot.sh").write_text(ROBOT)
    more = {"iterations": 9, "growth": "paper", "skip": "known", "baseline_runs": 6}
    scenario = wall(oracle=Oracle(command="sh robot.sh {world}"), folder=folder, reduction=more)
    run = folder / f"{name}.ddenv"
    create_run(scenario, run)
    trust(program_of(scenario))
    return run


def children(pid: int) -> list[int]:
    found = []
    with suppress(OSError):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            found += map(int, (thread / "children").read_text().split())
    return found


def workers(engine: int) -> list[int]:
    found = []
    with suppress(OSError):
        found += [
            pid
            for pid in children(engine)
            if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
        ]
    return found


def how_many_began(run: Path) -> int:
    """How many tests ever began in a run."""
    return len(told(run, "test_started"))


def lives(run: Path, dice: random.Random, most: int) -> int:
    """One engine's life on a run: a worker is killed, and then the engine. Returns how many kills
    there were, at most `most`.
    """
    before = how_many_began(run)
    engine = start_engine(run, EngineOptions(jobs=2, ignore_crashes=True))
    kills, began, early = 0, math.inf, dice.randrange(ONE_IN) == 0
    moments = sorted(dice.uniform(0.0, EARLY if early else LIFE) for _ in range(min(2, most)))
    while engine.poll() is None and kills < len(moments):
        time.sleep(PERIOD)
        if began == math.inf and (workers(engine.pid) if early else how_many_began(run) > before):
            began = time.monotonic()
        if time.monotonic() - began < moments[kills]:
            continue
        # One worker in a life: a test that breaks twice would rightly be unknown.
        victims = workers(engine.pid) if kills < len(moments) - 1 else [engine.pid]
        with suppress(OSError):
            if victims:
                os.kill(dice.choice(victims), signal.SIGKILL)
                kills += 1
    assert engine.wait(PATIENCE) in (0, -signal.SIGKILL), last_words(run)
    return kills


def what_became(run: Path):
    state = state_of(run)
    verdicts = [
        (data["round"], data["candidate"], data["verdict"])
        for data in told(run, "candidate_judged")
    ]
    sound = [test for test in state.finished_tests if test.outcome not in BROKEN]
    made = Counter((models_in(state, test.id), test.run) for test in sound)
    assert set(made.values()) == {1}, "a finished test was made again"
    assert state.status == "finished"
    return story(state), verdicts


def came_of(run: Path) -> Counter:
    """How many engines worked on a run, how many of its tests ended, and how many were broken or
    lost by kills.
    """
    engines = len(told(run, "engine_started"))
    outcomes = Counter(test.outcome for test in state_of(run).tests)
    broken, lost = outcomes.pop("error", 0), outcomes.pop("lost", 0)
    return Counter(engines=engines, ended=outcomes.total(), broken=broken, lost=lost)


@pytest.mark.programs
def test_killed_at_random_moments_it_ends_as_if_nothing_had_happened(tmp_path, monkeypatch):
    monkeypatch.setenv("DDENV_HOME", str(tmp_path / "home"))
    undisturbed = new_run(tmp_path, "undisturbed")
    assert start_engine(undisturbed, EngineOptions(jobs=2)).wait(PATIENCE) == 0, last_words(
        undisturbed
    )
    expected, dice = what_became(undisturbed), random.Random(KILLS)
    left, number, came = KILLS, 0, Counter()
    while left > 0:
        number += 1
        run = new_run(tmp_path, f"run-{number}")
        finished = False
        while not finished:
            left -= lives(run, dice, left)
            finished = state_of(run).status == "finished"
        assert what_became(run) == expected, number
        came += came_of(run)
    print(f"{KILLS} kills in {number} runs: {dict(came)}")
