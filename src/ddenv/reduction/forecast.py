"""How many tests are left of a search: it is played on with dice, many times, each with other models as the needed ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any

import numpy as np

from ddenv import schemas
from ddenv.environment import Environment
from ddenv.evidence.rates import Shown
from ddenv.reduction.chance import distances_to_failure
from ddenv.reduction.evidence import Evidence, Names
from ddenv.reduction.guide import Guide, Search, guide_of
from ddenv.reduction.prioritizations import failure_proximal
from ddenv.reduction.procedure import Judged, Leg, Past, RoundBegan, Similar, search_on
from ddenv.reduction.round import Partition

# How likely one, two, ... models are needed of a world of up to `SMALL_WORLD` models; more in a larger one.
NEEDED, SMALL_WORLD = (10, 24, 22, 16, 11, 7, 5, 3, 2), 40
# A forecast is made of this many plays. In large worlds it ends earlier, after this many candidates, but not before a few plays. A
# round takes as long as one candidate for each `SPLIT` models of its environment, and those that it has.
PLAYS, CANDIDATES, FEWEST_PLAYS, SPLIT = 30, 6_000, 8, 50
STEP = 100
# A play that goes on for longer says nothing new.
MOST_ROUNDS = 1500
# The interval holds eight of ten plays, and somewhat more: a play knows less than there is to know.
SHARES, WIDER = (0.1, 0.5, 0.9), (0.8, 1.0, 1.2)
# A few runs of the whole world are not enough to expect a lower rate than this.
LEAST_RATE = 0.2
# Tests that each worker but the first makes ahead of time, and that nobody needs once a candidate shows f.
WASTED = 0.5
# Of the groups of models of which one is needed, only the smallest shape a play.
MOST_GROUPS = 60
# These are quick enough to be played. K-means and the learner are not: halves in space stand in for them.
QUICK = ("timeseg", "trajectoryseg")


@dataclass(frozen=True)
class Memory:
    """All that a search asked its guide, with the answers: so that its past can be played as it was."""

    splits: dict[tuple[Partition, int], list[Partition]] = field(default_factory=dict)
    scores: dict[tuple[Partition, ...], list[float]] = field(default_factory=dict)
    chances: dict[Partition, np.ndarray] = field(default_factory=dict)

    def of(self, guide: Guide) -> Guide:
        """`guide`, with its answers remembered."""

        def split(environment: Partition, n: int) -> list[Partition]:
            self.splits[environment, n] = found = guide.split(environment, n)
            return found

        def rank(partitions: Sequence[Partition]) -> list[float]:
            self.scores[tuple(partitions)] = found = guide.rank(partitions)
            return found

        def chances(environment: Partition) -> np.ndarray:
            self.chances[environment] = found = guide.chances(environment)
            return found

        return replace(guide, split=split, rank=rank, chances=chances)


@dataclass(frozen=True)
class Moment:
    """Where a search stands: it began with `leg`, its rounds so far had these `winners`, and `environment` is left.

    `begin(leg, guide)` starts the algorithm; `guide` is the search's own, `memory` what that was asked. `shown` knows of
    the runs so far; f shows in a share `rate` of the runs with all that it needs. `workers` make tests at the same time.
    """

    leg: Leg
    winners: tuple[int | None, ...]
    environment: Environment
    pair: str
    begin: Callable[[Leg, Guide], Search]
    guide: Guide
    memory: Memory
    evidence: Evidence
    shown: Callable[[Environment, int], Shown]
    refused: Callable[[Environment], bool]
    rate: float
    workers: int = 1


def plays(moment: Moment) -> Iterator[float]:
    """How many tests are left in each of up to `PLAYS` plays. The same moment gives the same plays."""
    return (tests for tests in playing(moment) if tests is not None)


def playing(moment: Moment) -> Iterator[float | None]:
    """As `plays`, with None every few milliseconds: in large worlds a play takes a while."""
    random = Random(f"{moment.evidence.seed} {len(moment.environment)} {len(moment.evidence.trials)}")
    line, guide = _near_to_far(moment), _quick_guide(moment)
    groups, looked_at = _groups(moment, line), 0
    for number in range(PLAYS):
        if number >= FEWEST_PLAYS and looked_at > CANDIDATES:
            return
        needed = _needed(random, len(moment.leg.free), len(line), groups)
        dice = _Dice(moment, guide, random, Environment.of(line[place] for place in needed))
        try:
            looked_at += yield from _play(moment, dice)
        except Exception:
            # An algorithm of another package may not bear answers that its own schemas would not give.
            return
        yield dice.tests


def _play(moment: Moment, dice: _Dice) -> Generator[None, None, int]:
    """To the end of the search, with a break after about `STEP` candidates; returns how many it looked at."""
    steps, rounds, looked_at, last = search_on(dice, moment.leg), 0, 0, 0
    answer: Past | bool | None = None
    while rounds < MOST_ROUNDS:
        try:
            step: Any = steps.send(answer)
        except StopIteration:
            break
        answer = None
        if isinstance(step, RoundBegan):
            if rounds < len(moment.winners):
                answer = Past(moment.winners[rounds])
            rounds, looked_at = rounds + 1, looked_at + len(step.round.environment) // SPLIT
        elif isinstance(step, Judged):
            looked_at += 1
        elif isinstance(step, Similar):
            answer, dice.tests = True, dice.tests + WASTED * (moment.workers - 1)
        if looked_at - last > STEP:
            last = looked_at
            yield
    return looked_at


class _Dice:
    """Drives a search in which f needs the models `needed`, and no other. Runs that were made show what they showed."""

    refusals, workers = 0, 1

    def __init__(self, moment: Moment, guide: Guide, random: Random, needed: Environment) -> None:
        self.tests = 0.0
        self._moment, self._guide, self._random, self._needed = moment, guide, random, needed
        self._rate = min(1.0, max(LEAST_RATE, moment.rate))
        self._drawn: dict[tuple[Environment, int], bool] = {}

    def shown(self, environment: Environment, run: int, full: bool = False) -> Shown:
        known = self._moment.shown(environment, run)
        if known is not None:
            return known
        if (environment, run) not in self._drawn:
            self.tests += 1
            self._drawn[environment, run] = self._needed <= environment and self._random.random() < self._rate
        return self._drawn[environment, run]

    def refused(self, environment: Environment) -> bool:
        return self._moment.refused(environment)

    def refused_by_user(self, environment: Environment) -> bool:
        return False

    def rate(self) -> float:
        return self._rate

    def goes_on(self) -> bool:
        return True

    def algorithm(self, leg: Leg) -> Search:
        return self._moment.begin(leg, self._guide)


def interval(tests: Sequence[float]) -> tuple[int, int, int]:
    """The low, the likely and the high number of tests, of one play at least."""
    ordered = sorted(tests)
    shares = zip(SHARES, WIDER, strict=True)
    low, likely, high = (ordered[round(share * (len(ordered) - 1))] * wider for share, wider in shares)
    return math.floor(low), round(likely), math.ceil(high)


def _quick_guide(moment: Moment) -> Guide:
    """Answers as the search's own guide did, where that was asked; else from what is known now, in a millisecond."""
    memory, evidence = moment.memory, moment.evidence
    # The first rounds are the same in most plays.
    splits, scores = dict(memory.splits), dict(memory.scores)
    partitioning, prioritization = schemas.split_pair(moment.pair)
    cut = schemas.load("partitioning", partitioning) if partitioning in QUICK else _halves
    order = schemas.load("prioritization", prioritization)
    if not order.__module__.startswith("ddenv."):
        order = failure_proximal
    quick = guide_of(cut, order, lambda: evidence)

    def split(environment: Partition, n: int) -> list[Partition]:
        if (environment, n) not in splits:
            splits[environment, n] = quick.split(environment, n)
        return splits[environment, n]

    def rank(partitions: Sequence[Partition]) -> list[float]:
        asked = tuple(partitions)
        if asked not in scores:
            scores[asked] = quick.rank(partitions)
        return scores[asked]

    def chances(environment: Partition) -> np.ndarray:
        known = memory.chances.get(environment)
        return moment.guide.chances(environment) if known is None else known

    return replace(moment.guide, split=split, rank=rank, chances=chances)


