"""What an algorithm did, test by test: as recorded with an oracle, or as a run file has it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from ddenv.errors import UserError
from ddenv.learn.recorded_oracle import Oracle
from ddenv.runfile.events import TestFinished, TestStarted
from ddenv.runfile.fold import steps
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import Candidate, RunState, Split, Trial
from ddenv.runfile.store import Recorded, RunFile
from ddenv.runfile.tested import made_for
from ddenv.schemas import BOTH, uses


@dataclass(frozen=True, slots=True)
class Turn:
    """A test of `candidate` in round `round`, which ended with `outcome`; `left` are the models that are kept after it.

    `again` says that it repeats a test of the same candidate with another seed.
    """

    candidate: Candidate | Trial
    round: int
    outcome: str
    left: tuple[str, ...]
    again: bool = False

    @property
    def split(self) -> Split | None:
        return self.candidate.split if isinstance(self.candidate, Candidate) else None


@dataclass(frozen=True, slots=True)
class Play:
    """The tests of one search: it begins with the models `begins`. `ended` says whether it came to its end."""

    name: str
    begins: tuple[str, ...]
    turns: tuple[Turn, ...]
    ended: bool = True
    method: str = ""

    @property
    def tests(self) -> int:
        return len(self.turns)

    @property
    def left(self) -> tuple[str, ...]:
        """What is left at the end."""
        return self.after(self.tests)

    def after(self, tests: int) -> tuple[str, ...]:
        """The models that are kept after so many tests."""
        return self.turns[min(tests, self.tests) - 1].left if tests and self.turns else self.begins


# Recorded with an oracle.


def recorded_play(name: str, oracle: Oracle) -> Play:
    """What the algorithm or pair `name` did with an oracle. Raises UserError if that does not fit the oracle."""
    environment, turns = oracle.models, list[Turn]()
    for number, round in enumerate(oracle.rounds[name], 1):
        if sorted(model for part in round.parts for model in part) != sorted(environment) or not round.tested:
            raise UserError(f"plays: {name}: round {number}: its parts are not what was left")
        split = Split(environment, round.parts)
        candidates = {one.label: one for one in _candidates(split)}
        for label in round.tested:
            if label not in candidates or (turns and turns[-1].round == number and turns[-1].outcome == "similar"):
                raise UserError(f"plays: {name}: round {number}: {label!r} cannot be tested there")
            one = candidates[label]
            outcome = oracle.outcome(one.models)
            if outcome == "similar":
                there = frozenset(one.models)
                environment = tuple(model for model in environment if model in there)
            turns.append(Turn(one, number, outcome, environment))
    return Play(name, oracle.models, tuple(turns))


def _candidates(split: Split) -> Iterator[Candidate]:
    for place in range(len(split.partitions)):
        for kind in ("partition", "complement"):
            yield Candidate(2 * place + (kind == "complement"), kind, place, split)


# From run files.


def plays_of_runs(runs: Sequence[Path]) -> tuple[Play, ...]:
    """The searches of these runs, which must be of one world. Raises UserError."""
    found, world = list[Play](), None
    for run in runs:
        with RunFile(run) as file:
            play, here = _play_of_run(run, file.events()), file.document("world")
        if world is not None and (here, set(play.begins)) != world:
            raise UserError(f"{run}: has another world than {runs[0]}; a race needs runs of one world")
        world = world or (here, set(play.begins))
        found.append(play)
    names = [play.name for play in found]
    if len(set(names)) < len(names):
        raise UserError(f"a race needs different runs, found {', '.join(names)}")
    return tuple(found)


def _play_of_run(run: Path, events: Sequence[Recorded]) -> Play:
    """The search of a run. Tests that others imply cost nothing, and are no turns."""
    state, turns, begun = RunState(), list[Turn](), dict[int, tuple[Candidate | Trial, bool]]()
    for recorded, _, state in steps(events):
        event = recorded.event
        if isinstance(event, TestStarted):
            test = state.tests[event.test - 1]
            candidate = made_for(state, test)
            if candidate is not None:
                begun[test.id] = candidate, test.run > 0
        elif isinstance(event, TestFinished) and event.test in begun:
            test, (candidate, again) = state.tests[event.test - 1], begun[event.test]
            turns.append(Turn(candidate, test.round or 0, test.outcome, state.environment, again))
        elif turns and state.environment is not turns[-1].left:
            last = turns[-1]
            turns[-1] = Turn(last.candidate, last.round, last.outcome, state.environment, last.again)
    if not turns:
        raise UserError(f"{run}: has no tests of a search yet")
    # While fresh runs certify its end, no test of the search is left.
    ended = state.status == "finished" or state.confirming
    return Play(run.stem, state.elements, tuple(turns), ended, _method(state))


def _method(state: RunState) -> str:
    """The algorithm, with the parts of the pair that it uses."""
    chosen = settings(state)
    parts = dict(zip(BOTH, chosen.pair.partition("/")[::2], strict=True))
    return f"{chosen.algorithm} {'/'.join(parts[each] for each in uses(chosen.algorithm))}".strip()
