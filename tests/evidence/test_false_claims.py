"""How often a claim is false where it is hardest: at the border of what it says, with seeds that
share their luck, and broken runs.

`DDENV_CLAIMS=1000` simulates so many certificates and reductions of each kind.
"""

import os
import random
from collections import Counter
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count

import pytest
from scipy.stats import binomtest

import ddenv
from ddenv.cli.test import elsewhere
from ddenv.environment import NOTHING, Environment
from ddenv.evidence.certificate import (
    ERROR,
    HELPING,
    REFUTED,
    Pairs,
    Terms,
    certificate_from_here,
    certificate_tests,
    error_of,
    falls,
    keeps,
    settle,
)
from ddenv.evidence.margins import (
    GONE,
    MISSED,
    MOST_OF_NUMBER,
    SHOWS,
    Known,
    Rule,
    error_each,
    margin_of,
    wanted,
)
from ddenv.evidence.rates import anytime_interval, estimated_rate, shows_at
from ddenv.evidence.slices import fresh_chance
from ddenv.reduction.isolation import Passing, passes
from ddenv.reduction.procedure import certify, procedure
from ddenv.runfile.events import NumberAsked
from ddenv.runfile.progress import Claim
from ddenv.words.slices import _chance
from tests.reduction import driving

pytestmark = pytest.mark.claims

SIMULATED = int(os.environ.get("DDENV_CLAIMS", "100"))
# Of what takes longer: whole reductions, forecasts, and margins.
LONGER = int(os.environ.get("DDENV_CLAIMS", "30"))
WHOLE, LEFT, REST = Environment.whole(6), Environment.whole(2), Environment.whole(1)
TERMS = Terms(certify_rate=2 / 3, keep_rate=0.8, error=error_of(1), at_least=10)


@dataclass(frozen=True)
class World:
    """The true rates of f in the whole world, in what is left, and in that without a model.

    A share `together` of the seeds has the same luck in all of them. A share `breaks` of the runs
    of what is left breaks where it would have missed f, and as many of the runs without a model
    where they would have shown it: the worst that breaking can do.
    """

    whole: float
    left: float
    rest: float = 0.0
    together: float = 0.0
    breaks: float = 0.0

    def shown(self, salt):
        def shown(environment, run):
            own, common = (
                random.Random(f"{salt} {environment.bits} {run}"),
                random.Random(f"{salt} {run}"),
            )
            luck = (common if common.random() < self.together else own).random()
            f = luck < {WHOLE: self.whole, LEFT: self.left}.get(environment, self.rest)
            against = f == (environment != LEFT)
            return "broken" if against and own.random() < self.breaks else f

        return shown


@pytest.fixture
def check(record_property):
    """Fails if so many false sentences are unlikely where each is false with a chance of `error`;
    conftest.py prints all.
    """

    def counted(false, error, simulated=SIMULATED, sentence=""):
        chance = binomtest(false, simulated, error, alternative="greater").pvalue
        row = f"{sentence} | {false} of {simulated} | {error:.2%} | {chance:.2g}"
        record_property("false claims", row)
        assert chance > 0.001, row

    return counted


KEPT = {
    "sure": World(1.0, 0.665),
    "usual": World(0.9, 0.599),
    "the same luck": World(0.9, 0.599, together=0.8),
    "rare": World(0.4, 0.265, together=0.5),
    "broken": World(0.9, 0.599, breaks=0.2),
}


@pytest.mark.parametrize("world", KEPT.values(), ids=KEPT)
def test_what_is_kept_is_rarely_less_than_the_bound(world, check):
    claims = [settle(keeps(LEFT, WHOLE, TERMS), world.shown(salt)) for salt in range(SIMULATED)]
    check(sum((claim.bound or 0.0) > world.left / world.whole for claim in claims), TERMS.error)


NEEDED = {
    "sure": World(1.0, 1.0, 0.805),
    "usual": World(0.9, 0.9, 0.725, together=0.3),
    "the same luck": World(0.6, 0.6, 0.485, together=0.8),
    "broken": World(0.9, 0.9, 0.725, breaks=0.2),
}


