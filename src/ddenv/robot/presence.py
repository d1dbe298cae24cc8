"""Removes models from a context and puts them back, without building the plant anew."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from pydrake.geometry import CollisionFilterDeclaration, CollisionFilterManager, GeometryId, GeometrySet
from pydrake.systems.framework import Context

from ddenv.robot.plant import Built


@contextmanager
def without(built: Built, context: Context, removed: frozenset[str]) -> Iterator[None]:
    """The world of `context` without the models `removed`: nothing touches them, and they touch nothing.

    Moving ones fall through everything and are gone; what touches nothing takes no part in the solver's work. (Locking them
    where they are would do too, but crashes Drake up to 1.55 at least where static geometry is on the world body, drake#24773.)
    On leaving, the collisions are as they were; poses are the caller's to reset.
    """
    filters = built.scene_graph.collision_filter_manager(built.scene_graph.GetMyMutableContextFromRoot(context))
    static, moving = _geometry(built, removed)
    everything_moving = _set([built.robot.geometry, *(body.geometry for body in built.moving.values())])
    # Nothing filters static from moving geometry but this, so that allowing it again is exact. A transient filter would copy
    # all pairs of the world: 170 ms instead of 6 in a world of 1300 boxes.
    filters.Apply(CollisionFilterDeclaration().ExcludeBetween(static, everything_moving))
    try:
        with _without_moving(filters, moving, everything_moving, _set(built.static.values())):
            yield
    finally:
        filters.Apply(CollisionFilterDeclaration().AllowBetween(static, everything_moving))


@contextmanager
def _without_moving(
    filters: CollisionFilterManager,
    moving: GeometrySet | None,
    everything_moving: GeometrySet,
    everything_static: GeometrySet,
) -> Iterator[None]:
    """Links of one moving model may be filtered from each other already: only a transient filter is taken back exactly."""
    if moving is None:
        yield
        return
    declaration = CollisionFilterDeclaration().ExcludeBetween(moving, everything_moving)
    filter_id = filters.ApplyTransient(declaration.ExcludeBetween(moving, everything_static))
    try:
        yield
    finally:
        filters.RemoveDeclaration(filter_id)


def _geometry(built: Built, removed: frozenset[str]) -> tuple[GeometrySet, GeometrySet | None]:
    """The static and the moving geometry of the removed models; None where no moving model is removed."""
    static = _set(geometry for name, geometry in built.static.items() if name in removed)
    moving = [body.geometry for name, body in built.moving.items() if name in removed]
    return static, _set(moving) if moving else None


def _set(groups: Iterable[tuple[GeometryId, ...]]) -> GeometrySet:
    return GeometrySet([member for group in groups for member in group])
