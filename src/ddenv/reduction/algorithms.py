"""The algorithms: generators that yield rounds and return the minimal environment. One function for
each.

An algorithm yields a `Round` and is sent the first similar candidate, or None. It runs nothing
itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import takewhile

import numpy as np

from ddenv.arrays import Floats
from ddenv.environment import Environment
from ddenv.reduction.evidence import LEAST
from ddenv.reduction.guide import Guide
from ddenv.reduction.round import (
    Candidate,
    Partition,
    Round,
    Rounds,
    in_order,
    left_out,
    make_round,
    one_model_partitions,
)

# A model is taken to be needed once the probability that it is not is below this; it is tried again
# at the end.
DOUBT = 0.25
# After a round in which each of so many parts was needed, many models are: binary splitting finds
# them in fewer tests.
MANY_NEEDED = 6


def ddenv(elements: Partition, guide: Guide) -> Rounds:
    """The paper's algorithm. Each round splits the environment into n partitions and tries them in
    the order of the prioritization, each followed by its complement. The first candidate that shows
    the failure becomes the environment. n grows with the rounds. The search ends when no candidate
    in a round of single models and their complements shows it: no single model can be removed.

    Paper, Algorithm 1; n never exceeds |E|. (As printed, it increments n before it checks, and
    would end one granularity early.) The last model is tested, too: f may need no model at all.
    With the guide's `growth` "steady", n grows only after rounds that found nothing, and a round
    always has n partitions; with `skip` "implied", candidates that lack everything that was missed
    before are skipped. Where none of `MANY_NEEDED` parts could go, a "steady" search ends as
    `splitting` does. The search `proves` that its end is minimal by trying to leave out each single
    model all the same.
    """
    environment = elements
    n = guide.n_partitions
    missed: list[Environment] = []
    while environment:
        n = min(n, len(environment))
        partitions = _split(environment, n, guide)
        ranked = sorted(
            zip(partitions, guide.rank(partitions), strict=True), key=lambda pair: pair[1]
        )
        round = make_round(n, environment, ranked, guide.candidates, guide.complement_order)
        if guide.skip == "implied":
            round = _without_implied(round, missed, guide.proves)
        # All candidates may be implied.
        winner = (yield round) if round.candidates else None
        missed = _missed(round, winner, missed, guide.broke)
        if winner is not None:
            environment = tuple(model for model in environment if model in winner.models)
        elif round.exhaustive:
            break
        if winner is None and guide.growth == "steady" and n >= MANY_NEEDED:
            return (yield from splitting(environment, guide))
        if winner is None or guide.growth == "paper":
            n += 1
    return Environment.of(environment)


def _split(environment: Partition, n: int, guide: Guide) -> list[Partition]:
    singles = one_model_partitions(environment)
    partitions = singles if n == len(environment) else guide.split(environment, n)
    if guide.growth == "steady":
        return _halved(partitions, n, guide)
    # A split that leaves all models together does not count (paper, section III-B).
    if len(partitions) > 1:
        return partitions
    return singles


def _halved(partitions: list[Partition], n: int, guide: Guide) -> list[Partition]:
    """Exactly n partitions: halves the largest, in the order in which its models would rank alone.

    Where a robot stands still, one instant may be the nearest to thousands of models: no split by
    time separates them.
    """
    parts = list(partitions)
    while len(parts) < n:
        largest = max(range(len(parts)), key=lambda place: len(parts[place]))
        models = parts[largest]
        scores = guide.rank(one_model_partitions(models))
        line = tuple(
            model for _, model in sorted(zip(scores, models, strict=True), key=lambda pair: pair[0])
        )
        parts[largest : largest + 1] = [line[: len(line) // 2], line[len(line) // 2 :]]
    return parts


def _missed(
    round: Round,
    winner: Candidate | None,
    missed: list[Environment],
    broke: Callable[[Candidate], bool],
) -> list[Environment]:
    """Groups of models of which at least one is needed, provided that f shows whenever everything
    that it needs is there.

    A candidate without f leaves out such a group, as far as its models are still in the
    environment. A group that is gone altogether was not needed after all: f showed by chance, or
    does not show in every such environment.
    """
    failed = takewhile(lambda one: one is not winner, round.candidates)
    found = [*missed, *(one.lacks for one in failed if not broke(one))]
    if winner is not None:
        found = [group & winner.models for group in found]
    return [group for group in dict.fromkeys(found) if group]


def _without_implied(round: Round, missed: list[Environment], proves: bool) -> Round:
    """`round` without candidates that lack a whole group of `missed`, or all that an earlier
    candidate of the round lacks.
    """
    lacked = list(missed)
    worth = []
    for one in round.candidates:
        if (proves and len(one.lacks) == 1) or not any(group <= one.lacks for group in lacked):
            worth.append(one)
            lacked.append(one.lacks)
    return replace(round, candidates=tuple(worth))


def ddmin(elements: Partition, guide: Guide | None = None) -> Rounds:
    """Classic delta debugging. It cuts the environment into n chunks in the order of the world
    file, and first tries each chunk alone, then each complement. A chunk that shows the failure is
    split in two; a complement keeps its n - 1 chunks; when nothing shows the failure, n doubles. It
    uses neither positions nor the place of the failure, so it is the baseline that shows what space
    and time are worth.

    Zeller and Hildebrandt, "Simplifying and Isolating Failure-Inducing Input", 2002. The last model
    is tested, too. It asks nothing of a guide.
    """
    environment = elements
    partitions = _cut(elements, 2)
    while environment:
        winner = yield in_order(environment, partitions, "partition", "complement")
        if winner is None:
            if len(partitions) == len(environment):
                break
            partitions = _cut(environment, 2 * len(partitions))
        elif winner.kind == "partition":
            environment = winner.part
            partitions = _cut(environment, 2)
        else:
            partitions = partitions[: winner.partition] + partitions[winner.partition + 1 :]
            environment = tuple(model for partition in partitions for model in partition)
            # A single partition would be the environment itself.
            partitions = partitions if len(partitions) > 1 else _cut(environment, 2)
    return Environment.of(environment)


def _cut(environment: Partition, n: int) -> list[Partition]:
    """Up to n chunks of neighbours, as equal in length as possible."""
    size = len(environment)
    n = min(n, len(environment))
    return [environment[size * part // n : size * (part + 1) // n] for part in range(n)]


def probdd(elements: Partition, guide: Guide) -> Rounds:
    """Probabilistic delta debugging. Each model has a probability of being needed, at first from
    its distance to the failure (or the same for all, with the scenario's key `reduction.prior:
    uniform`). Each test leaves out the group with the greatest expected gain; if the failure does
    not show, the probabilities of the group rise. When no candidate is left, each remaining model
    is left out once more.

    Wang et al., "Probabilistic Delta Debugging", 2021.
    """
    chance = dict(zip(elements, guide.chances(elements).tolist(), strict=True))
    environment = elements
    while group := _best_group(environment, chance):
        round = left_out(group, environment)
        # f needs something, we assume: leaving out everything is not worth a test.
        winner = (yield round) if round.candidates else None
        if winner is None:
            # Bayes' rule: at least one of the group is needed.
            some_needed = float(1.0 - np.prod([1.0 - chance[model] for model in group]))
            for model in group:
                chance[model] = 1.0 if len(group) == 1 else min(1.0, chance[model] / some_needed)
        else:
            environment = tuple(model for model in environment if model in winner.models)
    return (yield from sweep(tuple(sorted(environment, key=chance.__getitem__))))


def _best_group(environment: Partition, chance: dict[int, float]) -> Partition:
    """The least likely models: as many as maximize their number times the probability that none of
    them is needed.
    """
    order = [model for model in sorted(environment, key=chance.__getitem__) if chance[model] < 1.0]
    if not order:
        return ()
    none_needed = np.cumprod([1.0 - chance[model] for model in order])
    return tuple(order[: 1 + int(np.argmax(none_needed * np.arange(1, len(order) + 1)))])


def splitting(elements: Partition, guide: Guide) -> Rounds:
    """Binary splitting. It sorts the models by the prioritization, far to near. Each test leaves
    out a group from the far end, of the most informative size: the failure shows about as often as
    not. If it does not show, smaller groups are left out, until the farthest needed model is found.
    Where the failure does not show in every run, one run is made without a group, and a miss only
    makes it likelier that the group is needed. At the end each remaining model is left out once
    more, in as many runs as any other candidate. It takes close to the minimum number of tests.

    Noisy binary search (Burnashev and Zigangirov, 1974) for the farthest needed model, with the
    guide's probabilities as prior.
    """
    scores = guide.rank(one_model_partitions(elements)) if elements else []
    line = tuple(
        model for model, _ in sorted(zip(elements, scores, strict=True), key=lambda pair: -pair[1])
    )
    weight = dict(zip(line, -np.log1p(-guide.chances(line)), strict=True))
    environment = line
    passed = found = 0.0
    # How many runs without the first 1, 2, ... models of the line missed f.
    misses: dict[int, int] = {}
    while line:
        # The ratio of needed models found so far to those expected by now.
        likelier = (1.0 + found) / (1.0 + passed)
        spared = _spared(np.array([weight[model] for model in line]) * likelier, misses, guide)
        if spared[0] < DOUBT:
            passed = passed + weight[line[0]]
            found = found + 1
            line = line[1:]
            misses = {}
            continue
        # Rather too few than too many: the near models are the likeliest to be needed.
        size = max(1, int((spared >= _most_telling(guide.rate())).sum()))
        group = line[:size]
        runs = misses.get(size, 0) + 1
        round = left_out(group, environment)
        # f needs something, we assume: leaving out everything is not worth a test.
        winner = (yield replace(round, runs=runs)) if round.candidates else None
        if winner is None:
            misses[size] = runs if round.candidates else guide.runs()
            continue
        environment = tuple(model for model in environment if model in winner.models)
        passed += sum(weight[model] for model in group)
        line = line[size:]
        misses = {more - size: count for more, count in misses.items() if more > size}
    return (yield from sweep(environment, guide.runs()))


def _spared(weights: Floats, misses: dict[int, int], guide: Guide) -> Floats:
    """The probability that none of the first 1, 2, ... models of the line is needed, shape
    (len(weights),).
    """
    none = np.exp(-np.cumsum(np.append(0.0, weights)))
    # That the first needed model is number 0, 1, ... of the line, and that none is needed.
    first = np.append(-np.diff(none), none[-1])
    for size, count in misses.items():
        first[size:] *= LEAST if count >= guide.runs() else (1.0 - guide.rate()) ** count
    return np.asarray(1.0 - np.cumsum(first[:-1]) / first.sum())


def _most_telling(rate: float) -> float:
    """The probability of being spared with which a group tells most in one run: the optimum of a
    Z-channel.

    f shows at `rate` (above 0) without a group that is spared, never without another one.
    """
    if rate >= 1.0:
        return 0.5
    entropy = -(rate * math.log2(rate) + (1.0 - rate) * math.log2(1.0 - rate))
    return 1.0 / (rate * (1.0 + math.exp2(entropy / rate)))


def sweep(environment: Partition, runs: int | None = None) -> Rounds:
    """Leaves out each model in turn, in the environment's order, until none can be left out;
    returns what remains.

    After a success it goes on with the next model: those before were just found to be needed. They
    are tried again at the end. With `runs`, all models have one run before any has a second one, up
    to `runs`: a model that is not needed is found before the others have had theirs.
    """
    looks = None if runs is None else 1
    while environment:
        round = in_order(environment, one_model_partitions(environment), "complement")
        winner = yield replace(round, runs=looks)
        if winner is not None:
            place = winner.partition
            environment = environment[place + 1 :] + environment[:place]
            looks = looks and 1
        elif looks is None or looks >= (runs or 1):
            break
        else:
            looks += 1
    return Environment.of(environment)


def tried_again(
    environment: Partition, groups: Sequence[Partition], search: Callable[[Partition], Rounds]
) -> Rounds:
    """Leaves out each group, or halves of it where that fails; then searches what is left. For a
    search that stepped back.
    """
    waiting = list(reversed(groups))
    while waiting:
        inside = frozenset(environment)
        group = tuple(model for model in waiting.pop() if model in inside)
        if not group or len(group) == len(environment):
            continue
        winner = yield left_out(group, environment)
        if winner is not None:
            gone = frozenset(group)
            environment = tuple(model for model in environment if model not in gone)
        elif len(group) > 1:
            waiting += [group[len(group) // 2 :], group[: len(group) // 2]]
    return (yield from search(environment))