@pytest.mark.parametrize("world", NEEDED.values(), ids=NEEDED)
def test_without_a_model_f_is_rarely_more_frequent_than_the_bound(world, check):
    claims = [
        settle(falls(REST, LEFT, TERMS.error), world.shown(salt)) for salt in range(SIMULATED)
    ]
    check(sum((claim.bound or 1.0) < world.rest / world.left for claim in claims), TERMS.error)


GOES_ON = replace(TERMS, certify_rate=0.8, first_rate=2 / 3)
TOGETHER = {
    "neither is true": (World(1.0, 0.665, 0.535), TERMS),
    "neither is true, the same luck": (World(0.9, 0.599, 0.482, together=0.8), TERMS),
    "only the rate is kept": (World(0.9, 0.9, 0.725, together=0.3), TERMS),
    "the model is needed, the rate is not kept": (World(0.9, 0.599, 0.1, together=0.3), TERMS),
    "more is asked for later": (World(1.0, 0.77, 0.62), GOES_ON),
}


@pytest.mark.parametrize(("world", "terms"), TOGETHER.values(), ids=TOGETHER)
def test_what_is_said_of_the_rate_and_of_a_model_together_is_rarely_false(world, terms, check):
    """One share of the error is enough for both, as the model has its turn only when the rate is
    shown to be kept.
    """
    false = 0
    for salt in range(SIMULATED):
        kept = settle(keeps(LEFT, WHOLE, terms), world.shown(salt))
        model = settle(falls(REST, LEFT, terms.error_of_models(kept.bound)), world.shown(salt))
        false += (kept.bound or 0.0) > world.left / world.whole or (
            model.bound or 1.0
        ) < world.rest / world.left
    check(false, terms.error)


WITHOUT = {
    f"{name}{' and luck' * bool(together)}": replace(world, together=together)
    for together in (0.0, 0.8)
    for name, world in {
        "nothing changes": World(0.4, 0.4, 0.4),
        "nothing changes, usual": World(0.8, 0.8, 0.8),
        "nothing changes, sure": World(1.0, 1.0, 1.0),
        "needed, hardly ever": World(0.05, 0.05, 0.0),
        "needed, just": World(0.2, 0.2, 0.158),
        "needed, rare": World(0.3, 0.3, 0.21),
        "needed, usual": World(0.9, 0.9, 0.72),
    }.items()
}
# "Not needed" has no error: docs/statistics.md says in how many cases it is wrong where it is wrong
# often.
SEEMS = 0.4


@pytest.mark.parametrize("world", WITHOUT.values(), ids=WITHOUT)
def test_a_model_rarely_helps_or_seems_not_needed_where_that_is_false(world, check):
    claims = [
        settle(falls(REST, LEFT, TERMS.error), world.shown(salt)).verdict
        for salt in range(SIMULATED)
    ]
    if world.rest == world.left:
        check(claims.count("needed"), TERMS.error, sentence="needed")
        check(claims.count("helps") + claims.count("rarer"), 1.0 / REFUTED, sentence="helps")
    else:
        check(claims.count("helps"), 1.0 / REFUTED, sentence="helps")
        check(claims.count("not needed"), SEEMS, sentence="seems not needed")


@pytest.mark.parametrize("together", [0.0, 0.8])
def test_what_keeps_what_the_search_aims_at_is_rarely_lost(together, check):
    world = World(0.9, 0.721, together=together)
    claims = [
        settle(keeps(LEFT, WHOLE, TERMS), world.shown(salt)).verdict for salt in range(SIMULATED)
    ]
    check(claims.count("lost"), 1.0 / REFUTED)


@pytest.mark.parametrize(("reached", "runs"), [(0, 10), (5, 10), (27, 30), (300, 300)])
def test_a_world_rarely_passes_that_passes_as_seldom_as_the_whole_world(reached, runs, check):
    rule, error = Passing.of(reached, runs), error_of(1) / 2
    rate, passed = min(rule.rather_than, 0.97), 0
    for salt in range(SIMULATED):
        shown = World(rate, rate).shown(salt)
        passed += (
            settle(passes(LEFT, Passing(rule.wanted, rule.rather_than, error), 10), shown).verdict
            == "passes"
        )
    check(passed, error)


