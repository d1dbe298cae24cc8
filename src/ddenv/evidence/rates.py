"""Statistics of a flaky failure: the interval of its rate, and how many re-runs it needs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Literal

from ddenv.environment import Environment

Z_95 = 1.959963984540054
# Few runs never show that f is certain.
HIGHEST_RATE = 0.985
# The rate of f where something that it needs is missing: another failure may end in the same place
# by chance.
SPURIOUS = 0.03
# Whether a run showed f. A broken one says nothing; None is a run that is not finished.
Shown = bool | Literal["broken"] | None
# Whether the run of an environment with this number showed it.
ShownIn = Callable[[Environment, int], Shown]
# From low to high.
Interval = tuple[float, float]


def wilson_interval(successes: int, trials: int, deviations: float = Z_95) -> Interval:
    """The Wilson interval of a rate seen `successes` times in `trials`, of 95 % or so many standard
    deviations. Raises ValueError for impossible counts.
    """
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"{successes} of {trials}")
    rate = successes / trials
    z2 = deviations**2
    centre = (rate + z2 / (2 * trials)) / (1 + z2 / trials)
    half = (
        deviations
        / (1 + z2 / trials)
        * math.sqrt(rate * (1 - rate) / trials + z2 / (4 * trials**2))
    )
    # Rounding must not push the rate out of its own interval.
    return min(rate, max(0.0, centre - half)), max(rate, min(1.0, centre + half))


def anytime_interval(successes: int, trials: int, error: float = 0.05) -> Interval:
    """An interval of a rate that misses it with a probability of at most `error`, however it is
    decided when to stop; 0 to 1 without runs.

    Jeffreys' mixture of Betas against each rate (Robbins, "Statistical methods related to the law
    of the iterated logarithm", 1970).
    """
    misses = trials - successes
    mixed = (
        math.lgamma(successes + 0.5)
        + math.lgamma(misses + 0.5)
        - math.lgamma(trials + 1)
        - math.log(math.pi)
    )

    def is_likely(rate: float) -> bool:
        if (successes and rate <= 0.0) or (misses and rate >= 1.0):
            return False
        at_rate = (successes and successes * math.log(rate)) + (
            misses and misses * math.log(1.0 - rate)
        )
        return mixed - at_rate < math.log(1.0 / error)

    def edge(outside: float) -> float:
        inside = outside if is_likely(outside) else successes / max(1, trials)
        for _ in range(30):
            middle = (inside + outside) / 2.0
            inside, outside = (middle, outside) if is_likely(middle) else (inside, middle)
        return inside

    return edge(0.0), edge(1.0)


def miss_chance(rate: float, iterations: int) -> float:
    """The probability that `1 + iterations` runs all miss a failure that shows at `rate`."""
    return (1.0 - rate) ** (1 + iterations)


def iterations_needed(rate: float, confidence: float = 0.95) -> int:
    """The fewest iterations with which a failure that shows at `rate` (above 0) is seen with
    probability `confidence`.
    """
    if rate >= 1.0:
        return 0
    return max(0, math.ceil(math.log(1.0 - confidence) / math.log(1.0 - rate) - 1e-9) - 1)


def shows_at(outcomes: Iterable[bool], rate: float, error: float = 0.01) -> bool | None:
    """Whether runs show a failure at `rate` (above 0) rather than at half of it: True, False, or
    None while they do not decide.

    Wald's sequential test ("Sequential tests of statistical hypotheses", 1945): wrong with a
    probability of at most about `error`.
    """
    runs = hits = 0
    for shown in outcomes:
        runs = runs + 1
        hits = hits + shown
        found = leans_to(hits, runs - hits, rate, rate / 2, error)
        if found is not None:
            return found
    return None


def leans_to(hits: int, misses: int, rate: float, other: float, error: float) -> bool | None:
    """The same after `hits` and `misses`: whether they speak for `rate` or for `other`, a lower
    one. Rates above 0.99, or 0.97 for `other`, are taken as these: no few runs tell them apart.
    """
    rate = min(rate, 0.99)
    other = min(other, 0.97)
    ratio = hits * math.log(rate / other) + misses * math.log((1.0 - rate) / (1.0 - other))
    if abs(ratio) >= math.log((1.0 - error) / error):
        return ratio > 0
    return None


def estimated_rate(shown: int, runs: int) -> float:
    """The rate of a failure that `shown` of `runs` showed, never 0 or 1."""
    return (shown + 0.5) / (runs + 1)
