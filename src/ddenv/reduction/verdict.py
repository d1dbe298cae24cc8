"""What a round's finished tests add up to, and which tests it needs next: the same in any order of finishing."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass
from typing import TypeVar

Key = TypeVar("Key")
Similar = Callable[[Key, int], bool | None]


@dataclass(frozen=True)
class Standing:
    """`verdicts` holds "similar", "dissimilar" or "" (open) for each candidate that was looked at; `evidence` the run that showed
    the failure.

    `winner` is the first similar candidate with none open before it. `wanted` are the tests still needed, as (candidate,
    run), in the order in which one worker would make them if none of them showed the failure: idle workers may take them
    from the front and the verdicts stay the same.
    """

    verdicts: tuple[str, ...]
    evidence: tuple[int | None, ...]
    winner: int | None
    wanted: tuple[tuple[int, int], ...]


def standing(
    candidates: Iterable[Key],
    similar: Similar,
    iterations: int,
    refused: Container[Key] = frozenset(),
    *,
    first: int = 0,
    enough: int | None = None,
) -> Standing:
    """Where a round stands (paper, Algorithm 1 lines 4 to 13).

    `similar(candidate, run)` says of a finished run whether it showed f, None of another. A candidate is similar at its first run
    that did, in the order of runs, and dissimilar when `1 + iterations` runs did not. `refused` ones count as dissimilar.
    `candidates` are those from number `first` on. They are looked at up to the first that is sure to be similar, since nothing
    behind it is worth a test, and no further than `enough` wanted tests.
    """
    verdicts, evidence = [], []
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


def _row(similar: Similar, candidate: Key, iterations: int) -> tuple[int | None, list[int]]:
    """The first run that showed f, if any, and the runs before it that are not made yet.

    A later run that showed it decides nothing while an earlier one is open: the evidence would depend on timing.
    """
    missing = []
    for run in range(1 + iterations):
        known = similar(candidate, run)
        if known:
            return run, missing
        if known is None:
            missing.append(run)
    return None, missing
