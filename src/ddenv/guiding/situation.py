"""What decides whether a command is possible, and what all commands share."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import dataclass_transform

from ddenv.runfile.snapshot import EngineIs
from ddenv.runfile.state import Candidate, RunState, Test, Trial
from ddenv.runfile.tested import made_for, purpose
from ddenv.text import count, first_of, shortened

Row = Candidate | Trial

# Maximum number of models that a line names, and maximum width of each name in cells.
NAMED, LONGEST = 2, 32

FINISHED = "the run is finished; u, h, f, c, p, w and o continue from here"
NO_FAILURE = "f is not known yet: the baseline comes first"
NO_MODELS = "no such models"


@dataclass(frozen=True, slots=True)
class Situation:
    """A run, and what else decides whether a command is possible.

    `barred` is why this viewer cannot guide the run at all, or "". `pending` is the viewer's last command in brief until
    the engine obeys it, or "".
    """

    state: RunState
    engine: EngineIs = "alive"
    barred: str = ""
    pending: str = ""

    def needs_engine(self) -> str:
        """Why no engine can answer now, or ""."""
        if self.engine == "starting":
            return "the engine is still starting"
        if self.state.status == "finished":
            return FINISHED
        return "no engine is running; space starts one" if self.engine == "absent" else ""


@dataclass(frozen=True, slots=True)
class Words:
    """A command in words: `brief` while it waits for its answer, `said` when it is sent, `question` before that, or ""."""

    brief: str
    said: str = ""
    question: str = ""


@dataclass_transform(frozen_default=True)
class Asked:
    """What the user asks of a run is one of these, and so a frozen dataclass."""

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True)(cls)


def label_of(state: RunState, test: Test) -> str:
    """What a test was made for, in words."""
    row = made_for(state, test)
    if row is None and test.round is None:
        return purpose(state, test)
    return row.label if row is not None else f"a candidate of round {test.round}"


def numbers_of(state: RunState, names: Iterable[str]) -> tuple[int, ...]:
    """The numbers of models, in the order of the world."""
    number = {name: index for index, name in enumerate(state.elements)}
    return tuple(sorted(number[name] for name in names))


def waiting(state: RunState) -> Candidate | None:
    """The candidate whose reduction waits for accept or reject."""
    round, waits = state.round, state.waiting_candidate
    return None if round is None or waits is None else round.candidates[waits]


def new_search(state: RunState, size: int | None = None) -> str:
    """What follows a decision that ends the search, as a sentence without a full stop.

    A new one begins from `size` models, by default as many as are left.
    """
    if state.baseline is None:
        return "The search begins with that"
    return f"A new search begins from {count(len(state.environment) if size is None else size, 'model')}"


def named(names: Iterable[str]) -> str:
    """The first names of some models, short enough for a line."""
    return first_of([shortened(name, LONGEST) for name in names], NAMED)
