"""What the rehearsals of a world's piles show of its start: where everything comes to rest, and what never does."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import numpy as np
from pydrake.math import RotationMatrix

from ddenv.arrays import Booleans, Floats
from ddenv.robot.drake.plant import Body
from ddenv.robot.drake.run_context import RunContext
from ddenv.robot.piles.rehearsal import Rehearsals
from ddenv.robot.piles.script import Script
from ddenv.robot.settled import Settled
from ddenv.world.pose import Pose, vector

# A model that falls from the top of its pile is at most so much slower than one that something else throws, m/s.
THROWN = 5.0


def settled(context: RunContext, rehearsals: Rehearsals, present: frozenset[str]) -> Settled:
    """How the world settles that has the models `present`."""
    context.presence.remove(frozenset())
    places: dict[str, tuple[Pose, ...]] = {}
    found: dict[str, set[str]] = {"restless": set(), "fallen": set(), "wild": set(), "broken": set()}
    ticks, seconds = context.clock.ticks, 0.0
    gravity = float(np.linalg.norm(cast(Floats, context.built.plant.gravity_field().gravity_vector())))
    for pile, script in rehearsals.settle(present):
        if script is None:
            found["broken"].update(body.name for body in pile)
            continue
        seconds = max(seconds, ticks[len(script.states) - 1].time)
        wild = _wild(script, gravity)
        gone = script.motions[-1].below(context.floor)
        for (body, links), rests in zip(_links(pile), script.resting, strict=True):
            places[body.name] = tuple(_place(script, link) for link in links)
            if gone[links].all():
                found["fallen"].add(body.name)
            elif wild[links].any():
                found["wild"].add(body.name)
            elif not rests:
                found["restless"].add(body.name)
    in_order = [name for name in context.built.moving if name in present]
    return Settled(
        seconds=seconds,
        places={name: places[name] for name in in_order if name in places},
        **{kind: tuple(name for name in in_order if name in names) for kind, names in found.items()},
    )


def _links(pile: tuple[Body, ...]) -> Iterator[tuple[Body, range]]:
    """The models of a pile, each with the numbers of its links."""
    first = 0
    for body in pile:
        yield body, range(first, first + len(body.links))
        first += len(body.links)


def _place(script: Script, link: int) -> Pose:
    last = script.motions[-1]
    w, x, y, z = RotationMatrix(last.turns[link]).ToQuaternion().wxyz().tolist()
    return Pose(vector(last.places[link]), (w, x, y, z))


def _wild(script: Script, gravity: float) -> Booleans:
    """Which links were ever faster than a fall from the top of their pile would make them."""
    highs = script.motions[0].high[:, 2]
    top = float(highs.max())
    wild = np.zeros(len(highs), dtype=bool)
    for motion in script.motions:
        fallen = np.maximum(top - motion.places[:, 2], 0.0)
        wild |= motion.speed > THROWN + np.sqrt(2.0 * gravity * fallen)
    return wild
