"""What rests on what in a run's world: what falls when other models go, and which models form a
stack.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

from ddenv.runfile.state import Candidate, Pairs, RunState, Trial
from ddenv.settings import SETTINGS, read
from ddenv.text import Names


def drops(state: RunState, tried: Candidate | Trial) -> Names:
    """The models of a candidate or a trial that fall when the others of its environment go."""
    if not state.supports:
        return ()
    if isinstance(tried, Candidate):
        before = tried.split.environment
    else:
        before = state.nodes[tried.node].environment
    return dropped(state.supports, tried.models, before)


def drops_without(state: RunState, models: frozenset[str]) -> Names:
    """The models of the environment that fall when `models` go."""
    there = state.environment
    return dropped(state.supports, (name for name in there if name not in models), there)


def stacks_of(state: RunState, environment: Names) -> tuple[Names, ...]:
    """The models of `environment` in groups that stay or go together: what is welded, and stacks if
    the run keeps them whole.
    """
    whole = read(state.scenario, SETTINGS["keep_supports"])
    return stacks(environment, (*state.welds, *state.supports) if whole else state.welds)


def stack_with(state: RunState, environment: Names, name: str | None) -> Names:
    """The models that go together with a model, itself included; none for None."""
    found = (stack for stack in stacks_of(state, environment) if name in stack)
    if name is None:
        return ()
    return next(found, (name,))


def dropped(supports: Pairs, keep: Iterable[str], environment: Iterable[str]) -> Names:
    """The models of `keep` that lose something that they rest on, or rest on one that does, in the
    order of `keep`.

    What is not in the `environment` was removed before: what rested on it has fallen already.
    """
    keep = tuple(keep)
    kept = frozenset(keep)
    there = frozenset(environment)
    held = [(upper, lower) for upper, lower in supports if upper in kept and lower not in kept]
    new = falling = {upper for upper, lower in held if lower in there or upper not in there}
    while new:
        new = {upper for upper, lower in supports if lower in new and upper in kept} - falling
        falling |= new
    return tuple(name for name in keep if name in falling)


@lru_cache(maxsize=16)
def stacks(environment: Names, supports: Pairs) -> tuple[Names, ...]:
    """The models of `environment` in groups that are connected by support; what is not there
    connects nothing.

    A model that neither rests on another nor carries one is a stack of its own. Models, and stacks
    by their first models, are in the environment's order.
    """
    group_of = {name: [name] for name in environment}
    for pair in supports:
        one, other = (group_of.get(name) for name in pair)
        if one is None or other is None or one is other:
            continue
        # The smaller group moves, so that no model moves often.
        small, large = sorted((one, other), key=len)
        large += small
        group_of |= dict.fromkeys(small, large)
    place = {name: number for number, name in enumerate(environment)}
    groups = {id(group): tuple(sorted(group, key=place.__getitem__)) for group in group_of.values()}
    return tuple(sorted(groups.values(), key=lambda group: place[group[0]]))
