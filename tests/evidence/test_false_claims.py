"""How often a claim is false where it is hardest: at the border of what it says, with seeds that share their luck, and broken runs.

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
from ddenv.evidence.certificate import ERROR, HELPING, REFUTED, Terms, error_of, falls, keeps, settle
from ddenv.evidence.margins import MOST_OF_NUMBER, Known, Rule, error_each, margin_of, wanted
from ddenv.evidence.rates import anytime_interval, shows_at
from ddenv.evidence.slices import fresh_chance
from ddenv.reduction.isolation import Passing, passes
from ddenv.reduction.procedure import certify, procedure
from ddenv.runfile.events import NumberAsked
from ddenv.runfile.progress import Claim
from ddenv.words.slices import _chance
from tests.reduction import driving

pytestmark = pytest.mark.claims

SIMULATED = int(os.environ.get("DDENV_CLAIMS", "150"))
WHOLE, LEFT, REST = Environment.whole(6), Environment.whole(2), Environment.whole(1)
TERMS = Terms(2 / 3, 0.8, error_of(1), 10)


@dataclass(frozen=True)
class World:
    """The true rates of f in the whole world, in what is left, and in that without a model.

    A share `together` of the seeds has the same luck in all of them. A share `breaks` of the runs of what is left breaks where it
    would have missed f, and as many of the runs without a model where they would have shown it: the worst that breaking can do.
    """

    whole: float
    left: float
    rest: float = 0.0
    together: float = 0.0
    breaks: float = 0.0

    def shown(self, salt):
        def shown(environment, run):
            own, common = random.Random(f"{salt} {environment.bits} {run}"), random.Random(f"{salt} {run}")
            luck = (common if common.random() < self.together else own).random()
            f = luck < {WHOLE: self.whole, LEFT: self.left, REST: self.rest}[environment]
            against = f == (environment != LEFT)
            return "broken" if against and own.random() < self.breaks else f

        return shown


def check(false, error, simulated=SIMULATED):
    """Fails if so many false claims are unlikely where each is false with a chance of `error`. With -s it prints a table of all."""
    kind = os.environ["PYTEST_CURRENT_TEST"].partition("::")[2].removesuffix(" (call)")
    print(f"| {kind} | {false} of {simulated} | {false / simulated:.1%} | {error:.1%} |")
    assert binomtest(false, simulated, error, alternative="greater").pvalue > 0.001, f"{false} of {simulated} are false"


KEPT = {
    "sure": World(1.0, 0.665),
    "usual": World(0.9, 0.599),
    "the same luck": World(0.9, 0.599, together=0.8),
    "rare": World(0.4, 0.265, together=0.5),
    "broken": World(0.9, 0.599, breaks=0.2),
}


@pytest.mark.parametrize("world", KEPT.values(), ids=KEPT)
def test_what_is_kept_is_rarely_less_than_the_bound(world):
    claims = [settle(keeps(LEFT, WHOLE, TERMS), world.shown(salt)) for salt in range(SIMULATED)]
    check(sum((claim.bound or 0.0) > world.left / world.whole for claim in claims), TERMS.error)


NEEDED = {
    "sure": World(1.0, 1.0, 0.805),
    "usual": World(0.9, 0.9, 0.725, together=0.3),
    "the same luck": World(0.6, 0.6, 0.485, together=0.8),
    "broken": World(0.9, 0.9, 0.725, breaks=0.2),
}


@pytest.mark.parametrize("world", NEEDED.values(), ids=NEEDED)
def test_without_a_model_f_is_rarely_more_frequent_than_the_bound(world):
    claims = [settle(falls(REST, LEFT, TERMS.error), world.shown(salt)) for salt in range(SIMULATED)]
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
def test_what_is_said_of_the_rate_and_of_a_model_together_is_rarely_false(world, terms):
    """One share of the error is enough for both, as the model has its turn only when the rate is shown to be kept."""
    false = 0
    for salt in range(SIMULATED):
        kept = settle(keeps(LEFT, WHOLE, terms), world.shown(salt))
        model = settle(falls(REST, LEFT, terms.error_of_models(kept.bound)), world.shown(salt))
        false += (kept.bound or 0.0) > world.left / world.whole or (model.bound or 1.0) < world.rest / world.left
    check(false, terms.error)


@pytest.mark.parametrize("together", [0.0, 0.8])
@pytest.mark.parametrize("rate", [0.4, 0.8, 1.0])
def test_what_changes_nothing_rarely_helps(rate, together):
    world = World(rate, rate, rate, together)
    claims = [settle(falls(REST, LEFT, TERMS.error), world.shown(salt)).verdict for salt in range(SIMULATED)]
    check(claims.count("helps") + claims.count("needed"), 1.0 / REFUTED + TERMS.error)


@pytest.mark.parametrize("together", [0.0, 0.8])
def test_what_keeps_what_the_search_aims_at_is_rarely_lost(together):
    world = World(0.9, 0.721, together=together)
    claims = [settle(keeps(LEFT, WHOLE, TERMS), world.shown(salt)).verdict for salt in range(SIMULATED)]
    check(claims.count("lost"), 1.0 / REFUTED)


@pytest.mark.parametrize(("reached", "runs"), [(0, 10), (5, 10), (27, 30), (300, 300)])
def test_a_world_rarely_passes_that_passes_as_seldom_as_the_whole_world(reached, runs):
    rule, error = Passing.of(reached, runs), error_of(1) / 2
    rate, passed = min(rule.rather_than, 0.97), 0
    for salt in range(SIMULATED):
        shown = World(rate, rate).shown(salt)
        passed += settle(passes(LEFT, Passing(rule.wanted, rule.rather_than, error), 10), shown).verdict == "passes"
    check(passed, error)


@pytest.mark.parametrize("rate", [0.05, 0.5, 0.9, 1.0])
def test_an_interval_rarely_misses_the_rate_although_it_is_looked_at_after_each_run(rate):
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
def test_what_no_run_met_is_rarely_met_more_often_than_said(often):
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
}


# What all rates are multiplied by in each call of the test.
IN_TIME = {
    "steady": lambda call: 1.0,
    "all rates fall": lambda call: max(0.3, 1.0 - call / 600),
    "every second call is luckier": lambda call: (1.0, 0.4)[call % 2],
}


@pytest.mark.parametrize("in_time", IN_TIME.values(), ids=IN_TIME)
@pytest.mark.parametrize("rate", LOOPS.values(), ids=LOOPS)
def test_all_claims_of_a_whole_reduction_are_rarely_false(rate, in_time):
    """Also where f gets rarer with each call of the test, or alternates, in all that is kept alike."""
    false = 0
    for salt in range(SIMULATED):
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
    check(false, ERROR)


@dataclass(frozen=True)
class Lucky(driving.World):
    """A share `together` of the seeds has the same luck in all environments.

    With `competes` another failure is as frequent in the whole world, and f is the luckier one of the first runs.
    """

    together: float = 0.0

    def luck(self, environment, run):
        common, own = random.Random(f"{self.seed} {run}"), random.Random(f"{self.seed} {environment.bits} {run}")
        return (common if common.random() < self.together else own).random()

    @cached_property
    def before(self):
        """Below this luck the other failure shows, if at all."""
        luck = [self.luck(self.whole, run) for run in range(self.baseline_runs)]
        first, second = (sum(low <= one < low + self.rate for one in luck) for low in (0.0, self.rate))
        return self.rate if self.competes and second > first else 0.0

    def outcome(self, environment, run):
        return 0.0 <= self.luck(environment, run) - self.before < self.rate_in(environment)


LUCKY = Lucky(
    tuple(range(6)), Environment.of([0]), Environment.of([1, 2]), "ddenv", 0, 0.9, 0.79, iterations=3, baseline_runs=10
)
REDUCTIONS = {
    "independent": LUCKY,
    "the same luck": replace(LUCKY, together=0.8),
    "competing failures": replace(LUCKY, rate=0.45, competes=True),
    "competing failures, the same luck": replace(LUCKY, rate=0.45, competes=True, together=0.8),
}


@pytest.mark.parametrize("world", REDUCTIONS.values(), ids=REDUCTIONS)
def test_what_a_whole_reduction_says_is_rarely_false(world):
    """Where each of two models takes a bit more of the rate than a needed one has to, and than the search may lose."""
    said, false = Counter(), Counter()
    for seed in range(SIMULATED):
        one = replace(world, seed=seed)
        driver = driving.Driver(one)
        driver.drive(procedure(driver, one.whole, one.baseline_runs, keeps_rate=True))
        told = list(sentences(one, driver))
        # One chance in a reduction, however many of its certificates say the same: the seeds of one are shared.
        said += Counter({kind for kind, _ in told})
        false += Counter({kind for kind, true in told if not true})
    assert said["bound"] > SIMULATED / 2
    assert said["lost"] > SIMULATED / 5
    check(false["bound"], ERROR)
    check(false["first lost"], 1.0 / REFUTED)
    check(false["first interval"], 0.05)


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
                    shown = [driver.shown(named.environment, fact.certificate.first_run + run) for run in named.runs]
                    low, high = anytime_interval(sum(shown), len(shown))
                    yield "first interval", low <= rate <= high
                    yield "first lost", not lost or rate < terms.keep_rate * world.rate
            elif left:
                yield "bound", claim.bound >= rate / left


TOO_RARE = {"hardly ever": World(0.05, 0.05, 0.0), "rare": World(0.3, 0.3, 0.21), "usual": World(0.9, 0.9, 0.72)}


@pytest.mark.parametrize("world", TOO_RARE.values(), ids=TOO_RARE)
def test_without_a_model_that_is_said_to_help_f_is_rarely_as_rare_as_without_a_needed_one(world):
    claims = [settle(falls(REST, LEFT, TERMS.error), world.shown(salt)).verdict for salt in range(SIMULATED)]
    check(claims.count("helps"), 1.0 / REFUTED)


@pytest.mark.parametrize("share", [0.801, 0.82])
def test_models_that_are_called_needed_beside_others_that_only_help_are_rarely_not(share):
    """The runs choose of which of ten models "minimal but for" is said: the error is that of all of them."""
    false = 0
    for seed in range(SIMULATED):
        ten = driving.World(
            tuple(range(10)), NOTHING, Environment.whole(10), "ddenv", seed, 1.0, share, keeps_rate=False
        )
        driver = driving.Driver(ten)
        made = driver.drive(certify(driver, driver.leg(), (ten.whole,)))
        _, *verdicts = (named.claim.verdict for named in made.claims)
        false += "needed" in verdicts and {*verdicts} <= {"needed", *HELPING}
    check(false, error_of(1))


@pytest.mark.parametrize(("rate", "without"), [(0.0, 0.0), (0.15, 0.15), (0.9, 0.73), (1.0, 0.805)])
def test_a_model_is_rarely_needed_in_another_simulator_where_it_is_not(rate, without):
    here, said = Claim(None, "kept", 29, 29, 0.88, 1.0), 0
    for salt in range(SIMULATED):
        draw = random.Random(salt)
        results = [
            {"without": name, "models": 2, "outcome": "similar" if draw.random() < one else "pass", "seed": seed}
            for name, one in ((None, rate), ("crate", without))
            for seed in range(40)
        ]
        said += "needed in MuJoCo, too" in elsewhere(results, here, "MuJoCo")[1]["said"]
    check(said, ERROR)


@pytest.mark.parametrize("share", [0.5, 0.4])
def test_what_still_fails_rarely_fails_at_half_the_rate_that_is_said(share):
    low, said = 0.8, 0
    for salt in range(SIMULATED):
        draw = random.Random(salt)
        said += shows_at((draw.random() < share * low for _ in range(60)), low) is True
    check(said, 0.01)


@pytest.mark.parametrize("rate", [1.0, 0.7])
def test_the_goal_is_rarely_said_to_be_reached_to_the_end_where_it_is_not(rate):
    """In a window of values alone, as wide as half of the range: beyond it f shows again."""
    asked, false = NumberAsked("x", 0.5, 0.0, 1.0, 1.0, 0.01), 0
    rule = Rule(rate, error_each(rate, MOST_OF_NUMBER))
    for salt in range(SIMULATED // 3):
        draw, outcomes = random.Random(salt), {}
        first = draw.uniform(0.52, 0.9)
        window = first, draw.uniform(first + 0.02, 1.0)
        while asks := list(wanted(asked, rule, Known(outcomes, outcomes))):
            for value, _ in asks:
                goal, f = window[0] <= value < window[1], draw.random() < rate
                outcomes.setdefault(value, []).append("pass" if goal else "similar" if f else "other")
        false += margin_of(asked, rule, Known(outcomes, outcomes)).up.to_end
    check(false, ERROR, SIMULATED // 3)


# What a run meets beside five usual models: the chance, of how many groups of models one, and how many are in each.
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
