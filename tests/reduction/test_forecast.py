"""What a search is expected to take: held against real searches, without a robot."""

from dataclasses import replace

import numpy as np
import pytest

from ddenv.environment import NOTHING, Environment
from ddenv.reduction.evidence import Evidence, Trial
from ddenv.reduction.forecast import Memory, Moment, interval, playing, plays
from ddenv.reduction.guide import make_guide, search
from ddenv.reduction.procedure import Leg, RoundBegan, RoundEnded, Similar, Wants, search_on
from ddenv.reduction.verdict import Acceptance
from ddenv.schemas import split_pair

NEAR = "model2model/failure-proximal"


def world(models, seed=0):
    """Models on 20 x 20 m, and a robot that drove straight to the middle, where it failed."""
    rng = np.random.default_rng([models, seed])
    places = rng.uniform(0, 20, (models, 2))
    elements = tuple(f"m{index}" for index in range(models))
    times = np.linspace(0, 20, 41)
    path = np.column_stack([times, np.clip(times, 0, 10), np.full(41, 10.0), np.zeros((41, 2))])
    sensed = {name: float(place[0]) for name, place in zip(elements, places, strict=True)}
    positions = {name: (*place, 0.0) for name, place in zip(elements, places.tolist(), strict=True)}
    return Evidence(elements, positions, path, (10.0, 10.0, 0.0), sensed, seed=seed)


def needed_of(known, count):
    """The models which f needs: likelier the nearer they are to it."""
    rng = np.random.default_rng([known.seed, count])
    apart = np.linalg.norm(known.places(known.elements) - known.failure_position, axis=1)
    weights = np.exp(-apart / 2)
    return Environment.of(rng.choice(len(known.elements), count, replace=False, p=weights / weights.sum()).tolist())


def leg_of(known, iterations):
    free = {model: Environment.of([model]) for model in range(len(known.elements))}
    whole = Environment.whole(len(known.elements))
    return Leg(1, whole, (whole,), NOTHING, free, Acceptance(1 + iterations))


class Searched:
    """Drives a search of a world that knows which models f needs, and forecasts each of its rounds."""

    refusals, workers = 0, 1

    def __init__(self, known, needed, algorithm, pair, iterations, **options):
        self.known, self.needed, self.algorithm_name, self.pair = known, needed, algorithm, pair
        self.leg, self.memory = leg_of(known, iterations), Memory()
        self.trials, self.made, self.winners, self.told = [], {}, [], []
        self.left = self.leg.whole
        evidence = lambda: replace(known, trials=self.trials)  # noqa: E731
        self.guide = make_guide(*split_pair(pair), evidence, runs=lambda: 1 + iterations, **options)

    def shown(self, environment, run, full=False):
        return self.made.get((environment, run))

    def refused(self, environment):
        return False

    refused_by_user = refused

    def algorithm(self, leg):
        return self.begin(leg, self.memory.of(self.guide))

    def begin(self, leg, guide):
        return search(self.algorithm_name, range(len(self.known.elements)), guide)

    def moment(self, rate=1.0):
        return Moment(
            self.leg,
            tuple(self.winners),
            self.left,
            self.pair,
            self.begin,
            self.guide,
            self.memory,
            replace(self.known, trials=tuple(self.trials)),
            self.shown,
            self.refused,
            rate,
        )

    def carried_through(self):
        """(the forecast's low, likely, high; the tests that were left) in each round."""
        steps, answer = search_on(self, self.leg), None
        while True:
            try:
                step = steps.send(answer)
            except StopIteration as end:
                assert end.value[-1] == self.needed
                return [(*expected, len(self.trials) - at) for at, expected in self.told]
            answer = None
            match step:
                case Wants():
                    test = step.tests[0]
                    shows = self.made[test.environment, test.run] = self.needed <= test.environment
                    self.trials.append(Trial(test.environment, shows, self.known.elements))
                case RoundBegan():
                    self.told.append((len(self.trials), interval(list(plays(self.moment())))))
                case Similar():
                    self.left, answer = step.environment, True
                case RoundEnded():
                    self.winners.append(step.winner)


