"""Makes tests on the workers of a Dask cluster, as `Pool` does in processes here. Each test goes to one worker that is free.

A worker is asked before it gets a test: it makes the first run of the whole world, and is left out if its bits
are others than here.
"""

from __future__ import annotations

import math
import pickle
import uuid
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass, replace
from hashlib import sha256
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np
from distributed import Client, Future, KilledWorker

from ddenv import __version__
from ddenv.engine.cluster.link import GOODBYE, Attached, Link, Lost, There, in_a_line
from ddenv.engine.cluster.made_there import Asked, Hello, NotGreeted, NotWanted, forget, greet, make
from ddenv.engine.pool import Broken, Pool
from ddenv.engine.shared import machine, simulator
from ddenv.engine.worker import Start
from ddenv.errors import UserError
from ddenv.robot.result import RunResult
from ddenv.runfile.store import Live
from ddenv.text import count, printable
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario

# What is said of the cluster: how many tests it makes at the same time now, and a sentence.
Tell = Callable[[int, str], None]
# The number of the test made here to compare with.
REFERENCE = 0


@dataclass(frozen=True)
class _Worker:
    """A Dask worker that can make `threads` tests at the same time; `hello` is None until it has answered, `isin` whether it is
    taken in.
    """

    address: str
    threads: int
    hello: Hello | None = None
    isin: bool = False

    @property
    def name(self) -> str:
        return self.address if self.hello is None else f"{self.address} ({printable(self.hello.host)})"


@dataclass(frozen=True)
class _Flight:
    """What a worker was asked; the scheduler drops it with the `future`. `asked` is None for a hello."""

    address: str
    future: Future[Any]
    asked: Asked | None
    slot: int = 0


@dataclass(frozen=True)
class _Ended:
    """What came back for a key: a result, a hello with a run, or an exception."""

    key: str
    answer: Any


