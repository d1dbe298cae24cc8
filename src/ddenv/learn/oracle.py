"""What happens in every part of a small world: recorded once, so that a student's own tests cost nothing."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ddenv.errors import UserError
from ddenv.world.files.access import read_bytes

OUTCOMES = ("similar", "other", "pass")
# More models than this have too many parts.
MOST_MODELS = 14


@dataclass(frozen=True)
class Oracle:
    """`outcomes` of the sets of `models` that do not end `otherwise`; every other set does."""

    models: tuple[str, ...]
    outcomes: dict[frozenset[str], str]
    otherwise: str

    def outcome(self, kept: Iterable[str]) -> str:
        """How a test with these models ends: one of `OUTCOMES`."""
        return self.outcomes.get(frozenset(kept), self.otherwise)

    @cached_property
    def showing(self) -> frozenset[frozenset[str]]:
        """All sets that show f."""
        return frozenset(kept for kept, outcome in self.outcomes.items() if outcome == "similar")

    @cached_property
    def minimal(self) -> tuple[tuple[str, ...], ...]:
        """The 1-minimal sets, the smallest first, each in the order of the models."""
        found = [kept for kept in self.showing if not any(kept - {name} in self.showing for name in kept)]
        ordered = (tuple(name for name in self.models if name in kept) for kept in found)
        return tuple(sorted(ordered, key=lambda kept: (len(kept), kept)))


def read_oracle(path: Path) -> Oracle:
    """The oracle in a JSON file. Raises UserError if it is not one."""
    try:
        data = json.loads(read_bytes(path))
        models = tuple(map(str, data["models"]))
        outcomes = {frozenset(key.split()): str(value) for key, value in data["outcomes"].items()}
        otherwise = str(data["otherwise"])
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise UserError(f"{path}: is not an oracle; expected models, outcomes and otherwise") from None
    if len(models) > MOST_MODELS or len(set(models)) != len(models):
        raise UserError(f"{path}: models: expected up to {MOST_MODELS} different names")
    if not {*outcomes.values(), otherwise}.issubset(OUTCOMES) or otherwise == "similar":
        raise UserError(f"{path}: outcomes: expected {', '.join(OUTCOMES)}")
    if not frozenset().union(*outcomes).issubset(models):
        raise UserError(f"{path}: outcomes: a set has a model that is not among the models")
    return Oracle(models, outcomes, otherwise)
