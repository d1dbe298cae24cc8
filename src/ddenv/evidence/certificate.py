"""What fresh runs show of a result: what share of the rate of f it keeps, and how often f still
shows without each model.

Fresh runs have seeds that chose nothing. Two environments are compared by pairs of runs with the
same seed. For each share there is a bet that the first one shows f at more than this share of the
second one's rate. If it does not, the bet reaches a wealth of 1 / error with a probability of at
most `error`, whenever one looks (Ville's inequality; Ramdas et al., "Game-theoretic statistics and
safe anytime-valid inference", 2023). So the highest share whose bet has reached 1 / error is a
lower bound of what is kept; a bet the other way gives an upper bound. Nothing is assumed about how
runs with the same seed depend on each other.

A run that was not made, or broke, counts against the claim: the whole world need not run where what
is left shows f, and is then taken to show f, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

from ddenv.environment import Environment
from ddenv.evidence.rates import (
    HIGHEST_RATE,
    Interval,
    Shown,
    ShownIn,
    iterations_needed,
    wilson_interval,
)

Verdict = Literal[
    "",
    "kept",
    "lost",
    "exact",
    "needed",
    "helps",
    "rarer",
    "not needed",
    "passes",
    "fails",
    "not shown",
    "unknown",
]
# Without these models f is rarer, but not shown to be rare enough. "helps": it is shown not to be
# that rare.
HELPING = ("helps", "rarer")

# The chance that any claim of a run is wrong, over all its certificates. It is not divided by the
# number of models: "each model is needed" is wrong only if a certain one is not, and its own bet
# won by chance.
ERROR = 0.05
# Claims come in turn: that the rate is kept, up to what has to be shown, and then those about
# models. If too little is kept, a claim about a model comes only after that was already wrong, so
# this share of a certificate's error is enough for both. The rest is for claims out of turn: that
# more of the rate is kept, or about a model while the rate is not shown to be kept.
IN_TURN = 0.9
# Without a needed model f shows in at most this share of the runs with it.
NEEDED_SHARE = 0.8
# At this wealth a bet against a claim ends the search for evidence.
REFUTED = 20.0
# In the first runs, and while what is left shows f in such a share of them, the whole world runs
# only where what is left missed f: one more seed tells more than a run of the whole world.
ALONE_SHARE = 0.7
ALONE_FIRST = 10
# The maximum number of pairs for what is left and for a removal. A removal is given up after some
# if its bets would have to grow so many times as fast as they did.
MOST_PAIRS = 300
MOST_REMOVAL_PAIRS = 240
FEWEST_PAIRS = 100
HOPE = 4.0
# Where f is shown to be rarer without a model and seems to keep so much of its rate, more than so
# many pairs would decide little, unless the bet that it does has won such a part of what it needs.
HELPS_AFTER = 60
HELPS_SHARE = 0.75
NEARLY = 0.2
# If the runs decide nothing, a model without which f seems to keep so much of its rate is not
# needed.
ABOUT_AS_OFTEN = 0.9
# Where f shows no more at all, a certificate ends after so many pairs; after more if f is rare, so
# that some would surely show it.
VAIN = 30
SURELY = 0.999
# Where chosen runs are reduced exactly, so many others say how often f shows with other seeds.
RUNS_BESIDE = 20
# Where the whole world repeats to the last bit with any seed, one run shows whether what is left
# depends on the seed.
RUNS_BESIDE_ALIKE = 1
# More broken runs of one claim than this, and than a tenth, leave it unknown.
MOST_BROKEN = 5
# An earlier environment is judged by a sequential test of this log-likelihood ratio, and at most so
# many runs.
ENOUGH_RATIO = 3.0
MOST_EARLIER = 60
# Each bet is divided among these stakes, parts of the highest possible one: most of it is where f
# nearly always or never shows.
STAKES = {0.3: 0.15, 0.65: 0.25, 0.95: 0.6}


@dataclass(frozen=True, kw_only=True)
class Terms:
    """The share of the whole world's rate that a certificate has to show, the share at which the
    search aims, the chance of error of all claims together, and the minimum number of runs of what
    is left.

    `first_rate` is what it had to show at first, if it goes on to show more: up to there claims are
    in turn. After `vain` pairs, none of which showed f at all, it ends.

    With `order_seed` runs are made in blocks: one run of each environment with an open claim, in an
    order that this seed draws. Without seeds runs only have in common when they are made, and rates
    may change from one run to the next. After `most_tests`, not `MOST_PAIRS`, what is open is not
    shown.
    """

    certify_rate: float
    keep_rate: float
    error: float
    at_least: int = 1
    first_rate: float | None = None
    vain: int = MOST_PAIRS
    order_seed: int | None = None
    most_tests: int | None = None

    @property
    def in_turn(self) -> float:
        """The share up to which claims of the rate that is kept are in turn."""
        if self.first_rate is None:
            return self.certify_rate
        return self.first_rate

    def error_of_models(self, kept: float | None) -> float:
        """The chance of error of a claim about a model where so much of the rate is shown to be
        kept.
        """
        return self.error * (
            IN_TURN if kept is not None and kept >= self.in_turn else 1.0 - IN_TURN
        )


def vain_after(rate: float) -> int:
    """After how many runs without f a failure that showed at this rate does not show any more."""
    return min(MOST_PAIRS, max(VAIN, 1 + iterations_needed(max(rate, 1e-6), SURELY)))


def error_of(number: int) -> float:
    """The chance of error of certificate `number`, counted from 1; those of all certificates add up
    to `ERROR`.
    """
    return ERROR * 6.0 / (math.pi * number) ** 2


@dataclass(frozen=True)
class Pairs:
    """Runs of two environments with the same seeds: how many showed f in both, in the first alone,
    in the second alone.
    """

    both: int = 0
    first: int = 0
    second: int = 0

    def after(self, first: bool, second: bool) -> Pairs:
        """The pairs with one more."""
        return Pairs(
            self.both + (first and second),
            self.first + (first > second),
            self.second + (second > first),
        )

    def above(self, share: float) -> float:
        """The wealth of the bet that the first shows f at more than `share` (above 0) of the rate
        of the second.
        """
        return _wealth(self, 1.0 / share - 1.0, 1.0 / share, -1.0)

    def below(self, share: float) -> float:
        """The wealth of the bet that the first shows f at less than `share` of the rate of the
        second.
        """
        return _wealth(self, share - 1.0, -1.0, share)

    def keeps_at_least(self, error: float, known: float = 0.0) -> float:
        """The lower bound of the share, from 0 to 1; no lower than `known`."""
        return _last(known, 1.0, lambda share: self.above(share) >= 1.0 / error)

    def at_most(self, error: float, known: float = 1.0) -> float:
        """The upper bound of the share, from 0 to 1; no higher than `known`."""
        return 1.0 - _last(1.0 - known, 1.0, lambda more: self.below(1.0 - more) >= 1.0 / error)

    @property
    def share(self) -> float:
        """How often the first showed f for each time that the second did."""
        return (self.both + self.first) / max(1, self.both + self.second)


# A screen asks for the same ones again and again.
@lru_cache(maxsize=1 << 16)
def _wealth(pairs: Pairs, both: float, first: float, second: float) -> float:
    """The wealth of a bet that gains these multiples of its stake in a pair of each kind."""
    logarithms = (
        pairs.both * math.log1p(stake * both)
        + pairs.first * math.log1p(stake * first)
        + pairs.second * math.log1p(stake * second)
        for stake in STAKES
    )
    wealths = (math.exp(min(700.0, logarithm)) for logarithm in logarithms)
    return sum(part * wealth for part, wealth in zip(STAKES.values(), wealths, strict=True))


def _last(known: float, most: float, holds: Callable[[float], bool]) -> float:
    """The highest number from `known` to `most` for which something holds that holds for all lower
    ones, to a thousandth.
    """
    if not holds(known + 0.001 * (most - known)):
        return known
    while most - known > 0.001:
        middle = (known + most) / 2.0
        known, most = (middle, most) if holds(middle) else (known, middle)
    return known


# The run of an environment with this number.
NumberedRun = tuple[Environment, int]


@dataclass(frozen=True)
class Wanted:
    """What a procedure asks for: these `tests`, as (environment, run); `later` environments will
    run with later seeds, if at all. `bound` is what its tests have shown so far.
    """

    tests: tuple[NumberedRun, ...]
    later: tuple[Environment, ...]
    bound: float | None = None


# Asks for tests, is sent whether each showed f or broke, and returns a verdict with the bound that
# was shown.
Procedure = Generator[Wanted, tuple[Shown, ...], tuple[Verdict, float | None]]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A verdict, "" while it is open, and the `bound` shown so far, that rest on tests, as
    (environment, run). `wanted` are the tests that it needs next, `later` those that it may need
    after these. `broken` of its tests broke.
    """

    verdict: Verdict
    bound: float | None = None
    rests_on: tuple[NumberedRun, ...] = ()
    broken: int = 0
    wanted: tuple[NumberedRun, ...] = ()
    later: tuple[NumberedRun, ...] = ()


