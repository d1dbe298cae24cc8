"""What a round of each algorithm is about: where its candidates come from, and what follows from it. Pure text."""

from __future__ import annotations

from collections.abc import Callable

from ddenv.runfile.settings import Settings
from ddenv.runfile.state import Round
from ddenv.workbench.listings import is_sweep
from ddenv.workbench.methods import chosen
from ddenv.workbench.wording import count, plain

# These leave out one group of models a round, and each model in turn at the end.
GROUPS = ("probdd", "splitting")


def beginning(options: Settings, models: int) -> str:
    """How the next round comes about, of so many models."""
    kept = f"the {count(models, 'model')} of E"
    names = chosen(options.algorithm, options.pair)
    match options.algorithm:
        case "ddenv":
            return f"{kept} are split by {names['partitioning']}, then put in order by {names['prioritization']}."
        case "ddmin":
            return f"{kept} are cut into parts of equal size, in the order of the world file."
        case "probdd":
            return f"of {kept}, those go whose loss is the greatest gain to expect."
        case "splitting":
            return f"of {kept}, the farthest that are undecided go; {names['prioritization']} says what is far."
    return f"{plain(options.algorithm)} decides what is tried of {kept}."


def follows(options: Settings, last: Round) -> str:
    """What the last round means for the next one, or ""."""
    if last.winner is None:
        # The user changed something in the middle of it.
        if not all(one.verdict for one in last.candidates):
            return ""
        reason = "Nothing showed f in the last round"
        if options.algorithm not in SMALLER:
            return f"{reason}."
        return f"{reason}, so {SMALLER[options.algorithm](last)}."
    if options.algorithm != "ddmin":
        return ""
    if last.candidates[last.winner].kind == "partition":
        return "One part alone showed f, so it is cut in two next."
    return "One part could go: the others stay as they are, and n is one less."


def fruitless(options: Settings, current: Round, models: int) -> str:
    """What it means that no candidate of the round `current` showed f; E has so many models."""
    if options.algorithm in GROUPS and is_sweep(current):
        return "Each model was left out once: nothing more can be removed."
    if options.algorithm not in SMALLER:
        return "E stays as it is."
    if options.algorithm not in GROUPS and current.n_partitions >= models:
        return "The parts were single models already: nothing more can be removed."
    return f"E stays as it is; {SMALLER[options.algorithm](current)}."


def _ddenv(_: Round) -> str:
    return "the next round splits it into smaller parts"


def _ddmin(_: Round) -> str:
    return "n doubles, and the parts get smaller"


def _probdd(last: Round) -> str:
    if _group(last) == 1:
        return "the model that was left out is needed"
    return "each model that was left out is likelier to be needed"


def _splitting(last: Round) -> str:
    if _group(last) == 1:
        return "the model that was left out is needed"
    return "one of those that were left out is needed; half of them go next"


SMALLER: dict[str, Callable[[Round], str]] = {
    "ddenv": _ddenv,
    "ddmin": _ddmin,
    "probdd": _probdd,
    "splitting": _splitting,
}


def _group(last: Round) -> int:
    """How many models the round's only candidate leaves out."""
    return len(last.environment) - last.candidates[0].size if last.candidates else 0
