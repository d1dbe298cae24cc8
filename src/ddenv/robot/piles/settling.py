"""What the rehearsals of a world's piles show: where everything comes to rest, what never does, and which models rest on which."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import numpy as np
from pydrake.geometry import QueryObject
from pydrake.math import RotationMatrix

from ddenv.robot.drake.plant import Body
from ddenv.robot.drake.run_context import RunContext
from ddenv.robot.piles.motion import CALM, Script
from ddenv.robot.piles.rehearsal import Rehearsals
from ddenv.robot.settled import Settled
from ddenv.world.pose import Pose, vector


def settled(context: RunContext, rehearsals: Rehearsals, present: frozenset[str]) -> Settled:
    """How the world settles that has the models `present`."""
    context.presence.remove(frozenset())
    places: dict[str, tuple[Pose, ...]] = {}
    found: dict[str, set[str]] = {"restless": set(), "fallen": set(), "broken": set()}
    ticks, seconds = context.clock.ticks, 0.0
    for pile, script in rehearsals.settle(present):
        if script is None:
            found["broken"].update(body.name for body in pile)
            continue
        seconds = max(seconds, ticks[len(script.states) - 1].time)
        gone = script.motions[-1].below(context.floor)
        for (body, links), rests in zip(_links(pile), script.resting, strict=True):
            places[body.name] = tuple(_place(script, link) for link in links)
            if gone[links].all():
                found["fallen"].add(body.name)
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
    return sorted(_between(_contacts(context, rehearsals, present), elements))


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


def _contacts(context: RunContext, rehearsals: Rehearsals, present: frozenset[str]) -> set[Pair]:
    """Who rests directly on whom in the settled world."""
    built, hold, presence = context.built, context.hold, context.presence
    presence.remove(frozenset())
    settled = rehearsals.settle(present)
    moving = tuple(built.moving.values())
    hold.begin(others=(built.robot,))
    presence.join(moving, (), robot=False)
    found: set[Pair] = set()
    try:
        for back in np.linspace(0.0, CALM, LOOKS):
            for pile, script in settled:
                entries = hold.entries(pile)
                # A pile whose simulation breaks is taken as it starts.
                hold.put(entries, hold.start[entries] if script is None else script.states[_row(context, script, back)])
            hold.apply()
            found.update(_carried(context))
    finally:
        presence.part(moving, ())
    return found


def _row(context: RunContext, script: Script, back: float) -> int:
    """The row of `script` that is `back` (s) before its end, or its first."""
    ticks = context.clock.ticks[: len(script.states)]
    return sum(tick.time < ticks[-1].time - back for tick in ticks)


def _carried(context: RunContext) -> Iterator[Pair]:
    """Each two models whose contact now carries the upper one, which can move."""
    built = context.built
    shapes = [*built.static.items(), *((body.name, body.geometry) for body in built.moving.values())]
    # The robot's shapes are missing.
    model_of = {shape: name for name, identities in shapes for shape in identities}
    query = cast(QueryObject, built.plant.get_geometry_query_input_port().Eval(context.plant_context))
    for contact in query.ComputePointPairPenetration():
        first, second = model_of.get(contact.id_A), model_of.get(contact.id_B)
        # The normal points from the second to the first.
        up = contact.nhat_BA_W[2]
        upper, lower = (first, second) if up > 0 else (second, first)
        if upper and lower and upper != lower and upper in built.moving and abs(up) >= UPWARDS:
            yield upper, lower
