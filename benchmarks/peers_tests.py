"""The tests of `peers.py`: runs of the robot in forked copies of one process, judged as the engine does, each written down.

A forked process finds the simulator built. It gives the same results to the last bit as the engine's workers, and costs 20 ms.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path

from early_stop import fixed

from ddenv.reduction.verdict import Acceptance, standing
from ddenv.robot.oracle import judge
from ddenv.robot.result import RunResult
from ddenv.robot.simulation.template import Variants
from ddenv.runs.subject import load_parts
from ddenv.world.scenario import Scenario, seed_of

Keep = frozenset[str]
BEGUN, SIMILAR, WITHOUT = "begun", "similar", "without"


@dataclass(frozen=True)
class Counts:
    """Finished tests, how many of them were re-runs of candidates, and tests that were stopped."""

    tests: int = 0
    reruns: int = 0
    stopped: int = 0


def prepare(scenario: Scenario, record: Path, jobs: int) -> tuple[str, ...]:
    """Builds the simulator and fixes f from the baseline; returns the world's models. Raises UserError, and SystemExit without f.

    All processes forked from here on can run tests.
    """
    global _scenario, _record, _elements, _simulator, _failure
    world, robot = load_parts(scenario)
    _scenario, _record = scenario, record
    _elements = world.elements(frozenset(scenario.protected))
    _simulator = Variants(world, robot, scenario)
    # What the simulator learns of the world in its first run, processes that are forked later need not learn again.
    first = _baseline_run(0)
    with workers(jobs) as executor:
        rest = executor.map(_baseline_run, range(1, scenario.reduction.baseline_runs))
        _failure = fixed(scenario, [first, *rest])
    return _elements


def workers(jobs: int) -> ProcessPoolExecutor:
    """Processes that are forked at the first task."""
    return ProcessPoolExecutor(jobs, multiprocessing.get_context("fork"))


def _baseline_run(run: int) -> RunResult:
    everything = frozenset(_elements)
    _write(everything, run, BEGUN)
    result = _simulator.run(everything, seed_of(_scenario.reduction, run))
    # Nobody asks for a verdict on the whole world.
    _write(everything, run, SIMILAR)
    return result


def shows(keep: Keep, run: int) -> bool:
    """Whether f shows in one run of what is kept."""
    _write(keep, run, BEGUN)
    result = _simulator.run(keep, seed_of(_scenario.reduction, run), full=not _scenario.reduction.early_stop)
    similar = judge(result, _failure).outcome == SIMILAR
    _write(keep, run, SIMILAR if similar else WITHOUT)
    return similar


def shows_in_any(keep: Keep) -> bool:
    """Whether f shows in one of the runs that a candidate has, made one after another."""
    return any(shows(keep, run) for run in range(1 + _scenario.reduction.iterations))


def _write(keep: Keep, run: int, outcome: str) -> None:
    """One line at once: several processes write to the same file."""
    numbers = [str(number) for number, name in enumerate(_elements) if name in keep]
    line = f"{outcome} {run} {','.join(numbers)}\n"
    file = os.open(_record, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    os.write(file, line.encode())
    os.close(file)


def counts(record: Path) -> Counts:
    """The tests so far, from the record."""
    lines = [line.split(" ") for line in record.read_text().splitlines()] if record.exists() else []
    # The baseline comes first, and no candidate has all its models.
    everything = lines[0][2] if lines else ""
    ended = [line for line in lines if line[0] != BEGUN]
    reruns = sum(line[1] != "0" and line[2] != everything for line in ended)
    return Counts(len(ended), reruns, len(lines) - 2 * len(ended))


def _judged_without() -> set[Keep]:
    """The sets judged to be without f: all their runs were made, and none showed it."""
    lines = [line.split(" ") for line in _record.read_text().splitlines()]
    runs = {(keep, run) for outcome, run, keep in lines if outcome == WITHOUT}
    asked = [str(run) for run in range(1 + _scenario.reduction.iterations)]
    without = {keep for keep, _ in runs if all((keep, run) in runs for run in asked)}
    return {frozenset(_elements[int(number)] for number in keep.split(",") if number) for keep in without}


def is_minimal(kept: Keep, jobs: int) -> bool:
    """Whether no single model can be left out of `kept`; what was not tested is tested now."""
    without = _judged_without()
    untested = [kept - {name} for name in sorted(kept) if kept - {name} not in without]
    with workers(jobs) as executor:
        return not any(list(executor.map(shows_in_any, untested)))


class Bench:
    """Makes tests in `jobs` processes: the next in line, and on free ones those that may be asked for next."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._executor = workers(jobs)
        self._known: dict[tuple[Keep, int], bool] = {}
        self._running: dict[Future[bool], tuple[Keep, int]] = {}

    def first_similar(self, candidates: Sequence[Keep], bets: Sequence[Keep] = ()) -> int | None:
        """The index of the first candidate in which f shows, as if they were tested in order, or None.

        `bets` are sets that may be asked for next; their first runs are made ahead of time.
        """
        while True:
            now = standing(candidates, self._similar, Acceptance(1 + _scenario.reduction.iterations))
            if not now.wanted:
                return now.winner
            line = [(candidates[index], run) for index, run in now.wanted]
            self._start([line[0], *((keep, 0) for keep in bets), *line[1:]])
            done, _ = wait(self._running, return_when=FIRST_COMPLETED)
            for future in done:
                self._known[self._running.pop(future)] = future.result()

    def _similar(self, keep: Keep, run: int) -> bool | None:
        return self._known.get((keep, run))

    def _start(self, tests: Sequence[tuple[Keep, int]]) -> None:
        begun = {*self._known, *self._running.values()}
        new = [test for test in dict.fromkeys(tests) if test not in begun]
        for test in new[: self._jobs - len(self._running)]:
            self._running[self._executor.submit(shows, *test)] = test
