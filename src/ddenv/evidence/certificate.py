"""What fresh runs show of a result: whether what is left keeps the rate of f, and whether each removal falls below it.

Fresh runs have seeds that chose nothing. Whole world, result, and result without one model run with the same seeds, in pairs. Each
claim is a bet against its opposite: where the opposite is true, no bet is likely to win much, and reaches a wealth of 1 / error
with a probability of at most `error`, whenever one looks (Ville's inequality; Ramdas et al., "Game-theoretic statistics and safe
anytime-valid inference", 2023). Nothing is assumed about how runs with the same seed depend on each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from ddenv.environment import Environment
from ddenv.evidence.rates import HIGHEST_RATE, Shown

Verdict = Literal["", "kept", "lost", "needed", "not needed", "passes", "fails", "not shown", "unknown"]
# Asks for a run of each of these subjects with the next seed, is sent whether each showed f, and returns a verdict.
Procedure = Generator[tuple[Environment, ...], tuple[bool, ...], Verdict]

# The chance that any claim of a run is wrong, over all its certificates; half of it is for rates kept, half for removals.
ERROR = 0.05
# From this rate on, nearly all runs are expected to show f. Then the result runs alone first, since no rate exceeds 1.
SURE, MOST_ALONE, SHARE_ALONE, HOPELESS = 0.93, 80, 0.8, 0.02
EXPECTED = (0.9, 0.95, 0.99, 1.0)
# At this wealth a bet on the opposite ends the search for evidence. Where it is wrong, it only costs runs.
REFUTED = 20.0
# The maximum number of pairs: a multiple of the expected number, and never more than these.
PATIENCE, MOST_PAIRS, MOST_REMOVAL_PAIRS = 5.0, 600, 240
# After this number of pairs a claim is given up if both bets grow so slowly that this many times their growth would not be enough.
FEWEST_PAIRS, HOPE = 100, 4.0
# Well above what must be kept: a rate that falls below this share of the whole world's is given up, since to show that it is kept
# would take too many runs. After all pairs, the lower one counts.
WELL_ABOVE, SOMEWHAT_ABOVE, HIGHEST_SHARE, HIGH_SHARE = 0.15, 0.1, 0.95, 0.9
# More broken runs of one claim than this, and than a tenth, leave it unknown.
MOST_BROKEN = 5
# An earlier environment is judged by a sequential test of this log-likelihood ratio, and at most so many runs.
ENOUGH_RATIO, MOST_EARLIER = 3.0, 60


@dataclass(frozen=True)
class Terms:
    """The terms of a certificate: the share of the whole world's rate that must be kept, an estimate of that rate, the chance of
    error of the claim, and the minimum number of runs.
    """

    keep_rate: float
    rate: float
    error: float
    at_least: int = 1


def error_of(number: int) -> float:
    """The chance of error of certificate `number`, counted from 1; those of all certificates add up to `ERROR`."""
    return ERROR * 6.0 / (math.pi * number) ** 2


@dataclass(frozen=True)
class Claim:
    """A verdict, "" while it is open, that rests on the first `runs` runs; the tests that it rests on and those still needed, as
    (subject, run).
    """

    verdict: Verdict
    runs: int
    wanted: tuple[tuple[Environment, int], ...] = ()
    rests_on: tuple[tuple[Environment, int], ...] = ()


def settle(procedure: Procedure, shown: Callable[[Environment, int], Shown], ahead: int = 1) -> Claim:
    """Carries a procedure as far as the finished runs go. It follows from their outcomes in order alone.

    Looks `ahead` for this many runs of each subject, so that idle workers have something to do. A run that broke for one
    of its subjects counts for none.
    """
    run = broken = 0
    tests: list[tuple[Environment, int]] = []
    # Every procedure asks for a run.
    subjects = next(procedure)
    while True:
        known = [shown(subject, run) for subject in subjects]
        if None in known:
            later = ((subject, run + more) for more in range(max(1, ahead)) for subject in subjects)
            return Claim("", run, tuple(one for one in later if shown(*one) is None), tuple(tests))
        tests += [(subject, run) for subject in subjects]
        run += 1
        if "broken" in known:
            broken += 1
            if broken > max(MOST_BROKEN, run // 10):
                return Claim("unknown", run, rests_on=tuple(tests))
            continue
        try:
            subjects = procedure.send(tuple(one is True for one in known))
        except StopIteration as end:
            return Claim(end.value, run, rests_on=tuple(tests))


def keeps(left: Environment, whole: Environment, terms: Terms) -> Procedure:
    """Whether `left` shows f at `keep_rate` of the rate of `whole` or more: "kept", "lost" or "not shown".

    "kept" is wrong with a probability of at most the terms' error. "lost" is no such claim: f is seen to be rarer than in
    `whole`, and the runs do not show that enough is kept.
    """
    if left == whole:
        return (yield from _of_whole(left, max(1, terms.at_least)))
    need, rate, alone, runs, hits, share = 1.0 / terms.error, terms.rate, 0.0, 0, 0, 0.0
    if rate >= SURE and terms.keep_rate < EXPECTED[0]:
        share, bet = SHARE_ALONE, [1.0 / len(EXPECTED)] * len(EXPECTED)
        while runs < MOST_ALONE and sum(bet) >= HOPELESS:
            (shown,) = yield (left,)
            runs, hits = runs + 1, hits + shown
            bet = [wealth * _likelier(each, terms.keep_rate, shown) for wealth, each in zip(bet, EXPECTED, strict=True)]
            if share * sum(bet) >= need:
                return (yield from _at_least(terms.at_least - runs, (left,), "kept"))
        alone = share * sum(bet)
        if sum(bet) >= HOPELESS:
            rate = min(rate, hits / runs)
    rate = min(max(rate, 0.05), HIGHEST_RATE)
    stake, growth = _best_stake(round(rate, 2), terms.keep_rate)
    highest = 0.995 / terms.keep_rate
    bet_for = _Bet.of(0.5 * stake, stake, min(1.5 * stake, highest))
    against, share_well = _Bet.of(0.2, 0.5, 0.9), max(terms.keep_rate, min(HIGHEST_SHARE, terms.keep_rate + WELL_ABOVE))
    shown_left = shown_whole = 0
    for pair in range(min(MOST_PAIRS, int(PATIENCE * math.log(3.0 / terms.error) / growth))):
        mine, theirs = yield left, whole
        shown_left, shown_whole = shown_left + mine, shown_whole + theirs
        bet_for, against = bet_for.after(mine - terms.keep_rate * theirs), against.after(share_well * theirs - mine)
        if alone + (1.0 - share) * bet_for.wealth >= need:
            return (yield from _at_least(terms.at_least - runs - pair - 1, (left, whole), "kept"))
        if against.wealth >= REFUTED:
            return "lost"
    return "not shown" if shown_left >= _likely_kept(terms) * shown_whole else "lost"


def _of_whole(whole: Environment, runs: int) -> Procedure:
    """The whole world keeps its own rate, if f shows in it at all."""
    shown = 0
    for _ in range(runs):
        (mine,) = yield (whole,)
        shown += mine
    return "kept" if shown else "not shown"


def _likely_kept(terms: Terms) -> float:
    """The share of the whole world's rate from which on it is likely that enough is kept."""
    return max(terms.keep_rate, min(HIGH_SHARE, terms.keep_rate + SOMEWHAT_ABOVE))