@pytest.mark.parametrize("rate", [0.05, 0.5, 0.9, 1.0])
def test_an_interval_rarely_misses_the_rate_although_it_is_looked_at_after_each_run(rate, check):
    missed = 0
    for salt in range(SIMULATED):
        draw, shown = random.Random(salt), 0
        for run in range(1, 120):
            shown += draw.random() < rate
            low, high = anytime_interval(shown, run)
            if not low <= rate <= high:
                missed += 1
                break
    check(missed, 0.05)


@pytest.mark.parametrize("often", [1.1, 2.0, 3.2])
def test_what_no_run_met_is_rarely_met_more_often_than_said(often, check):
    runs, false = 20, 0
    for salt in range(SIMULATED):
        draw = random.Random(salt)
        met = [Environment.of([1] if draw.random() < often / runs else []) for _ in range(runs)]
        kind, _, most = _chance(met).removesuffix(" %").rpartition(" ")
        false += kind == "probably below" and not any(met) and 100 * often / runs > float(most)
    check(false, 0.05)


# Where is f in 0.9 of the runs, and how often does it show in what is left?
LOOPS = {
    "a model that halves it": lambda kept: 0.9 * 0.5 ** ("b" not in kept),
    "many that each take a bit": lambda kept: 0.9 * 0.93 ** (5 - len(kept & set("bcdef"))),
    "one that takes a fifth": lambda kept: 0.9 * 0.81 ** ("b" not in kept),
    "either of two": lambda kept: 0.9 * (0.3 + 0.7 * bool(kept & set("bc"))),
    "two of four": lambda kept: 0.9 * (0.2, 0.6, 1.0, 1.0, 1.0)[len(kept & set("bcde"))],
    "a model that hides it": lambda kept: (
        0.9 * (0.5 if "b" in kept else 1.0) * 0.5 ** ("c" not in kept)
    ),
}


# What all rates are multiplied by in each call of the test.
IN_TIME = {
    "steady": lambda call: 1.0,
    "all rates fall": lambda call: max(0.3, 1.0 - call / 600),
    "every second call is luckier": lambda call: (1.0, 0.4)[call % 2],
}


@pytest.mark.parametrize("in_time", IN_TIME.values(), ids=IN_TIME)
@pytest.mark.parametrize("rate", LOOPS.values(), ids=LOOPS)
def test_all_claims_of_a_whole_reduction_are_rarely_false(rate, in_time, check):
    """Also where f gets rarer with each call of the test, or alternates, in all that is kept
    alike.
    """
    false = 0
    for salt in range(LONGER):
        draw, calls = random.Random(salt), count()

        def shows_f(kept, draw=draw, calls=calls):
            return "a" in kept and draw.random() < rate(kept) * in_time(next(calls))

        found = ddenv.reduce("abcdefgh", shows_f, algorithm="ddmin", iterations=3)
        left = frozenset(found.kept)
        for claim in found.claims:
            share = rate(left) / rate(frozenset("abcdefgh")) if "a" in left else 0.0
            if claim.without is None:
                false += claim.verdict == "kept" and claim.bound > share
            elif claim.verdict == "needed" and claim.without != "a":
                false += claim.bound < rate(left - {claim.without}) / rate(left)
    check(false, ERROR, LONGER)


@dataclass(frozen=True)
class Lucky(driving.World):
    """A share `together` of the seeds has the same luck in all environments.

    With `competes` another failure is as frequent in the whole world, and f is the luckier one of
    the first runs. A share `crashes` of the runs with f breaks.
    """

    together: float = 0.0
    crashes: float = 0.0

    def luck(self, environment, run):
        common, own = (
            random.Random(f"{self.seed} {run}"),
            random.Random(f"{self.seed} {environment.bits} {run}"),
        )
        return (common if common.random() < self.together else own).random()

    @cached_property
    def before(self):
        """Below this luck the other failure shows, if at all."""
        luck = [self.luck(self.whole, run) for run in range(self.baseline_runs)]
        first, second = (
            sum(low <= one < low + self.rate for one in luck) for low in (0.0, self.rate)
        )
        return self.rate if self.competes and second > first else 0.0

    def outcome(self, environment, run):
        f = 0.0 <= self.luck(environment, run) - self.before < self.rate_in(environment)
        crashes = (
            random.Random(f"crash {self.seed} {environment.bits} {run}").random() < self.crashes
        )
        return "broken" if f and crashes else f


