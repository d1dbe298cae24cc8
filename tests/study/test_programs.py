"""`ddenv study` as it is typed, on a simulator of a few lines: killed, interrupted, and at its end
the same as undisturbed.
"""

import csv
import os
import signal
import subprocess
import sys

import pytest

from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.store import RunFile
from ddenv.study.folder import sessions
from ddenv.study.plan import run_path
from tests.engine.reading import events
from tests.study.made import plan_of, wall
from tests.study.quick import Lab
from tests.study.test_conduct import fails, study, told
from tests.waiting import PATIENCE, wait_until

# Counts its runs, and waits before each unless it may go on: so many at a time.
ROBOT = """
echo >> made
while [ $(wc -l < made) -gt $(cat most) ]; do sleep 0.05; done
echo 0,0,0,0,0,0,0,1
echo 1,2,0,0,0,0,0,1
grep -q 'model name="deck"' $1 && grep -q 'model name="wall"' $1 && exit 1
exit 0
"""
WORDS = (
    *("--pairs", "model2model/sequential", "--algorithms", "splitting", "--jobs", "1"),
    *("-o", "study", "--keep-rate", "0.5"),
)


@pytest.fixture
def start(tmp_path, monkeypatch):
    """Starts the study; nothing of it is left in the end."""
    monkeypatch.setenv("DDENV_HOME", str(tmp_path / "home"))
    started = []

    def begin():
        words = [sys.executable, "-m", "ddenv", "study", "--scenarios", "wall.yaml", *WORDS]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        started.append(subprocess.Popen(words, cwd=tmp_path, **pipes))
        return started[-1]

    yield begin
    (tmp_path / "most").write_text("1000")
    for each in started:
        each.kill()
        each.communicate()


def engine_of(run):
    """The process of the engine that was started last."""
    with RunFile(run) as file:
        return [one.event.pid for one in file.events() if one.kind == "engine_started"][-1]


@pytest.mark.programs
def test_whatever_happens_to_a_study_it_comes_to_the_same_end(tmp_path, start, monkeypatch):
    (tmp_path / "robot.sh").write_text(ROBOT)
    made, most = tmp_path / "made", tmp_path / "most"
    plan = plan_of(
        wall(tmp_path, oracle="sh robot.sh {world}"),
        pairs=WORDS[1],
        algorithms=WORDS[3],
        keep_rate=0.5,
    )
    folder, run = tmp_path / "study", run_path(tmp_path / "study", plan.cells[0])

    def stands_at(number):
        """The next test waits."""
        wait_until(lambda: made.exists() and len(made.read_text()) > number)

    # Killed, its engine lives on, until it is killed as well.
    most.write_text("2")
    first = start()
    stands_at(2)
    first.kill()
    first.wait()
    assert engine_is_alive(run)
    os.kill(engine_of(run), signal.SIGKILL)
    wait_until(lambda: not engine_is_alive(run))

    # Interrupted, it stops its engine and writes what it has.
    most.write_text("6")
    second = start()
    stands_at(6)
    second.send_signal(signal.SIGINT)
    said, complained = second.communicate(timeout=PATIENCE)
    assert (second.returncode, complained) == (130, "interrupted; the same command continues\n")
    assert "0 of 1 cell certified; wrote study/study.html" in said
    assert (folder / "study.html").exists() and not engine_is_alive(run)

    # Nothing in its way any more.
    most.write_text("1000")
    third = start()
    said, complained = third.communicate(timeout=PATIENCE)
    assert (third.returncode, complained) == (0, "")
    assert "1 of 1 cell certified; wrote study/study.html" in said
    assert len(sessions(folder)) == 3

    # Of the tests that were in flight nothing is left, and no other one was made twice, but for
    # replays of runs that showed f.
    (row,) = csv.DictReader((folder / "study.csv").read_text().splitlines())
    replays = sum(event.kind == "comparing" for event in events(run))
    in_flight = len(made.read_text()) - int(row["tests"]) - int(row["certificate_tests"]) - replays
    # Of the two that were stopped one may have been a replay.
    assert in_flight in (1, 2)
    assert (row["left_f"], row["without_most"]) == (row["left_runs"], "0.0")

    Lab(monkeypatch, fails)
    assert study(tmp_path / "alone", plan, jobs=1)[0] == 0
    assert told(folder) == told(tmp_path / "alone")
