"""Reads a `<link>`: its collisions, visuals and inertia, in the world frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ddenv.world.extent import shape_bounds
from ddenv.world.model import Box, Collision, Link, Visual
from ddenv.world.pose import ONE, Pose, Vector
from ddenv.world.sdf.context import Context
from ddenv.world.sdf.frames import Scope
from ddenv.world.sdf.geometry import Lost, Placed, read_shape, remedies
from ddenv.world.sdf.inertia import WATER, read_density, read_inertia
from ddenv.world.sdf.surface import can_be_touched, read_color, read_friction
from ddenv.world.sdf.unread import note_unread
from ddenv.world.sdf.xml import Element, complain, name_of, truth


@dataclass(frozen=True)
class Site:
    """Where a link is read to: its `pose` in the world, `local` in its model, and what `<state>` multiplies its sizes by."""

    name: str
    pose: Pose
    local: Pose
    scale: Vector = ONE
    moving: bool = False


@dataclass(frozen=True)
class _Item:
    """A `<collision>` or `<visual>` and its pose in the link."""

    element: Element
    pose: Pose
    shape: Placed | Lost | None


def read_link(element: Element, scope: Scope, site: Site, context: Context) -> Link:
    """The link of `element` at `site`. Raises UserError."""
    note_unread(element, context)
    items = [_item(child, scope, site, context) for child in element if child.tag in ("collision", "visual")]
    collisions, density = [], []
    for item in items:
        if item.element.tag == "collision":
            placed = _settled(item, items, context)
            if placed is not None and can_be_touched(item.element, context):
                pose = site.pose @ item.pose @ placed.offset
                mu = read_friction(item.element, context)
                collisions.append(Collision(name_of(item.element), placed.shape, pose, mu))
                density.append(read_density(item.element, _density(element)))
    inertia = read_inertia(element, site.pose, collisions, density, context) if site.moving else None
    if site.moving and truth(element, "kinematic", False):
        context.note("ignored", element.find("kinematic"), "it moves by itself, as any other link")
    return Link(site.name, site.pose, inertia, tuple(collisions), tuple(_visuals(items, site, context)))


def _item(child: Element, scope: Scope, site: Site, context: Context) -> _Item:
    note_unread(child, context)
    name_of(child)
    pose = child.find("pose")
    if pose is not None and (pose.get("relative_to") or pose.get("frame")):
        local = site.local.inverse() @ scope.place(child)
    else:
        local = scope.place(child)
    return _Item(child, local, read_shape(child, context, site.scale))


def _density(link: Element) -> float:
    inertial = link.find("inertial")
    return WATER if inertial is None else read_density(inertial, WATER)


def _settled(item: _Item, items: list[_Item], context: Context) -> Placed | None:
    """The shape of a collision, with something in place of a mesh that cannot be had. Raises UserError."""
    if not isinstance(item.shape, Lost):
        return item.shape
    lost = item.shape
    if lost.sibling:
        box = _box_around([other for other in items if other.element.tag == lost.sibling])
        if box is None:
            raise complain(lost.element, f"no {lost.sibling} shape of its link can stand in for '{lost.uri[:200]}'")
        context.note("replaced", lost.element, f"'{lost.uri}' by the box around its link's {lost.sibling} shapes")
        return Placed(box.shape, item.pose.inverse() @ box.offset)
    if context.ignores("mesh"):
        context.note("ignored", lost.element, f"'{lost.uri}' cannot be had ({lost.reason}): nothing collides with it")
        return None
    kinds = {other.element.tag for other in items if isinstance(other.shape, Placed)}
    context.miss(lost.uri, complain(lost.element, remedies(lost, tuple(sorted(kinds)))))
    return None


def _box_around(items: list[_Item]) -> Placed | None:
    """The box around shapes, in the frame of their link; None where none can be had."""
    placed = [(item.shape, item.pose) for item in items if isinstance(item.shape, Placed)]
    if not placed:
        return None
    lows, highs = zip(*(shape_bounds(one.shape, pose @ one.offset) for one, pose in placed), strict=True)
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    size = tuple(float(part) for part in np.maximum(high - low, 1e-3))
    return Placed(Box(size), Pose(tuple(float(part) for part in (low + high) / 2)))  # type: ignore[arg-type]


def _visuals(items: list[_Item], site: Site, context: Context) -> Iterator[Visual]:
    for item in items:
        if item.element.tag != "visual" or item.shape is None:
            continue
        if isinstance(item.shape, Lost):
            lost = item.shape
            context.note("ignored", lost.element, f"'{lost.uri}' is not drawn: {lost.reason}")
            continue
        pose = site.pose @ item.pose @ item.shape.offset
        yield Visual(name_of(item.element), item.shape.shape, pose, read_color(item.element))
