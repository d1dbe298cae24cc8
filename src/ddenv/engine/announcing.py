"""Writes how a round begins: its environment, its parts, its candidates."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ddenv.engine.journal import Journal
from ddenv.engine.subjects import Keep, other_way
from ddenv.errors import UserError
from ddenv.reduction.round import Candidate, Round


def announce(journal: Journal, number: int, round: Round, pinned: Keep, shows_distance: bool) -> None:
    """Writes that a round begins, with what its candidates were ranked by if that is a distance, m.

    Raises UserError if an earlier engine has begun another round with this number.
    """
    numbers = {name: index for index, name in enumerate(journal.state.elements)}

    def numbered(names: Iterable[str]) -> list[int]:
        return sorted(map(numbers.__getitem__, names))

    def distance(candidate: Candidate) -> float | None:
        return float(f"{round.scores[candidate.partition]:.3f}") if shows_distance else None

    partitions = [numbered(partition) for partition in round.partitions]
    more: dict[str, Any] = {"pinned": numbered(pinned)} if pinned else {}
    journal.record_once(
        "round_started",
        number,
        n_partitions=round.n_partitions,
        environment=numbered((*round.environment, *pinned)),
        partitions=partitions,
        candidates=[[one.kind, one.partition, distance(one)] for one in round.candidates],
        **more,
    )
    if journal.partitions[number] != partitions:
        raise UserError(other_way(number))
