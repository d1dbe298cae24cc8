"""How many fresh runs a certificate takes: known before it begins, from its policy alone."""

from __future__ import annotations

import math

# It takes so many times the expected number of runs. From the rate `SURE` on, what is left runs alone, at most so often.
SHORTER, LONGER, SURE, MOST_ALONE = 0.5, 2.2, 0.93, 80
# The maximum number of pairs, for what is left and for a removal.
MOST_PAIRS, MOST_REMOVAL_PAIRS = 600, 240
# Logarithms of the wealth that the first certificate asks for, with what it costs to bet in several ways at once: that the rate is
# kept, and that a single model is needed.
FOR_KEPT, FOR_NEEDED = 4.0, 4.9


def certificate_tests(rate: float, keep_rate: float, left: int, at_least: int) -> tuple[int, int, int]:
    """Tests of a certificate of `left` needed models that keep all of `rate`, as (low, likely, high).

    Of ten such certificates, seven to ten take between low and high. They run what is left, alone or in pairs with the whole world,
    and what is left without each model, in pairs as well; pairs of the whole world are the same for all. The numbers follow
    `ddenv.reduction.certificate`: wealth grows as the square of the mean gain of a pair over twice its second moment.
    """
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
    likely = of_left + of_whole + left * removals
    most = MOST_ALONE * (rate >= SURE) + 2 * MOST_PAIRS + left * MOST_REMOVAL_PAIRS
    return math.floor(SHORTER * likely), round(likely), min(most, math.ceil(LONGER * likely))
