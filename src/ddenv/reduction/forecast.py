"""How many tests are left of a search: its algorithm is played on, many times, each with other models as the needed ones."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import xor
from random import Random

import numpy as np

from ddenv import schemas
from ddenv.reduction.verdict import MOST_RUNS, Acceptance
from ddenv.reduction.chance import distances_to_failure
from ddenv.reduction.evidence import Evidence, Partition
from ddenv.reduction.guide import Guide, Search, search
from ddenv.reduction.prioritizations import failure_proximal
from ddenv.reduction.round import Candidate

# How likely one, two, ... models are needed of a world of up to `SMALL_WORLD` models; more in a larger one.
NEEDED, SMALL_WORLD = (10, 24, 22, 16, 11, 7, 5, 3, 2), 40
# A forecast is made of this many plays. In large worlds it ends earlier, after this many candidates, but not before a few plays. A
# round takes as long as one candidate for each `SPLIT` models of its environment, and those that it has.
PLAYS, CANDIDATES, FEWEST_PLAYS, SPLIT = 30, 6_000, 8, 50
STEP = 100
# What is known is looked through with a break after so many models of tests.
MODELS = 20_000
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
    """Where a search stands: of `elements`, with which it began, `environment` is left.

    `guide` is the search's own, `memory` what that was asked. `rule` judges a candidate; f shows in a share `rate` of the runs
    with all that it needs. `jobs` tests run at the same time.
    """

    algorithm: str
    pair: str
    elements: Partition
    environment: Partition
    guide: Guide
    memory: Memory
    evidence: Evidence
    rule: Acceptance
    rate: float
    jobs: int = 1


def plays(moment: Moment) -> Iterator[float]:
    """How many tests are left in each of up to `PLAYS` plays. The same moment gives the same plays."""
    return (tests for tests in playing(moment) if tests is not None)


def playing(moment: Moment) -> Iterator[float | None]:
    """As `plays`, with None every few milliseconds: in large worlds a play takes a while."""
    random = Random(f"{moment.evidence.seed} {len(moment.environment)} {len(moment.evidence.trials)}")
    codes = {name: random.getrandbits(62) for name in moment.elements}
    guide, line = _quick_guide(moment), _near_to_far(moment)
    verdicts, missed = yield from _known(moment, codes)
    groups = yield from _groups(moment, line)
    looked_at = 0
    for number in range(PLAYS):
        if number >= FEWEST_PLAYS and looked_at > CANDIDATES:
            return
        needed = _needed(random, len(moment.elements), len(line), groups)
        play = _Play(moment, random, frozenset(line[place] for place in needed), codes, dict(verdicts), dict(missed))
        try:
            yield from play.run(search(moment.algorithm, moment.elements, guide))
        except Exception:
            # An algorithm of another package may not bear answers that its own schemas would not give.
            return
        looked_at += play.looked_at
        yield play.tests


def interval(tests: Sequence[float]) -> tuple[int, int, int]:
    """The low, the likely and the high number of tests, of one play at least."""
    ordered = sorted(tests)
    shares = zip(SHARES, WIDER, strict=True)
    low, likely, high = (ordered[round(share * (len(ordered) - 1))] * wider for share, wider in shares)
    return math.floor(low), round(likely), math.ceil(high)


class _Play:
    """A search where f needs the models `needed`, and no other. What has one of `verdicts` is not tested again; other candidates
    go on after the runs that `missed` f.

    Verdicts are found by the exclusive or of the `codes` of all models that are there: of thousands of complements, sets of names
    would take too long.
    """

    def __init__(
        self,
        moment: Moment,
        random: Random,
        needed: frozenset[str],
        codes: dict[str, int],
        verdicts: dict[int, bool],
        missed: dict[int, int],
    ) -> None:
        self.tests = 0.0
        self.looked_at = 0
        self._rule = moment.rule
        self._rate = min(1.0, max(LEAST_RATE, moment.rate))
        self._wasted = WASTED * (moment.jobs - 1)
        self._random = random
        self._needed = needed
        self._codes = codes
        self._verdicts = verdicts
        self._missed = missed

    def run(self, searching: Search) -> Iterator[None]:
        """To the end of the search, with a break after about `STEP` candidates."""
        winner, last = None, 0
        for _ in range(MOST_ROUNDS):
            try:
                round = searching.send(winner)
            except StopIteration:
                return
            whole = _code(self._codes, round.environment)
            self.looked_at += len(round.environment) // SPLIT
            rule = self._rule.within(round.runs)
            winner = next((one for one in round.candidates if self._is_similar(one, whole, rule)), None)
            if self.looked_at - last > STEP:
                last = self.looked_at
                yield

    def _is_similar(self, candidate: Candidate, whole: int, rule: Acceptance) -> bool:
        """Its verdict by `rule`; `whole` is the code of the round's environment."""
        self.looked_at += 1
        part = _code(self._codes, candidate.part)
        code = part if candidate.kind == "partition" else part ^ whole
        if code in self._verdicts:
            return self._verdicts[code]
        similar = self._shows(candidate, code, rule)
        if similar or self._rule.verdict(0, self._missed.get(code, 0)):
            self._verdicts[code] = similar
        return similar

    def _shows(self, candidate: Candidate, code: int, rule: Acceptance) -> bool:
        part = candidate.part
        all_there = self._needed.issubset(part) if candidate.kind == "partition" else self._needed.isdisjoint(part)
        shown, missed = 0, self._missed.get(code, 0)
        while not (verdict := rule.verdict(shown, missed)):
            self.tests += 1
            if all_there and self._random.random() < self._rate:
                shown += 1
            else:
                missed += 1
        # Where some runs showed f, it is judged for good.
        self._missed[code] = missed if not shown else MOST_RUNS
        if verdict == "similar":
            self.tests += self._wasted
        return verdict == "similar"