def searched(known, needed, algorithm="ddenv", pair=NEAR, iterations=3, **options):
    return Searched(known, needed, algorithm, pair, iterations, **options).carried_through()


def first(models, algorithm="ddenv", pair=NEAR, iterations=3, rate=1.0, known=None, **options):
    known = world(models) if known is None else known
    driver = Searched(known, NOTHING, algorithm, pair, iterations, **options)
    driver.trials = list(known.trials)
    for trial in known.trials:
        for run in range(1 + iterations):
            driver.made[trial.environment, run] = trial.similar
    return driver.moment(rate)


def likely(*arguments, **options):
    return interval(list(plays(first(*arguments, **options))))[1]


AS_PRINTED = {"growth": "paper", "skip": "known"}
BEST = {"growth": "steady", "skip": "implied"}


@pytest.mark.parametrize(
    ("algorithm", "pair", "options"),
    [
        ("ddenv", NEAR, BEST),
        ("ddenv", NEAR, AS_PRINTED),
        ("ddenv", "timeseg/avg-trajectory-proximal", BEST),
        ("ddenv", "learner/random", BEST),
        ("ddmin", NEAR, {}),
        ("probdd", NEAR, {}),
        ("splitting", NEAR, {}),
    ],
)
@pytest.mark.rates
def test_the_interval_holds_what_is_left_at_the_start_and_in_most_rounds(algorithm, pair, options):
    at_start, later = [], []
    for seed in range(3):
        known = world(24, seed)
        begin, *rest = searched(known, needed_of(known, 2 + seed), algorithm, pair, **options)
        at_start.append(begin)
        later += rest
    assert sum(low <= left <= high for low, _, high, left in at_start) >= 2
    assert sum(low <= left <= high for low, _, high, left in later) >= 0.6 * len(later)
    assert all(low <= middle <= high for low, middle, high, _ in (*at_start, *later))


def test_the_same_moment_gives_the_same_plays():
    moment = first(43)
    assert list(plays(moment)) == list(plays(moment))


def test_what_makes_a_search_longer_is_expected_to():
    few = likely(60)
    assert likely(20) < few
    assert likely(60, iterations=0) < few
    assert likely(43, candidates="complements", **AS_PRINTED) < likely(43, **AS_PRINTED)


def test_models_that_are_known_to_be_needed_make_a_search_longer():
    known = world(60)
    everything = Environment.whole(60)
    missed = [
        Trial(everything - Environment.of(range(place, place + 6)), False, known.elements) for place in range(0, 60, 6)
    ]
    assert likely(60, **BEST) < likely(60, known=replace(known, trials=missed), **BEST)


@pytest.mark.parametrize("models", [1, 2, 3])
@pytest.mark.parametrize("algorithm", ["ddenv", "ddmin", "probdd", "splitting"])
def test_tiny_worlds(models, algorithm):
    low, _, high = interval(list(plays(first(models, algorithm, "model2model/random", rate=0.5))))
    assert 0 <= low <= high < 60


def test_large_worlds_are_played_a_few_times_and_a_play_makes_way_for_other_work():
    moment = first(400, **AS_PRINTED)
    pauses = [tests is None for tests in playing(moment)]
    assert 8 <= pauses.count(False) == len(list(plays(moment))) < len(list(plays(first(20))))
    assert pauses.count(True) > 5 * pauses.count(False)


def test_an_algorithm_that_cannot_be_played_has_no_forecast(monkeypatch):
    def choosy(elements, guide):
        raise KeyError("it knows only its own guide")
        yield

    monkeypatch.setattr("ddenv.reduction.algorithms.splitting", choosy)
    assert list(plays(first(9, "splitting"))) == []
