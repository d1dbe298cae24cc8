"""The ddenv algorithm (paper, Algorithm 1)."""

from __future__ import annotations

from dataclasses import replace
from itertools import takewhile

from ddenv.reduction.evidence import Partition
from ddenv.reduction.guide import Guide, Search
from ddenv.reduction.round import Candidate, Round, make_round, one_model_partitions


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
