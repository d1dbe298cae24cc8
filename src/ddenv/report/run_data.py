"""All that a report needs of a run file, read once."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.map.footprints import Drawn, plan
from ddenv.runfile.events import Created, RoundStarted
from ddenv.runfile.fold import recorded_scenario, steps
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.state import Round, RunState
from ddenv.runfile.store import Recorded, RunFile
from ddenv.runs.changes import Change, changes
from ddenv.runs.experiment import read_parts
from ddenv.runs.reasons import Nearest, Reason, nearest, reasons
from ddenv.text import Data, Sentences
from ddenv.world.model import World
from ddenv.world.scenario import Scenario

T = TypeVar("T")
# Of the polygon that stands for a circle.
CORNERS = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """A run: its `state`, its `rounds` as they ended, its first settings, and its scenario and
    world if they can be read.

    `started` is the Unix time of the first event, s. `original` is the robot's path in f,
    `evidence` that on the last similar run: flat rows of `COLUMNS` floats. `troubles` are one line
    each on what could not be read. `elements` are the models that can be removed, `kept` those of
    them that are left. `reasons` say what happens without each of these, `nearest` what the nearest
    world that passes lacks, `changes` what other values of numbers do; `ways` are the robot's paths
    in the tests that they compare. `models` are those of the world, as they are drawn.
    """

    path: Path
    state: RunState
    rounds: tuple[Round, ...]
    asked: Data
    started: float
    alive: bool
    scenario: Scenario | None
    world: World | None
    models: tuple[Drawn, ...]
    original: array[float] | None
    evidence: array[float] | None
    troubles: Sentences
    elements: frozenset[str]
    kept: frozenset[str]
    reasons: tuple[Reason, ...]
    nearest: Nearest | None
    changes: tuple[Change, ...]
    ways: Mapping[int, array[float]]


def read_run(path: Path) -> Record:
    """Reads a run file; of a damaged one, as much as is valid. Raises UserError if it is not a run
    file.
    """
    alive = engine_is_alive(path)
    with RunFile(path) as file:
        first, state, rounds, trouble = _story(file)
        if first is None or not isinstance(first.event, Created):
            raise UserError(trouble or f"{path}: damaged run file: it has no data for a report")
        troubles = [trouble] if trouble else []
        scenario, world, _ = _tried(lambda: read_parts(file), troubles) or (None, None, None)
        f = None if state.f_test is None else state.f_test.id
        original = _path(file, f, troubles)
        same = state.evidence_test == f
        evidence = original if same else _path(file, state.evidence_test, troubles)
        why = None if current(state) is None else _tried(lambda: reasons(file, state), troubles)
        passing = nearest(file, state)
        numbers = _tried(lambda: changes(file, state, world), troubles) or ()
        partings = [reason.parting for reason in why or ()] + [change.parting for change in numbers]
        partings.append(passing.parting if passing else None)
        compared = [test for one in partings if one for test in (one.with_test, one.without_test)]
        ways = {test: file.trajectory(test) for test in compared}
    return Record(
        path=path,
        state=state,
        rounds=rounds,
        asked=recorded_scenario(first.event.scenario),
        started=first.time,
        alive=alive,
        scenario=scenario,
        world=world,
        models=() if world is None else plan(world, CORNERS),
        original=original,
        evidence=evidence,
        troubles=tuple(troubles),
        elements=frozenset(state.elements),
        kept=frozenset(state.environment),
        reasons=why or (),
        nearest=passing,
        changes=numbers,
        ways=ways,
    )


def _story(file: RunFile) -> tuple[Recorded | None, RunState, tuple[Round, ...], str]:
    """The first event, the state at the end or before the first damaged event, every round as it
    ended, and what is wrong.
    """
    first = None
    state = RunState()
    rounds: dict[int, Round] = {}
    trouble = ""
    try:
        for recorded, before, after in steps(file.read()):
            first = first or recorded
            # A round does not change after its end.
            if isinstance(recorded.event, RoundStarted) and before.round is not None:
                rounds[before.round.number] = before.round
            state = after
    except UserError as error:
        trouble = f"{error}; the report shows what came before it"
    if state.round is not None:
        rounds[state.round.number] = state.round
    return first, state, tuple(rounds.values()), trouble


def _tried(read: Callable[[], T], troubles: list[str]) -> T | None:
    """What `read` returns; what it cannot read is one of the `troubles`."""
    try:
        return read()
    except UserError as error:
        troubles.append(str(error))
        return None


def _path(file: RunFile, test: int | None, troubles: list[str]) -> array[float] | None:
    samples = None if test is None else _tried(lambda: file.motion(test), troubles)
    if samples and all(map(math.isfinite, samples)):
        return samples
    return None
