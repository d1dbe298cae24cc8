"""What rests on what, as a graph: what falls when other models go, and which models form a stack. Pure."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

Names = tuple[str, ...]
# The first of each two models rests on the second.
Supports = tuple[tuple[str, str], ...]


def dropped(supports: Supports, keep: Iterable[str], environment: Iterable[str]) -> Names:
    """The models of `keep` that lose something that they rest on, or rest on one that does, in the order of `keep`.

    What is not in the `environment` was removed before: what rested on it has fallen already.
    """
    keep = tuple(keep)
    kept, there = frozenset(keep), frozenset(environment)
    falling = {
        upper
        for upper, lower in supports
        if upper in kept and lower not in kept and (lower in there or upper not in there)
    }
    new = falling
    while new:
        new = {upper for upper, lower in supports if lower in new and upper in kept} - falling
        falling |= new
    return tuple(name for name in keep if name in falling)


@lru_cache(maxsize=16)
def stacks(environment: Names, supports: Supports) -> tuple[Names, ...]:
    """The models of `environment` in groups that are connected by support; what is not there connects nothing.

    A model that neither rests on another nor carries one is a stack of its own. Models, and stacks by their first models, are in
    the environment's order.
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
