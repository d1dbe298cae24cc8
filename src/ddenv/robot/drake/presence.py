"""Which geometry can touch which in a context: removes models and puts them back without building a new plant."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet
from pydrake.systems.framework import Context

from ddenv.robot.drake.plant import Body, Built


class Presence:
    """The collision filters of one context.

    Moving models touch only what `join` has connected them with, also within a model that collides with itself: what is not
    joined must not be in the solver's problem. (Drake's transient filters, which it could take back itself, copy all pairs of the
    world: 170 ms instead of 3 in a world of 1300 boxes.)
    """

    def __init__(self, built: Built, context: Context) -> None:
        self._built = built
        self._filters = built.scene_graph.collision_filter_manager(
            built.scene_graph.GetMyMutableContextFromRoot(context)
        )
        self._robot = GeometrySet(list(built.robot.geometry))
        # What has a twin waits away from everything while it is not simulated, and needs no filter.
        self._free = [body.geometry for body in built.moving.values() if body.name in built.twins]
        self._movers = _set([built.robot.geometry, *self._free])
        self._free += [twin.geometry for twin in built.twins.values()]
        self._removed: frozenset[str] = frozenset()
        self._kept = built.static
        self._all_kept: GeometrySet | None = None
        self.part(tuple(built.moving.values()), ())

    def remove(self, removed: frozenset[str]) -> None:
        """Removes what never moves of the models `removed`, and puts back all others. Moving models are simply not joined.

        Only the difference to the last call costs time: most runs keep nearly the same models as the run before.
        """
        gone, back = self._static(removed - self._removed), self._static(self._removed - removed)
        if gone:
            self._filters.Apply(CollisionFilterDeclaration().ExcludeBetween(_set(gone), self._movers))
        if back:
            self._filters.Apply(CollisionFilterDeclaration().AllowBetween(_set(back), self._movers))
        if gone or back:
            self._removed, self._all_kept = removed, None
            self._kept = {name: geometry for name, geometry in self._built.static.items() if name not in removed}

    @property
    def _ground(self) -> GeometrySet:
        """Everything that never moves and is kept."""
        if self._all_kept is None:
            self._all_kept = _set(self._kept.values())
        return self._all_kept

    def _static(self, names: frozenset[str]) -> list[tuple[GeometryId, ...]]:
        return [geometry for name in names if (geometry := self._built.static.get(name))]

    def join(self, bodies: Sequence[Body], others: Sequence[Body], robot: bool = True) -> None:
        """Lets `bodies` touch themselves, each other, `others`, what is kept and never moves, and with `robot` also the robot."""
        declaration = CollisionFilterDeclaration()
        for body, rest in self._pairs(bodies, others, robot):
            declaration.AllowBetween(body, rest)
        self._filters.Apply(declaration)

    def part(self, bodies: Sequence[Body], others: Sequence[Body]) -> None:
        """Undoes `join`. `others` are the moving models that `bodies` could touch besides each other."""
        declaration = CollisionFilterDeclaration()
        for body, rest in self._pairs(bodies, others, True):
            declaration.ExcludeBetween(body, rest)
        self._filters.Apply(declaration)

    def _pairs(
        self, bodies: Sequence[Body], others: Sequence[Body], robot: bool
    ) -> Iterator[tuple[GeometrySet, GeometrySet]]:
        bodies = [body for body in bodies if body.name not in self._built.twins]
        for number, body in enumerate(bodies):
            mine = GeometrySet(list(body.geometry))
            yield mine, _set([*self._free, *(other.geometry for other in (*bodies[number + 1 :], *others))])
            if robot:
                yield mine, self._robot
            yield mine, self._ground_of(body)
            for one, other in body.own_pairs:
                yield GeometrySet(list(one)), GeometrySet(list(other))

    def _ground_of(self, body: Body) -> GeometrySet:
        """What is kept and never moves, without the model's own links: a door does not touch its frame."""
        if not self._built.static.get(body.name):
            return self._ground
        return _set(geometry for name, geometry in self._kept.items() if name != body.name)


def _set(groups: Iterable[tuple[GeometryId, ...]]) -> GeometrySet:
    return GeometrySet([member for group in groups for member in group])
