"""The engine as a program on a disk that takes no more, and stopped with its workers: nothing is
lost, nothing counts as late.
"""

import os
import resource
import signal
import sys
import time

import pytest

from ddenv.runfile.integrity import faults, whole
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.engine_job import EngineOptions
from ddenv.runs.programs import start_engine
from tests.engine.reading import state_of
from tests.waiting import wait_until
from tests.wall import wall

# Maximum real time of a test, s: a machine that does much else takes a second for what takes a
# tenth alone.
LIMIT = 8.0
# What a file may still grow by, bytes.
LEFT = 65_536
pytestmark = [
    pytest.mark.programs,
    pytest.mark.skipif(sys.platform != "linux", reason="needs Linux's prlimit"),
]


@pytest.fixture
def path(tmp_path):
    create_run(wall(simulation={"wall_timeout": LIMIT}), tmp_path / "a.ddenv")
    return tmp_path / "a.ddenv"


@pytest.fixture
def engine(path):
    process = start_engine(path, EngineOptions(jobs=2))
    yield process
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGCONT)
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def at_work(path):
    with RunFile(path) as file:
        return file.live()


def limit_files(engine, most):
    """Files of the engine may have at most so many bytes."""
    resource.prlimit(engine.pid, resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))


def ends_well(path, engine):
    """The engine comes to its end, with a run file that has no fault."""
    wait_until(lambda: engine.poll() is not None, path.with_name("a.ddenv.log").read_text)
    assert (state_of(path).status, engine.returncode) == ("finished", 0)
    with RunFile(path) as file:
        assert faults(file) == [] and whole(file).trouble == ""


def test_a_file_that_may_not_grow_stops_no_reduction(path, engine):
    log = path.with_name("a.ddenv.log")
    wait_until(lambda: state_of(path).tests_done >= 1, log.read_text)
    limit_files(engine, path.stat().st_size)
    # What may not be written waits, and is not said of the disk.
    wait_until(
        lambda: "waits until the limit of a file's size (ulimit -f) is raised" in log.read_text(),
        log.read_text,
    )
    assert "MB are free" not in log.read_text()
    before = state_of(path).tests_done
    assert engine.poll() is None
    limit_files(engine, resource.RLIM_INFINITY)
    ends_well(path, engine)
    assert state_of(path).tests_done > before


def test_no_test_starts_whose_result_a_file_may_not_hold(path, engine):
    # The engine is still being loaded.
    limit_files(engine, path.stat().st_size + LEFT)
    wait_until(lambda: state_of(path).file_is_full, path.with_name("a.ddenv.log").read_text)
    assert state_of(path).tests_done == 0
    limit_files(engine, resource.RLIM_INFINITY)
    ends_well(path, engine)
    assert not state_of(path).file_is_full


def test_no_test_is_late_because_all_were_stopped(path, engine):
    log = path.with_name("a.ddenv.log")
    for _ in range(2):
        wait_until(lambda: at_work(path), log.read_text)
        os.killpg(engine.pid, signal.SIGSTOP)
        # Longer than a test may take.
        until = time.monotonic() + LIMIT + 1.0
        wait_until(lambda until=until: time.monotonic() > until)
        os.killpg(engine.pid, signal.SIGCONT)
    wait_until(lambda: engine.poll() is not None, log.read_text)
    state = state_of(path)
    assert state.status == "finished", state.reason
    assert not {test.outcome for test in state.finished_tests} & {"timeout", "error"}
