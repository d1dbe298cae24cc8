"""Reads a `<link>`: its collisions with their friction, its visuals with their colours, and its
inertia, in the world frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ddenv.world.extent import around, shape_bounds
from ddenv.world.model import Box, Collision, Link, Mesh, Piece, Visual
from ddenv.world.pose import HERE, Pose, vector
from ddenv.world.sdf.context import Context, note_unread
from ddenv.world.sdf.frames import pose_of
from ddenv.world.sdf.geometry import Lost, read_shape, remedies, scaled
from ddenv.world.sdf.inertia import WATER, read_density, read_inertia
from ddenv.world.sdf.joints import Spot
from ddenv.world.sdf.standin import AUTO, NO_FLOOR, NONE, Placed, guess
from ddenv.world.sdf.xml import Element, complain, name_of, number, numbers, text_of, truth

Color = tuple[float, float, float, float]
# SDF's default for <mu>, also used by simulators.
DEFAULT_MU = 1.0
# Drake's own coefficients: where time is discrete it uses the dynamic one.
DRAKE_MU = ("drake:mu_dynamic", "drake:mu_static")
# The collide_bitmask of a collision that touches all others.
EVERYTHING = 0xFFFF
# Colours of the Gazebo materials that worlds use most.
GAZEBO_COLORS: dict[str, tuple[float, float, float]] = {
    "Black": (0.05, 0.05, 0.05),
    "Blue": (0.1, 0.2, 0.8),
    "BlueTransparent": (0.1, 0.2, 0.8),
    "Bricks": (0.6, 0.3, 0.25),
    "DarkGray": (0.18, 0.18, 0.18),
    "DarkGrey": (0.18, 0.18, 0.18),
    "FlatBlack": (0.1, 0.1, 0.1),
    "Gold": (0.8, 0.65, 0.12),
    "Gray": (0.5, 0.5, 0.5),
    "Green": (0.1, 0.6, 0.15),
    "Grey": (0.5, 0.5, 0.5),
    "Indigo": (0.3, 0.0, 0.5),
    "LightWood": (0.78, 0.63, 0.45),
    "Orange": (1.0, 0.5, 0.1),
    "Purple": (0.6, 0.1, 0.6),
    "Red": (0.8, 0.1, 0.1),
    "Residential": (0.7, 0.65, 0.6),
    "Road": (0.25, 0.25, 0.27),
    "SkyBlue": (0.5, 0.7, 0.9),
    "Turquoise": (0.1, 0.75, 0.75),
    "White": (0.95, 0.95, 0.95),
    "Wood": (0.6, 0.42, 0.25),
    "WoodFloor": (0.65, 0.47, 0.3),
    "Yellow": (0.9, 0.85, 0.1),
    "ZincYellow": (0.95, 0.85, 0.3),
}


def read_link(element: Element, spot: Spot, context: Context, pose: Pose, local: Pose) -> Link:
    """The link of `element` in the model at `spot`, with its `pose` in the world, and `local` in
    its model. Raises UserError.
    """
    note_unread(element, context)
    items = []
    for child in (child for child in element if child.tag in ("collision", "visual")):
        note_unread(child, context)
        name_of(child)
        own = child.find("pose")
        place = spot.scope.place(child)
        if own is not None and (own.get("relative_to") or own.get("frame")):
            place = local.inverse() @ place
        items.append(_Item(child, place, read_shape(child, context, spot.scale)))
    inertial = element.find("inertial")
    usual = WATER if inertial is None else read_density(inertial, WATER)
    collisions = []
    density = []
    visuals = []
    for item in items:
        if (
            item.element.tag == "collision"
            and (placed := _settled(item, items, element, context)) is not None
        ):
            solids = _collisions(item, placed, pose, context)
            collisions += solids
            density += [read_density(item.element, usual)] * len(solids)
    inertia = None if spot.static else read_inertia(element, pose, collisions, density, context)
    kinematic = element.find("kinematic")
    if kinematic is not None and not spot.static and truth(element, "kinematic", False):
        context.note("ignored", kinematic, "forces move it like any other link")
    for item in items:
        if isinstance(item.shape, Lost) and item.element.tag == "visual":
            context.note(
                "ignored",
                item.shape.element,
                f"'{item.shape.uri}' is not drawn: {item.shape.reason}",
            )
        elif isinstance(item.shape, Placed) and item.element.tag == "visual":
            place = pose @ item.pose @ item.shape.offset
            visuals.append(
                Visual(name_of(item.element), item.shape.shape, place, read_color(item.element))
            )
    return Link(
        name=spot.prefix + name_of(element),
        pose=pose,
        inertia=inertia,
        collisions=tuple(collisions),
        visuals=tuple(visuals),
    )


@dataclass(frozen=True)
class _Item:
    """A `<collision>` or `<visual>`, its pose in the link, and its shape."""

    element: Element
    pose: Pose
    shape: Placed | Lost | None


def _collisions(item: _Item, placed: Placed, pose: Pose, context: Context) -> list[Collision]:
    """The shapes of a `<collision>` of the link at `pose`; none if nothing can touch it. Raises
    UserError.
    """
    if not can_be_touched(item.element, context):
        return []
    mu = read_friction(item.element, context)
    place = pose @ item.pose @ placed.offset
    name = name_of(item.element)
    if not isinstance(placed.shape, Mesh) or not placed.pieces:
        return [Collision(name=name, shape=placed.shape, pose=place, mu=mu)]
    return [
        Collision(
            name=name, shape=shape, pose=place @ offset, mu=mu, piece=Piece(placed.shape, offset)
        )
        for shape, offset in placed.pieces
    ]


def _settled(item: _Item, items: list[_Item], link: Element, context: Context) -> Placed | None:
    """The shape of a collision, with a replacement for a missing mesh; None if nothing collides.
    Raises UserError.
    """
    if not isinstance(item.shape, Lost):
        return item.shape
    lost = item.shape
    if lost.word == NONE:
        context.note(
            "ignored", lost.element, f"'{lost.uri}' is left out as asked: nothing collides with it"
        )
        return None
    if lost.word == AUTO:
        context.guessed.append((context.model, lost.uri))
    if lost.word:
        kind = "visual" if lost.word == AUTO else lost.word
        near = [
            (one.shape, one.pose)
            for one in items
            if one.element.tag == kind and isinstance(one.shape, Placed)
        ]
        box = around(shape_bounds(one.shape, pose @ one.offset) for one, pose in near)
        if box is not None:
            context.note(
                "replaced", lost.element, f"'{lost.uri}' by the box around its link's {kind} shapes"
            )
            middle = Pose(vector((box[0] + box[1]) / 2))
            return Placed(
                Box(vector(np.maximum(box[1] - box[0], 1e-3))), item.pose.inverse() @ middle
            )
        if lost.word == AUTO:
            return _guessed(lost, item, link, context)
        raise complain(
            lost.element, f"its link has no {kind} shape that could replace '{lost.uri[:200]}'"
        )
    if context.ignores(lost.element.tag):
        why = f"'{lost.uri}' {lost.problem} ({lost.reason}): nothing collides with it"
        context.note("ignored", lost.element, why)
        return None
    kinds = {other.element.tag for other in items if isinstance(other.shape, Placed)}
    if lost.unreadable:
        context.unreadable[lost.uri] = lost.reason
    context.missing.setdefault(
        lost.uri, complain(lost.element, remedies(lost, tuple(sorted(kinds))))
    )
    return None


def _guessed(lost: Lost, item: _Item, link: Element, context: Context) -> Placed | None:
    """A shape for a missing mesh whose link has no other visual shape to go by; None for a
    floor.
    """
    guessed = guess(lost.uri, link)
    if guessed is None:
        context.note("ignored", lost.element, f"'{lost.uri}' {NO_FLOOR}")
        return None
    stand_in, text, why, scale = guessed
    context.note("replaced", lost.element, f"'{lost.uri}' by a guess, {text}: {why}")
    if scale is None:
        mass = link.find("inertial/pose")
        return Placed(
            stand_in.shape, item.pose.inverse() @ (HERE if mass is None else pose_of(mass))
        )
    by = [abs(own / usual) for own, usual in zip(lost.scale, scale, strict=True)]
    return scaled(stand_in, vector(by), lost.element)


def can_be_touched(collision: Element, context: Context) -> bool:
    """Whether contacts with this collision exert forces; those of sensors do not."""
    contact = collision.find("surface/contact")
    if contact is None:
        return True
    mask = contact.find("collide_bitmask")
    if mask is not None and text_of(mask):
        try:
            bits = int(text_of(mask), 0) & EVERYTHING
        except ValueError:
            raise complain(mask, f"expected a whole number, found '{text_of(mask)[:60]}'") from None
        if bits == 0:
            context.note("ignored", collision, "its collide_bitmask lets nothing touch it")
            return False
        if bits != EVERYTHING:
            context.note("ignored", mask, "everything touches it")
    if truth(contact, "collide_without_contact", False):
        context.note("ignored", collision, "it collides without contact")
        return False
    return True


def read_friction(collision: Element, context: Context) -> float:
    """The Coulomb friction coefficient: Drake's own, else the smaller of SDF's two, which are for
    two directions.

    Raises UserError.
    """
    own = collision.find("drake:proximity_properties")
    for tag in DRAKE_MU:
        if own is not None and own.find(tag) is not None:
            return _friction(own, tag)
    engine = collision.find("surface/friction/ode")
    names = ("mu", "mu2")
    if engine is None:
        engine = collision.find("surface/friction/bullet")
        names = ("friction", "friction2")
    if engine is None:
        return DEFAULT_MU
    first, second = (_friction(engine, name) for name in names)
    if first != second:
        why = (
            f"friction of {first:g} and {second:g} in two directions by {min(first, second):g} "
            "in both"
        )
        context.note("replaced", engine, why)
    return min(first, second)


def _friction(engine: Element, name: str) -> float:
    child = engine.find(name)
    if child is None:
        return DEFAULT_MU
    mu = numbers(child, 1)[0]
    if mu < 0:
        raise complain(child, f"friction must not be negative, found {mu:g}")
    return mu


def read_color(visual: Element) -> Color | None:
    """The diffuse colour, else the ambient one, else that of a known Gazebo material; None if there
    is none.
    """
    opacity = 1.0 - min(max(number(visual, "transparency", 0.0), 0.0), 1.0)
    for tag in ("material/diffuse", "material/ambient"):
        element = visual.find(tag)
        if element is not None and text_of(element):
            count = 4 if len(text_of(element).split()) == 4 else 3
            red, green, blue, *alpha = (
                min(max(value, 0.0), 1.0) for value in numbers(element, count)
            )
            # Many files have colours with an alpha of zero, which the simulators that wrote them
            # ignored.
            return red, green, blue, ((alpha or [1.0])[0] or 1.0) * opacity
    name = text_of(visual.find("material/script/name")).removeprefix("Gazebo/")
    if name in GAZEBO_COLORS:
        return (*GAZEBO_COLORS[name], opacity)
    return None
