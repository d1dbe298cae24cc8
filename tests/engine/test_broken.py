"""Own simulators under a pool and an engine: they break, hang and are killed, and nothing of them
is left.
"""

import os
import signal
import subprocess
import sys
import tempfile
import uuid
from pathlib import Path

import pytest

from ddenv.engine.pool import Pool
from ddenv.engine.scheduler import MOST_BROKEN
from ddenv.engine.worker import Run
from ddenv.errors import UserError
from ddenv.runs.creation import create_run
from ddenv.runs.engine_job import EngineOptions
from ddenv.runs.experiment import load_parts
from ddenv.runs.programs import start_engine
from ddenv.runs.trust import program_of, trust
from ddenv.world.scenario import Scenario
from tests.engine.reading import events, send, state_of
from tests.engine.test_pool import EVERYTHING, result, workers
from tests.robot.external.own import FAMILY, SLEEP, TOKEN, own_scenario, processes_with
from tests.tiers import slow
from tests.waiting import PATIENCE, wait_until

COMMAND = "DDENV_WORLD="


@pytest.fixture(autouse=True)
def token(tmp_path, monkeypatch):
    """What stands in the environment of all that the test starts; in the end nothing of it is
    left.
    """
    token = uuid.uuid4().hex
    monkeypatch.setenv(TOKEN, token)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setenv("DDENV_HOME", str(tmp_path / "home"))
    yield token
    wait_until(lambda: not processes_with(token, COMMAND) and not list(temporary.glob("ddenv-*")))


def create_trusted(scenario: Scenario, run: Path) -> None:
    create_run(scenario, run)
    trust(program_of(scenario))


def own_pool(folder: Path, code: str, **options) -> Pool:
    scenario = own_scenario(folder, code, **options)
    return Pool(scenario, *load_parts(scenario), 1)


def test_a_worker_that_is_killed_takes_its_command_along_and_the_next_one_works(tmp_path, token):
    once = (
        "import os, sys\nif os.path.exists('again'):\n    print('0,0,0,0,0,0,0,1')\n    "
        f"sys.exit()\n{FAMILY}"
    )
    pool = own_pool(tmp_path, once + SLEEP)
    try:
        pool.submit(1, Run(keep=EVERYTHING, seed=0))
        wait_until(lambda: pool.finished(0.0) or pool.live())
        (tmp_path / "again").touch()
        for pid in workers(pool):
            os.kill(pid, signal.SIGKILL)
        test, broken = result(pool)
        assert (test, broken.outcome) == (1, "error")
        wait_until(lambda: not processes_with(token, COMMAND))
        pool.submit(2, Run(keep=EVERYTHING, seed=0))
        assert result(pool)[1].outcome == "pass"
    finally:
        pool.close()


def test_a_command_that_hangs_is_told_with_its_reason_and_its_worker_lives_on(tmp_path):
    pool = own_pool(tmp_path, FAMILY + SLEEP, wall_timeout=0.5)
    try:
        for test in (1, 2):
            pool.submit(test, Run(keep=EVERYTHING, seed=0))
            late = result(pool)[1]
            assert (late.outcome, late.failure) == ("error", "took longer than 0.5 s of wall clock")
            before = workers(pool)
        assert workers(pool) == before
        # A simulator of the user's gets the environment as it is.
        assert "GLIBC_TUNABLES" not in Path(f"/proc/{before[0]}/environ").read_text()
    finally:
        pool.close()


def test_a_command_that_went_missing_is_told(tmp_path):
    scenario = own_scenario(tmp_path, SLEEP)
    parts = load_parts(scenario)
    pool = Pool(
        scenario.model_copy(
            update={"oracle": scenario.oracle.model_copy(update={"command": "./gone"})}
        ),
        *parts,
        1,
    )
    try:
        pool.submit(1, Run(keep=EVERYTHING, seed=0))
        with pytest.raises(UserError, match=r"oracle.command: .*gone"):
            result(pool)
    finally:
        pool.close()


@pytest.mark.parametrize(
    "way", slow(pytest.mark.programs, ["killed", "terminated", "stopped"], but=["killed"])
)
def test_an_engine_that_ends_takes_its_commands_along(tmp_path, token, way):
    run = tmp_path / "run.ddenv"
    create_trusted(own_scenario(tmp_path, FAMILY + SLEEP), run)
    engine = start_engine(run, EngineOptions(jobs=2))
    wait_until(lambda: len(processes_with(token, COMMAND)) >= 6)
    if way == "stopped":
        send(run, "stop")
    else:
        engine.send_signal(signal.SIGKILL if way == "killed" else signal.SIGTERM)
    engine.wait(PATIENCE)
    wait_until(lambda: not processes_with(token))


# Fails where the deck and the wall are; from the fourth run on it breaks until it is mended.
BREAKS = """
    import os, sys
    with open("made", "a") as made:
        made.write("x")
        number = made.tell()
    if number > 3 and not os.path.exists("mended"):
        print("no display", file=sys.stderr)
        sys.exit(2)
    print("0,0,0,0,0,0,0,1")
    world = open(sys.argv[1]).read()
    sys.exit('model name="deck"' in world and 'model name="wall"' in world)
"""


@pytest.mark.programs
def test_a_simulator_that_is_out_of_order_stops_the_engine_and_it_can_go_on(tmp_path):
    run = tmp_path / "run.ddenv"
    scenario = own_scenario(
        tmp_path, BREAKS, "{world}", baseline_runs=3, iterations=1, growth="paper", skip="known"
    )
    create_trusted(scenario, run)
    done = _resume(run)
    assert done.returncode == 2
    assert done.stderr == (
        f"ddenv: {MOST_BROKEN} tests in a row broke; the last one: the command's exit code is 2, "
        "neither 0 nor 1: no display; "
        f"fix this and continue with 'ddenv resume {run}' (it repeats these tests)\n"
    )
    state = state_of(run)
    assert state.status == "failed"
    assert [test.outcome for test in state.tests].count("error") == MOST_BROKEN
    (tmp_path / "mended").touch()
    done = _resume(run)
    assert done.returncode in (0, 1), done.stderr
    state = state_of(run)
    assert state.status == "finished"
    assert {"deck", "wall"} <= set(state.environment)
    # What broke proves nothing.
    assert state.minimal == (set(state.environment) == {"deck", "wall"})
    # No finished test was made again, but for the replays of runs that showed f.
    made = len((tmp_path / "made").read_text()) - sum(
        event.kind == "comparing" for event in events(run)
    )
    assert made - 2 <= sum(test.is_finished for test in state.tests) <= made


def _resume(run: Path) -> subprocess.CompletedProcess:
    words = [sys.executable, "-m", "ddenv", "resume", str(run), "--jobs", "2"]
    return subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE)


@pytest.mark.programs
def test_where_all_of_the_baseline_breaks_there_is_nothing_to_reduce(tmp_path):
    run = tmp_path / "run.ddenv"
    create_trusted(
        own_scenario(tmp_path, "import sys; print('no licence', file=sys.stderr); sys.exit(7)"), run
    )
    done = _resume(run)
    assert done.returncode == 1
    assert (
        "no baseline run finished: the command's exit code is 7, neither 0 nor 1: no licence"
        in done.stdout
    )
