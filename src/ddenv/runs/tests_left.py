"""How many tests a run takes: those still left by the engine's forecast, and a rough number before
there is a run.

Both count the certificate, which ends every run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice

from ddenv.evidence.certificate import RUNS_BESIDE, RUNS_BESIDE_ALIKE, Expected, certificate_tests
from ddenv.evidence.claims import expected_fresh_runs, fresh_runs_made, in_the_making
from ddenv.runfile.fold_decisions import stands_for_all
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState
from ddenv.settings import Reduction
from ddenv.text import Sentences, about, count, rounded

# The latest tests show how long one takes. Workers wait for each other for some of the time.
LATEST = 50
BUSY = 0.9
# Tests of n models without re-runs are about factor * n ** power: fitted to random worlds of 5 to
# 5000 models.
SCALE = {
    "ddenv": (6.5, 0.32),
    "ddenv as printed": (5.6, 0.62),
    "ddmin": (11.0, 0.41),
    "probdd": (8.0, 0.25),
    "splitting": (6.2, 0.25),
}
# Where the likely number of tests is nearly made or exceeded, one part in so many of it is still
# expected.
LATE = 3
# Most candidates do not show f, and get all their re-runs.
# Eight of ten random worlds took between `FEWER` and `MORE` times as many tests.
RERUN = 0.75
FEWER = 0.35
MORE = 2.3
# Where f nearly always shows, so many runs without it make a candidate dissimilar, if the rate is
# to be kept.
FEWEST_MISSES = 2
# Tests of a search that keeps the rate grow with this power of 1 / rate: 70, 117, 237 and 342 for
# rates of 1, .8, .5 and .32.
RARER = 1.5
LEAST_RATE = 0.02
# How many models are left, if nothing is known.
SURVIVORS = 3
# How many models took part in the baseline: in the ditch 5 of 43, in friction 20 of 25, in the
# rubble 27 to 34 of 36, among 5,000 models 31.
TOOK_PART = (5, 20, 35)


@dataclass(frozen=True, slots=True)
class Remaining:
    """What is left from now on, as (low, likely, high). `seconds` is None while nothing is run."""

    tests: Expected
    seconds: tuple[float, float, float] | None


def remaining(state: RunState, at_work: bool) -> Remaining | None:
    """What is left of a run: of its search, and its certificate. None if unknown: before the first
    round, after more tests than were expected, and at the end.

    Without an engine `at_work` nothing runs, and the time is not known.
    """
    expected = None if state.ended or _is_overdue(state) else _expected(state)
    if expected is None:
        return None
    running = len(state.running_tests) if at_work else 0
    most = math.inf if state.budget is None else max(0, state.budget - state.made)
    low, likely, high = (int(min(most, max(running, each))) for each in expected)
    if not at_work or state.paused or state.needs_room or state.waiting_candidate is not None:
        return Remaining((low, likely, high), None)
    # Real time from one finished test to the next, s.
    finished = (
        test.wall_seconds for test in islice(reversed(state.tests), 2 * LATEST) if test.is_finished
    )
    times = [each for each in islice(finished, LATEST) if each > 0]
    each = sum(times) / len(times) / (1 + BUSY * (max(1, state.jobs) - 1)) if times else None
    return Remaining(
        (low, likely, high), None if each is None else (low * each, likely * each, high * each)
    )


def left_said(state: RunState, at_work: bool) -> Sentences:
    """What is left, in tests and with the time in brackets, from the longest form to none; nothing
    if it is unknown.
    """
    left = remaining(state, at_work)
    if left is None:
        if _is_overdue(state):
            return ("more tests than forecast", "")
        return ()
    low, likely, high = map(rounded, left.tests)
    words = f"about {count(likely, 'test')} left"
    time = [] if left.seconds is None else [about(left.seconds[1])]
    ranges = [f"{low:,} to {high:,}"] if low < high else []
    forms = [f"{words} ({', '.join(more)})" for more in (ranges + time, time or ranges) if more]
    return (*dict.fromkeys(forms), words, "")


def _is_overdue(state: RunState) -> bool:
    """Whether the search, or the certificate, takes more tests than were foretold."""
    forecast = state.forecast
    now = in_the_making(state)
    if state.ended:
        return False
    if now is not None:
        return fresh_runs_made(state, now) >= expected_fresh_runs(state, now)[-1]
    searches = not (state.confirming or state.isolating is not None)
    return (
        searches
        and forecast is not None
        and state.tests_done - forecast.tests_done >= forecast.tests[-1]
    )


def _expected(state: RunState) -> Expected | None:
    """How many tests are left, as (low, likely, high); None if unknown."""
    forecast = state.forecast
    baseline = state.baseline
    if state.isolating is not None or state.margining is not None:
        return None
    if state.confirming:
        now = in_the_making(state)
        if now is None:
            return None
        return _after(expected_fresh_runs(state, now), fresh_runs_made(state, now))
    if forecast is None or baseline is None:
        return None
    left = min(len(state.environment), max(state.lower_bound, SURVIVORS))
    rate = (baseline.failures + 0.5) / (baseline.runs + 1)
    asked = settings(state)
    certificate = certificate_tests(rate, asked.certify_rate, left, baseline.runs, baseline.runs)
    if asked.accept_rate == "exact":
        certificate = (RUNS_BESIDE_ALIKE if stands_for_all(state) else RUNS_BESIDE,) * 3
    search = _after(forecast.tests, state.tests_done - forecast.tests_done)
    low, likely, high = (one + other for one, other in zip(search, certificate, strict=True))
    return low, likely, high


def _after(expected: Expected, done: int) -> Expected:
    """What is left of `expected`, as (low, likely, high), once `done` are made. What is late is not
    about to end.
    """
    low, likely, high = (max(0, each - done) for each in expected)
    return low, max(likely, min(expected[1], high) // LATE), high


def search_tests(models: int, asked: Reduction, rate: float | None = None) -> Expected:
    """Tests of a search in this number of `models`, as (low, likely, high), for an unknown world in
    which f shows at `rate`, by default always. For every round the engine writes them as its
    forecast.
    """
    runs = {"first": 1 + asked.iterations, "exact": asked.exact_seeds}.get(
        asked.accept_rate, min(1 + asked.iterations, FEWEST_MISSES)
    )
    if asked.algorithm == "ddenv" and asked.growth == "paper":
        key = "ddenv as printed"
    else:
        key = asked.algorithm
    factor, power = SCALE.get(key, SCALE["ddenv"])
    likely = factor * models**power * (1 + RERUN * (runs - 1))
    # A few models make few different candidates.
    likely = min(likely, models**1.5 * runs)
    if asked.accept_rate == "kept" and rate is not None:
        likely *= max(rate, LEAST_RATE) ** -RARER
    return math.floor(FEWER * likely), round(likely), math.ceil(MORE * likely)


@dataclass(frozen=True, slots=True)
class Rough:
    """A whole run, as (low, likely, high): tests of the `baseline`, of the `search` and of the
    `certificate`.
    """

    baseline: int
    search: Expected
    certificate: Expected

    @property
    def tests(self) -> Expected:
        low, likely, high = (
            self.baseline + sum(each) for each in zip(self.search, self.certificate, strict=True)
        )
        return low, likely, high


def rough_run(
    models: int, asked: Reduction, rate: float | None = None, slices: bool = True
) -> Rough:
    """Before there is a run: of `models` that can be removed, where f shows at `rate`, or if all
    runs of the baseline show it.

    With `slices`, and if they are asked for, only what took part in the baseline is searched. That
    has little to do with the size of the world: `TOOK_PART` is how many models these were in the
    bundled worlds of 25 to 43 models and in one of 5,000: few, usual, many. Without slices every
    model is searched.
    """
    slices = slices and asked.slice
    searched = [min(models, most) if slices else models for most in TOOK_PART]
    # Assumed without a word of earlier runs, the rate is taken as it is.
    seen = asked.baseline_runs
    if rate is None:
        rate = (asked.baseline_runs + 0.5) / (asked.baseline_runs + 1)
        seen = 0
    few, usual, many = (search_tests(each, asked, rate) for each in searched)
    certificate = certificate_tests(
        rate, asked.certify_rate, min(models, SURVIVORS), asked.baseline_runs, seen
    )
    if asked.accept_rate == "exact":
        certificate = (RUNS_BESIDE,) * 3
    return Rough(asked.baseline_runs, (few[0], usual[1], many[2]), certificate)
