"""The verdicts of a round from its finished tests, and which tests it needs next: the same whichever tests finish first."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass
from typing import TypeVar

Key = TypeVar("Key")
Similar = Callable[[Key, int], bool | None]


@dataclass(frozen=True)
class Standing:
    """Where a round stands.

    `verdicts` has "similar", "dissimilar" or "" (open) for each candidate looked at; `evidence` the number of the run that showed
    the failure. `winner` is the first similar candidate, if no candidate before it is open. `wanted` are the tests still needed, as
    (candidate, run), in the order in which a single worker would run them if none showed the failure. Idle workers may take them
    from the front: the verdicts stay the same.
    """

    verdicts: tuple[str, ...]
    evidence: tuple[int | None, ...]
    winner: int | None
    wanted: tuple[tuple[int, int], ...]


def standing(
    candidates: Iterable[Key],
    similar: Similar[Key],
    iterations: int,
    refused: Container[Key] = frozenset(),
    *,
    first: int = 0,
    enough: int | None = None,
) -> Standing:
    """Where a round stands (paper, Algorithm 1 lines 4 to 13).

    `similar(candidate, run)` returns whether a finished run showed f, and None for a run that is not finished. A candidate is
    similar at its first run that showed f, in the order of runs, and dissimilar after `1 + iterations` runs that did not. `refused`
    candidates count as dissimilar. `candidates` begin with number `first`. They are looked at up to the first one that is sure to
    be similar, since no later one is worth a test, or until there are `enough` wanted tests.
    """
    verdicts: list[str] = []
    evidence: list[int | None] = []
    wanted: list[tuple[int, int]] = []
    for index, key in enumerate(candidates, first):
        shown, missing = (None, []) if key in refused else _row(similar, key, iterations)
        verdicts.append("" if missing else "dissimilar" if shown is None else "similar")
        evidence.append(None if missing else shown)
        wanted += [(index, run) for run in missing]
        if shown is not None:
            return Standing(tuple(verdicts), tuple(evidence), None if wanted else index, tuple(wanted))
        if enough is not None and len(wanted) >= enough:
            break
    return Standing(tuple(verdicts), tuple(evidence), None, tuple(wanted))


def _row(similar: Similar[Key], candidate: Key, iterations: int) -> tuple[int | None, list[int]]:
    """The first run that showed f, if any, and the runs before it that are not finished.

    A later run that showed f decides nothing while an earlier one is open: else the evidence would depend on timing.
    """
    missing: list[int] = []
    for run in range(1 + iterations):
        known = similar(candidate, run)
        if known:
            return run, missing
        if known is None:
            missing.append(run)
    return None, missing
