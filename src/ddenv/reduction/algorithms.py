"""The algorithms: the paper's ddenv, and ddmin, probdd and binary splitting to compare it with. Each is a generator."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import takewhile

import numpy as np

from ddenv.reduction.evidence import Partition
from ddenv.reduction.guide import Guide, Search
from ddenv.reduction.round import Candidate, Round, left_out, make_round, one_model_partitions, round_of


def sweep(environment: Partition) -> Search:
    """Rounds in which each model is left out in turn, in the environment's order, until none can be: returns what is left.

    After a success the next model is the first in line, since those before it were just needed; they are tried again at the end.
    """
    while environment:
        ranked = [(part, float(place)) for place, part in enumerate(one_model_partitions(environment))]
        round = round_of(len(environment), environment, ranked, [("complement", place) for place in range(len(ranked))])
        winner = yield round
        if winner is None:
            break
        place = winner.partition
        environment = environment[place + 1 :] + environment[:place]
    return frozenset(environment)


def ddenv(elements: Partition, guide: Guide) -> Search:
    """The paper's algorithm. The environment is split into n partitions, likeliest first; each partition and its complement are
    tried, and the first in which the failure shows becomes the environment. n grows by one after every round, and when a round of
    single models and their complements shows nothing, no single model can be removed.

    n is at most |E|. (Algorithm 1 as printed counts up before it checks, and would end one granularity early.) A last model is left
    out, too: whether f needs it is not known before. With the guide's `growth` "steady" n grows only when nothing was similar, and
    there are always n partitions; with `skip` "implied" nothing is tried that lacks all that was missed before.
    """
    environment, n = elements, guide.n_partitions
    missed: list[frozenset[str]] = []
    while environment:
        n = min(n, len(environment))
        partitions = _split(environment, n, guide)
        ranked = sorted(zip(partitions, guide.rank(partitions), strict=True), key=lambda pair: pair[1])
        round = make_round(n, environment, ranked, guide.candidates, guide.complement_order)
        if guide.skip == "implied":
            round = _without_implied(round, missed)
        # Everything may be implied.
        winner = (yield round) if round.candidates else None
        missed = _missed(round, winner, missed)
        if winner is not None:
            kept = winner.models
            environment = tuple(name for name in environment if name in kept)
        elif round.exhaustive:
            break
        if winner is None or guide.growth == "paper":
            n += 1
    return frozenset(environment)


def _split(environment: Partition, n: int, guide: Guide) -> list[Partition]:
    if n == len(environment):
        return one_model_partitions(environment)
    partitions = guide.split(environment, n)
    if guide.growth == "steady":
        return _halved(partitions, n, guide)
    # A split that leaves all models together is no split (paper, section III-B).
    return partitions if len(partitions) > 1 else one_model_partitions(environment)


def _halved(partitions: list[Partition], n: int, guide: Guide) -> list[Partition]:
    """As many as n partitions: the largest are halved, by what their models would rank alone.

    Where a robot stands still, one instant may be nearest to thousands of models: no split by time tells them apart.
    """
    parts = list(partitions)
    while len(parts) < n:
        largest = max(range(len(parts)), key=lambda place: len(parts[place]))
        models = parts[largest]
        scores = guide.rank(one_model_partitions(models))
        line = tuple(name for _, name in sorted(zip(scores, models, strict=True), key=lambda pair: pair[0]))
        parts[largest : largest + 1] = [line[: len(line) // 2], line[len(line) // 2 :]]
    return parts


def _missed(round: Round, winner: Candidate | None, missed: list[frozenset[str]]) -> list[frozenset[str]]:
    """Groups of models of which at least one is needed, if f shows in every environment that holds all it needs.

    They are what candidates without f had left out, as far as it is still there. Where nothing of it is, f did not need it after
    all: it showed by chance, or does not show in every such environment.
    """
    failed = takewhile(lambda one: one is not winner, round.candidates)
    found = [*missed, *(one.lacks for one in failed)]
    if winner is not None:
        left = winner.models
        found = [group & left for group in found]
    return [group for group in dict.fromkeys(found) if group]


def _without_implied(round: Round, missed: list[frozenset[str]]) -> Round:
    """The round without candidates that lack a whole group of `missed`, or all that an earlier candidate of the round lacks.

    That a single model cannot be left out is always tried: else nothing would show that the environment is minimal.
    """
    lacked, worth = list(missed), []
    for one in round.candidates:
        if len(round.environment) - one.size == 1 or not _lacks_any(one, lacked):
            worth.append(one)
            lacked.append(one.lacks)
    return replace(round, candidates=tuple(worth))


def _lacks_any(candidate: Candidate, groups: list[frozenset[str]]) -> bool:
    part = frozenset(candidate.part)
    if candidate.kind == "partition":
        return any(group.isdisjoint(part) for group in groups)
    return any(group <= part for group in groups)


def ddmin(elements: Partition, guide: Guide) -> Search:
    """Classic delta debugging. The environment is cut into n runs of models in the order of the world file; first each run is tried
    alone, then each complement. A run that shows the failure is split in two next, a complement is kept in its n - 1 runs, and
    when nothing shows, n doubles. It uses neither positions nor the failure's place: what space and time are worth is the
    difference to it.

    Tests that were made before are not made again, as the paper has it. A last model is left out, too.
    """
    environment, partitions = elements, _cut(elements, 2)
    while environment:
        winner = yield _round(environment, partitions)
        if winner is None:
            if len(partitions) == len(environment):
                break
            partitions = _cut(environment, 2 * len(partitions))
        elif winner.kind == "partition":
            environment = winner.part
            partitions = _cut(environment, 2)
        else:
            partitions = partitions[: winner.partition] + partitions[winner.partition + 1 :]
            environment = tuple(name for partition in partitions for name in partition)
            # With one partition left it would be its own environment.
            partitions = partitions if len(partitions) > 1 else _cut(environment, 2)
    return frozenset(environment)


def _cut(environment: Partition, n: int) -> list[Partition]:
    """Up to n runs of neighbours, as equal in length as can be."""
    size, n = len(environment), min(n, len(environment))
    return [environment[size * part // n : size * (part + 1) // n] for part in range(n)]


def _round(environment: Partition, partitions: list[Partition]) -> Round:
    """Subsets first, then complements."""
    n = len(partitions)
    ranked = [(partition, float(place)) for place, partition in enumerate(partitions)]
    wanted = [(kind, place) for kind in ("partition", "complement") for place in range(n)]
    return round_of(n, environment, ranked, wanted)


def probdd(elements: Partition, guide: Guide) -> Search:
    """Probabilistic delta debugging. Each model has a chance of being needed, at first by how near it is to the failure (or the
    same for all, with the scenario's key `reduction.prior: uniform`). Each test leaves out the models whose loss would be the
    greatest gain on average; if the failure does not show, the chances of those that were left out rise. When all that is left is
    certain, each model is left out once more.
    """
    chance = dict(zip(elements, guide.chances(elements).tolist(), strict=True))
    environment = elements
    while group := _best_group(environment, chance):
        round = left_out(group, environment)
        # f is taken to need something: leaving out everything is not worth a test.
        winner = (yield round) if round.candidates else None
        if winner is None:
            _raise_chances(group, chance)
        else:
            environment = tuple(name for name in environment if name not in set(group))
    return (yield from sweep(tuple(sorted(environment, key=chance.__getitem__))))


def _best_group(environment: Partition, chance: dict[str, float]) -> Partition:
    """The least likely models, so many that their number times the chance that none is needed is greatest; certain ones never."""
    order = [name for name in sorted(environment, key=chance.__getitem__) if chance[name] < 1.0]
    if not order:
        return ()
    none_needed = np.cumprod([1.0 - chance[name] for name in order])
    return tuple(order[: 1 + int(np.argmax(none_needed * np.arange(1, len(order) + 1)))])


def _raise_chances(group: Partition, chance: dict[str, float]) -> None:
    """Bayes' rule: one of the group is needed at least."""
    some_needed = 1.0 - np.prod([1.0 - chance[name] for name in group])
    for name in group:
        chance[name] = 1.0 if len(group) == 1 else min(1.0, chance[name] / float(some_needed))


def splitting(elements: Partition, guide: Guide) -> Search:
    """Binary splitting. The models stand in a line, by the prioritization, the last one first: far to near. A group at the head of
    the line is left out, so large that the failure shows with even chances; if it does not show, one of the group is needed, and
    halves of it are left out until it is found. At the end each model is left out once more. It takes the failure for one that
    needs all its models in every environment, and then needs about as few tests as can be.
    """
    line = _far_to_near(elements, guide)
    weight = dict(zip(line, -np.log1p(-guide.chances(line)), strict=True))
    environment, suspects = line, ()
    passed = found = 0.0
    while line:
        # How much likelier needed models are than was thought, from what was passed so far.
        likelier = (1.0 + found) / (1.0 + passed)
        group = _half(suspects, weight, likelier) if suspects else _head(line, weight, likelier)
        round = left_out(group, environment)
        # f is taken to need something: leaving out everything is not worth a test.
        winner = (yield round) if round.candidates else None
        if winner is not None:
            environment = tuple(name for name in environment if name not in set(group))
            line, suspects = line[len(group) :], suspects[len(group) :]
            passed += sum(weight[name] for name in group)
        else:
            suspects = group
        if len(suspects) == 1:
            # All others that were suspected are gone.
            passed, found = passed + weight[suspects[0]], found + 1
            line, suspects = line[1:], ()
    return (yield from sweep(environment))


def _far_to_near(elements: Partition, guide: Guide) -> Partition:
    scores = guide.rank(one_model_partitions(elements)) if elements else []
    return tuple(name for name, _ in sorted(zip(elements, scores, strict=True), key=lambda pair: -pair[1]))


def _head(line: Partition, weight: dict[str, float], likelier: float) -> Partition:
    """So many models from the head of the line that none of them is needed with even chances; at least one."""
    reach = np.cumsum([weight[name] for name in line]) * likelier
    return line[: max(1, int(np.searchsorted(reach, math.log(2.0))))]


def _half(suspects: Partition, weight: dict[str, float], likelier: float) -> Partition:
    """So many of the suspects, of which one is needed, that it is among them with even chances; not all of them."""
    reach = np.cumsum([weight[name] for name in suspects]) * likelier
    # Solves (e^-x - e^-all) / (1 - e^-all) = 1/2: none in the first part, though some in all.
    even = -math.log((1.0 + math.exp(-reach[-1])) / 2.0)
    nearest = int(np.argmin(np.abs(reach[:-1] - even)))
    return suspects[: nearest + 1]