def _halves(environment: Names, n_partitions: int, evidence: Evidence) -> list[Names]:
    """Parts of models near each other: the largest is halved across its longer side, until there are enough."""
    places = evidence.places(environment)
    parts = [np.arange(len(environment))]
    while len(parts) < n_partitions:
        models = parts.pop(max(range(len(parts)), key=lambda part: len(parts[part])))
        there = places[models]
        along = there[:, int(np.argmax(np.ptp(there, axis=0)))]
        models = models[np.argsort(along, kind="stable")]
        parts += [models[: len(models) // 2], models[len(models) // 2 :]]
    return [tuple(environment[model] for model in np.sort(part)) for part in parts]


def _near_to_far(moment: Moment) -> Partition:
    """The models that may go from the environment, the nearest to f first; one of each stack."""
    models = tuple(model for model, stack in moment.leg.free.items() if stack <= moment.environment)
    names = tuple(moment.evidence.elements[model] for model in models)
    order = np.argsort(distances_to_failure(names, moment.evidence), kind="stable")
    return tuple(models[place] for place in order)


def _groups(moment: Moment, line: Partition) -> list[tuple[int, ...]]:
    """Places in the line of which one at least is needed: f did not show without the models there."""
    shown = {trial.environment for trial in moment.evidence.trials if trial.similar}
    missed = {trial.environment for trial in moment.evidence.trials} - shown
    models, place = Environment.of(line), {model: number for number, model in enumerate(line)}
    # A group of which nothing is left was not needed after all.
    groups = sorted(
        {group for there in missed if (group := models - there)}, key=lambda group: (len(group), group.bits)
    )
    return [tuple(sorted(map(place.__getitem__, group))) for group in groups[:MOST_GROUPS]]


def _needed(random: Random, whole: int, models: int, groups: Sequence[tuple[int, ...]]) -> set[int]:
    """Places in a line of `models` of which f might need the models: one of each group, and most of them near f."""
    count, places = min(models, _how_many(random, whole)), set[int]()
    # In a plane, the rank grows with the square of the distance.
    scale = models * 10 ** random.uniform(-3.0, -1.0)
    while len(places) < count:
        near = int(scale * random.gammavariate(2, 1) ** 2)
        # Where the nearest ones are taken, any other.
        places.add(near if near < models and near not in places else random.randrange(models))
    for group in groups:
        if places.isdisjoint(group):
            places.add(group[int(len(group) * random.random() ** 2)])
    for one in random.sample(sorted(places), len(places)):
        rest = places - {one}
        if len(places) > count and not any(rest.isdisjoint(group) for group in groups):
            places = rest
    return places


def _how_many(random: Random, whole: int) -> int:
    """How many models f might need in a world of so many."""
    more = max(0, round(math.log10(max(1, whole) / SMALL_WORLD)))
    return random.choices(range(1 + more, 1 + more + len(NEEDED)), NEEDED)[0]
