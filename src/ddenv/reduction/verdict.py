"""What a round's finished tests add up to, and which tests it needs next: the same in any order of finishing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

Key = TypeVar("Key")


@dataclass(frozen=True)
class Standing(Generic[Key]):
    """`verdicts` holds "similar", "dissimilar" or "" (open) for each candidate; `evidence` the run that showed the failure.

    `winner` is the first similar candidate with none open before it. `wanted` are the tests still needed, as (candidate,
    run), in the order in which one worker would make them if none of them showed the failure: idle workers may take them
    from the front and the verdicts stay the same.
    """

    verdicts: tuple[str, ...]
    evidence: tuple[int | None, ...]
    winner: int | None
    wanted: tuple[tuple[int, int], ...]


def standing(
    candidates: Sequence[Key],
    similar: Mapping[tuple[Key, int], bool],
    iterations: int,
    skipped: frozenset[int] = frozenset(),
) -> Standing[Key]:
    """Where a round stands (paper, Algorithm 1 lines 4 to 13).

    `similar` says of each finished (candidate, run) whether it showed f. A candidate is similar at its first run that did,
    in the order of runs, and dissimilar when `1 + iterations` runs did not. `skipped` candidates count as dissimilar.
    """
    rows = [_row(similar, key, iterations, index in skipped) for index, key in enumerate(candidates)]
    verdicts = tuple("" if missing else "dissimilar" if shown is None else "similar" for shown, missing in rows)
    evidence = tuple(None if missing else shown for shown, missing in rows)
    # Nothing behind a candidate that is sure to be similar is worth a test.
    sure = next((index for index, (shown, _) in enumerate(rows) if shown is not None), len(rows))
    wanted = tuple((index, run) for index, (_, missing) in enumerate(rows[: sure + 1]) for run in missing)
    winner = sure if sure < len(rows) and not wanted else None
    return Standing(verdicts, evidence, winner, wanted)


def _row(
    similar: Mapping[tuple[Key, int], bool], candidate: Key, iterations: int, skipped: bool
) -> tuple[int | None, list[int]]:
    """The first run that showed f, if any, and the runs before it that are not made yet.

    A later run that showed it decides nothing while an earlier one is open: the evidence would depend on timing.
    """
    missing = []
    for run in () if skipped else range(1 + iterations):
        known = similar.get((candidate, run))
        if known:
            return run, missing
        if known is None:
            missing.append(run)
    return None, missing
