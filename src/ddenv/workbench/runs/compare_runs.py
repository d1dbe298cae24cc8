"""Two runs side by side: what they cost, what is left, and the settings in which they differ."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import PurePath
from typing import Any

from ddenv.text import count, first_of, plain, truncated
from ddenv.words.signs import brief
from ddenv.workbench.runs.recent_runs import Recent

# The maximum number of models to name, and width of a value.
NAMED, LONGEST = 20, 60
NONE = "none"
# What the screen shows elsewhere, or what every run has its own of.
ASIDE = ("name", "description")
# Files are the same if their names are: a run holds its own copy, and its machine has other folders.
FILES = ("world", "model")


def lines(first: Recent, second: Recent) -> Iterator[tuple[str, str, str]]:
    """(name, value in the first, value in the second)."""
    yield "run", plain(first.path.stem), plain(second.path.stem)
    for name, say in _FACTS.items():
        yield name, say(first), say(second)
    here, there = frozenset(first.kept), frozenset(second.kept)
    both = tuple(name for name in first.kept if name in there)
    only = tuple(tuple(name for name in side.kept if name not in here & there) for side in (first, second))
    yield "in both", _names(both), _names(both)
    yield "only in this one", _names(only[0]), _names(only[1])
    for name, one, other in differences(first.chosen, second.chosen):
        yield name, one, other


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


def differences(first: Mapping[str, Any], second: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str, str]]:
    """The settings in which two scenarios differ, by their paths such as `reduction.iterations`."""
    for key in dict.fromkeys((*first, *second)):
        one, other = (_of_key(key, side.get(key)) for side in (first, second))
        if one == other or (not above and key in ASIDE):
            continue
        if isinstance(one, Mapping) and isinstance(other, Mapping):
            yield from differences(one, other, f"{above}{key}.")
        else:
            yield f"{above}{plain(key)}", _value(one), _value(other)


def _of_key(key: str, value: Any) -> Any:
    return PurePath(value).name if key in FILES and isinstance(value, str) else value


def _value(value: Any) -> str:
    return NONE if value is None else truncated(plain(value), LONGEST)


def _names(names: tuple[str, ...]) -> str:
    return f"{len(names)}: {first_of([plain(name) for name in names], NAMED)}" if names else NONE
