"""Statistics of a flaky failure: the interval of its rate, and how many re-runs it needs."""

from __future__ import annotations

import math
from collections.abc import Iterable

Z_95 = 1.959963984540054


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """The 95 % Wilson interval of a rate that was seen `successes` times in `trials`. Raises ValueError for impossible counts."""
    if trials < 1 or not 0 <= successes <= trials:
        raise ValueError(f"{successes} of {trials}")
    rate, z2 = successes / trials, Z_95**2
    centre = (rate + z2 / (2 * trials)) / (1 + z2 / trials)
    half = Z_95 / (1 + z2 / trials) * math.sqrt(rate * (1 - rate) / trials + z2 / (4 * trials**2))
    # Rounding must not push the rate out of its own interval.
    return min(rate, max(0.0, centre - half)), max(rate, min(1.0, centre + half))


def miss_chance(rate: float, iterations: int) -> float:
    """The probability that `1 + iterations` runs all miss a failure that shows at `rate`."""
    return (1.0 - rate) ** (1 + iterations)


def iterations_needed(rate: float, confidence: float = 0.95) -> int:
    """The fewest iterations with which a failure that shows at `rate` (above 0) is seen with probability `confidence`."""
    if rate >= 1.0:
        return 0
    return max(0, math.ceil(math.log(1.0 - confidence) / math.log(1.0 - rate) - 1e-9) - 1)


def shows_at(outcomes: Iterable[bool], rate: float, error: float = 0.01) -> bool | None:
    """Whether runs show a failure at `rate` (above 0) rather than at half of it: True, False, or None if they do not decide yet.

    Wald's sequential test ("Sequential tests of statistical hypotheses", 1945): at either rate it is wrong with a probability of
    at most about `error`, although it may be asked after each run.
    """
    rate = min(rate, 0.99)
    ratio, enough = 0.0, math.log((1.0 - error) / error)
    for shown in outcomes:
        ratio += math.log(2.0) if shown else math.log((1.0 - rate) / (1.0 - rate / 2))
        if abs(ratio) >= enough:
            return ratio > 0
    return None
