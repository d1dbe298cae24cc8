"""How many fresh runs a certificate takes, from its policy and the rates seen so far."""

from __future__ import annotations

import math

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
# Eight of ten rates are in the interval of so many standard deviations.
EIGHT_OF_TEN = 1.28


def certificate_tests(
    rate: float, certify_rate: float, left: int, at_least: int, seen: int = 0
) -> tuple[int, int, int]:
    """Tests of a certificate of `left` needed models, as (low, likely, high): of ten, about eight take between low and high.

    `rate` is the whole world's. It was `seen` in so many runs and may be another one; with 0 it is known.
    """
    # A damaged run file may ask for nothing, or for all.
    rate, certify_rate, seen = (
        min(max(rate, 0.0), 1.0),
        min(max(certify_rate, 0.01), 0.99),
        min(max(0, seen), MOST_PAIRS),
    )
    rates = [rate, *(wilson_interval(round(rate * seen), seen, EIGHT_OF_TEN) if seen else ())]
    ends = [_expected(each, certify_rate, left, at_least) for each in rates]
    # What is not known of the rate and chance within the certificate are independent factors.
    shorter = math.exp(math.hypot(math.log(SHORTER), math.log(min(ends) / ends[0])))
    longer = math.exp(math.hypot(math.log(LONGER), math.log(max(ends) / ends[0])))
    most = max(ends[0], min(2 * MOST_PAIRS + left * MOST_REMOVAL_PAIRS, ends[0] * longer))
    return math.floor(ends[0] / shorter), round(ends[0]), math.ceil(most)


def _expected(rate: float, certify_rate: float, left: int, at_least: int) -> float:
    """Its tests where the whole world and what is left show f at `rate`, and that without any of its models never.

    As `ddenv.evidence.certificate` goes, where the wealth of each bet grows as fast as its fastest stake on average.
    """
    kept = (1.0 / certify_rate - 1.0, 1.0 / certify_rate, -1.0)
    both = ALIKE * rate + (1.0 - ALIKE) * rate * rate
    alone = max(float(at_least), NEEDS / _growth((rate, 0.0, rate - both), kept))
    if alone <= MOST_ALONE:
        of_left, of_whole = alone, alone * (1.0 - rate)
    else:
        of_left = of_whole = min(float(MOST_PAIRS), NEEDS / _growth((both, rate - both, rate - both), kept))
    needed = (NEEDED_SHARE - 1.0, -1.0, NEEDED_SHARE)
    removal = NEEDS / _growth((0.0, 0.0, rate), needed)
    removal = max(at_least, removal if removal <= MOST_REMOVAL_PAIRS else HELPS_AFTER)
    lost = 2.0 * NEEDS_AGAINST / _growth((both, rate - both, rate - both), needed)
    return min(lost, max(of_left, removal if left else 0.0) + of_whole + left * removal)


def _growth(shares: tuple[float, float, float], gains: tuple[float, float, float]) -> float:
    """How fast the wealth of a bet grows in a pair, in nats; nearly 0 if it shrinks. `shares` of all pairs have these `gains`."""
    pairs = tuple(zip(shares, gains, strict=True))
    return max(1e-4, *(sum(share * math.log1p(stake * gain) for share, gain in pairs) for stake in STAKES))
