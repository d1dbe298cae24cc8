"""What a reduction will cost: tests by expectation, and time from earlier runs of the same scenario."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError
from ddenv.runfile.store import RunFile
from ddenv.workbench.wording import count, duration

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

# The maximum number of runs to look at, and how many of the same scenario are enough.
LOOKED_AT, ENOUGH = 30, 3
UNKNOWN_TIME = "the time is known after the baseline"


@dataclass(frozen=True, slots=True)
class Past:
    """From earlier `runs` of a scenario: the median time of a test, real `seconds`, and the `rate` of f in the baseline."""

    runs: int = 0
    seconds: float | None = None
    rate: float | None = None


def past_of(scenario: Scenario, folder: Path) -> Past:
    """What is known from the newest runs in `folder` with the same name, timeout and files, wherever these are."""
    try:
        paths = sorted(folder.glob("*.ddenv"), key=lambda path: -path.stat().st_mtime)
    except OSError:
        return Past()
    found: list[tuple[list[float], float | None]] = []
    for path in paths[:LOOKED_AT]:
        if len(found) < ENOUGH and (figures := _figures(path, scenario)) is not None:
            found.append(figures)
    seconds = [each for times, _ in found for each in times]
    rates = [rate for _, rate in found if rate is not None]
    return Past(len(found), median(seconds) if seconds else None, median(rates) if rates else None)


def _figures(path: Path, scenario: Scenario) -> tuple[list[float], float | None] | None:
    """The real times of a run's tests, s, and its failure rate; None for another scenario's run or a damaged one."""
    try:
        with RunFile(path) as run:
            if not _alike(json.loads(run.document("scenario")), scenario):
                return None
            events = run.events()
    except (UserError, ValueError, RecursionError):
        return None
    times = [_positive(event.data.get("wall_seconds")) for event in events if event.kind == "test_finished"]
    rates = [_positive(event.data.get("rate")) for event in events if event.kind == "baseline_finished"]
    return [each for each in times if each is not None], next(iter(rates), None)


def _alike(data: Any, scenario: Scenario) -> bool:
    try:
        files = [Path(each).name for each in (data["world"], data["robot"]["model"])]
        asked = [scenario.world.name, scenario.robot.model.name]
        timeout = data.get("failure", {}).get("timeout", scenario.failure.timeout)
        return data["name"] == scenario.name and files == asked and timeout == scenario.failure.timeout
    except (KeyError, TypeError, AttributeError):
        return False


def _positive(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and 0 < value < 1e7 else None


def whole_cost(scenario: Scenario, models: int, jobs: int, past: Past) -> str:
    """The line with the tests and the time that all of a reduction may take."""
    reduction = scenario.reduction
    low, middle, high = _tests(models, scenario, jobs, past)
    budget = getattr(reduction, "budget", None)
    if budget is not None:
        low, middle, high = (min(each, budget) for each in (low, middle, high))
    words = f"about {count(middle, 'test')} ({low} to {high})"
    if budget is not None and middle >= budget:
        words = f"{count(budget, 'test')} at most"
    if past.seconds is None:
        return f"{words}; {UNKNOWN_TIME} of {count(reduction.baseline_runs, 'test')}"
    spent = duration(middle * past.seconds / jobs)
    before = f"{reduction.baseline_runs} of them the baseline; {past.seconds:.1f} s a test in earlier runs"
    return f"{words}, {spent} with {count(jobs, 'job')}; {before}"


def _tests(models: int, scenario: Scenario, jobs: int, past: Past) -> tuple[int, int, int]:
    """Least, expected and most tests, with the baseline's."""
    from ddenv.forecast.estimate import expect

    reduction = scenario.reduction
    rate = past.rate if past.rate is not None else 1.0
    how = {key: getattr(reduction, key) for key in ("growth", "skip", "candidates", "complement_order", "n_partitions")}
    expected = expect(models, reduction.algorithm, reduction.pair, reduction.iterations, rate, jobs=jobs, **how)
    all = (expected.tests_low, expected.tests, expected.tests_high)
    low, middle, high = (round(each) + reduction.baseline_runs for each in all)
    return low, middle, high
