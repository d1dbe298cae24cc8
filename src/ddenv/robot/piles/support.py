"""What rests on what: found once for each world, by the contacts after all piles have come to rest.

Removing a shelf changes what lies on it. This is the one relation for all that must know it: what a removal drops, which models a
stack consists of, what must stay for a run to repeat. (Which models sleep is another question: it is asked at each tick, also of
models that are out of the solver's problem and so have no contacts.)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import cast

import numpy as np
from pydrake.geometry import GeometryId, QueryObject

from ddenv.robot.drake.plant import Body, Built
from ddenv.robot.drake.run_context import RunContext
from ddenv.robot.piles.rehearsal import CALM, Rehearsals

# A contact carries where its normal points at least this far up (the cosine of 60 degrees): boards lean on steep edges.
UPWARDS = 0.5
# How often the contacts are looked at within the last `CALM` seconds: models that tremble do not touch all the time.
LOOKS = 4

Pair = tuple[str, str]


def supports(
    context: RunContext, rehearsals: Rehearsals, present: frozenset[str], elements: frozenset[str]
) -> list[Pair]:
    """Each of `elements` that can move with each one that it rests on, as (upper, lower), sorted.

    `present` are the models of the world. What rests on something that is no element, and so always stays, rests on what that
    rests on.
    """
    touching = set(_contacts(context, rehearsals, present))
    return sorted(_between(touching, elements))


def _between(pairs: set[Pair], elements: frozenset[str]) -> Iterator[Pair]:
    """`pairs` with the models between two elements skipped."""
    below: dict[str, set[str]] = {}
    for upper, lower in pairs:
        below.setdefault(upper, set()).add(lower)
    for upper in elements & set(below):
        reached, ahead = set(), set(below[upper])
        while ahead:
            one = ahead.pop()
            reached.add(one)
            ahead |= set() if one in elements else below.get(one, set()) - reached
        yield from ((upper, lower) for lower in reached & elements - {upper})


def _contacts(context: RunContext, rehearsals: Rehearsals, present: frozenset[str]) -> Iterator[Pair]:
    """Who rests directly on whom in the settled world."""
    built, hold, presence = context.built, context.hold, context.presence
    presence.remove(frozenset())
    settled = rehearsals.settle(present)
    model_of = _model_of(built)
    moving = tuple(built.moving.values())
    hold.begin(others=(built.robot,))
    presence.join(moving, (), robot=False)
    try:
        for back in np.linspace(0.0, CALM, LOOKS):
            for pile, script in settled:
                if script is not None:
                    ticks = context.clock.ticks[: len(script.states)]
                    row = sum(tick.time < ticks[-1].time - back for tick in ticks)
                    hold.put(hold.entries(pile), script.states[row])
            hold.apply()
            query = cast(QueryObject, built.plant.get_geometry_query_input_port().Eval(context.plant_context))
            for contact in query.ComputePointPairPenetration():
                first, second = model_of.get(contact.id_A), model_of.get(contact.id_B)
                if first is None or second is None or first == second:
                    continue
                # The normal points from the second to the first.
                up = contact.nhat_BA_W[2]
                upper, lower = (first, second) if up > 0 else (second, first)
                if abs(up) >= UPWARDS and upper in built.moving:
                    yield upper, lower
    finally:
        presence.part(moving, ())


def _model_of(built: Built) -> dict[GeometryId, str]:
    """The model of each geometry; the robot's are missing."""
    return {shape: name for name, shapes in _shapes(built) for shape in shapes}


def _shapes(built: Built) -> Iterable[tuple[str, tuple[GeometryId, ...]]]:
    bodies: Iterable[Body] = built.moving.values()
    return [*built.static.items(), *((body.name, body.geometry) for body in bodies)]
