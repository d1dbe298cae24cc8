"""Writes the events of an earlier run into a new run file, at their own pace, as an engine would.

    python benchmarks/replay.py SOURCE TARGET [--speed X] [--until TESTS] [--minutes M]

It holds the run's lock, and writes ten times a second, at any speed, where the robots of the running tests are. `--until` first
writes the events of this many tests at once. `--minutes` is how long the run then goes on, by its own clock: when its events are
used up, its rounds begin again, as new tests. Only the paths that a view reads are copied. It says "ready" when it begins.
"""

from __future__ import annotations

import argparse
import itertools
import time
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ddenv.runfile.events import EnvironmentNamed, Event, Forecast, RoundStarted, TestFinished, TestLost, TestStarted
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import COLUMNS, ROBOT, Live, Recorded, RunFile, create

PERIOD = 0.1  # between two looks at the running tests, s
ENDS = ("finished", "engine_stopped", "engine_failed")


@dataclass(frozen=True)
class Entry:
    """An event to write `at` this time of the run's clock, s; `test` is the number that its test has in the source."""

    at: float
    event: Event
    test: int


@dataclass(frozen=True)
class Course:
    """The path of a running test, with its start and end, s."""

    path: array
    begins: float
    ends: float

    def live(self, slot: int, test: int, clock: float) -> Live:
        share = min(1.0, max(0.0, (clock - self.begins) / max(self.ends - self.begins, 1e-3)))
        row = COLUMNS * int(share * (len(self.path) // COLUMNS - 1))
        at, *pose = self.path[row : row + COLUMNS]
        return Live(slot, test, at, tuple(pose))


class Source:
    """The run that is replayed, with the paths of its tests."""

    def __init__(self, file: RunFile) -> None:
        self._file = file
        self.events = file.events()
        self._ends = {one.event.test: one.time for one in self.events if isinstance(one.event, TestFinished)}
        self._starts = {one.event.test: one.time for one in self.events if isinstance(one.event, TestStarted)}
        named = [getattr(one.event, name, None) for one in self.events for name in ("failure_test", "evidence_test")]
        self._read = {test for test in named if test is not None}
        self._any = file.trajectory(min(self._read))

    def course(self, entry: Entry) -> Course:
        path = self._file.motion(entry.test) or self._any
        lasts = self._ends.get(entry.test, self.events[-1].time) - self._starts[entry.test]
        return Course(path, entry.at, entry.at + lasts)

    def motions(self, entry: Entry) -> dict[str, bytes] | None:
        """What is written with a test's end: the path that shows f, if a view reads it."""
        if not isinstance(entry.event, TestFinished) or entry.test not in self._read:
            return None
        return {ROBOT: self._file.trajectory(entry.test).tobytes()}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("source", type=Path)
    parser.add_argument("target", type=Path)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--until", type=int, default=0, help="tests that are there from the beginning")
    parser.add_argument("--minutes", type=float, default=60.0)
    options = parser.parse_args()
    with RunFile(options.source) as file:
        source = Source(file)
        create(options.target, file.documents(""), source.events[0].event)
        with RunFile(options.target) as target, engine_lock(options.target):
            target.own()
            script = endless(source.events)
            first = at_once(source, target, script, options.until)
            print("ready", flush=True)
            play(source, target, itertools.chain([first], script), options.speed, first.at + 60 * options.minutes)
            target.set_live([])


def at_once(source: Source, target: RunFile, script: Iterator[Entry], tests: int) -> Entry:
    """Writes everything before test number `tests` + 1; returns that test's start."""
    for entry in script:
        if isinstance(entry.event, TestStarted) and entry.event.test > tests:
            return entry
        target.append(entry.event, source.motions(entry))
    raise ValueError("no more tests")


def play(source: Source, target: RunFile, script: Iterator[Entry], speed: float, until: float) -> None:
    """Writes the rest at its pace, up to this time of the run's clock, s."""
    running: dict[int, Course] = {}
    first = next(script)
    started = looked = time.monotonic()
    for entry in itertools.chain([first], script):
        while True:
            now = time.monotonic()
            clock = first.at + speed * (now - started)
            if now - looked >= PERIOD:
                looked = now
                target.set_live([way.live(slot, test, clock) for slot, (test, way) in enumerate(running.items())])
            if clock >= min(entry.at, until):
                break
            time.sleep(min(looked + PERIOD - now, (entry.at - clock) / speed))
        if entry.at > until:
            return
        if isinstance(entry.event, TestStarted):
            running[entry.event.test] = source.course(entry)
        elif isinstance(entry.event, TestFinished | TestLost):
            running.pop(entry.event.test, None)
        target.append(entry.event, source.motions(entry))


def endless(events: list[Recorded]) -> Iterator[Entry]:
    """All events but the first, and then those of the rounds again and again, as later tests of later rounds."""
    begin = next(index for index, one in enumerate(events) if one.kind == "round_started")
    ends = [index + 1 for index, one in enumerate(events) if one.kind == "round_finished"]
    end = ends[-1] if ends else len(events)
    for one in events[1:begin]:
        yield Entry(one.time, one.event, getattr(one.event, "test", 0))
    body = [(one.time, one.event) for one in events[begin:end] if one.kind not in ENDS]
    last = body[-1][0]
    body += [(last, TestLost(test)) for test in unfinished([event for _, event in body])]
    tests = [event.test for _, event in body if isinstance(event, TestStarted)]
    rounds = sum(isinstance(event, RoundStarted) for _, event in body)
    lasts = last - body[0][0]
    for lap in itertools.count():
        for at, event in body:
            # Environments keep the numbers of the first lap.
            if not (lap and isinstance(event, EnvironmentNamed)):
                moved = later(event, tests[0], lap * len(tests), lap * rounds)
                yield Entry(at + lap * lasts, moved, getattr(event, "test", 0))


def unfinished(events: list[Event]) -> list[int]:
    """Tests that were started and did not end."""
    running: dict[int, None] = {}
    for event in events:
        if isinstance(event, TestStarted):
            running[event.test] = None
        elif isinstance(event, TestFinished | TestLost):
            running.pop(event.test, None)
    return list(running)


def later(event: Event, first: int, tests: int, rounds: int) -> Event:
    """An event with later numbers of tests, from `first` on, and of rounds."""

    def moved(test: int) -> int:
        return test + tests if test >= first else test

    changes: dict[str, Any] = {
        name: moved(getattr(event, name)) for name in ("test", "evidence_test", "by") if hasattr(event, name)
    }
    if hasattr(event, "tests") and not isinstance(event, Forecast):
        changes["tests"] = tuple(map(moved, event.tests))
    if getattr(event, "round", None) is not None:
        changes["round"] = event.round + rounds
    return replace(event, **changes)


if __name__ == "__main__":
    main()
