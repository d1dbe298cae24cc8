"""A student's own search in a small world whose every part is known: tests, what is held, the verdict, and a comparison."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from ddenv.errors import UserError
from ddenv.evidence.claims import of_all_parts
from ddenv.learn.race import Play
from ddenv.learn.recorded_oracle import Oracle
from ddenv.text import count, first_of

NAMED = 5
BOUND = "The last line: how many answers of yes or no it takes to single out such a set if nothing is known beforehand."


@dataclass(frozen=True, slots=True)
class Tried:
    """A test of the models `kept` of those that were held, without the models `out`."""

    kept: tuple[str, ...]
    out: tuple[str, ...]
    outcome: str


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the comparison: how many tests somebody made, what was left, and whether one of that can still go.

    `left` is None for the bound.
    """

    name: str
    tests: int
    left: tuple[str, ...] | None = None
    can_go: bool = False


class Attempt:
    """At first all models are held. A test that shows f makes its models the ones that are held.

    `moves` are all that the student did, as they are kept: "test NAMES", "back" and "end".
    """

    def __init__(self, oracle: Oracle, budget: int, moves: Iterable[str] = ()) -> None:
        """After these moves; from the first one that is not possible on, they are dropped."""
        self.oracle, self.budget = oracle, budget
        self.moves: tuple[str, ...] = ()
        self.tried: list[Tried] = []
        self.ended = False
        self._chain: list[tuple[str, ...]] = [oracle.models]
        for move in moves:
            try:
                self._make(move)
            except UserError:
                return

    @property
    def held(self) -> tuple[str, ...]:
        """The student's environment."""
        return self._chain[-1]

    @property
    def tests_left(self) -> int:
        return self.budget - len(self.tried)

    # What the student does.

    def test(self, kept: Iterable[str]) -> str:
        """Tests these models of those that are held; returns the outcome. Raises UserError, with the reason."""
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
            raise UserError("no test is left: m says that you are done")
        names = tuple(name for name in self.held if name in there)
        outcome = self.oracle.outcome(names)
        self.tried.append(Tried(names, tuple(name for name in self.held if name not in there), outcome))
        if outcome == "similar":
            self._chain.append(names)
        self._did(" ".join(("test", *names)))
        return outcome

    def back(self) -> None:
        """Holds again what was held before the last test that showed f. Raises UserError."""
        if self.ended or len(self._chain) == 1:
            raise UserError("this search is over" if self.ended else "all models are there already")
        self._chain.pop()
        self._did("back")

    def end(self) -> None:
        """The student says that no single model can go."""
        if not self.ended:
            self.ended = True
            self._did("end")

    def _did(self, move: str) -> None:
        self.moves = (*self.moves, move)

    def _make(self, move: str) -> None:
        what, _, names = move.partition(" ")
        if what == "test":
            self.test(names.split())
        elif what == "back":
            self.back()
        elif what == "end":
            self.end()

    # What it is worth.

    @property
    def found(self) -> bool:
        """Whether no single model of what is held can go."""
        return not self.oracle.could_go(self.held)

    @property
    def verdict(self) -> str:
        """What is known of the models that are held, and what the student had shown of it."""
        smallest = self.oracle.minimal[0] if self.oracle.minimal else ()
        smaller = smallest if len(smallest) < len(self.held) else ()
        known = of_all_parts(self.held, self.oracle.could_go(self.held), smaller)
        said = f"{known[:1].upper()}{known[1:]}."
        shown = sum(self._was_left_out(name) for name in self.held)
        if not self.found or shown == len(self.held):
            return said
        return f"{said} Your own tests {f'show it for {shown} of them' if shown else 'do not show it'}."

    def _was_left_out(self, name: str) -> bool:
        rest = frozenset(self.held) - {name}
        return any(rest == frozenset(each.kept) for each in self.tried)


def comparison(oracle: Oracle, plays: Sequence[Play], attempt: Attempt | None) -> Iterator[Line]:
    """The student, the algorithms, and the bound for what the student found, or else for the smallest set."""
    if attempt is not None:
        yield Line("you", len(attempt.tried), attempt.held, not attempt.found)
    for play in plays:
        yield Line(play.name, play.tests, play.left, bool(oracle.could_go(play.left)))
    size = len(attempt.held) if attempt is not None and attempt.found else min(map(len, oracle.minimal), default=0)
    yield Line(f"log2 C({len(oracle.models)}, {size})", bound(len(oracle.models), size))


def bound(models: int, needed: int) -> int:
    """How many answers of yes or no tell one set of `needed` models from all others of its size."""
    return math.ceil(math.log2(math.comb(models, needed)))


def in_one_sentence(oracle: Oracle, plays: Sequence[Play], attempt: Attempt) -> str:
    """How the student's search compares."""
    tests, held = count(len(attempt.tried), "test"), count(len(attempt.held), "model")
    done = sorted((play for play in plays if not oracle.could_go(play.left)), key=lambda play: play.tests)
    others = first_of([f"{play.name} {play.tests}" for play in done], NAMED)
    sizes = {len(play.left) for play in done}
    if sizes - {len(attempt.held)}:
        low, high = min(sizes), max(sizes)
        others += f", for {count(high, 'model')}" if low == high else f", for {low} to {high} models"
    if not attempt.found:
        behind = f" The algorithms went on until none could: {others}." if others else ""
        return f"After {tests} you stopped at {held}, and at least one of them can still go.{behind}"
    found, least = f"You found {held} in {tests}", bound(len(oracle.models), len(attempt.held))
    if len(attempt.tried) < least:
        luck = f"{found}, fewer than {least}: luck or a look at the map helped you."
        return f"{luck} The algorithms: {others}." if others else luck
    if not done:
        return f"{found}; who knows nothing in advance needs at least {least}."
    quicker = [play.name for play in done if play.tests < len(attempt.tried)]
    if not quicker:
        return f"{found}, and no algorithm needed fewer: {others}."
    return f"{found}; {first_of(quicker, NAMED)} needed fewer: {others}."