class Settling:
    """A procedure that is carried as far as the finished runs go. What it claims follows from their
    outcomes in order alone.
    """

    def __init__(self, procedure: Procedure) -> None:
        # Every procedure asks for a run.
        self._procedure = procedure
        self._wanted = next(procedure)
        self._tests: list[NumberedRun] = []
        self._broken = 0
        self._settled: Claim | None = None

    def claim(self, shown: ShownIn, ahead: int = 1) -> Claim:
        """What it claims by now. Looks `ahead` for so many runs of each environment, so that idle
        workers have something to do.
        """
        while self._settled is None:
            wanted = self._wanted
            known = tuple(shown(*test) for test in wanted.tests)
            if None in known:
                last = wanted.tests[-1][1]
                later = (
                    (subject, last + more) for more in range(1, ahead) for subject in wanted.later
                )
                missing = (
                    tuple(test for test in of if shown(*test) is None)
                    for of in (wanted.tests, later)
                )
                now, then = missing
                return Claim(
                    verdict="",
                    bound=wanted.bound,
                    rests_on=tuple(self._tests),
                    broken=self._broken,
                    wanted=now,
                    later=then,
                )
            self._tests += wanted.tests
            self._broken += known.count("broken")
            ended: tuple[Verdict, float | None] | None = None
            if self._broken > max(MOST_BROKEN, len(self._tests) // 10):
                ended = "unknown", wanted.bound
            else:
                try:
                    self._wanted = self._procedure.send(known)
                except StopIteration as end:
                    ended = end.value
            if ended is not None:
                verdict, bound = ended
                self._settled = Claim(
                    verdict=verdict,
                    bound=bound,
                    rests_on=tuple(self._tests),
                    broken=self._broken,
                )
        return self._settled


def settle(procedure: Procedure, shown: ShownIn, ahead: int = 1) -> Claim:
    """What a procedure claims by the finished runs."""
    return Settling(procedure).claim(shown, ahead)


def keeps(left: Environment, whole: Environment, terms: Terms) -> Procedure:
    """What share of the rate of `whole` is kept by `left`: "kept" if at least `certify_rate` is,
    "lost", or "not shown".

    "kept" is wrong with a probability of at most the terms' error; "lost", less than `keep_rate` is
    kept, of at most 1 / `REFUTED`.
    """
    if left == whole:
        return (yield from _shows(whole, terms))
    # `assumed` takes f to show in the whole world where that did not run; `sound` takes it not to
    # show there.
    assumed = Pairs()
    sound = Pairs()
    bound = 0.0
    run = 0
    # The seeds with which only what is left has run, and showed f.
    hits: list[int] = []
    mine: Shown = True
    most_pairs = terms.most_tests or MOST_PAIRS
    while run < most_pairs or hits:
        shows_often = run < ALONE_FIRST or assumed.both + assumed.first >= ALONE_SHARE * run
        alone = shows_often and run < most_pairs and terms.order_seed is None
        theirs: Shown = None
        if hits and not alone:
            mine = True
            (theirs,) = yield Wanted(((whole, hits.pop(0)),), (whole,), bound)
            assumed = replace(assumed, both=assumed.both - 1)
            sound = replace(sound, first=sound.first - 1)
        elif alone:
            (mine,) = yield Wanted(((left, run),), (left,), bound)
            if mine is True:
                hits.append(run)
                assumed = assumed.after(True, True)
                sound = sound.after(True, False)
            else:
                (theirs,) = yield Wanted(((whole, run),), (left,), bound)
            run += 1
        else:
            mine, theirs = yield Wanted(((left, run), (whole, run)), (left, whole), bound)
            run += 1
        if theirs is not None:
            assumed = assumed.after(mine is True, theirs is not False)
            sound = sound.after(mine is not False, theirs is True)
        in_turn = min(terms.in_turn, assumed.keeps_at_least(terms.error * IN_TURN, bound))
        bound = max(in_turn, assumed.keeps_at_least(terms.error * (1.0 - IN_TURN), bound))
        if bound >= terms.certify_rate and run >= terms.at_least:
            return "kept", bound
        if sound.below(terms.keep_rate) >= REFUTED:
            return "lost", bound
        # What broke may have been f.
        if run >= terms.vain and assumed.both + assumed.first + assumed.second == 0:
            break
    return "not shown", bound


def _shows(whole: Environment, terms: Terms) -> Procedure:
    """The whole world keeps its own rate, if f shows in it at all."""
    shown = run = 0
    while run < max(1, terms.at_least) or (not shown and run < terms.vain < MOST_PAIRS):
        shown += (yield Wanted(((whole, run),), (whole,)))[0] is True
        run += 1
    if shown:
        return ("kept", 1.0)
    return ("not shown", None)


def falls(
    without: Environment,
    left: Environment,
    error: float,
    share: float = NEEDED_SHARE,
    first: int = 0,
) -> Procedure:
    """How often f shows in `without`, as a part of its rate in `left`; "needed" if at most `share`.
    Runs begin at `first`.

    "needed" is wrong with a probability of at most `error`. "rarer": f is rarer than in `left`;
    "helps": that, and more frequent than `share`, each wrong in at most 1 / `REFUTED` of the cases.
    "not needed": it seems to show about as often; that has no error, and the next certificate has
    to show it.
    """
    assumed = Pairs()
    sound = Pairs()
    bound = 1.0
    rarer = False
    for run in range(MOST_REMOVAL_PAIRS):
        mine, theirs = yield Wanted(
            ((without, first + run), (left, first + run)), (without, left), bound
        )
        assumed = assumed.after(mine is not False, theirs is True)
        sound = sound.after(mine is True, theirs is not False)
        bound = assumed.at_most(error, bound)
        if bound <= share:
            return "needed", bound
        rarer = rarer or assumed.below(1.0) >= REFUTED
        often = sound.above(share)
        if often >= REFUTED:
            return "helps" if rarer else "not needed", bound
        if (
            rarer
            and often < NEARLY * REFUTED
            and run + 1 >= HELPS_AFTER
            and assumed.share >= HELPS_SHARE
        ):
            return "rarer", bound
        likeliest = max(often * error * REFUTED, assumed.below(share))
        if (
            run + 1 >= FEWEST_PAIRS
            and likeliest ** (HOPE * MOST_REMOVAL_PAIRS / (run + 1)) < 1.0 / error
        ):
            break
    if rarer:
        return "rarer", bound
    if assumed.second + assumed.both > 0 and assumed.share >= ABOUT_AS_OFTEN:
        return "not needed", bound
    return "not shown", bound


def often(environment: Environment, runs: int) -> Procedure:
    """Runs an environment so often: it claims nothing but how often f showed."""
    yield Wanted(tuple((environment, run) for run in range(runs)), ())
    return "exact", None


def good_enough(earlier: Environment, rate: float, keep_rate: float, lost_rate: float) -> Procedure:
    """Whether an earlier environment is shown to have lost the `rate` of f, being nearer to
    `lost_rate`: "lost", else "kept".
    """
    good = min(rate, HIGHEST_RATE)
    bad = min(max(0.02, min(keep_rate * good, (good + lost_rate) / 2.0)), keep_rate * good)
    ratio = 0.0
    for run in range(MOST_EARLIER):
        (shown,) = yield Wanted(((earlier, run),), (earlier,))
        if shown != "broken":
            ratio += math.log(good / bad) if shown else math.log((1.0 - good) / (1.0 - bad))
        if abs(ratio) >= ENOUGH_RATIO:
            break
    return ("lost" if ratio <= -ENOUGH_RATIO else "kept"), None


# How many tests a certificate takes.

# How many it takes, as (low, likely, high).
Expected = tuple[int, int, int]

# It takes so many times the expected number, if the rates are right.
SHORTER = 0.55
LONGER = 2.2
# Of the pairs of runs with the same seed, so many end alike whatever their rates are.
ALIKE = 0.4
# The wealth that a bet of the first certificate needs.
NEEDS = 1.0 / (IN_TURN * error_of(1))
# Eight of ten rates are in the interval of so many standard deviations.
EIGHT_OF_TEN = 1.28


def certificate_tests(
    rate: float, certify_rate: float, left: int, at_least: int, seen: int = 0
) -> Expected:
    """Tests of a certificate of `left` needed models, as (low, likely, high): about seven of ten or
    more take between low and high, if f never shows without one of these models.

    Where f is rare, and the same seeds show it, most take fewer. Where f still shows without a
    model, most take more. `rate` is the whole world's. It was `seen` in so many runs and may be
    another one; with 0 it is known.
    """
    # A damaged run file may ask for nothing, or for all.
    rate = min(max(rate, 0.0), 1.0)
    certify_rate = min(max(certify_rate, 0.01), 0.99)
    seen = min(max(0, seen), MOST_PAIRS)
    rates = [rate, *(wilson_interval(round(rate * seen), seen, EIGHT_OF_TEN) if seen else ())]
    ends = [_expected(each, certify_rate, left, at_least) for each in rates]
    shorter, longer = _factors(ends)
    most = max(ends[0], min(2 * MOST_PAIRS + left * MOST_REMOVAL_PAIRS, ends[0] * longer))
    return math.floor(ends[0] / shorter), round(ends[0]), math.ceil(most)


def _factors(ends: Sequence[float]) -> Interval:
    """It takes one of `ends` tests by what may be the rates, the first one probably: how many times
    fewer or more it may take.
    """
    # What is not known of the rates and chance within the certificate are independent factors.
    shorter = math.exp(math.hypot(math.log(SHORTER), math.log(min(ends) / ends[0])))
    return shorter, math.exp(math.hypot(math.log(LONGER), math.log(max(ends) / ends[0])))


def certificate_from_here(
    made: int, left_runs: int, open_pairs: Sequence[int], seen: Pairs, runs: int
) -> Expected:
    """The same once removals have shown something: `made` tests so far, `left_runs` of them of what
    is left.

    Each claim about a model that is not decided has so many `open_pairs`. `runs` pairs of all
    removals were as `seen`.
    """
    with_it = (seen.both + seen.second) / runs
    second = max(seen.second, 0.5) / runs
    ends = []
    for share in (second, *wilson_interval(seen.second, runs, EIGHT_OF_TEN)):
        each = _removal_pairs(max(0.0, with_it - share), seen.first / runs, max(share, 0.01))
        ends.append(
            sum(max(1.0, each - pairs) for pairs in open_pairs) + max(1.0, each - left_runs)
        )
    shorter, longer = _factors(ends)
    # A model that is not needed ends the certificate.
    fewest = ends[0] / shorter if seen.share < NEEDED_SHARE else 0.0
    return made + math.floor(fewest), made + round(ends[0]), made + math.ceil(longer * ends[0])


def _removal_pairs(both: float, first: float, second: float) -> float:
    """After how many pairs a claim about a model is decided, where pairs have these shares."""
    kinds = both, first, second
    needed = _until(NEEDS, kinds, (NEEDED_SHARE - 1.0, -1.0, NEEDED_SHARE))
    refuted = _until(REFUTED, kinds, (1.0 / NEEDED_SHARE - 1.0, 1.0 / NEEDED_SHARE, -1.0))
    if min(needed, refuted) > HOPE * MOST_REMOVAL_PAIRS:
        given_up = FEWEST_PAIRS
    else:
        given_up = MOST_REMOVAL_PAIRS
    return min(needed, refuted, float(given_up))


def _expected(rate: float, certify_rate: float, left: int, at_least: int) -> float:
    """Its tests where the whole world and what is left show f at `rate`, and that without any of
    its models never.

    As `ddenv.evidence.certificate` goes, where the wealth of each bet grows as fast as its fastest
    stake on average.
    """
    kept = (1.0 / certify_rate - 1.0, 1.0 / certify_rate, -1.0)
    both = ALIKE * rate + (1.0 - ALIKE) * rate * rate
    pairs = (both, rate - both, rate - both)
    if rate >= ALONE_SHARE:
        of_left = max(float(at_least), _until(NEEDS, (rate, 0.0, rate - both), kept))
        of_whole = of_left * (1.0 - rate)
    else:
        of_left = of_whole = min(
            float(MOST_PAIRS), max(float(at_least), _until(NEEDS, pairs, kept))
        )
    needed = (NEEDED_SHARE - 1.0, -1.0, NEEDED_SHARE)
    removal = _until(NEEDS, (0.0, 0.0, rate), needed)
    removal = removal if removal <= MOST_REMOVAL_PAIRS else HELPS_AFTER
    lost = 2.0 * _until(REFUTED, pairs, needed)
    return min(lost, max(of_left, removal if left else 0.0) + of_whole + left * removal)


def tests_in_blocks(rate: float, certify_rate: float, left: int) -> int:
    """How many tests a certificate without seeds takes on average, where without any of `left`
    models f never shows.
    """
    both = rate * rate
    blocks = _until(
        NEEDS,
        (both, rate - both, rate - both),
        (1.0 / certify_rate - 1.0, 1.0 / certify_rate, -1.0),
    )
    removal = _until(NEEDS, (0.0, 0.0, rate), (NEEDED_SHARE - 1.0, -1.0, NEEDED_SHARE))
    return round(2.0 * blocks + left * removal)


def _until(
    wealth: float, shares: tuple[float, float, float], gains: tuple[float, float, float]
) -> float:
    """After how many pairs a bet has this wealth, on average. `shares` of all pairs have these
    `gains`.
    """
    pairs = tuple(zip(shares, gains, strict=True))
    growths = {
        stake: sum(share * math.log1p(stake * gain) for share, gain in pairs) for stake in STAKES
    }
    return min(
        math.log(wealth / STAKES[stake]) / max(1e-4, growth) for stake, growth in growths.items()
    )