class ClusterPool:
    """The workers of the `cluster` of a scenario, and one process here while something is made to compare with."""

    def __init__(self, scenario: Scenario, world: World, robot: Model, cluster: str, tell: Tell) -> None:
        """Raises UserError if no scheduler answers, or where Drake is needed and not installed."""
        self._cluster, self._tell, self._parts = cluster, tell, (scenario, world, robot)
        self._blob = pickle.dumps(self._parts)
        self._run = f"{__version__} {sha256(self._blob).hexdigest()}"
        self._topic = f"ddenv-{uuid.uuid4().hex}"
        self._keys = 0
        self._whole = frozenset(world.elements(frozenset(scenario.protected))), scenario.reduction.seed
        self._workers: dict[str, _Worker] = {}
        self._flights: dict[str, _Flight] = {}
        self._waiting: list[Asked] = []
        self._greeted: list[tuple[str, Hello, RunResult | Broken | None]] = []
        self._ready: list[tuple[int, RunResult | Broken]] = []
        self._progress: dict[int, Mapping[str, Any]] = {}
        self._news: list[str] = []
        self._said = 0
        self._client: Client | None = None
        self._sent: Future[bytes] | None = None
        self._compares = scenario.oracle is None
        self._reference: RunResult | None = None
        self._same: list[int] = []
        self._home: Pool | None = None
        self._settling = False
        self._happenings: SimpleQueue[Any] = SimpleQueue()
        tell(0, f"asking the Dask scheduler of {cluster}")
        self._link = Link(cluster, self._happenings)
        if self._compares:
            self._here().submit(REFERENCE, *self._whole)

    def _here(self) -> Pool:
        """The process on this machine."""
        if self._home is None:
            self._home = Pool(*self._parts, 1)
        return self._home

    @property
    def idle(self) -> int:
        """How many more tests can start now."""
        made = sum(flight.asked is not None for flight in self._flights.values())
        return max(0, self._room - made - len(self._waiting))

    @property
    def busy(self) -> int:
        made = sum(flight.asked is not None for flight in self._flights.values())
        return made + len(self._waiting) + len(self._ready) + len(self._same)

    @property
    def _room(self) -> int:
        return sum(worker.threads for worker in self._workers.values() if worker.isin)

    def submit(self, test: int, keep: frozenset[str], seed: int, full: bool = True, limit: float | None = None) -> None:
        """Has a worker make a test, as soon as there is one; as `Pool.submit`."""
        if self._compares and full and (keep, seed) == self._whole:
            # It is made here in any case.
            self._same.append(test)
            return
        self._waiting.append(Asked(self._run, self._topic, test, keep, seed, full, limit))
        self._send()

    def finished(self, seconds: float) -> list[tuple[int, RunResult | Broken]]:
        """As `Pool.finished`: tests that have ended, waiting at most `seconds` for one."""
        self._look_here()
        with suppress(Empty):
            happened = self._happenings.get(timeout=0.0 if self._ready else seconds) if seconds else None
            while True:
                if happened is not None:
                    _HANDLED[type(happened)](self, happened)
                happened = self._happenings.get_nowait()
        self._take_in()
        self._send()
        self._say()
        ready, self._ready = self._ready, []
        return sorted(ready, key=lambda one: one[0])

    def _look_here(self) -> None:
        """Raises UserError if the run to compare with broke."""
        if self._home is not None and self._compares and self._reference is None:
            for _, result in self._home.finished(0.0):
                if isinstance(result, Broken):
                    raise UserError(
                        f"the first run of the whole world, to compare the cluster with, broke: {result.failure}"
                    )
                self._reference = result
        if self._reference is not None:
            self._ready += [(test, self._reference) for test in self._same]
            self._same.clear()
        if self._home is not None and not self._settling and (self._reference is not None or not self._compares):
            self._home.close()
            self._home = None

    # What happens to the cluster.

    def _attached(self, happened: Attached) -> None:
        self._client = happened.client
        self._client.subscribe_topic(self._topic, self._noted)
        with warnings.catch_warnings():
            # A world with meshes is large, and goes out once.
            warnings.simplefilter("ignore")
            # As a task it is made again if the workers that hold it die.
            self._sent = self._client.submit(bytes, self._blob, key=self._key("parts"), pure=False)
        self._news.append(f"attached to the Dask scheduler of {self._cluster}")

    def _lost(self, happened: Lost) -> None:
        self._client = self._sent = None
        for address in list(self._workers):
            self._gone(address)
        self._news.append(
            f"the Dask scheduler of {self._cluster} is lost ({happened.why}); waiting for it. To go on without it, stop the run, "
            "and resume it with --cluster here"
        )

    def _there(self, happened: There) -> None:
        gone = [address for address in self._workers if address not in happened.threads]
        lost = sum(self._gone(address) for address in gone)
        if gone:
            again = f"; {count(lost, 'test')} made again elsewhere" if lost else ""
            self._news.append(f"{count(len(gone), 'worker')} left the cluster{again}")
        new = [address for address in happened.threads if address not in self._workers]
        for address in new:
            self._workers[address] = _Worker(address, happened.threads[address])
            self._ask(address)
        if new:
            first = ": first the whole world once, as it is made here, to compare the bits" if self._compares else ""
            self._news.append(f"{count(len(new), 'worker')} came to the cluster{first}")

    def _gone(self, address: str) -> int:
        """Forgets a worker; returns how many of its tests have to be made again."""
        del self._workers[address]
        keys = [key for key, flight in self._flights.items() if flight.address == address]
        again = [asked for key in keys if (asked := self._flights.pop(key).asked) is not None]
        self._wait_again(again)
        return len(again)

    def _wait_again(self, tests: list[Asked]) -> None:
        for asked in tests:
            self._progress.pop(asked.test, None)
        self._waiting = sorted([*self._waiting, *tests], key=lambda asked: asked.test)

    def _noted(self, event: tuple[float, Mapping[str, Any]]) -> None:
        """A running test's progress; comes in Dask's own thread."""
        self._progress[event[1]["test"]] = event[1]

    # Tests.

    def _key(self, what: str) -> str:
        self._keys += 1
        return f"{what}-{self._keys}-{self._topic}"

    def _ask(self, address: str) -> None:
        """Asks a new worker who it is, and what bits it computes."""
        self._hand_out(
            address, greet, "hello", Asked(self._run, self._topic, REFERENCE, *self._whole, True, None), None
        )

    def _send(self) -> None:
        """Hands tests to free workers, in the order of the algorithm."""
        while self._waiting and self._client is not None and (address := self._free()) is not None:
            asked = self._waiting.pop(0)
            self._hand_out(address, make, "test", asked, asked)

    def _free(self) -> str | None:
        """The worker with the most free threads; None if all are busy."""
        free = {worker.address: worker.threads for worker in self._workers.values() if worker.isin}
        for flight in self._flights.values():
            if flight.address in free:
                free[flight.address] -= 1
        best = max(free, key=lambda address: free[address], default=None)
        return best if best is not None and free[best] > 0 else None

    def _hand_out(self, address: str, what: Callable[..., Any], name: str, words: Asked, asked: Asked | None) -> None:
        assert self._client is not None
        key = self._key(name)
        try:
            future = self._client.submit(
                what, self._sent, words, key=key, workers=[address], pure=False, priority=-words.test
            )
        except Exception:
            # The connection has just broken: the link will say so.
            if asked is not None:
                self._wait_again([asked])
            self._client = None
            return
        used = {flight.slot for flight in self._flights.values()}
        slot = next(number for number in range(len(used) + 1) if number not in used)
        self._flights[key] = _Flight(address, future, asked, slot)
        future.add_done_callback(lambda done: self._happenings.put(_Ended(key, _answer(done))))

    def _ended(self, happened: _Ended) -> None:
        """Raises UserError if the world cannot be simulated."""
        flight = self._flights.pop(happened.key, None)
        if flight is None:
            # Its worker was lost, and the test is made elsewhere.
            return
        answer, asked = happened.answer, flight.asked
        if asked is None:
            self._answered(flight.address, answer)
            return
        if isinstance(answer, CancelledError | NotWanted | NotGreeted | KilledWorker):
            self._wait_again([asked])
            if isinstance(answer, NotGreeted) and (worker := self._workers.get(flight.address)) is not None:
                self._workers[worker.address] = replace(worker, isin=False)
                self._ask(worker.address)
            return
        self._progress.pop(asked.test, None)
        if isinstance(answer, UserError):
            raise answer
        broke = isinstance(answer, BaseException)
        self._ready.append((asked.test, Broken("error", printable(in_a_line(answer))) if broke else answer))

    # Who may make tests.

    def _answered(self, address: str, answer: Any) -> None:
        worker = self._workers.get(address)
        if worker is None or isinstance(answer, CancelledError | KilledWorker):
            return
        if isinstance(answer, BaseException):
            self._leave_out(worker, f"it cannot make tests: {printable(in_a_line(answer))}")
            return
        hello, run = answer
        self._workers[address] = replace(worker, hello=hello)
        self._greeted.append((address, hello, run))

    def _take_in(self) -> None:
        """Compares what new workers made, once there is something to compare with."""
        if self._compares and self._reference is None:
            return
        for address, hello, run in self._greeted:
            worker = self._workers.get(address)
            if worker is None:
                continue
            if why := refusal(hello, run, self._reference):
                self._leave_out(worker, why)
            else:
                self._workers[address] = replace(worker, isin=True)
        self._greeted.clear()

    def _leave_out(self, worker: _Worker, why: str) -> None:
        self._news.append(f"worker {worker.name} is left out: {why}")

    def _say(self) -> None:
        """Tells what has changed."""
        if self._room != self._said:
            workers = sum(worker.isin for worker in self._workers.values())
            tests = count(self._room, "test")
            self._news.append(f"{count(workers, 'worker')} of the cluster can make {tests} at the same time")
        if self._news:
            self._said = self._room
            self._tell(self._room, "; ".join(self._news))
            self._news.clear()

    # As of `Pool`.

    def settle(self, elements: frozenset[str]) -> Callable[[], Start | Broken | None]:
        """As `Pool.settle`, on this machine: once the run to compare with is made, since there is one process."""
        self._settling = True
        asked: list[Callable[[], Start | Broken | None]] = []

        def found() -> Start | Broken | None:
            if not asked:
                if self._compares and self._reference is None:
                    return None
                asked.append(self._here().settle(elements))
            result = asked[0]()
            self._settling = result is None
            return result

        return found

    def live(self) -> list[tuple[Live, float]]:
        """As `Pool.live`."""
        running = [
            (flight.slot, self._progress.get(flight.asked.test)) for flight in self._flights.values() if flight.asked
        ]
        return [
            (
                Live(
                    slot,
                    row["test"],
                    row["time"],
                    tuple(row["pose"]),
                    {name: tuple(pose) for name, pose in row["models"].items()},
                ),
                row["real"],
            )
            for slot, row in running
            if row is not None and math.isfinite(row["time"])
        ]

    def close(self) -> None:
        """Drops what runs: the workers end it by themselves."""
        if self._home is not None:
            self._home.close()
        client, taken = self._client, [worker.address for worker in self._workers.values() if worker.isin]
        self._flights.clear()
        if client is not None and taken:
            with suppress(Exception):
                client.sync(client._run, forget, self._run, workers=taken, on_error="ignore", callback_timeout=GOODBYE)
        self._link.close()


