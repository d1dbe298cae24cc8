"""What a typed line asks for: `veto part B`, `pin crate_01, crate_02`, `undo`; the screen's keys mean the same."""

from __future__ import annotations

from ddenv.errors import UserError
from ddenv.guiding.offers import Offer, Pointed, offer
from ddenv.guiding.situation import Row, Situation
from ddenv.runfile.state import RunState

# By the words that are typed: the action of `ddenv.guiding.offers`, the screen's key for it, and what it does.
GUIDES = {
    "pause": ("pause", "space", "start no new test; again to go on"),
    "step": ("step", "s", "run one test, then pause"),
    "round": ("step_round", "S", "run to the end of the round, then pause"),
    "accept": ("accept", "a", "accept the reduction that waits; 'accept try 1' adopts a try that shows f"),
    "reject": ("reject", "x", "reject the reduction that waits"),
    "veto": ("veto", "v", "leave out a candidate: 'veto part B'; again takes that back"),
    "pin": ("pin", "p", "keep models: 'pin crate_01, crate_02'; again unpins them"),
    "without": ("without", "w", "try the environment without models: 'without crate_01'"),
    "only": ("only", "o", "try models alone: 'only crate_01, crate_02'"),
    "undo": ("undo", "u", "take back the last reduction"),
    "ask": ("mode", "t", "accept reductions automatically, or ask before each one"),
    "resume": ("resume", "r", "start the engine again"),
}
_KEYS = {key: words for words, (_, key, _) in GUIDES.items()}


def meaning(line: str, now: Situation) -> Offer | None:
    """What a line asks for now; None if it guides nothing. Raises UserError for a row or a model that there is not."""
    first, _, rest = line.strip().partition(" ")
    word = first if first in GUIDES else _KEYS.get(first)
    if word is None:
        return None
    action, rest = GUIDES[word][0], rest.strip()
    if action in ("pin", "without", "only"):
        if not rest:
            raise UserError(f"{word}: which models? Type their names after it, separated by commas")
        return offer(action, now, Pointed(models=_models(rest, now.state)))
    return offer(action, now, Pointed(row=_row(rest, now.state) if rest else None))


def _models(typed: str, state: RunState) -> tuple[str, ...]:
    names = tuple(name.strip() for name in typed.split(",") if name.strip())
    unknown = next((name for name in names if name not in state.environment), None)
    if unknown is not None:
        raise UserError(f"there is no model '{unknown}' in what is left; 'models' lists them")
    return names


def _row(typed: str, state: RunState) -> Row:
    rows: list[Row] = [*state.trials, *(state.round.candidates if state.round is not None else ())]
    found = next((row for row in rows if row.label.casefold() == typed.casefold()), None)
    if found is None:
        raise UserError(f"there is no '{typed}' in this round; 'table' lists the candidates and tries")
    return found
