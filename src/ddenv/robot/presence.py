"""Removes models from a context and puts them back, without building the plant anew."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet
from pydrake.systems.framework import Context

from ddenv.robot.plant import Built


@contextmanager
def without(built: Built, context: Context, removed: frozenset[str]) -> Iterator[None]:
    """The world of `context` without the models `removed`: nothing touches them, and they touch nothing.

    Moving ones fall through everything and are gone; what touches nothing takes no part in the solver's work. (Locking them
    where they are would do too, but crashes Drake up to 1.55 at least where static geometry is on the world body, drake#24773.)
    On leaving, the collisions are as they were; poses are the caller's to reset.
    """
    if not removed:
        yield
        return
    filters = built.scene_graph.collision_filter_manager(built.scene_graph.GetMyMutableContextFromRoot(context))
    # A transient filter lies on top of the others, so that taking it back is exact.
    filter_id = filters.ApplyTransient(_exclusion(built, removed))
    try:
        yield
    finally:
        filters.RemoveDeclaration(filter_id)


def _exclusion(built: Built, removed: frozenset[str]) -> CollisionFilterDeclaration:
    """Nothing that is removed touches anything that moves; two static models never meet anyway."""
    static = [geometry for name, geometry in built.static.items() if name in removed]
    moving = [body.geometry for name, body in built.moving.items() if name in removed]
    all_moving = [built.robot.geometry, *(body.geometry for body in built.moving.values())]
    declaration = CollisionFilterDeclaration().ExcludeBetween(_set([*static, *moving]), _set(all_moving))
    return declaration.ExcludeBetween(_set(moving), _set(built.static.values())) if moving else declaration


def _set(groups: Iterable[tuple[GeometryId, ...]]) -> GeometrySet:
    return GeometrySet([member for group in groups for member in group])
