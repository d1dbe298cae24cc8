"""How many fresh runs a certificate takes: known before it begins, from its policy alone."""

from __future__ import annotations

import math

from ddenv.rates import wilson_interval

# It takes so many times the expected number, if the rate is right. From the rate `SURE` on, what is left first runs alone.
SHORTER, LONGER, SURE = 0.5, 2.2, 0.93
# The maximum number of runs alone, and of pairs, for what is left and for a removal.
MOST_ALONE, MOST_PAIRS, MOST_REMOVAL_PAIRS = 80, 600, 240
# Logarithms of the wealth that the first certificate asks for, with what it costs to bet in several ways at once: that the rate is
# kept, and that a single model is needed.
FOR_KEPT, FOR_NEEDED = 4.0, 4.9


def certificate_tests(rate: float, keep_rate: float, left: int, at_least: int, seen: int = 0) -> tuple[int, int, int]:
    """Tests of a certificate of `left` needed models that keep all of `rate`, as (low, likely, high).

    The rate was seen in so many runs, and may be another one; 0 if it is known. Of ten such certificates, seven to ten take between
    low and high. They run what is left, alone or in pairs with the whole world, and what is left without each model, in pairs as
    well; pairs of the whole world are the same for all.
    """
    likely = _expected(rate, keep_rate, left, at_least)
    lower = higher = likely
    if seen > 0:
        seen = min(seen, MOST_PAIRS)
        rates = wilson_interval(round(min(max(rate, 0.0), 1.0) * seen), seen)
        ends = (likely, *(_expected(each, keep_rate, left, at_least) for each in rates))
        lower, higher = min(ends), max(ends)
    most = MOST_ALONE * (rate >= SURE) + 2 * MOST_PAIRS + left * MOST_REMOVAL_PAIRS
    # What is not known of the rate and chance within the certificate are independent factors.
    low = likely / math.exp(math.hypot(math.log(SHORTER), math.log(lower / likely)))
    high = likely * math.exp(math.hypot(math.log(LONGER), math.log(higher / likely)))
    return math.floor(low), round(likely), min(most, math.ceil(high))


def _expected(rate: float, keep_rate: float, left: int, at_least: int) -> float:
    """As `ddenv.reduction.certificate` goes: wealth grows as the square of the mean gain of a pair over twice its second moment."""
    # A damaged run file may ask for nothing, or for all.
    rate, keep_rate = min(max(rate, 0.05), 0.985), min(max(keep_rate, 0.01), 0.99)
    needs = FOR_NEEDED + math.log(max(1, left))
    removals = min(MOST_REMOVAL_PAIRS, max(at_least, needs / math.log(1 + 0.95 * keep_rate) / rate)) if left else 0
    if rate >= SURE:
        of_left, of_whole = max(at_least, 1.27 * FOR_KEPT / -math.log(keep_rate)), removals
    else:
        mean = rate * (1 - keep_rate)
        moment = rate**2 * (1 - keep_rate) ** 2 + rate * (1 - rate) * (1 + keep_rate**2)
        of_left = min(MOST_PAIRS, max(at_least, FOR_KEPT * 2 * moment / mean**2))
        of_whole = max(of_left, removals)
    return of_left + of_whole + left * removals
