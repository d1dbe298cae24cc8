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
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import COLUMNS, ROBOT, Event, Live, RunFile, create

PERIOD = 0.1  # between two looks at the running tests, s
ENDS = ("confirm_started", "finished", "engine_stopped", "engine_failed")


@dataclass(frozen=True)
class Entry:
    """An event to write `at` this time of the run's clock, s; `test` is the number that its test has in the source."""

    at: float
    kind: str
    data: dict[str, Any]
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
        self._ends = {event.data["test"]: event.time for event in self.events if event.kind == "test_finished"}
        self._starts = {event.data["test"]: event.time for event in self.events if event.kind == "test_started"}
        named = [event.data.get("failure_test", event.data.get("evidence_test")) for event in self.events]
        self._read = {test for test in named if test is not None}
        self._any = file.trajectory(min(self._read))

    def course(self, entry: Entry) -> Course:
        path = self._file.motion(entry.test) or self._any
        lasts = self._ends.get(entry.test, self.events[-1].time) - self._starts[entry.test]
        return Course(path, entry.at, entry.at + lasts)

    def motions(self, entry: Entry) -> dict[str, bytes] | None:
        """What is written with a test's end: the path that shows f, if a view reads it."""
        if entry.kind != "test_finished" or entry.test not in self._read:
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
        create(options.target, file.documents(""), source.events[0].data)
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
        if entry.kind == "test_started" and entry.data["test"] > tests:
            return entry
        target.append(entry.kind, entry.data, source.motions(entry))
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
        if entry.kind == "test_started":
            running[entry.data["test"]] = source.course(entry)
        elif entry.kind in ("test_finished", "test_lost"):
            running.pop(entry.data["test"], None)
        target.append(entry.kind, entry.data, source.motions(entry))


def endless(events: list[Event]) -> Iterator[Entry]:
    """All events but the first, and then those of the rounds again and again, as later tests of later rounds."""
    begin = next(index for index, event in enumerate(events) if event.kind == "round_started")
    ends = [index + 1 for index, event in enumerate(events) if event.kind == "round_finished"]
    end = ends[-1] if ends else len(events)
    for event in events[1:begin]:
        yield Entry(event.time, event.kind, event.data, event.data.get("test", 0))
    body = [event for event in events[begin:end] if event.kind not in ENDS]
    body += [Event(0, body[-1].time, "test_lost", {"test": test}) for test in unfinished(body)]
    tests = [event.data["test"] for event in body if event.kind == "test_started"]
    rounds = sum(event.kind == "round_started" for event in body)
    lasts = body[-1].time - body[0].time
    for lap in itertools.count():
        for event in body:
            data = later(event.data, tests[0], lap * len(tests), lap * rounds)
            yield Entry(event.time + lap * lasts, event.kind, data, event.data.get("test", 0))


def unfinished(events: list[Event]) -> list[int]:
    """Tests that were started and did not end."""
    running: dict[int, None] = {}
    for event in events:
        if event.kind == "test_started":
            running[event.data["test"]] = None
        elif event.kind in ("test_finished", "test_lost"):
            running.pop(event.data["test"], None)
    return list(running)


def later(data: dict[str, Any], first: int, tests: int, rounds: int) -> dict[str, Any]:
    """An event's data with later numbers of tests, from `first` on, and of rounds."""

    def moved(test: int) -> int:
        return test + tests if test >= first else test

    changes: dict[str, Any] = {name: moved(data[name]) for name in ("test", "evidence_test") if name in data}
    if "tests" in data:
        changes["tests"] = [moved(test) for test in data["tests"]]
    if data.get("round") is not None:
        changes["round"] = data["round"] + rounds
    return data | changes


if __name__ == "__main__":
    main()
