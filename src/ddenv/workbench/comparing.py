"""What two places in a run's history have in common, and in what they differ. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.runfile.guiding import Node


@dataclass(frozen=True, slots=True)
class Comparison:
    """Models' names in the order of the world file."""

    common: tuple[str, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]


def compare(first: Node, second: Node) -> Comparison:
    """Both environments, model by model."""
    left, right = frozenset(first.environment), frozenset(second.environment)
    return Comparison(
        common=tuple(name for name in first.environment if name in right),
        only_first=tuple(name for name in first.environment if name not in right),
        only_second=tuple(name for name in second.environment if name not in left),
    )
