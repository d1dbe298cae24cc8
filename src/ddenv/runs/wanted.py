"""What a viewer wants the scene to show: a moment of the run, and a row of the table at that moment."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from ddenv.runfile.state import Candidate, RunState, Trial


@dataclass(frozen=True, slots=True)
class Wanted:
    """`at` is the id of an event, None for the present. A candidate is one of round number `round`; None follows the run."""

    at: int | None = None
    round: int | None = None
    candidate: int | None = None
    trial: int | None = None


def written(wanted: Wanted) -> str:
    """A line for the scene's standard input."""
    return json.dumps(asdict(wanted)) + "\n"


def read(line: str) -> Wanted | None:
    """What a line of standard input asks for; None if it is no such line."""
    try:
        wanted = Wanted(**json.loads(line))
    except (ValueError, TypeError):
        return None
    return wanted if all(value is None or type(value) is int for value in asdict(wanted).values()) else None


def row_of(state: RunState, wanted: Wanted) -> Candidate | Trial | None:
    """The row that is wanted; None if there is none, or no more."""
    if wanted.trial is not None:
        return state.trials[wanted.trial - 1] if 0 < wanted.trial <= len(state.trials) else None
    if wanted.candidate is None or state.round is None or state.round.number != wanted.round:
        return None
    candidates = state.round.candidates
    return candidates[wanted.candidate] if 0 <= wanted.candidate < len(candidates) else None
