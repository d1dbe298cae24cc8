"""The guide of an algorithm: how to split and rank the environment, and which models are likely to
be needed.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from ddenv import schemas
from ddenv.arrays import Floats
from ddenv.errors import UserError
from ddenv.reduction.evidence import Evidence, Lacking, spatial_prior
from ddenv.reduction.round import Candidate, Partition, Rounds

# The prior without any positions (Wang et al. 2021).
UNIFORM = 0.1
# Fields of the evidence in the words of `ddenv.reduce`, where those are others.
_ARGUMENTS = {"trajectory": "a trajectory", "failure_position": "a failure_pose"}


@dataclass(frozen=True, kw_only=True)
class Guide:
    """What an algorithm asks while it searches. Models are numbers, in the order of the world file.

    `split(environment, n)` returns at most n partitions; `rank(partitions)` their scores, the
    lowest is tried first; `chances(environment)` the probability that each model is needed, shape
    (len(environment),), before any test. `n_partitions`, `candidates`, `complement_order`, `growth`
    and `skip` are those of the settings. `rate()` is the rate at which f shows in a single run
    where all that it needs is there, `runs()` how many runs a candidate has if none shows f,
    `broke(candidate)` whether its tests say nothing about f. `proves`: the search has to show by
    itself that its end is minimal.
    """

    split: Callable[[Partition, int], list[Partition]]
    rank: Callable[[Sequence[Partition]], list[float]]
    chances: Callable[[Partition], Floats]
    n_partitions: int = 2
    candidates: str = "both"
    complement_order: str = "paper"
    growth: str = "paper"
    skip: str = "known"
    rate: Callable[[], float] = lambda: 1.0
    runs: Callable[[], int] = lambda: 1
    broke: Callable[[Candidate], bool] = lambda candidate: False
    proves: bool = True


def make_guide(
    partitioning: str,
    prioritization: str,
    evidence: Callable[[], Evidence],
    *,
    prior: str = "spatial",
    **more: Any,
) -> Guide:
    """A guide for the schemas of these names, which look at what `evidence()` returns at that
    moment, and see models by name.

    Raises UserError for unknown names; a schema that lacks evidence raises UserError when it is
    used. A schema that is a class is instantiated for each guide. `prior` is "uniform", or
    "spatial" where that can be known. `more` are the other fields of `Guide`.
    """
    split = _made("partitioning", partitioning)
    rank = _made("prioritization", prioritization)

    def split_now(environment: Partition, n: int) -> list[Partition]:
        known = evidence()
        names = known.names(environment)
        with _told("partitioning", partitioning):
            partitions = [tuple(part) for part in split(names, n, known)]
        models = [name for part in partitions for name in part]
        if not all(partitions) or Counter(models) != Counter(names):
            raise UserError(
                f"partitioning '{partitioning}': its partitions must be disjoint, not empty, and "
                "cover E"
            )
        numbers = {name: number for number, name in enumerate(known.elements)}
        return [tuple(map(numbers.__getitem__, part)) for part in partitions]

    def rank_now(partitions: Sequence[Partition]) -> list[float]:
        known = evidence()
        with _told("prioritization", prioritization):
            scores = [
                float(score) for score in rank([known.names(part) for part in partitions], known)
            ]
        if len(scores) != len(partitions) or any(map(math.isnan, scores)):
            expected = f"a score for each of {len(partitions)} partitions"
            raise UserError(f"prioritization '{prioritization}': expected {expected}")
        return scores

    def chances_now(environment: Partition) -> Floats:
        known = evidence()
        names = known.names(environment)
        if prior == "uniform" or known.positions is None or known.failure_position is None:
            return np.full(len(names), UNIFORM)
        return spatial_prior(names, known)

    return Guide(split=split_now, rank=rank_now, chances=chances_now, **more)


def begin_search(algorithm: str, elements: Iterable[int], guide: Guide) -> Rounds:
    """The algorithm `algorithm`, before its first round. Raises UserError for an unknown name."""
    searching: Rounds = schemas.load("algorithm", algorithm)(tuple(elements), guide)
    return searching


def _made(kind: schemas.Kind, name: str) -> Callable[..., Any]:
    found = schemas.load(kind, name)
    try:
        return found() if isinstance(found, type) else found
    except TypeError as error:
        raise UserError(f"{kind} '{name}': cannot be instantiated: {error}") from error


@contextmanager
def _told(kind: schemas.Kind, name: str) -> Iterator[None]:
    """Raises UserError where the schema of this name lacks evidence."""
    try:
        yield
    except Lacking as lacking:
        what = _ARGUMENTS.get(str(lacking), str(lacking))
        others = ", ".join(other for other in schemas.names(kind) if other != name)
        raise UserError(
            f"{kind} '{name}' needs {what}, which is missing; or use one of {others}"
        ) from None
