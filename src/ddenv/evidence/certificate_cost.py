"""How many fresh runs a certificate takes, from its policy and the rates seen so far."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from ddenv.evidence.rates import wilson_interval

# It takes so many times the expected number, if the rates are right. From the rate `SURE` on, what is left first runs alone.
SHORTER, LONGER, SURE = 0.5, 2.2, 0.93
# The maximum number of runs alone, and of pairs, for what is left and for a removal.
MOST_ALONE, MOST_PAIRS, MOST_REMOVAL_PAIRS = 80, 600, 240
# Logarithms of the wealth that the first certificate asks for, with what it costs to bet in several ways at once: that the rate is
# kept, that it is not, and that a single model is needed.
FOR_KEPT, FOR_LOST, FOR_NEEDED = 4.0, 2.0, 4.9
# The share of the rate that bets against what is left, and the stakes of those for a removal.
WELL_KEPT, STAKES = 0.95, (0.5, 0.75, 0.95)
# Before it has runs, what is left is taken to show f as often as the whole world, and a removal never to, as if so many of its runs
# had shown that.
WORTH, WORTH_WITHOUT = 8, 4
# Eight of ten rates are in the interval of so many standard deviations. How little may be left, as a share of all, until it ends.
EIGHT_OF_TEN, LEAST_LEFT = 1.28, 0.3

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
    rate: float, keep_rate: float, left: int, at_least: int, seen: int = 0, made: Made | None = None
) -> tuple[int, int, int]:
    """Tests of a certificate of `left` needed models, as (low, likely, high): of ten, about eight take between low and high.

    `rate` is the whole world's. It was `seen` in so many runs and may be another one; with 0 it is known. `made` says what the
    certificate's own runs showed so far: only the others are open. It runs what is left, alone or in pairs with the whole world,
    and what is left without each model, in pairs as well; pairs of the whole world are the same for all.
    """
    now = Made() if made is None else made
    # A damaged run file may ask for nothing, or for all.
    rate, keep_rate = min(max(rate, 0.0), 1.0), min(max(keep_rate, 0.01), 0.99)
    seen, tests = min(max(0, seen), MOST_PAIRS), max(0, now.tests)
    end, sure_end = _rate(now.end, rate, WORTH)
    without = [_rate(each, 0.0, WORTH_WITHOUT) for each in (*now.without[:left], *[(0, 0)] * (left - len(now.without)))]
    rates = [each for each, _ in without]
    expected = _Expected(keep_rate, at_least, left)
    likely = expected.tests(rate, end, rates)
    ends = [likely]
    if seen > 0:
        of_whole = wilson_interval(round(rate * seen), seen, EIGHT_OF_TEN)
        ends += [expected.tests(each, end if now.end[1] else each, rates) for each in of_whole]
    if now.end[1] > 0:
        ends += [expected.tests(rate, each, rates) for each in _ends(end, sure_end)]
    if now.tests and without:
        # Of all removals, the one that may take longest.
        place = max(range(left), key=lambda one: _ends(*without[one])[1])
        ends.append(expected.tests(rate, end, [*rates[:place], _ends(*without[place])[1], *rates[place + 1 :]]))
    # What is not known of the rates and chance within the certificate are independent factors.
    shorter = math.exp(math.hypot(math.log(SHORTER), math.log(min(ends) / likely)))
    longer = math.exp(math.hypot(math.log(LONGER), math.log(max(ends) / likely)))
    most = MOST_ALONE * (rate >= SURE) + 2 * MOST_PAIRS + left * MOST_REMOVAL_PAIRS
    still = max(likely - tests, LEAST_LEFT * likely if tests else 0.0)
    low, high = tests + max(0.0, likely - tests) / shorter, max(tests + still, min(most, tests + still * longer))
    return math.floor(low), round(tests + still), math.ceil(high)


def _rate(of: Shown, before: float, worth: int) -> tuple[float, int]:
    """The rate that runs show after `worth` runs at the rate `before`, and from how many runs in all."""
    runs = min(max(0, of[1]), MOST_PAIRS)
    return (min(max(0, of[0]), runs) + worth * before) / (runs + worth), runs + worth


def _ends(rate: float, runs: int) -> tuple[float, float]:
    return wilson_interval(round(rate * runs), runs, EIGHT_OF_TEN)


@dataclass(frozen=True)
class _Expected:
    """As `ddenv.evidence.certificate` goes: wealth grows as the square of the mean gain of a pair over twice its second moment."""

    keep_rate: float
    at_least: int
    left: int

    def tests(self, rate: float, end: float, without: Sequence[float]) -> float:
        """Where the whole world shows f at `rate`, and what is left, and that without each model, at these rates."""
        rate, end = (min(max(each, 0.05), 0.985) for each in (rate, end))
        lost = 2.0 * _pairs(rate, end, WELL_KEPT, -FOR_LOST)
        needs = FOR_NEEDED + math.log(max(1, self.left))
        removals = [max(self.at_least, _removal_pairs(rate, each, self.keep_rate, needs)) for each in without]
        longest = max(removals, default=0.0)
        if min(rate, end) >= SURE:
            of_left, of_whole = max(self.at_least, 1.27 * FOR_KEPT / -math.log(self.keep_rate)), longest
        else:
            of_left = max(self.at_least, _pairs(rate, end, self.keep_rate, FOR_KEPT))
            of_whole = max(of_left, longest)
        return min(lost, of_left + of_whole + sum(removals))


def _pairs(rate: float, end: float, share: float, needs: float) -> float:
    """Pairs until a bet has won `needs`: that what is left keeps more than this share of the rate, or, if negative, less."""
    mean = end - share * rate
    moment = end * (1 - rate) + end * rate * (1 - share) ** 2 + (1 - end) * rate * share**2
    return min(MOST_PAIRS, needs * 2 * moment / (mean * abs(mean))) if mean * needs > 0 else MOST_PAIRS


@lru_cache(maxsize=4096)
def _removal_pairs(rate: float, without: float, keep_rate: float, needs: float) -> float:
    """Pairs until a bet has won `needs`: that without a model f shows at less than its share of the rate."""
    growth = max(
        rate * (1 - without) * math.log(1 + stake * keep_rate)
        + without * (1 - rate) * math.log(1 - stake)
        + rate * without * math.log(1 - stake * (1 - keep_rate))
        for stake in STAKES
    )
    return min(MOST_REMOVAL_PAIRS, needs / growth) if growth > 0 else MOST_REMOVAL_PAIRS
