"""In what two runs, or two scenarios, differ."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from pathlib import Path, PurePath
from typing import Any

from ddenv.runfile.state import RunState
from ddenv.runs.experiment import Experiment
from ddenv.runs.recent import Recent, recent_of
from ddenv.text import coordinates, count, first_of, plain, truncated
from ddenv.words.signs import brief
from ddenv.world.extent import model_bounds
from ddenv.world.model import Model, World

# The maximum number of models to name, and the width of a value.
MOST_COMPARED = 20
LONGEST = 60
NONE = "none"
# What a screen shows elsewhere, or what every run has its own of.
ASIDE = ("name", "description", "folder")
# Files are the same if their names are: a run holds its own copy, and its machine has other
# folders.
FILES = ("world", "model")
# A difference: what differs, and how it is in the first and in the second.
Difference = tuple[str, str, str]

_FACTS: dict[str, Callable[[Recent], str]] = {
    "state": lambda run: f"{run.sign} {run.state_words}",
    "scenario": lambda run: plain(run.scenario),
    "algorithm": lambda run: run.algorithm,
    "pair": lambda run: run.pair,
    "tests": lambda run: str(run.tests),
    "computing": lambda run: brief(run.computed),
    "decisions": lambda run: f"{run.decisions} by hand",
    "models left": lambda run: f"{len(run.kept)} of {count(run.total, 'model')}",
}


def compared(first: Recent, second: Recent) -> Iterator[Difference]:
    """Two runs side by side: (name, value in the first, value in the second)."""
    yield "run", plain(first.path.stem), plain(second.path.stem)
    for name, say in _FACTS.items():
        yield name, say(first), say(second)
    both = _names(first, second, in_both=True)
    yield "in both", both, both
    yield (
        "only in this one",
        _names(first, second, in_both=False),
        _names(second, first, in_both=False),
    )
    yield from differences(first.chosen, second.chosen)


def differences(
    first: Mapping[str, Any], second: Mapping[str, Any], above: str = ""
) -> Iterator[Difference]:
    """The settings in which two scenarios differ, by their paths such as `reduction.iterations`."""
    for key in dict.fromkeys((*first, *second)):
        one = first.get(key)
        other = second.get(key)
        if key in FILES:
            one, other = (
                PurePath(each).name if isinstance(each, str) else each for each in (one, other)
            )
        if one == other or (not above and key in ASIDE):
            continue
        if isinstance(one, Mapping) and isinstance(other, Mapping):
            yield from differences(one, other, f"{above}{key}.")
        else:
            yield f"{above}{plain(key)}", _value(one), _value(other)


def _value(value: Any) -> str:
    if value is None:
        return NONE
    return truncated(plain(value), LONGEST)


def _names(run: Recent, other: Recent, *, in_both: bool) -> str:
    """The models that are left in `run`: those that are left in `other` too, or those that are
    not.
    """
    names = [plain(name) for name in run.kept if (name in other.kept) == in_both]
    if names:
        return f"{len(names)}: {first_of(names, MOST_COMPARED)}"
    return NONE


def as_recent(name: str, subject: Experiment) -> Recent:
    """What `name` stands for, as a list would show it; of a scenario nothing was run."""
    state = subject.state or RunState(
        scenario=subject.scenario.model_dump(mode="json"),
        elements=subject.elements,
        environment=subject.elements,
    )
    return recent_of(subject.run or Path(name), state, changed=0.0)


def unlike(first: World, second: World) -> Iterator[Difference]:
    """The models of one name that differ, up to a number of them: in place, size or else."""
    others = {model.name: model for model in second.models}
    pairs = ((model, others[model.name]) for model in first.models if model.name in others)
    seen = ((model.name, _looks(model), _looks(other)) for model, other in pairs)
    yield from islice(
        ((plain(name), one, other) for name, one, other in seen if one != other), MOST_COMPARED
    )


def _looks(model: Model) -> str:
    """Where a model is, how large and how slippery, and whether it moves."""
    box = model_bounds(model)
    moves = "static" if model.static else "can move"
    if box is None:
        return f"at ({coordinates(model.pose.position)}) m, {moves}"
    friction = min((collision.mu for collision in model.collisions), default=1.0)
    low, high = (coordinates(corner.tolist()) for corner in box)
    return f"({low}) to ({high}) m, friction {friction:g}, {moves}"