LUCKY = Lucky(
    tuple(range(6)),
    Environment.of([0]),
    Environment.of([1, 2]),
    "ddenv",
    0,
    0.9,
    0.79,
    iterations=3,
    baseline_runs=10,
)
REDUCTIONS = {
    "independent": LUCKY,
    "the same luck": replace(LUCKY, together=0.8),
    "crashes with f": replace(LUCKY, crashes=0.25),
    "rare crashes with f": replace(LUCKY, crashes=0.05, together=0.5),
    "competing failures": replace(LUCKY, rate=0.45, competes=True),
    "competing failures, the same luck": replace(LUCKY, rate=0.45, competes=True, together=0.8),
}


@pytest.mark.parametrize("world", REDUCTIONS.values(), ids=REDUCTIONS)
def test_what_a_whole_reduction_says_is_rarely_false(world, check):
    """Where each of two models takes a bit more of the rate than a needed one has to, and than the
    search may lose.
    """
    said, false = Counter(), Counter()
    for seed in range(LONGER):
        one = replace(world, seed=seed)
        driver = driving.Driver(one)
        driver.drive(procedure(driver, one.whole, one.baseline_runs, keeps_rate=True))
        told = list(sentences(one, driver))
        # One chance in a reduction, however many of its certificates say the same: the seeds of one
        # are shared.
        said += Counter({kind for kind, _ in told})
        false += Counter({kind for kind, true in told if not true})
    assert said["bound"] > LONGER / 2
    # Where many runs break, nothing is lost for sure.
    assert said["lost"] > LONGER / 5 or world.crashes
    check(false["bound"], ERROR, LONGER, sentence="kept, needed")
    check(false["first lost"], 1.0 / REFUTED, LONGER, sentence="lost")
    check(false["first interval"], 0.05, LONGER, sentence="interval")


def sentences(world, driver):
    """All that the certificates of a reduction say, each with whether it is true."""
    certified = [fact[1] for fact in driver.facts if fact[0] == "certified"]
    for place, fact in enumerate(certified):
        left = world.rate_in(fact.claims[0].environment)
        for named in fact.claims:
            rate, claim = world.rate_in(named.environment), named.claim
            if named.model is None:
                yield "bound", claim.bound <= rate / world.rate
                lost, terms = claim.verdict == "lost", fact.certificate.terms
                if lost:
                    yield "lost", rate < terms.keep_rate * world.rate
                if not place:
                    # The others are about what the first ones left.
                    runs = (
                        driver.shown(named.environment, fact.certificate.first_run + run)
                        for run in named.runs
                    )
                    shown = [one for one in runs if one != "broken"]
                    low, high = anytime_interval(sum(shown), len(shown))
                    # Of the runs that did not break.
                    sound = rate * (1.0 - world.crashes) / (1.0 - rate * world.crashes)
                    yield "first interval", low <= sound <= high
                    yield "first lost", not lost or rate < terms.keep_rate * world.rate
            elif left:
                yield "bound", claim.bound >= rate / left


@pytest.mark.parametrize("share", [0.801, 0.82])
def test_models_that_are_called_needed_beside_others_that_only_help_are_rarely_not(share, check):
    """The runs choose of which of ten models "minimal but for" is said: the error is that of all of
    them.
    """
    false = 0
    for seed in range(LONGER):
        ten = driving.World(
            tuple(range(10)),
            NOTHING,
            Environment.whole(10),
            "ddenv",
            seed,
            1.0,
            share,
            keeps_rate=False,
        )
        driver = driving.Driver(ten)
        made = driver.drive(certify(driver, driver.search(), (ten.whole,)))
        _, *verdicts = (named.claim.verdict for named in made.claims)
        false += "needed" in verdicts and {*verdicts} <= {"needed", *HELPING}
    check(false, error_of(1), LONGER)


