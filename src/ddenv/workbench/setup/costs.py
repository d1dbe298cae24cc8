"""What a reduction will cost: a rough number of tests, and their time from earlier runs of the same scenario."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from statistics import mean, median
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError
from ddenv.text import about, between, count, rounded

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

# The maximum number of runs to read, and how many of the same scenario are enough.
LOOKED_AT, ENOUGH = 30, 3


@dataclass(frozen=True, slots=True)
class Past:
    """From earlier `runs` of a scenario: the median time of a test, real `seconds`, and the `rate` of f in their baselines."""

    runs: int = 0
    seconds: float | None = None
    rate: float | None = None


def past_of(scenario: Scenario, folder: Path) -> Past:
    """The cost in the newest runs in `folder` with the same name, timeout and files, in any folder."""
    try:
        paths = sorted(folder.glob("*.ddenv"), key=lambda path: -path.stat().st_mtime)
    except OSError:
        return Past()
    runs = (one for path in paths[:LOOKED_AT] if (one := _costs(path, scenario)) is not None)
    found = list(islice(runs, ENOUGH))
    seconds, rates = ([each for one in found for each in one[part]] for part in (0, 1))
    return Past(len(found), median(seconds) if seconds else None, mean(rates) if rates else None)


def _costs(path: Path, scenario: Scenario) -> tuple[list[float], list[float]] | None:
    """The real times of a run's tests, s, and the rate in its baseline; None for another scenario's run or a damaged one."""
    from ddenv.runfile.events import BaselineFinished, TestFinished
    from ddenv.runfile.store import RunFile

    try:
        with RunFile(path) as run:
            if not _alike(json.loads(run.document("scenario")), scenario):
                return None
            events = run.events()
    except (UserError, ValueError, RecursionError):
        return None
    times = [one.event.wall_seconds for one in events if isinstance(one.event, TestFinished)]
    rates = [one.event.rate for one in events if isinstance(one.event, BaselineFinished)]
    return [time for time in times if 0 < time < 1e7], [rate for rate in rates if rate]


def _alike(data: Any, scenario: Scenario) -> bool:
    try:
        files = [Path(each).name for each in (data["world"], data["robot"]["model"])]
        asked = [scenario.world.name, scenario.robot.model.name]
        timeout = data.get("failure", {}).get("timeout", scenario.failure.timeout)
        return data["name"] == scenario.name and files == asked and timeout == scenario.failure.timeout
    except (KeyError, TypeError, AttributeError):
        return False


def whole_cost(scenario: Scenario, models: int, jobs: int, past: Past) -> str:
    from ddenv.runs.tests_left import rough_run

    reduction = scenario.reduction
    # Another simulator does not say what took part.
    rough = rough_run(models, reduction, past.rate, slices=scenario.oracle is None)
    low, middle, high = rough.tests
    budget = getattr(reduction, "budget", None)
    if budget is not None:
        low, middle, high = (min(each, budget) for each in (low, middle, high))
    words = f"about {count(rounded(middle), 'test')} ({between(low, high)})"
    baseline, search, certificate = reduction.baseline_runs, rounded(rough.search[1]), rounded(rough.certificate[1])
    parts = f"{baseline} for the baseline, {search} for the search, {certificate} for the certificate"
    if budget is not None and middle >= budget:
        # The certificate may not be reached.
        words, parts = f"{count(budget, 'test')} at most", f"{baseline} for the baseline, then the search"
    rare = "; more if the failure is rare" if past.rate is None else ""
    if past.seconds is None:
        return f"{words}: {parts}{rare}"
    spent = about(*(each * past.seconds / jobs for each in (middle, low, high)))
    return f"{words}: {parts}{rare}; {spent} with {count(jobs, 'job')} at {past.seconds:.1f} s a test, as before"
