"""How a world comes to rest before the robot comes, and what is wrong with its start, in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from ddenv.text import Names, count, first_of
from ddenv.world.model import World
from ddenv.world.pose import Pose
from ddenv.world.sdf.moved import link_poses

# A model that moves farther than this before anything touches it was not at rest in the file, m.
UNREST = 0.05
MOST_NAMES = 3  # a line names so many models


@dataclass(frozen=True, kw_only=True)
class Settled:
    """What the models that can move do in `seconds` of simulated time while nobody comes near them.

    `places` are the poses of their links at the end, in the world frame and in the order of the
    file. `restless` models still move then, `fallen` ones have fallen out of the world. What is
    `broken` could not be simulated, and has no place.
    """

    seconds: float = 0.0
    places: Mapping[str, tuple[Pose, ...]] = field(default_factory=dict)
    restless: Names = ()
    fallen: Names = ()
    broken: Names = ()


def moved(world: World, settled: Settled) -> dict[str, float]:
    """How far each model has moved that is still in the world, m."""
    starts = link_poses(world)
    gone = frozenset(settled.fallen)
    return {
        name: max(
            math.dist(one.position, there.position)
            for one, there in zip(starts[name], places, strict=True)
        )
        for name, places in settled.places.items()
        if name not in gone
    }


def notes_on(world: World, settled: Settled) -> Iterator[tuple[str, str]]:
    """What is wrong with the start of `world`: a word and a sentence for each."""
    ways = {name: way for name, way in moved(world, settled).items() if way > UNREST}
    if ways:
        farthest = max(ways, key=lambda name: ways[name])
        yield (
            "unrest",
            f"the world is not at rest at the start: {_do(len(ways), 'moves', 'move')} before "
            "the robot arrives, "
            f"{farthest} by {ways[farthest]:.2f} m; 'ddenv world settle' writes the world at rest",
        )
    for about, names, does, do, why in (
        (
            "restless",
            settled.restless,
            "does",
            "do",
            f"not come to rest within {settled.seconds:.1f} s",
        ),
        ("fallen", settled.fallen, "falls", "fall", "out of the world"),
        ("broken", settled.broken, "cannot", "cannot", "be simulated: their motion diverges"),
    ):
        if names:
            yield about, f"{_do(len(names), does, do)} {why} ({first_of(names, MOST_NAMES)})"


def _do(number: int, does: str, do: str) -> str:
    return f"{count(number, 'model')} {does if number == 1 else do}"
