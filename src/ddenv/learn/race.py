"""What algorithms did in one world, test by test, as an oracle or run files have it; who needed the
fewest tests, and why.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from ddenv.errors import UserError
from ddenv.learn.attempt import Attempt, Oracle
from ddenv.learn.lesson import Answer, Question
from ddenv.runfile.events import TestFinished, TestStarted
from ddenv.runfile.fold import steps
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import BROKEN, Candidate, RunState, Split, Trial
from ddenv.runfile.store import Recorded, RunFile
from ddenv.runfile.tested import made_for
from ddenv.schemas import BOTH, uses
from ddenv.text import Names, Sentences, count, first_of

# The least and the most searches of a race, and how many searches a sentence names.
RACERS = (2, 4)
NAMED = 5
BOUND = "The last line: no search can be sure to find such a set with fewer yes-or-no answers."


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """A test of `candidate` in round `round`, which ended with `outcome`; `left` are the models
    that are kept after it.

    `again` says that it repeats a test of the same candidate with another seed.
    """

    candidate: Candidate | Trial
    round: int
    outcome: str
    left: Names
    again: bool = False

    @property
    def split(self) -> Split | None:
        if isinstance(self.candidate, Candidate):
            return self.candidate.split
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Play:
    """The tests of one search: it begins with the models `begins`. `ended` says whether it came to
    its end.
    """

    name: str
    begins: Names
    turns: tuple[Turn, ...]
    ended: bool = True
    method: str = ""

    @property
    def tests(self) -> int:
        return len(self.turns)

    @property
    def left(self) -> Names:
        return self.after(self.tests)

    def after(self, tests: int) -> Names:
        """The models that are kept after so many tests."""
        if tests and self.turns:
            return self.turns[min(tests, self.tests) - 1].left
        return self.begins


# Recorded with an oracle.


def recorded_play(name: str, oracle: Oracle) -> Play:
    """What the algorithm or pair `name` did with an oracle. Raises UserError if that does not fit
    the oracle.
    """
    environment = oracle.models
    turns = list[Turn]()
    for number, round in enumerate(oracle.rounds[name], 1):
        if (
            sorted(model for part in round.parts for model in part) != sorted(environment)
            or not round.tested
        ):
            raise UserError(
                f"plays: {name}: round {number}: its parts do not make up the models that were left"
            )
        split = Split(environment=environment, partitions=round.parts)
        kinds = (("partition", 0), ("complement", 1))
        made = (
            Candidate(index=2 * at + odd, kind=kind, partition=at, split=split)
            for at in range(len(split.partitions))
            for kind, odd in kinds
        )
        candidates = {one.label: one for one in made}
        for label in round.tested:
            if label not in candidates or (
                turns and turns[-1].round == number and turns[-1].outcome == "similar"
            ):
                raise UserError(f"plays: {name}: round {number}: {label!r} cannot be tested there")
            one = candidates[label]
            outcome = oracle.outcome(one.models)
            if outcome == "similar":
                there = frozenset(one.models)
                environment = tuple(model for model in environment if model in there)
            turns.append(Turn(candidate=one, round=number, outcome=outcome, left=environment))
    return Play(name=name, begins=oracle.models, turns=tuple(turns))


# From run files.


def plays_of_runs(runs: Sequence[Path]) -> tuple[Play, ...]:
    """The searches of these runs, which must be of one world. Raises UserError."""
    found = list[Play]()
    worlds = list[tuple[bytes, set[str]]]()
    for run in runs:
        with RunFile(run) as file:
            found.append(_play_of_run(run, file.events()))
            worlds.append((file.document("world"), set(found[-1].begins)))
        if worlds[-1] != worlds[0]:
            raise UserError(
                f"{run}: its world is not that of {runs[0]}; a race needs runs of one world"
            )
    names = [play.name for play in found]
    if len(set(names)) < len(names):
        raise UserError(f"a race needs different runs, found {', '.join(names)}")
    return tuple(found)


def _play_of_run(run: Path, events: Sequence[Recorded]) -> Play:
    """The search of a run. Tests that others imply cost nothing, and are no turns."""
    state = RunState()
    turns = list[Turn]()
    begun = dict[int, tuple[Candidate | Trial, bool]]()
    for recorded, _, state in steps(events):
        event = recorded.event
        if isinstance(event, TestStarted):
            test = state.test(event.test)
            if (candidate := made_for(state, test)) is not None:
                begun[test.id] = candidate, test.run > 0
        elif isinstance(event, TestFinished) and event.test in begun:
            test = state.test(event.test)
            (candidate, again) = begun[event.test]
            turns.append(
                Turn(
                    candidate=candidate,
                    round=test.round or 0,
                    outcome=test.outcome,
                    left=state.environment,
                    again=again,
                )
            )
        elif turns and state.environment is not turns[-1].left:
            turns[-1] = replace(turns[-1], left=state.environment)
    if not turns:
        raise UserError(f"{run}: has no search tests yet")
    # While fresh runs certify its end, no test of the search is left.
    ended = state.status == "finished" or state.confirming
    chosen = settings(state)
    parts = dict(zip(BOTH, chosen.pair.partition("/")[::2], strict=True))
    method = (
        f"{chosen.algorithm} {'/'.join(parts[each] for each in uses(chosen.algorithm))}".strip()
    )
    return Play(
        name=run.stem, begins=state.elements, turns=tuple(turns), ended=ended, method=method
    )


def spent(play: Play, tests: int | None = None) -> dict[str, int]:
    """How many tests of a search, of the first so many `tests` or of all, were good for what, by
    `KINDS`.
    """
    return dict.fromkeys(KINDS, 0) | Counter(map(kind_of, play.turns[:tests]))


def reductions(play: Play) -> list[int]:
    """How many models each test that showed f took away."""
    lefts = [len(play.begins), *(len(turn.left) for turn in play.turns)]
    gone = zip(play.turns, pairwise(lefts), strict=True)
    return [
        before - after
        for turn, (before, after) in gone
        if turn.outcome == "similar" and before > after
    ]


def kind_of(turn: Turn) -> str:
    """What a test was good for: one of `KINDS`."""
    if turn.outcome == "similar":
        return "f showed"
    if turn.outcome in BROKEN:
        return "broke"
    if turn.again:
        return "again"
    if not isinstance(turn.candidate, Candidate):
        return "by hand"
    if turn.candidate.kind == "partition":
        return "part without f"
    return "rest without f"


# What a test was good for, with what a search did in those without f.
KINDS = {
    "f showed": "",
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
        before = self.at
        self.at = max(0, min(at, self.longest))
        return self.at != before

    def now(self, play: Play) -> Turn | None:
        """The last test that a search made; None before the first one."""
        if self.at:
            return play.turns[min(self.at, play.tests) - 1]
        return None

    def is_done(self, play: Play) -> bool:
        return self.at >= play.tests


def result(plays: Sequence[Play]) -> Sentences:
    """Who won and why, in sentences; a search that did not end cannot win."""
    ended = sorted((play for play in plays if play.ended), key=lambda play: play.tests)
    open_ones = [play.name for play in plays if not play.ended]
    if open_ones:
        said = [f"{_and(open_ones)} did not finish, so the number of tests says nothing."]
    else:
        said = []
    if len(ended) < 2:
        return (*said, "So there is no winner.")
    first = ended[0]
    last = ended[-1]
    if first.tests == last.tests:
        return (*said, f"All needed {count(first.tests, 'test')}.")
    best = _and([play.name for play in ended if play.tests == first.tests])
    said.append(
        f"{best} needed the fewest tests: {first.tests}. {last.name} needed the most: {last.tests}."
    )
    return (*said, why(first, last))


def why(first: Play, last: Play) -> str:
    """Why `first` needed fewer tests than `last`: the kind of tests that makes up most of the
    difference.
    """
    quick = spent(first)
    slow = spent(last)
    most = max(KINDS, key=lambda kind: slow[kind] - quick[kind])
    if most != "f showed":
        fewer = f"only {count(quick[most], 'time')}" if quick[most] else "never"
        return f"{last.name} {KINDS[most]} {count(slow[most], 'time')}, {first.name} {fewer}."
    return f"{first.name} got there in {_in_steps(first)}, {last.name} in {_in_steps(last)}."


def _in_steps(play: Play) -> str:
    sizes = reductions(play)
    return f"{count(len(sizes), 'reduction')} of {', '.join(map(str, sizes)) or 'no'} models"


def _and(names: Sequence[str]) -> str:
    if len(names) > 1:
        return f"{', '.join(names[:-1])} and {names[-1]}"
    return "".join(names)


def bet(plays: Sequence[Play]) -> Question:
    fewest = min(play.tests for play in plays)
    best = [play.name for play in plays if play.tests == fewest]
    tie = len(best) > 1
    answers = [
        Answer(play.name, best == [play.name], f"{play.name} needs {count(play.tests, 'test')}.")
        for play in plays
    ]
    answers.append(Answer("a tie", tie, f"{_and(best)} {'need' if tie else 'needs'} the fewest."))
    hint = "What does each know about the world before its first test?"
    return Question("Which of them needs the fewest tests?", tuple(answers), hint)


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the comparison: how many tests somebody made, what was left, and whether one of
    that can still go.

    `left` is None for the bound.
    """

    name: str
    tests: int
    left: Names | None = None
    can_go: bool = False


