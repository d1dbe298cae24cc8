"""Events of a run in short: models by numbers in place of numbered environments, and without what
follows from the state.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

from ddenv.environment import Environment
from ddenv.errors import UserError
from ddenv.runfile.events import KINDS, EnvironmentNamed, Event
from ddenv.runfile.fold import apply, fold
from ddenv.runfile.reading import read
from ddenv.runfile.state import RunState
from ddenv.runfile.store import Motions, Recorded, RunFile
from ddenv.runfile.supports import stack_with

OF_ROUND = (
    "candidate_judged",
    "waiting",
    "decided",
    "reduced",
    "round_finished",
    "vetoed",
    "unvetoed",
)
OF_TESTS = ("test_started", "implied")
Numbered = Callable[[Environment], int]


def typed(state: RunState, kind: str, data: dict[str, Any]) -> list[Event]:
    """The event in this state, and before it those that name its environments, as an engine does.
    Raises Invalid.
    """
    numbers = {models: number for number, models in enumerate(state.environments)}
    new: list[Event] = []

    def numbered(models: Environment) -> int:
        if models not in numbers:
            numbers[models] = len(state.environments) + len(new)
            new.append(EnvironmentNamed(environment=numbers[models], models=models))
        return numbers[models]

    full = _full(state, kind, dict(data), numbered)
    return [*new, read(KINDS[kind], json.dumps(full))]


def _full(state: RunState, kind: str, data: dict[str, Any], numbered: Numbered) -> dict[str, Any]:
    """The data as they stand in a file: `models` of a try, and each list `environment`, by one
    number.
    """
    if kind == "trial_started" and "models" in data:
        data["environment"] = data.pop("models")
    if isinstance(data.get("environment"), list | tuple):
        data["environment"] = numbered(Environment.of(data["environment"]))
    for key in ("took_part", "pinned"):
        if isinstance(data.get(key), list | tuple):
            data[key] = f"{Environment.of(data[key]).bits:x}"
    if kind in OF_ROUND and state.round is not None:
        data.setdefault("round", state.round.number)
    if kind in OF_TESTS:
        data.setdefault("environment", _of_test(state, data, numbered))
        # It follows from the environment.
        data.pop("node", None)
    if kind in ("baseline_finished", "accepted_other", "went_back") and "outcomes" in data:
        data["judged"] = {"outcomes": data.pop("outcomes"), "distances": data.pop("distances", {})}
    if kind == "accepted_other":
        data.setdefault("judged", {"outcomes": {}, "distances": {}})
    if kind == "certificate_finished":
        data["claims"] = [
            {"environment": numbered(_left_out(state, state.node, claim["without"]))} | claim
            for claim in data["claims"]
        ]
    return data


def _of_test(state: RunState, data: dict[str, Any], numbered: Numbered) -> int:
    """The environment of a test, by what it is made for."""
    if data["phase"] == "round" and state.round is not None:
        return numbered(state.round.candidates[data["candidate"]].kept)
    if data["phase"] == "hand":
        return state.trials[data["trial"] - 1].environment
    if data["phase"] in ("certify", "audit"):
        return numbered(_left_out(state, data.get("node", state.node), data.get("without")))
    return 0


def _left_out(state: RunState, node: int, without: int | None) -> Environment:
    """The environment of a node without a model, and without what goes with it."""
    here = state.nodes[node]
    gone = stack_with(state, here.environment, None if without is None else state.elements[without])
    return state.environments[here.id] - Environment.of(map(state.elements.index, gone))


def story(happened: Iterable[tuple[str, dict[str, Any]]], apart: float = 0.0) -> list[Recorded]:
    """Short events as those of a run, so many seconds `apart`. Raises UserError, or Invalid."""
    state, found = RunState(), list[Recorded]()
    for kind, data in happened:
        for event in typed(state, kind, data):
            found.append(Recorded(len(found) + 1, apart * len(found), event))
            state = apply(state, found[-1])
    return found


class Writing:
    """Writes short events into a run file."""

    def __init__(self, file: RunFile) -> None:
        self._file, self._state = file, RunState()

    def write(self, kind: str, data: dict[str, Any], motions: Motions | None = None) -> None:
        """One of a kind that does not exist is written as it is. Raises Invalid."""
        if kind not in KINDS:
            raw(self._file, kind, data)
            return
        # A test may have damaged the file.
        with suppress(UserError):
            self._state = fold(self._file.events(self._state.revision), self._state)
        command = data.get("command")
        for event in typed(self._state, kind, {key: data[key] for key in data if key != "command"}):
            made = None if self._state.margins is None else -1 - self._state.margins.made
            self._file.append(event, motions, command, made)


def raw(file: RunFile, kind: str, data: object) -> None:
    """Writes an event as it is, whether it makes sense or not."""
    with sqlite3.connect(file.path, isolation_level=None) as database:
        row = (1e9, kind, json.dumps(data))
        database.execute("INSERT INTO event (time, kind, data) VALUES (?, ?, ?)", row)
    database.close()