def _answer(done: Future[Any]) -> Any:
    """What came of a task; the exception where it came to nothing."""
    try:
        return done.result()
    except BaseException as error:
        return error


def refusal(hello: Hello, there: RunResult | Broken | None, here: RunResult | None) -> str:
    """Why a worker is left out whose first run of the whole world is `there`; "" if it may make tests.

    Without a run `here` to compare with, only the version of ddenv counts.
    """
    if hello.version != __version__:
        return f"it has ddenv {hello.version}, here is ddenv {__version__}"
    if here is None:
        return ""
    if isinstance(there, Broken):
        return f"its first run of the whole world broke: {there.failure}"
    if there is None or not _same_bits(there, here):
        return f"its first run of the whole world has other bits than here; {_difference(hello)}"
    return ""


def _difference(hello: Hello) -> str:
    there = f"{hello.simulator}, {hello.machine}".split(", ")
    here = f"{simulator()}, {machine()}".split(", ")
    theirs = ", ".join(each for each in there if each not in here)
    ours = ", ".join(each for each in here if each not in there)
    return (
        f"it has {theirs}, here is {ours}" if theirs else "it says that it has the same versions and the same processor"
    )


def _same_bits(one: RunResult, other: RunResult) -> bool:
    """Whether two runs of the same models with the same seed are the same to the last bit."""
    first, second = ((run.outcome, run.failure, run.cut, run.took_part) for run in (one, other))
    ours, theirs = ({**run.motions, "": run.trajectory} for run in (one, other))
    same_models = ours.keys() == theirs.keys()
    return first == second and same_models and all(np.array_equal(ours[name], theirs[name]) for name in ours)


_HANDLED: dict[type, Callable[[ClusterPool, Any], None]] = {
    Attached: ClusterPool._attached,
    Lost: ClusterPool._lost,
    There: ClusterPool._there,
    _Ended: ClusterPool._ended,
}