def falls(without: Environment, whole: Environment, terms: Terms) -> Procedure:
    """Whether `without` shows f at less than `keep_rate` of the rate of `whole`: "needed", "not needed" or "not shown".

    "needed" is wrong with a probability of at most the terms' error. "not needed" says that f shows about as often; the next
    certificate has to show it.
    """
    bet_for = _Bet.of(0.5, 0.75, 0.95, 0.95)
    against = _Bet.of(0.2, 0.5, 0.9)
    shown_without = shown_whole = 0
    for pair in range(MOST_REMOVAL_PAIRS):
        mine, theirs = yield without, whole
        shown_without, shown_whole = shown_without + mine, shown_whole + theirs
        gain = terms.keep_rate * theirs - mine
        bet_for, against = bet_for.after(gain), against.after(-gain)
        if bet_for.wealth >= 1.0 / terms.error:
            return (yield from _at_least(terms.at_least - pair - 1, (without, whole), "needed"))
        if against.wealth >= REFUTED:
            return "not needed"
        more = pair + 1, MOST_REMOVAL_PAIRS
        if not bet_for.may_reach(1.0 / terms.error, *more) and not against.may_reach(REFUTED, *more):
            break
    return "not needed" if shown_without and shown_without >= _likely_kept(terms) * shown_whole else "not shown"


