"""What rests on what in a run's world: its events, and what they mean for a removal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ddenv.resting import Names, dropped, stacks
from ddenv.runfile.events import Changes, Data, names
from ddenv.runfile.state import Candidate, RunState, Trial
from ddenv.settings import SETTINGS, read


def supports_started(_: RunState, __: Data, ___: float) -> Changes:
    return {"settling": True}


def supports(state: RunState, data: Data, _: float) -> Changes:
    return {
        "settling": False,
        "unsettled": str(data.get("why", "")),
        "supports": tuple(_pairs(state, data["pairs"])),
        "ties": None if data.get("ties") is None else tuple(_pairs(state, data["ties"])),
    }


def _pairs(state: RunState, pairs: Any) -> Iterator[tuple[str, str]]:
    for pair in pairs:
        one, other = names(state.elements, pair)
        yield one, other


def drops(state: RunState, tried: Candidate | Trial) -> Names:
    """The models of a candidate or a trial that fall when the others of its environment go."""
    if not state.supports:
        return ()
    before = tried.split.environment if isinstance(tried, Candidate) else state.nodes[tried.node].environment
    return dropped(state.supports, tried.models, before)


def drops_without(state: RunState, models: frozenset[str]) -> Names:
    """The models of the environment that fall when `models` go."""
    there = state.environment
    return dropped(state.supports, (name for name in there if name not in models), there)


def stacks_of(state: RunState, environment: Names) -> tuple[Names, ...]:
    """The models of `environment` in groups that stay or go together: single models, unless the run keeps stacks whole."""
    return stacks(environment, state.supports if _keeps_stacks(state) else ())


def stack_with(state: RunState, environment: Names, name: str | None) -> Names:
    """The models that go together with a model, itself included; none for None."""
    if name is None or not _keeps_stacks(state):
        return () if name is None else (name,)
    return next((stack for stack in stacks_of(state, environment) if name in stack), (name,))


def _keeps_stacks(state: RunState) -> bool:
    return bool(read(state.scenario, SETTINGS["keep_supports"]))