def _code(codes: dict[str, int], models: Iterable[str]) -> int:
    return reduce(xor, map(codes.__getitem__, models), 0)


def _known(moment: Moment, codes: dict[str, int]) -> Generator[None, None, tuple[dict[int, bool], dict[int, int]]]:
    """The verdicts so far, and how often candidates without a verdict missed f."""
    shown, missed = set[int](), dict[int, int]()
    for number, trial in enumerate(moment.evidence.trials, 1):
        if number % max(1, MODELS // len(codes)) == 0:
            yield
        code = _code(codes, trial.models.intersection(codes))
        if trial.similar:
            shown.add(code)
        else:
            missed[code] = missed.get(code, 0) + 1
    verdicts = {code: False for code, count in missed.items() if moment.rule.verdict(0, count)}
    return verdicts | dict.fromkeys(shown, True), missed


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

    def split(environment: Partition, n: int) -> list[Partition]:
        if (environment, n) not in splits:
            splits[environment, n] = cut(environment, n, evidence)
        return splits[environment, n]

    def rank(partitions: Sequence[Partition]) -> list[float]:
        asked = tuple(partitions)
        if asked not in scores:
            scores[asked] = order(partitions, evidence)
        return scores[asked]

    def chances(environment: Partition) -> np.ndarray:
        known = memory.chances.get(environment)
        return moment.guide.chances(environment) if known is None else known

    return replace(moment.guide, split=split, rank=rank, chances=chances)


def _halves(environment: Partition, n_partitions: int, evidence: Evidence) -> list[Partition]:
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
    """The environment's models, the nearest to f first."""
    order = np.argsort(distances_to_failure(moment.environment, moment.evidence), kind="stable")
    return tuple(moment.environment[place] for place in order)


def _groups(moment: Moment, line: Partition) -> Generator[None, None, list[tuple[int, ...]]]:
    """Places in the line of which one at least is needed: f did not show without the models there."""
    place = {name: number for number, name in enumerate(line)}
    shown = {trial.models for trial in moment.evidence.trials if trial.similar}
    missed = {trial.models for trial in moment.evidence.trials} - shown
    groups = set()
    for number, models in enumerate(missed, 1):
        groups.add(tuple(sorted(place[name] for name in place.keys() - models)))
        if number % max(1, MODELS // len(place)) == 0:
            yield
    # A group of which nothing is left was not needed after all.
    return sorted((group for group in groups if group), key=lambda group: (len(group), group))[:MOST_GROUPS]


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