def good_enough(earlier: Environment, rate: float, keep_rate: float, lost_rate: float) -> Procedure:
    """Whether an earlier environment still shows f at `rate`, and not nearer to `lost_rate`: "kept" or "lost"."""
    good = min(rate, HIGHEST_RATE)
    bad = min(max(0.02, min(keep_rate * good, (good + lost_rate) / 2.0)), keep_rate * good)
    ratio = 0.0
    for _ in range(MOST_EARLIER):
        (shown,) = yield (earlier,)
        ratio += math.log(good / bad) if shown else math.log((1.0 - good) / (1.0 - bad))
        if abs(ratio) >= ENOUGH_RATIO:
            break
    return "kept" if ratio > 0 else "lost"


def _at_least(more: int, subjects: tuple[Environment, ...], verdict: Verdict) -> Procedure:
    """`verdict`, after so many more runs: its interval has to say something."""
    for _ in range(more):
        yield subjects
    return verdict


def _likelier(rate: float, limit: float, shown: bool) -> float:
    """How much likelier a run is at `rate` than at `limit`."""
    return rate / limit if shown else (1.0 - rate) / (1.0 - limit)


@dataclass(frozen=True)
class _Bet:
    """A mixture of strategies; each bets a part of its wealth on every pair."""

    stakes: tuple[float, ...]
    wealths: tuple[float, ...]

    @classmethod
    def of(cls, *stakes: float) -> _Bet:
        return cls(stakes, tuple(1.0 / len(stakes) for _ in stakes))

    def after(self, gain: float) -> _Bet:
        """The bet after a pair; the product of a stake and a gain is never below -1."""
        pairs = zip(self.stakes, self.wealths, strict=True)
        return _Bet(self.stakes, tuple(wealth * (1.0 + stake * gain) for stake, wealth in pairs))

    @property
    def wealth(self) -> float:
        return sum(self.wealths)

    def may_reach(self, wealth: float, pairs: int, most: int) -> bool:
        """Whether it may reach `wealth` within `most` pairs, if it grows up to `HOPE` times as fast as in these `pairs`."""
        growth = math.log(max(self.wealths) * len(self.stakes)) / pairs
        return pairs < FEWEST_PAIRS or HOPE * growth * most >= math.log(wealth)


@lru_cache(maxsize=1024)
def _best_stake(rate: float, keep_rate: float) -> tuple[float, float]:
    """The stake with which the wealth grows fastest where both show f at `rate`, independently; and its growth a pair, in nats."""
    both, one = rate * rate, rate * (1.0 - rate)

    def growth(stake: float) -> float:
        return (
            both * math.log(1.0 + (1.0 - keep_rate) * stake)
            + one * math.log(1.0 + stake)
            + one * math.log(1.0 - keep_rate * stake)
        )

    stakes = [step / 100 / keep_rate for step in range(1, 100)]
    best = max(stakes, key=growth)
    return best, max(growth(best), 1e-4)
