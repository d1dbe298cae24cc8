"""The engine as a program on a disk that takes no more, and stopped with its workers: nothing is lost, nothing counts as late."""

import os
import resource
import signal
import sys
import time

import pytest

from ddenv.runfile.integrity import faults, whole
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.programs import start_engine
from tests.engine.reading import state_of
from tests.waiting import wait_until
from tests.wall import wall

LIMIT = 3.0
pytestmark = [pytest.mark.programs, pytest.mark.skipif(sys.platform != "linux", reason="needs Linux's prlimit")]


@pytest.fixture
def path(tmp_path):
    create_run(wall(simulation={"wall_timeout": LIMIT}), tmp_path / "a.ddenv")
    return tmp_path / "a.ddenv"


@pytest.fixture
def engine(path):
    process = start_engine(path, 2)
    yield process
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGCONT)
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def at_work(path):
    with RunFile(path) as file:
        return file.live()


def test_a_file_that_may_not_grow_stops_no_reduction(path, engine):
    log = path.with_name("a.ddenv.log")
    wait_until(lambda: state_of(path).tests_done >= 1, log.read_text)
    resource.prlimit(engine.pid, resource.RLIMIT_FSIZE, (path.stat().st_size, resource.RLIM_INFINITY))
    # It is said where the user looks, and not as a full disk.
    wait_until(lambda: state_of(path).file_is_full, log.read_text)
    assert "MB are free" not in log.read_text()
    before = state_of(path).tests_done
    assert engine.poll() is None
    resource.prlimit(engine.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    wait_until(lambda: engine.poll() is not None, log.read_text)
    state = state_of(path)
    assert (state.status, engine.returncode) == ("finished", 0) and state.tests_done > before
    with RunFile(path) as file:
        assert faults(file) == [] and whole(file).trouble == ""


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