def comparison(oracle: Oracle, plays: Sequence[Play], attempt: Attempt | None) -> Iterator[Line]:
    """The student, the algorithms, and the bound for what the student found, or else for the
    smallest set.
    """
    if attempt is not None:
        yield Line("you", len(attempt.tried), attempt.held, not attempt.found)
    for play in plays:
        yield Line(play.name, play.tests, play.left, bool(oracle.could_go(play.left)))
    if attempt is not None and attempt.found:
        size = len(attempt.held)
    else:
        size = min(map(len, oracle.minimal), default=0)
    yield Line("minimum", bound(len(oracle.models), size))


def bound(models: int, needed: int) -> int:
    """How many answers of yes or no tell one set of `needed` models from all others of its size."""
    return math.ceil(math.log2(math.comb(models, needed)))


def in_one_sentence(oracle: Oracle, plays: Sequence[Play], attempt: Attempt) -> str:
    tests = count(len(attempt.tried), "test")
    held = count(len(attempt.held), "model")
    done = sorted(
        (play for play in plays if not oracle.could_go(play.left)), key=lambda play: play.tests
    )
    others = first_of([f"{play.name} {play.tests}" for play in done], NAMED)
    if not attempt.found:
        behind = f" The algorithms went on until none could: {others}." if others else ""
        return (
            f"After {tests} you stopped at {held}, and at least one of them can still go.{behind}"
        )
    found = f"You found {held} in {tests}"
    least = bound(len(oracle.models), len(attempt.held))
    if len(attempt.tried) < least:
        luck = f"{found}, fewer than {least}: luck or a look at the map helped you."
        if others:
            return f"{luck} The algorithms: {others}."
        return luck
    if not done:
        return f"{found}; without prior knowledge it takes at least {least}."
    quicker = [play.name for play in done if play.tests < len(attempt.tried)]
    if quicker:
        what = f"; {first_of(quicker, NAMED)} needed fewer"
    else:
        what = ", and no algorithm needed fewer"
    return f"{found}{what}: {others}."
