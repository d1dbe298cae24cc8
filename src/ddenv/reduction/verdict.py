"""The verdicts of a round from its finished tests, and which tests it needs next: the same whichever tests finish first."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass
from typing import Literal, TypeVar

from ddenv.reduction.acceptance import Rule, Verdict

Key = TypeVar("Key")
# Whether a run showed f. A broken one says nothing; None is a run that is not finished.
Shown = bool | Literal["broken"] | None
Runs = Callable[[Key, int], Shown]


@dataclass(frozen=True)
class Standing:
    """Where a round stands.

    `verdicts` has "similar", "dissimilar", "unknown" (a test broke) or "" (open) for each candidate looked at. `winner` is the
    first similar candidate, if no candidate before it is open. `wanted` are the tests still needed, as (candidate, run), in the
    order in which a single worker would run them if none showed the failure. Idle workers may take them from the front: the
    verdicts stay the same.
    """

    verdicts: tuple[Verdict, ...]
    winner: int | None
    wanted: tuple[tuple[int, int], ...]


def standing(
    candidates: Iterable[Key],
    shown: Runs[Key],
    rule: Rule,
    refused: Container[Key] = frozenset(),
    *,
    first: int = 0,
    enough: int | None = None,
) -> Standing:
    """Where a round stands (paper, Algorithm 1 lines 4 to 13).

    `shown(candidate, run)` returns whether a finished run showed f. The rule decides from the runs of a candidate, in their order;
    a broken run makes it unknown. `refused` candidates count as dissimilar. `candidates` begin with number `first`. They are
    looked at up to the first one that is sure to be similar, since no later one is worth a test, or until there are `enough`
    wanted tests.
    """
    verdicts: list[Verdict] = []
    wanted: list[tuple[int, int]] = []
    for index, key in enumerate(candidates, first):
        verdict, missing = ("dissimilar", []) if key in refused else _row(shown, key, rule)
        verdicts.append("" if missing else verdict)
        wanted += [(index, run) for run in missing]
        if verdict == "similar":
            return Standing(tuple(verdicts), None if wanted else index, tuple(wanted))
        if enough is not None and len(wanted) >= enough:
            break
    return Standing(tuple(verdicts), None, tuple(wanted))


def _row(shown: Runs[Key], candidate: Key, rule: Rule) -> tuple[Verdict, list[int]]:
    """The verdict if no missing run shows f, and the missing runs up to there.

    A later run that showed f decides nothing while an earlier one is open: else the verdict would depend on timing.
    """
    missing: list[int] = []
    hits = misses = 0
    while not (verdict := rule.verdict(hits, misses)):
        run = hits + misses
        known = shown(candidate, run)
        if known == "broken":
            return "unknown", missing
        if known is None:
            missing.append(run)
        if known:
            hits += 1
        else:
            misses += 1
    return verdict, missing


def decided_by(shown: Callable[[int], Shown], rule: Rule) -> int:
    """How many runs of a candidate decided its verdict; all of them are finished."""
    hits = misses = 0
    while not rule.verdict(hits, misses):
        known = shown(hits + misses)
        if known == "broken":
            return hits + misses + 1
        if known:
            hits += 1
        else:
            misses += 1
    return hits + misses
