"""What runs inside a Dask worker: each test in a child process that keeps the simulator: Dask
cannot end what hangs.
"""

from __future__ import annotations

import multiprocessing
import pickle
import platform
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from distributed import get_worker

from ddenv import __version__
from ddenv.engine.pool import Pool
from ddenv.engine.shared import machine, simulator
from ddenv.engine.worker import Result, Run
from ddenv.world.command import command_words
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario

# How long to wait for a test before looking whether it is still wanted, s.
LOOK = 0.2
# The time between two reports of a running test, s.
PERIOD = 0.5
# What a test needs. It is sent once to each worker, as bytes.
Parts = tuple[Scenario, World, Model]


@dataclass(frozen=True)
class Asked:
    """A test to make in the world of `run`, whose progress goes to `topic`."""

    run: str
    topic: str
    test: int
    task: Run


@dataclass(frozen=True)
class Hello:
    """Who a worker is, and what it computes with."""

    host: str
    version: str
    simulator: str
    machine: str


class NotWanted(Exception):
    """Nobody waits for the test any more."""


def greet(parts: bytes, asked: Asked) -> tuple[Hello, Result | None]:
    """A worker's hello, and the test by which its bits are compared; none in a simulator of the
    user's own. Raises UserError where that cannot be started.
    """
    hello = Hello(platform.node(), __version__, simulator(), machine())
    # The name of the run begins with the engine's version: another one may understand nothing else.
    if hello.version != asked.run.partition(" ")[0]:
        return hello, None
    known: Parts = pickle.loads(parts)
    if known[0].oracle is not None:
        command_words(known[0])
        return hello, None
    return hello, make(parts, asked)


def make(parts: bytes, asked: Asked) -> Result:
    """Makes a test in a child process. Raises UserError if the world cannot be simulated, and
    NotWanted.
    """
    worker = get_worker()
    key = worker.get_current_task()
    with _child(parts, asked.run) as child:
        child.submit(asked.test, asked.task)
        due = 0.0
        while not (ended := child.finished(LOOK)):
            # Dask itself never stops a task that runs.
            task = worker.state.tasks.get(key)
            if task is None or task.state != "executing":
                raise NotWanted(key)
            if time.monotonic() > due:
                due = time.monotonic() + PERIOD
                for live, real in child.live():
                    row = {
                        "test": live.test,
                        "time": live.time,
                        "pose": list(live.pose),
                        "models": live.models,
                    }
                    worker.log_event(asked.topic, row | {"real": real})
    return ended[0][1]


# The idle children, with the run that each is for.
_idle: list[tuple[str, Pool]] = []
_lock = threading.Lock()


@contextmanager
def _child(parts: bytes, run: str) -> Iterator[Pool]:
    """A child process for `run`, kept for the next test unless this one goes wrong."""
    with _lock:
        kept = next((one for one in _idle if one[0] == run), _idle[0] if _idle else None)
        if kept is not None:
            _idle.remove(kept)
    if kept is not None and kept[0] == run:
        child = kept[1]
    else:
        if kept is not None:
            # A worker has memory for one a thread.
            kept[1].close()
        # Dask's nanny starts workers as daemons, which may have no children. Ours follow their
        # parent's end by themselves.
        multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]  # there is no public way
        known: Parts = pickle.loads(parts)
        child = Pool(*known, 1, at_a_time=get_worker().state.nthreads)
    try:
        yield child
    except BaseException:
        child.close()
        raise
    with _lock:
        _idle.append((run, child))


def forget(run: str) -> None:
    """Ends the idle children of `run`."""
    with _lock:
        gone = [one for one in _idle if one[0] == run]
        for one in gone:
            _idle.remove(one)
    for _, child in gone:
        # This is the thread in which the worker talks with the scheduler.
        threading.Thread(target=child.close).start()
