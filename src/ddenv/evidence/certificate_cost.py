"""How many fresh runs a certificate takes, from its policy and the rates seen so far."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ddenv.evidence.certificate import (
    HELPS_AFTER,
    MOST_ALONE,
    MOST_PAIRS,
    MOST_REMOVAL_PAIRS,
    NEEDED_SHARE,
    REFUTED,
    STAKES,
    error_of,
)
from ddenv.evidence.rates import wilson_interval

# It takes so many times the expected number, if the rates are right.
SHORTER, LONGER = 0.55, 2.2
# Of the pairs of runs with the same seed, so many end alike whatever their rates are.
ALIKE = 0.4
# The logarithm of the wealth that a bet of the first certificate needs, with what it costs to bet with several stakes at once; and
# that of a bet against it.
NEEDS, NEEDS_AGAINST = math.log(2.0 / error_of(1) * len(STAKES)), math.log(REFUTED * len(STAKES))
# Before it has runs, what is left is taken to show f as often as the whole world, and a removal never to, as if so many of its runs
# had shown that.
WORTH, WORTH_WITHOUT = 3, 4
# Eight of ten rates are in the interval of so many standard deviations. How little may be left, as a share of all, until it ends.
EIGHT_OF_TEN, LEAST_LEFT = 1.28, 0.1

# Of so many runs (the second number), so many showed f.
Shown = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Made:
    """The runs of a certificate so far: all `tests` that are finished, and how often what is left, and that without each model,
    showed f.
    """

    tests: int = 0
    end: Shown = (0, 0)
    without: Sequence[Shown] = ()


def certificate_tests(
    rate: float, certify_rate: float, left: int, at_least: int, seen: int = 0, made: Made | None = None
) -> tuple[int, int, int]:
    """Tests of a certificate of `left` needed models, as (low, likely, high): of ten, about eight take between low and high.

    `rate` is the whole world's. It was `seen` in so many runs and may be another one; with 0 it is known. `made` says what the
    certificate's own runs showed so far: only the others are open. It runs what is left, the whole world where that missed f, and
    what is left without each model.
    """
    now = Made() if made is None else made
    # A damaged run file may ask for nothing, or for all.
    rate, certify_rate = min(max(rate, 0.0), 1.0), min(max(certify_rate, 0.01), 0.99)
    seen, tests = min(max(0, seen), MOST_PAIRS), max(0, now.tests)
    end = _rate(now.end, rate, WORTH)
    without = [_rate(each, 0.0, WORTH_WITHOUT) for each in (*now.without[:left], *[(0, 0)] * (left - len(now.without)))]
    likely = _expected(certify_rate, at_least, rate, end, without)
    ends = [likely]
    for each in wilson_interval(round(rate * seen), seen, EIGHT_OF_TEN) if seen else ():
        ends.append(_expected(certify_rate, at_least, each, end if now.end[1] else each, without))
    # What is not known of the rates and chance within the certificate are independent factors.
    shorter = math.exp(math.hypot(math.log(SHORTER), math.log(min(ends) / likely)))
    longer = math.exp(math.hypot(math.log(LONGER), math.log(max(ends) / likely)))
    most = 2 * MOST_PAIRS + left * MOST_REMOVAL_PAIRS
    still = max(likely - tests, LEAST_LEFT * likely if tests else 0.0)
    low, high = tests + max(0.0, likely - tests) / shorter, max(tests + still, min(most, tests + still * longer))
    return math.floor(low), round(tests + still), math.ceil(high)


def _rate(of: Shown, before: float, worth: int) -> float:
    """The rate that runs show after `worth` runs at the rate `before`."""
    runs = min(max(0, of[1]), MOST_PAIRS)
    return (min(max(0, of[0]), runs) + worth * before) / (runs + worth)


def _expected(certify_rate: float, at_least: int, rate: float, end: float, without: Sequence[float]) -> float:
    """Its tests where the whole world shows f at `rate`, and what is left, and that without each model, at these rates.

    As `ddenv.evidence.certificate` goes, where the wealth of each bet grows as fast as its fastest stake on average.
    """
    kept = (1.0 / certify_rate - 1.0, 1.0 / certify_rate, -1.0)
    both, mine, theirs = _shares(end, rate)
    alone = max(float(at_least), NEEDS / _growth((both + mine, 0.0, theirs), kept))
    if alone <= MOST_ALONE:
        of_left, of_whole = alone, alone * (1.0 - end)
    else:
        of_left = of_whole = min(float(MOST_PAIRS), NEEDS / _growth((both, mine, theirs), kept))
    needed = (NEEDED_SHARE - 1.0, -1.0, NEEDED_SHARE)
    removals = [NEEDS / _growth(_shares(each, end), needed) for each in without]
    removals = [max(at_least, each if each <= MOST_REMOVAL_PAIRS else HELPS_AFTER) for each in removals]
    lost = 2.0 * NEEDS_AGAINST / _growth((both, mine, theirs), needed)
    return min(lost, max(of_left, *removals, 0.0) + of_whole + sum(removals))


def _shares(first: float, second: float) -> tuple[float, float, float]:
    """Of pairs of these rates, the shares in which both show f, only the first, only the second."""
    both = ALIKE * min(first, second) + (1.0 - ALIKE) * first * second
    return both, first - both, second - both


def _growth(shares: tuple[float, float, float], gains: tuple[float, float, float]) -> float:
    """How fast the wealth of a bet grows in a pair, in nats; nearly 0 if it shrinks."""
    pairs = tuple(zip(shares, gains, strict=True))
    return max(1e-4, *(sum(share * math.log1p(stake * gain) for share, gain in pairs) for stake in STAKES))
