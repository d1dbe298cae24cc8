"""Searches side by side, test by test; who needed the fewest tests, and why."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from ddenv.learn.lesson import Answer, Question
from ddenv.learn.plays import Play, Turn
from ddenv.runfile.state import BROKEN, Candidate
from ddenv.text import count

RACERS = (2, 4)


@dataclass(frozen=True, slots=True)
class Tally:
    """The tests of a search by what they were good for: `spent` has a number for each of `KINDS`; they add up to all tests.

    `steps` says how many models each test that showed f took away.
    """

    spent: dict[str, int]
    steps: tuple[int, ...]


def tally(play: Play, tests: int | None = None) -> Tally:
    """What the tests of a search were good for; the first so many `tests`, or all."""
    sizes = [(turn, len(before) - len(turn.left)) for before, turn in _steps(play)[:tests]]
    spent = {kind: sum(is_one(turn) for turn, _ in sizes) for kind, is_one in KINDS.items()}
    return Tally(spent, tuple(gone for turn, gone in sizes if turn.outcome == "similar" and gone > 0))


def _steps(play: Play) -> list[tuple[tuple[str, ...], Turn]]:
    lefts = (play.begins, *(turn.left for turn in play.turns))
    return [(before, turn) for (before, _), turn in zip(pairwise(lefts), play.turns, strict=True)]


def _missed(turn: Turn, kind: str) -> bool:
    of_kind = isinstance(turn.candidate, Candidate) and turn.candidate.kind == kind
    return of_kind and not turn.again and turn.outcome != "similar" and turn.outcome not in BROKEN


# Each test is of one kind.
KINDS: dict[str, Callable[[Turn], bool]] = {
    "f showed": lambda turn: turn.outcome == "similar",
    "part without f": lambda turn: _missed(turn, "partition"),
    "rest without f": lambda turn: _missed(turn, "complement"),
    "again": lambda turn: turn.again and turn.outcome != "similar" and turn.outcome not in BROKEN,
    "broke": lambda turn: turn.outcome in BROKEN,
    "by hand": lambda turn: (
        not turn.again and not isinstance(turn.candidate, Candidate) and turn.outcome not in ("similar", *BROKEN)
    ),
}
_WITHOUT_F = {
    "part without f": "tested a part alone and did not see f",
    "rest without f": "left out a part and lost f",
    "again": "repeated a test and did not see f",
    "broke": "made tests that broke",
    "by hand": "tried by hand and did not see f",
}


@dataclass
class Race:
    """Searches in one world; each has made `at` tests, or all of its tests."""

    plays: tuple[Play, ...]
    at: int = 0

    @property
    def longest(self) -> int:
        return max(play.tests for play in self.plays)

    @property
    def over(self) -> bool:
        return self.at >= self.longest

    def go(self, at: int) -> bool:
        """To another number of tests; False if it is there already."""
        before, self.at = self.at, max(0, min(at, self.longest))
        return self.at != before

    def now(self, play: Play) -> Turn | None:
        """The last test that a search made; None before the first one."""
        return play.turns[min(self.at, play.tests) - 1] if self.at else None

    def is_done(self, play: Play) -> bool:
        return self.at >= play.tests


def result(plays: Sequence[Play]) -> tuple[str, ...]:
    """Who won and why, in sentences; a search that did not end cannot win."""
    ended = sorted((play for play in plays if play.ended), key=lambda play: play.tests)
    open_ones = [play.name for play in plays if not play.ended]
    said = [f"{_and(open_ones)} did not come to an end, so the number of tests says nothing."] if open_ones else []
    if len(ended) < 2:
        return (*said, "So there is no winner.")
    first, last = ended[0], ended[-1]
    best = [play.name for play in ended if play.tests == first.tests]
    if first.tests == last.tests:
        return (*said, f"All needed {count(first.tests, 'test')}.", *_ends(ended))
    return (
        *said,
        f"{_and(best)} needed the fewest tests: {first.tests}. {last.name} needed the most: {last.tests}.",
        why(first, last),
        *_ends(ended),
    )


def why(first: Play, last: Play) -> str:
    """Why `first` needed fewer tests than `last`: the kind of tests that makes up most of the difference."""
    quick, slow = tally(first), tally(last)
    most = max(KINDS, key=lambda kind: slow.spent[kind] - quick.spent[kind])
    if most != "f showed":
        fewer = f"only {count(quick.spent[most], 'time')}" if quick.spent[most] else "never"
        return f"{last.name} {_WITHOUT_F[most]} {count(slow.spent[most], 'time')}, {first.name} {fewer}."
    return f"{first.name} got there in {_in_steps(quick)}, {last.name} in {_in_steps(slow)}."


def _in_steps(tally: Tally) -> str:
    return f"{count(len(tally.steps), 'reduction')} of {', '.join(map(str, tally.steps)) or 'no'} models"


def _ends(plays: Sequence[Play]) -> tuple[str, ...]:
    """What is left, where that differs."""
    if len({frozenset(play.left) for play in plays}) == 1:
        return ()
    sizes: dict[int, list[str]] = {}
    for play in plays:
        sizes.setdefault(len(play.left), []).append(play.name)
    if len(sizes) == 1:
        return (f"They ended with as many models, {next(iter(sizes))}, but not with the same ones.",)
    said = "; ".join(f"{_and(names)} with {count(size, 'model')}" for size, names in sorted(sizes.items()))
    return (f"Their ends differ: {said}.",)


def _and(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "".join(names)


def bet(plays: Sequence[Play]) -> Question:
    """Asks before a race who will need the fewest tests."""
    fewest = min(play.tests for play in plays)
    best = [play.name for play in plays if play.tests == fewest]
    tie = len(best) > 1
    answers = [
        Answer(play.name, not tie and play.name == best[0], f"{play.name} needs {count(play.tests, 'test')}.")
        for play in plays
    ]
    answers.append(Answer("a tie", tie, f"{_and(best)} {'need' if tie else 'needs'} the fewest."))
    return Question(
        "Which of them needs the fewest tests?",
        tuple(answers),
        "What does each know of the world before its first test?",
    )
