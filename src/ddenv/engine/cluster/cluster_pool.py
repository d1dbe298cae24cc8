"""Makes tests on the workers of a Dask cluster, as `Pool` does in processes here. A worker gets
tests once its first run of the whole world has the bits that it has here.
"""

from __future__ import annotations

import pickle
import threading
import uuid
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np
from distributed import Client, Future, KilledWorker, Security, SSHCluster

from ddenv import __version__
from ddenv.engine.cluster.made_there import Asked, Hello, NotWanted, forget, greet, make
from ddenv.engine.pool import Pool
from ddenv.engine.shared import machine, simulator
from ddenv.engine.worker import AskSettled, Broken, Ended, Result, Run, Start, reason_of
from ddenv.errors import UserError
from ddenv.robot.result import RunResult
from ddenv.runfile.store import Live
from ddenv.runs.trust import hosts_of
from ddenv.text import count, printable
from ddenv.world.access import is_file
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario, seed_of

# The number of the test made here to compare with.
REFERENCE = 0
# The maximum time until a result that is there has come, s. A client that is closed meanwhile would
# never bring it, and its thread would keep the engine from ending.
FETCHED = 20.0
# The time between two looks at who is there, and between two attempts to connect, s.
PERIOD = 0.5
AGAIN = 2.0
# How long a scheduler may take to answer, and to say goodbye, s.
ANSWER = 10.0
GOODBYE = 2.0


class Link:
    """The connection to the scheduler of `cluster`, in a thread of its own; it is made again when
    it is lost.

    It calls `attached` with each new connection, `there` with the addresses of all workers and how
    many tests each can make at a time, and `lost` with the reason.
    """

    def __init__(
        self,
        cluster: str,
        attached: Callable[[Client], None],
        there: Callable[[Mapping[str, int]], None],
        lost: Callable[[str], None],
    ) -> None:
        """Raises UserError if no scheduler answers."""
        self._cluster = cluster
        self._attached = attached
        self._there = there
        self._lost = lost
        self._client: Any = None
        self._ssh: Any = None
        self._closed = threading.Event()
        try:
            self._connect()
        except Exception as error:
            self._end()
            raise UserError(
                f"{cluster}: no Dask scheduler can be used there ({reason_of(error)}); start it, "
                "or run the tests on this machine with --cluster here"
            ) from None
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def _connect(self) -> None:
        hosts = hosts_of(self._cluster)
        how = {"timeout": ANSWER, "set_as_default": False, "name": "ddenv"}
        if hosts:
            # Dask makes the first one its scheduler.
            self._ssh = SSHCluster([hosts[0], *hosts])
            self._client = Client(self._ssh, **how)
        elif is_file(Path(self._cluster)):
            self._client = Client(scheduler_file=self._cluster, **how)
        else:
            if self._cluster.startswith("tls:"):
                how["security"] = Security(require_encryption=True)
            self._client = Client(self._cluster, **how)

    def _follow(self) -> None:
        while not self._closed.is_set():
            if (client := self._client) is not None:
                self._attached(client)
                why = self._watch(client)
                if self._closed.is_set():
                    return
                self._lost(why)
                self._end()
            if self._closed.wait(AGAIN):
                return
            try:
                self._connect()
            except Exception:
                # It is not there yet.
                self._end()

    def _watch(self, client: Client) -> str:
        """Tells who is there, as often as that changes, until the scheduler is lost; returns
        why.
        """
        before = None
        comm = client.scheduler_comm
        while not self._closed.wait(PERIOD):
            # Dask connects again by itself, but has forgotten what it was asked.
            if client.status != "running" or client.scheduler_comm is not comm:
                return "the connection broke"
            try:
                threads = dict(client.ncores())
            except Exception as error:
                return reason_of(error)
            if threads != before:
                before = threads
                self._there(threads)
        return ""

    def _end(self) -> None:
        ending = (self._client, self._ssh)
        self._client = None
        self._ssh = None
        for each in ending:
            # What is left of a broken connection may complain.
            with suppress(Exception):
                if each is not None:
                    each.close(timeout=GOODBYE)

    def close(self) -> None:
        """Ends the connection, and what was started over SSH."""
        self._closed.set()
        self._end()
        self._thread.join(ANSWER)