@pytest.mark.parametrize(("rate", "without"), [(0.0, 0.0), (0.15, 0.15), (0.9, 0.73), (1.0, 0.805)])
def test_a_model_is_rarely_needed_in_another_simulator_where_it_is_not(rate, without, check):
    here, said = Claim(without=None, verdict="kept", shown=29, runs=29, low=0.88, high=1.0), 0
    for salt in range(SIMULATED):
        draw = random.Random(salt)
        results = [
            {
                "without": name,
                "models": 2,
                "outcome": "similar" if draw.random() < one else "pass",
                "seed": seed,
            }
            for name, one in ((None, rate), ("crate", without))
            for seed in range(40)
        ]
        said += "needed in MuJoCo, too" in elsewhere(results, here, "MuJoCo")[1]["said"]
    check(said, ERROR)


@pytest.mark.parametrize("share", [0.5, 0.4])
def test_what_still_fails_rarely_fails_at_half_the_rate_that_is_said(share, check):
    low, said = 0.8, 0
    for salt in range(SIMULATED):
        draw = random.Random(salt)
        said += shows_at((draw.random() < share * low for _ in range(60)), low) is True
    check(said, 0.01)


@pytest.mark.parametrize("rate", [1.0, 0.7])
def test_the_goal_is_rarely_said_to_be_reached_to_the_end_where_it_is_not(rate, check):
    """In a window of values alone, as wide as half of the range: beyond it f shows again."""
    asked, false = NumberAsked(name="x", now=0.5, low=0.0, high=1.0, scale=1.0, resolution=0.01), 0
    rule = Rule(rate, error_each(rate, MOST_OF_NUMBER))
    for salt in range(LONGER):
        draw, outcomes = random.Random(salt), {}
        first = draw.uniform(0.52, 0.9)
        window = first, draw.uniform(first + 0.02, 1.0)
        while asks := list(wanted(asked, rule, Known(outcomes, outcomes))):
            for value, _ in asks:
                goal, f = window[0] <= value < window[1], draw.random() < rate
                outcomes.setdefault(value, []).append(
                    "pass" if goal else "similar" if f else "other"
                )
        false += margin_of(asked, rule, Known(outcomes, outcomes)).up.to_end
    check(false, ERROR, LONGER, sentence="to the end")


# At each value of a number: the share of its rate at which f shows, and the chance that the robot
# reaches its goal.
VALUES = {
    "f is all but gone": (GONE, 0.0),
    "f still shows": (SHOWS, 0.0),
    "f still shows, else the goal": (SHOWS, 1.0),
    "the goal is mostly missed": (0.0, MISSED),
}


@pytest.mark.parametrize("rate", [1.0, 0.7])
@pytest.mark.parametrize(("share", "goal"), VALUES.values(), ids=VALUES)
def test_what_margins_say_of_the_values_of_a_number_is_rarely_false(share, goal, rate, check):
    """That f shows up to a value, that it is gone at one, and that the robot reaches its goal at
    one: all of a call together.
    """
    asked, false = NumberAsked(name="x", now=0.5, low=0.0, high=1.0, scale=1.0, resolution=0.01), 0
    rule = Rule(rate, error_each(rate, MOST_OF_NUMBER))
    wrong = {"f"} if share <= GONE else {"other", "goal"}
    if goal <= MISSED:
        wrong.add("goal")
    for salt in range(SIMULATED):
        draw, outcomes = random.Random(salt), {}
        while asks := list(wanted(asked, rule, Known(outcomes, outcomes))):
            for value, _ in asks:
                f, reached = draw.random() < share * rate, draw.random() < goal
                outcomes.setdefault(value, []).append(
                    "similar" if f else "pass" if reached else "other"
                )
        tried = [
            value
            for side in margin_of(asked, rule, Known(outcomes, outcomes)).sides
            for value in side.tried
        ]
        false += any(value.verdict in wrong for value in tried)
    check(false, ERROR, sentence="f up to, no f at, goal at")


