"""A small world whose every part is known: what happens in each, recorded once, and a student's own
search in it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from ddenv.errors import UserError
from ddenv.text import Names
from ddenv.words.claims import of_all_parts
from ddenv.world.access import read_bytes

OUTCOMES = ("similar", "other", "pass")
# More models than this have too many parts.
MOST_MODELS = 14


@dataclass(frozen=True, slots=True)
class RecordedRound:
    """The parts of a round that an algorithm made, and the labels of the candidates that it tested,
    such as "without A".
    """

    parts: tuple[Names, ...]
    tested: Names


@dataclass(frozen=True, kw_only=True)
class Oracle:
    """`outcomes` of the sets of `models` that do not end `otherwise`; every other set does.

    `rates` of f, 0..1, are of sets where luck decides; elsewhere it is 0.
    `rounds` is what algorithms did in this world, by their names.
    """

    models: Names
    outcomes: dict[frozenset[str], str]
    otherwise: str
    rates: dict[frozenset[str], float] = field(default_factory=dict)
    rounds: Mapping[str, tuple[RecordedRound, ...]] = field(default_factory=dict)

    def outcome(self, kept: Iterable[str]) -> str:
        """How a test with these models ends: one of `OUTCOMES`."""
        return self.outcomes.get(frozenset(kept), self.otherwise)

    def rate(self, kept: Iterable[str]) -> float:
        """How often f shows with these models, 0..1. Raises UserError for a model that the world
        does not have.
        """
        there = frozenset(kept)
        if unknown := there.difference(self.models):
            raise UserError(f"the oracle's world has no model '{min(unknown)}'")
        return self.rates.get(there, 1.0 if self.outcome(there) == "similar" else 0.0)

    @cached_property
    def showing(self) -> frozenset[frozenset[str]]:
        """All sets that show f."""
        return frozenset(kept for kept, outcome in self.outcomes.items() if outcome == "similar")

    @cached_property
    def minimal(self) -> tuple[Names, ...]:
        """The 1-minimal sets, the smallest first, each in the order of the models."""
        found = [
            kept for kept in self.showing if not any(kept - {name} in self.showing for name in kept)
        ]
        ordered = (tuple(name for name in self.models if name in kept) for kept in found)
        return tuple(sorted(ordered, key=lambda kept: (len(kept), kept)))

    def could_go(self, kept: Iterable[str]) -> Names:
        """The models of `kept` that can each be left out alone: f still shows."""
        there = frozenset(kept)
        return tuple(
            name for name in self.models if name in there and there - {name} in self.showing
        )


def read_oracle(path: Path) -> Oracle:
    """The oracle in a JSON file. Raises UserError if it is not one."""
    try:
        data = json.loads(read_bytes(path))
        models = tuple(map(str, data["models"]))
        outcomes = {frozenset(key.split()): str(value) for key, value in data["outcomes"].items()}
        otherwise = str(data["otherwise"])
        rates = {
            frozenset(key.split()): float(value) for key, value in data.get("rates", {}).items()
        }
        rounds = {
            str(name): tuple(
                RecordedRound(
                    tuple(tuple(part.split()) for part in one["parts"]),
                    tuple(map(str, one["tested"])),
                )
                for one in each
            )
            for name, each in data.get("plays", {}).items()
        }
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise UserError(f"{path}: not an oracle; expected models, outcomes and otherwise") from None
    if len(models) > MOST_MODELS or len(set(models)) != len(models):
        raise UserError(f"{path}: models: expected up to {MOST_MODELS} different names")
    if not {*outcomes.values(), otherwise}.issubset(OUTCOMES) or otherwise == "similar":
        raise UserError(f"{path}: outcomes: expected {', '.join(OUTCOMES)}")
    if not all(0 <= rate <= 1 for rate in rates.values()):
        raise UserError(f"{path}: rates: expected numbers from 0 to 1")
    if not frozenset().union(*outcomes, *rates).issubset(models):
        raise UserError(f"{path}: outcomes: a set names a model that is not listed")
    return Oracle(models=models, outcomes=outcomes, otherwise=otherwise, rates=rates, rounds=rounds)


@dataclass(frozen=True, slots=True)
class Tried:
    """A test of the models `kept` of those that were held, without the models `out`."""

    kept: Names
    out: Names
    outcome: str


class Attempt:
    """At first all models are held. A test that shows f makes its models the ones that are held.

    `moves` are all that the student did, as they are kept: "test NAMES", "back" and "end".
    """

    def __init__(self, oracle: Oracle, budget: int, moves: Iterable[str] = ()) -> None:
        """After these moves; from the first one that is not possible on, they are dropped."""
        self.oracle = oracle
        self.budget = budget
        self.moves: Names = ()
        self.tried: list[Tried] = []
        self.ended = False
        self._chain: list[Names] = [oracle.models]
        for move in moves:
            what, _, names = move.partition(" ")
            try:
                if what == "test":
                    self.test(names.split())
                elif what == "back":
                    self.back()
                elif what == "end":
                    self.end()
            except UserError:
                return

    @property
    def held(self) -> Names:
        return self._chain[-1]

    @property
    def tests_left(self) -> int:
        return self.budget - len(self.tried)

    # What the student does.

    def test(self, kept: Iterable[str]) -> str:
        """Tests these models of those that are held; returns the outcome. Raises UserError, with
        the reason.
        """
        there = frozenset(kept)
        if self.ended:
            raise UserError("this search is over: n begins a new one")
        if there == frozenset(self.held):
            raise UserError("nothing is left out: mark the models to leave out first")
        if not there.issubset(self.held):
            raise UserError("some of these models are gone already")
        for number, earlier in enumerate(self.tried, 1):
            if there == frozenset(earlier.kept):
                raise UserError(f"test {number} was the same")
        if self.tests_left <= 0:
            raise UserError("no tests are left: press m for the verdict")
        names = tuple(name for name in self.held if name in there)
        outcome = self.oracle.outcome(names)
        self.tried.append(
            Tried(names, tuple(name for name in self.held if name not in there), outcome)
        )
        if outcome == "similar":
            self._chain.append(names)
        self.moves += (" ".join(("test", *names)),)
        return outcome

    def back(self) -> None:
        """Holds again what was held before the last test that showed f. Raises UserError."""
        if self.ended or len(self._chain) == 1:
            raise UserError("this search is over" if self.ended else "all models are there already")
        self._chain.pop()
        self.moves += ("back",)

    def end(self) -> None:
        """The student says that no single model can go."""
        if not self.ended:
            self.ended = True
            self.moves += ("end",)

    # What it is worth.

    @property
    def found(self) -> bool:
        """Whether no single model of what is held can go."""
        return not self.oracle.could_go(self.held)

    @property
    def verdict(self) -> str:
        """What is known of the models that are held."""
        smallest = self.oracle.minimal[0] if self.oracle.minimal else ()
        smaller = smallest if len(smallest) < len(self.held) else ()
        known = of_all_parts(self.held, self.oracle.could_go(self.held), smaller)
        return f"{known[:1].upper()}{known[1:]}."