@dataclass(eq=False, kw_only=True)
class _Worker:
    """A Dask worker that can make `threads` tests at a time; `accepted` once it has shown the same
    bits. `hello` is None until it has answered. `asked` has by key what it does now, None for a
    hello; the scheduler drops it with its future.
    """

    address: str
    threads: int
    hello: Hello | None = None
    accepted: bool = False
    asked: dict[str, tuple[Asked | None, Future[Any]]] = field(default_factory=dict)

    @property
    def free(self) -> int:
        if self.accepted:
            return self.threads - len(self.asked)
        return 0

    @property
    def name(self) -> str:
        if self.hello is None:
            return self.address
        return f"{self.address} ({printable(self.hello.host)})"


class ClusterPool:
    """The workers of the `cluster` of a scenario, and one process here while something is made to
    compare with.
    """

    def __init__(
        self,
        scenario: Scenario,
        world: World,
        robot: Model,
        cluster: str,
        tell: Callable[[int, str], None],
    ) -> None:
        """Calls `tell` with the number of tests that the cluster can run at the same time, and a
        sentence. Raises UserError if no scheduler answers, or where Drake is needed and not
        installed.
        """
        self._cluster = cluster
        self._tell = tell
        self._parts = (scenario, world, robot)
        self._blob = pickle.dumps(self._parts)
        self._run = f"{__version__} {sha256(self._blob).hexdigest()}"
        self._topic = f"ddenv-{uuid.uuid4().hex}"
        self._whole = Run(
            keep=frozenset(world.elements(scenario.protected)), seed=seed_of(scenario.reduction, 0)
        )
        self._workers: dict[str, _Worker] = {}
        self._waiting: list[Asked] = []
        # Workers that have answered, each with the run that it made to compare.
        self._greeted: list[tuple[_Worker, Result | None]] = []
        self._ready: list[Ended] = []
        self._progress: dict[int, Mapping[str, Any]] = {}
        self._news: list[str] = []
        self._said = 0
        self._client: Client | None = None
        self._sent: Future[bytes] | None = None
        # The process here that makes the run to compare with; runs of the user's own simulator are
        # not compared.
        self._home = Pool(*self._parts, 1) if scenario.oracle is None else None
        self._reference: RunResult | None = None
        # What has happened in other threads, to be done in that of the engine.
        self._due: SimpleQueue[Callable[[], None]] = SimpleQueue()
        tell(0, f"asking the Dask scheduler of {cluster}")
        self._link = Link(
            cluster, self._later(self._attached), self._later(self._there), self._later(self._lost)
        )
        if self._home is not None:
            self._home.submit(REFERENCE, self._whole)

    def _later(self, happened: Callable[..., None]) -> Callable[..., None]:
        return lambda *what: self._due.put(partial(happened, *what))

    @property
    def _tests(self) -> list[int]:
        asked = (asked for worker in self._workers.values() for asked, _ in worker.asked.values())
        return [each.test for each in asked if each is not None]

    @property
    def _room(self) -> int:
        return sum(worker.threads for worker in self._workers.values() if worker.accepted)

    @property
    def idle(self) -> int:
        """How many more tests can start now."""
        return max(0, self._room - len(self._tests) - len(self._waiting))

    @property
    def busy(self) -> int:
        return len(self._tests) + len(self._waiting) + len(self._ready)

    def submit(self, test: int, run: Run) -> None:
        """Has a worker make a test, as soon as there is one; as `Pool.submit`."""
        if self._reference is not None and replace(run, limit=None) == self._whole:
            # It was made here in any case.
            self._ready.append((test, self._reference))
            return
        self._waiting.append(Asked(self._run, self._topic, test, run))
        self._send()

    def finished(self, seconds: float) -> list[Ended]:
        """As `Pool.finished`. Raises UserError, too, if the run to compare with broke."""
        if self._home is not None and self._reference is None:
            for _, result in self._home.finished(0.0):
                if isinstance(result, Broken):
                    what = "the first run of the whole world, to compare the cluster with, broke"
                    raise UserError(f"{what}: {result.failure}")
                self._reference = result
        with suppress(Empty):
            self._due.get(timeout=0.0 if self._ready else seconds)()
            while True:
                self._due.get_nowait()()
        self._take_in()
        self._send()
        if self._room != self._said:
            workers = sum(worker.accepted for worker in self._workers.values())
            tests = count(self._room, "test")
            self._news.append(
                f"{count(workers, 'worker')} of the cluster can run {tests} at the same time"
            )
        if self._news:
            self._said = self._room
            self._tell(self._room, "; ".join(self._news))
            self._news.clear()
        ready = self._ready
        self._ready = []
        return sorted(ready, key=lambda one: one[0])

    # What happens to the cluster.

    def _attached(self, client: Client) -> None:
        self._client = client
        # The progress of running tests; it comes in Dask's own thread.
        self._client.subscribe_topic(
            self._topic, lambda event: self._progress.update({event[1]["test"]: event[1]})
        )
        with warnings.catch_warnings():
            # A world with meshes is large, and goes out once.
            warnings.simplefilter("ignore")
            # As a task it is made again if the workers that hold it die.
            self._sent = self._client.submit(
                bytes, self._blob, key=f"parts-{self._topic}-{uuid.uuid4().hex}", pure=False
            )
        self._news.append(f"attached to the Dask scheduler of {self._cluster}")

    def _lost(self, why: str) -> None:
        self._client = self._sent = None
        for address in list(self._workers):
            self._gone(address)
        without = "To continue without it, stop the run and resume it with --cluster here"
        self._news.append(
            f"the Dask scheduler of {self._cluster} is lost ({why}); waiting for it. {without}"
        )

    def _there(self, threads: Mapping[str, int]) -> None:
        gone = [address for address in self._workers if address not in threads]
        lost = sum(self._gone(address) for address in gone)
        if gone:
            again = f"; {count(lost, 'test')} repeated elsewhere" if lost else ""
            self._news.append(f"{count(len(gone), 'worker')} left the cluster{again}")
        new = [
            _Worker(address=address, threads=threads[address])
            for address in threads
            if address not in self._workers
        ]
        for worker in new:
            self._workers[worker.address] = worker
            self._hand_out(
                worker, greet, Asked(self._run, self._topic, REFERENCE, self._whole), None
            )
        if new:
            first = ": each first runs the whole world once, to compare the bits with ours"
            self._news.append(
                f"{count(len(new), 'worker')} joined the cluster{first if self._home else ''}"
            )

    def _gone(self, address: str) -> int:
        """Forgets a worker; returns how many of its tests have to be made again."""
        worker = self._workers.pop(address)
        again = [asked for asked, _ in worker.asked.values() if asked is not None]
        worker.asked.clear()
        for asked in again:
            self._wait_again(asked)
        return len(again)

    def _wait_again(self, asked: Asked) -> None:
        self._progress.pop(asked.test, None)
        self._waiting = sorted([*self._waiting, asked], key=lambda one: one.test)

    def _send(self) -> None:
        """Hands tests to the workers with the most free threads, in the order of the algorithm."""
        while self._waiting and self._client is not None:
            worker = max(self._workers.values(), key=lambda worker: worker.free, default=None)
            if worker is None or worker.free <= 0:
                return
            asked = self._waiting.pop(0)
            self._hand_out(worker, make, asked, asked)

    def _hand_out(
        self, worker: _Worker, what: Callable[..., Any], words: Asked, asked: Asked | None
    ) -> None:
        assert self._client is not None
        key = f"{what.__name__}-{uuid.uuid4().hex}"
        try:
            how = {"key": key, "workers": [worker.address], "pure": False, "priority": -words.test}
            future = self._client.submit(what, self._sent, words, **how)
        except Exception:
            # The connection has just broken: the link will say so.
            if asked is not None:
                self._wait_again(asked)
            self._client = None
            return
        worker.asked[key] = asked, future
        ended = self._later(self._ended)

        def answer(done: Future[Any]) -> None:
            try:
                came = done.result(timeout=FETCHED)
            except BaseException as error:
                came = error
            ended(worker, key, came)

        future.add_done_callback(answer)

    def _ended(self, worker: _Worker, key: str, answer: Any) -> None:
        """A result, a hello with a run, or an exception came back. Raises UserError if the world
        cannot be simulated.
        """
        if key not in worker.asked:
            # The worker was lost, and the test is made elsewhere.
            return
        asked, _ = worker.asked.pop(key)
        if asked is None:
            if not isinstance(answer, BaseException):
                worker.hello, run = answer
                self._greeted.append((worker, run))
            elif not isinstance(answer, CancelledError | KilledWorker):
                self._leave_out(worker, f"it cannot run tests: {reason_of(answer)}")
            return
        if isinstance(answer, CancelledError | NotWanted | KilledWorker | TimeoutError):
            self._wait_again(asked)
            return
        self._progress.pop(asked.test, None)
        if isinstance(answer, UserError):
            raise answer
        broke = isinstance(answer, BaseException)
        self._ready.append((asked.test, Broken("error", reason_of(answer)) if broke else answer))

    def _take_in(self) -> None:
        """Compares what new workers made, once there is something to compare with."""
        if self._home is not None and self._reference is None:
            return
        for worker, run in self._greeted:
            if worker.hello is None or worker is not self._workers.get(worker.address):
                continue
            if why := refusal(worker.hello, run, self._reference):
                self._leave_out(worker, why)
            else:
                worker.accepted = True
        self._greeted.clear()

    def _leave_out(self, worker: _Worker, why: str) -> None:
        self._news.append(f"worker {worker.name} is not used: {why}")

    def settle(self, elements: frozenset[str]) -> AskSettled:
        """As `Pool.settle`, in the process here once that has made the run to compare with."""
        asked: AskSettled | None = None

        def found() -> Start | Broken | None:
            nonlocal asked
            if asked is None and self._home is not None and self._reference is not None:
                asked = self._home.settle(elements)
            if asked is None:
                return None
            return asked()

        return found

    def live(self) -> list[tuple[Live, float]]:
        """As `Pool.live`."""
        rows = (row for test in self._tests if (row := self._progress.get(test)) is not None)
        return [
            (
                Live(
                    slot=row["test"],
                    test=row["test"],
                    time=row["time"],
                    pose=row["pose"],
                    models=row["models"],
                ),
                row["real"],
            )
            for row in rows
        ]

    def close(self) -> None:
        """Drops what runs: the workers end it by themselves."""
        if self._home is not None:
            self._home.close()
        client = self._client
        taken = [worker.address for worker in self._workers.values() if worker.accepted]
        self._workers.clear()
        if client is not None and taken:
            with suppress(Exception):
                client.sync(
                    client._run,
                    forget,
                    self._run,
                    workers=taken,
                    on_error="ignore",
                    callback_timeout=GOODBYE,
                )
        self._link.close()


def refusal(hello: Hello, there: Result | None, here: RunResult | None) -> str:
    """Why a worker is left out whose first run of the whole world is `there`; "" if it may make
    tests.

    Without a run `here` to compare with, only the version of ddenv counts.
    """
    if hello.version != __version__:
        return f"it has ddenv {hello.version}; this machine has ddenv {__version__}"
    if here is None:
        return ""
    if isinstance(there, Broken):
        return f"its first run of the whole world broke: {there.failure}"
    same = False
    if there is not None:
        ends = [(run.outcome, run.failure, run.cut, run.took_part) for run in (there, here)]
        rows, ours = ({**run.motions, "": run.trajectory} for run in (there, here))
        moved = rows.keys() == ours.keys() and all(
            np.array_equal(rows[name], ours[name]) for name in ours
        )
        same = moved and ends[0] == ends[1]
    if not same:
        theirs = f"{hello.simulator}, {hello.machine}"
        mine = f"{simulator()}, {machine()}"
        return (
            f"its first run of the whole world has different bits; it has {theirs}; this machine "
            f"has {mine}"
        )
    return ""
