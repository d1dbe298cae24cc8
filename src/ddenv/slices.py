"""Slices: what is known of a run because nothing that it lacks took part in another one. Pure.

Tests share their seeds, and a simulation repeats bit for bit where what took no part in it is removed. So a finished run of models
E1 implies the run of E2 with the same seed if E2 is a part of E1, has all that took part, and breaks no tie. It implies nothing
for other seeds. In programs this is dynamic slicing.

Who uses this keeps to three rules, so that neither workers nor kills change a result:

- An implied test has the outcome that a simulation would have. So verdicts, which follow from the outcomes of tests in their order,
  are the same whichever tests are implied.
- An environment is cut down to its slice by the runs that decisions rest on, and by no run that only ran ahead of time.
- That a slice was taken, or found to be wrong, is an event. What follows from it follows from the event.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

Models = frozenset[str]


@dataclass(frozen=True)
class Ties:
    """Groups of models that go together, or not at all, without a test; by each of their models."""

    of: Mapping[str, tuple[Models, ...]]

    @classmethod
    def among(cls, groups: Iterable[Iterable[str]]) -> Ties:
        """The ties `groups`, which may overlap."""
        of: dict[str, tuple[Models, ...]] = {}
        for group in map(frozenset, groups):
            for name in group:
                of[name] = (*of.get(name, ()), group)
        return cls(of)

    def breaks(self, there: Models, keep: Models) -> bool:
        """Whether a tie of the models `there` is broken where only `keep`, a part of them, stay."""
        few, others = (keep, there - keep) if 2 * len(keep) < len(there) else (there - keep, keep)
        return any(not others.isdisjoint(tie) for name in few for tie in self.of.get(name, ()))

    def closed(self, models: Models, there: Models) -> Models:
        """`models`, with all models `there` that are tied to them, directly or by others."""
        found, new = set(models), set(models)
        while new:
            tied = {other for name in new for tie in self.of.get(name, ()) for other in tie if other in there}
            new = tied - found
            found |= new
        return frozenset(found)


def implies(took_part: Models, there: Models, keep: Models, ties: Ties) -> bool:
    """Whether a run of the models `there` implies the run of `keep` with the same seed."""
    return took_part <= keep <= there and not ties.breaks(there, keep)


def fresh_chance(met: Sequence[Models]) -> float:
    """The chance that a fresh run meets a model that none of these runs `met`, estimated by the models that only one of them met.

    Good, "The population frequencies of species and the estimation of population parameters", 1953.
    """
    once: set[str] = set()
    more: set[str] = set()
    for models in met:
        more |= once & models
        once = (once | models) - more
    return min(1.0, len(once) / len(met)) if met else 1.0


def reasons(before: Models, after: Models, met: Sequence[Models], pinned: Models = frozenset()) -> dict[str, str]:
    """Why each model of `before` stays in `after` or goes, where `met` took part in each of the runs known there."""
    runs = f"{len(met)} run{'s' * (len(met) != 1)}"

    def why(name: str) -> str:
        took_part = sum(name in models for models in met)
        if name not in after:
            return f"took part in none of {runs}"
        if took_part:
            return f"took part in {took_part} of {runs}"
        return "is pinned" if name in pinned else "is tied to one that took part"

    return {name: why(name) for name in before}