AS_NEEDED = {
    "sure": World(1.0, 1.0),
    "usual": World(0.9, 0.9),
    "the same luck": World(0.9, 0.9, together=0.8),
    "rare": World(0.6, 0.6),
}
FORECAST = AS_NEEDED | {
    "rare, the same luck": World(0.4, 0.4, together=0.8),
    "removals halve the rate": World(0.9, 0.9, 0.5),
    "removals take a bit": World(0.9, 0.9, 0.7, together=0.5),
    "not needed": World(0.9, 0.9, 0.9),
    "a part is kept": World(0.9, 0.77, 0.3, together=0.3),
}
# A forecast says in what range eight of ten certificates are.
OUTSIDE = 0.2
PAIRS = 10


@pytest.mark.parametrize("world", FORECAST.values(), ids=FORECAST)
def test_about_eight_of_ten_certificates_take_as_many_tests_as_forecast(world, check):
    """At the start in the worlds that it takes for granted; once a model has some pairs, in any
    world.
    """
    at_first, later = Counter(), Counter()
    for salt in range(LONGER):
        took, first, from_here = forecasts(world.shown(salt))
        at_first[not first[0] <= took <= first[-1]] += 1
        if from_here is not None:
            later[not from_here[0] <= took <= from_here[-1]] += 1
    if world in AS_NEEDED.values():
        check(at_first[True], OUTSIDE, LONGER, sentence="forecast at the start")
    if later.total():
        check(later[True], OUTSIDE, later.total(), sentence="forecast after ten pairs")


def forecasts(shown, models=3):
    """How many tests a certificate takes, and its forecasts: after a baseline of ten runs, and
    after ten pairs without a model.
    """
    seen = sum(shown(WHOLE, -1 - run) is True for run in range(10))
    first = certificate_tests(
        estimated_rate(seen, 10), TERMS.certify_rate, models, TERMS.at_least, 10
    )
    kept = settle(keeps(LEFT, WHOLE, TERMS), shown)
    made, from_here = dict.fromkeys(kept.rests_on), None
    for place in range(models if kept.verdict != "lost" else 0):
        error = TERMS.error_of_models(kept.bound)
        claim = settle(falls(Environment.of([9 + place]), LEFT, error), shown)
        if from_here is None and len(claim.rests_on) > 2 * PAIRS:
            pairs = Pairs()
            done = {**made, **dict.fromkeys(claim.rests_on[: 2 * PAIRS])}
            for run in range(PAIRS):
                pairs = pairs.after(
                    *(shown(*test) for test in claim.rests_on[2 * run : 2 * run + 2])
                )
            of_left = sum(environment == LEFT for environment, _ in done)
            still = [PAIRS, *[0] * (models - 1 - place)]
            from_here = certificate_from_here(len(done), of_left, still, pairs, PAIRS)
        made |= dict.fromkeys(claim.rests_on)
        if claim.verdict == "not needed":
            break
    return len(made), first, from_here


# What a run meets beside five usual models: the chance, of how many groups of models one, and how
# many are in each.
MEETS = {"a detour": (0.1, 1, 12), "one of many": (0.3, 300, 1), "another group": (0.2, 50, 10)}


@pytest.mark.parametrize("world", MEETS.values(), ids=MEETS)
def test_the_chance_that_a_run_meets_another_model_is_about_what_is_said(world):
    chance, groups, size = world
    said = true = 0.0
    for salt in range(10 * SIMULATED):
        draw, met, seen = random.Random(salt), [], set()
        for _ in range(10):
            group = draw.randrange(groups) if draw.random() < chance else None
            others = () if group is None else range(5 + size * group, 5 + size * (group + 1))
            met.append(Environment.of((*range(5), *others)))
            seen |= {group} - {None}
        said += fresh_chance(met)
        true += chance * (groups - len(seen)) / groups
    assert 0.8 * true - SIMULATED / 10 < said < 1.3 * true + SIMULATED / 10
