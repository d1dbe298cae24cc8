"""How many tests a run takes: those still left by the engine's forecast, and a rough number before there is a run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice

from ddenv.runfile.state import RunState

# The latest tests show how long one takes. Workers wait for each other for some of the time.
LATEST, BUSY = 50, 0.9
# Tests of n models without re-runs are about factor * n ** power: fitted to random worlds of 5 to 5000 models.
SCALE = {
    "ddenv": (6.5, 0.32),
    "ddenv as printed": (5.6, 0.62),
    "ddmin": (11.0, 0.41),
    "probdd": (8.0, 0.25),
    "splitting": (6.2, 0.25),
}
# Most candidates do not show f, and get all their re-runs.
# Eight of ten random worlds took between `FEWER` and `MORE` times as many tests.
RERUN, FEWER, MORE = 0.75, 0.35, 2.3


@dataclass(frozen=True, slots=True)
class Remaining:
    """What is left from now on, as (low, likely, high). `seconds` is None while nothing is run."""

    tests: tuple[int, int, int]
    seconds: tuple[float, float, float] | None


def remaining(state: RunState, at_work: bool) -> Remaining | None:
    """What is left of a run. None if unknown: before the first round, after more tests than the engine expected, while
    the result is confirmed, and at the end.

    Without an engine `at_work` nothing runs, and the time is not known.
    """
    forecast = state.forecast
    if forecast is None or state.ended or state.confirming:
        return None
    done = state.tests_done - forecast.tests_done
    if done >= forecast.high:
        return None
    running = len(state.running_tests) if at_work else 0
    most = math.inf if state.budget is None else max(0, state.budget - state.tests_done)
    low, likely, high = (
        int(min(most, max(running, each - done))) for each in (forecast.low, forecast.likely, forecast.high)
    )
    each = _seconds_of_a_test(state) if at_work else None
    return Remaining((low, likely, high), None if each is None else (low * each, likely * each, high * each))


def _seconds_of_a_test(state: RunState) -> float | None:
    """Real time from one finished test to the next, s; None while nothing is started."""
    if state.paused or state.waiting_candidate is not None:
        return None
    finished = (test.wall_seconds for test in islice(reversed(state.tests), 2 * LATEST) if test.is_finished)
    times = [each for each in islice(finished, LATEST) if each > 0]
    return sum(times) / len(times) / (1 + BUSY * (max(1, state.jobs) - 1)) if times else None


def rough_tests(models: int, algorithm: str, iterations: int, as_printed: bool = False) -> tuple[int, int, int]:
    """Tests of a reduction of this number of `models`, as (low, likely, high), without the baseline, for an unknown world."""
    key = "ddenv as printed" if algorithm == "ddenv" and as_printed else algorithm
    factor, power = SCALE.get(key, SCALE["ddenv"])
    likely = factor * models**power * (1 + RERUN * iterations)
    # A few models make few different candidates.
    likely = min(likely, models**1.5 * (1 + iterations))
    return math.floor(FEWER * likely), round(likely), math.ceil(MORE * likely)
