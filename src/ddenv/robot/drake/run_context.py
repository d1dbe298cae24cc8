"""What all runs in one plant share: its context, who can touch whom, who is held still, and who
lies as part of the ground.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import cast

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet, SourceId
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.robot.clock import Clock
from ddenv.robot.drake.plant import Body, Built, StaticProxy
from ddenv.robot.drake.region import Region
from ddenv.robot.drake.shapes import to_drake, transform
from ddenv.world.pose import Pose


class Presence:
    """The collision filters of one context.

    Moving models touch only what `join` has connected them with, also within a model that collides
    with itself: what is not joined must not be in the solver's problem. (Drake's transient filters,
    which it could take back itself, copy all pairs of the world: 170 ms instead of 3 in a world of
    1300 boxes.)
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
        self.part(tuple(built.moving.values()), ())

    def remove(self, removed: frozenset[str]) -> None:
        """Removes what never moves of the models `removed`, and puts back all others. Moving models
        are simply not joined.

        Only the difference to the last call costs time: most runs keep nearly the same models as
        the run before.
        """
        static = self._built.static
        gone = [static[name] for name in removed - self._removed if static.get(name)]
        back = [static[name] for name in self._removed - removed if static.get(name)]
        if gone:
            self._filters.Apply(
                CollisionFilterDeclaration().ExcludeBetween(_set(gone), self._movers)
            )
        if back:
            self._filters.Apply(CollisionFilterDeclaration().AllowBetween(_set(back), self._movers))
            self._keep_apart()
        self._removed = removed
        self._kept = {name: geometry for name, geometry in static.items() if name not in removed}

    def join(self, bodies: Sequence[Body], others: Sequence[Body], robot: bool = True) -> None:
        """Lets `bodies` touch themselves, each other, `others`, what is kept and never moves, and
        with `robot` also the robot.
        """
        self._apply(CollisionFilterDeclaration.AllowBetween, bodies, others, robot)
        self._keep_apart()

    def part(self, bodies: Sequence[Body], others: Sequence[Body]) -> None:
        """Undoes `join`. `others` are the moving models that `bodies` could touch besides each
        other.
        """
        self._apply(CollisionFilterDeclaration.ExcludeBetween, bodies, others, True)

    def _keep_apart(self) -> None:
        """Filters what never touches, which may just have been allowed."""
        for one, other in self._built.apart:
            self._filters.Apply(CollisionFilterDeclaration().ExcludeBetween(one, other))

    def _apply(
        self,
        between: Callable[..., object],
        bodies: Sequence[Body],
        others: Sequence[Body],
        robot: bool,
    ) -> None:
        declaration = CollisionFilterDeclaration()
        bodies = [body for body in bodies if body.name not in self._built.twins]
        for number, body in enumerate(bodies):
            mine = GeometrySet(list(body.geometry))
            other_bodies = [other.geometry for other in (*bodies[number + 1 :], *others)]
            between(declaration, mine, _set([*self._free, *other_bodies]))
            if robot:
                between(declaration, mine, self._robot)
            # A model does not touch its own links that never move: a door its frame.
            between(
                declaration,
                mine,
                _set(geometry for name, geometry in self._kept.items() if name != body.name),
            )
            for one, other in self._built.own_pairs[body.name]:
                between(declaration, GeometrySet(one), GeometrySet(other))
        self._filters.Apply(declaration)


def _set(groups: Iterable[tuple[GeometryId, ...]]) -> GeometrySet:
    return GeometrySet([member for group in groups for member in group])


# Held joints are kept this far inside their limits (rad or m): a joint at its limit is work for the
# solver.
INSIDE = 1e-6
# Where models wait that are not simulated: this far from each other along x, and this high, m.
APART = 1e3
HIGH = 1e5


class Hold:
    """The held models of one context: each at a fixed pose, with zero velocity and without weight.

    With their collisions filtered out (`Presence`) they are no part of the solver's problem.
    (`Joint.Lock` would do the same, but crashes Drake where static geometry is on the world body,
    drake#24773.)

    `start` (P + V,) are the plant's positions and velocities at the start of every run.
    """

    def __init__(self, built: Built, plant_context: Context, start: Floats) -> None:
        self._plant = built.plant
        self._context = plant_context
        self.start = start
        self._bodies = tuple(built.moving.values())
        self._count = built.plant.num_positions()
        self._held: Booleans = np.zeros(len(start), dtype=bool)
        self._changed = True
        self._state = start.copy()
        low = cast(Floats, built.plant.GetPositionLowerLimits())
        high = cast(Floats, built.plant.GetPositionUpperLimits())
        inside = np.minimum(INSIDE, (high - low) / 4)
        self._low = low + inside
        self._high = high - inside
        self.away = start.copy()
        able = [built.robot, *(body for body in self._bodies if body.name in built.twins)]
        for number, body in enumerate(able):
            first = body.base.floating_positions_start()
            self.away[first + 4 : first + 7] = APART * (number + 1), 0.0, HIGH

    def entries(self, bodies: Iterable[Body]) -> Integers:
        """The indices (E,) of the positions and velocities of `bodies` in the plant's state."""
        plant = self._plant
        found = []
        for body in bodies:
            positions = to_drake(np.arange(self._count, dtype=float))
            found.append(plant.GetPositionsFromArray(body.instance, positions))
            velocities = to_drake(np.arange(self._count, len(self.start), dtype=float))
            found.append(plant.GetVelocitiesFromArray(body.instance, velocities))
        return np.concatenate([np.empty(0), *found]).astype(int)

    def begin(self, others: Sequence[Body] = ()) -> None:
        """Puts everything where it starts, but all moving models and `others` away, where it holds
        them.
        """
        self._held[:] = False
        self.reset()
        entries = self.entries([*self._bodies, *others])
        self.put(entries, self.away[entries])
        self.apply()

    def reset(self) -> None:
        """Puts everything where it starts."""
        self._state[:] = self.start
        self._plant.SetPositionsAndVelocities(self._context, to_drake(self.start))

    def put(self, entries: Integers, values: Floats) -> None:
        """Holds `entries` (E,) of the state at the positions in `values` (E,), from the next
        `apply` on.
        """
        self._held[entries] = self._changed = True
        self._state[entries] = values
        self._state[: self._count] = np.clip(self._state[: self._count], self._low, self._high)
        self._state[self._count :] = 0.0

    def release(self, entries: Integers, values: Floats) -> None:
        """Lets `entries` (E,) of the state move again, starting from `values` (E,)."""
        self._held[entries] = False
        self._changed = True
        state = self.state()
        state[entries] = values
        self._plant.SetPositionsAndVelocities(self._context, to_drake(state))

    def state(self) -> Floats:
        """All positions and velocities, shape (P + V,)."""
        return cast(Floats, self._plant.GetPositionsAndVelocities(self._context))

    def apply(self) -> None:
        """Puts every held model in its place and cancels its weight.

        Call this at each tick. Free bodies would stay where they are to the last bit, but a model
        that stands upright on a joint is like a pencil on its tip: rounding alone would topple it
        within seconds.
        """
        if not (self._bodies or self._changed):
            return
        state = self.state()
        held = self._held
        if not np.array_equal(state[held], self._state[held]):
            state[held] = self._state[held]
            self._plant.SetPositionsAndVelocities(self._context, to_drake(state))
        if self._changed:
            force = -cast(Floats, self._plant.CalcGravityGeneralizedForces(self._context))
            force[~self._held[self._count :]] = 0.0
            self._plant.get_applied_generalized_force_input_port().FixValue(self._context, force)
            self._changed = False


class Twins:
    """The twins of one context, all away at first."""

    def __init__(self, built: Built, context: Context) -> None:
        self._scene_graph = built.scene_graph
        self._context = built.scene_graph.GetMyMutableContextFromRoot(context)
        self._plant_context = built.plant.GetMyMutableContextFromRoot(context)
        self._source = cast(SourceId, built.plant.get_source_id())
        self._twins = built.twins
        self._filters = self._scene_graph.collision_filter_manager(self._context)
        self._welded = GeometrySet(
            [shape for twin in built.twins.values() if twin.places for shape in twin.geometry]
        )
        self._laid: dict[str, Body] = {}

    def lay(self, body: Body, places: Floats, turns: Floats) -> None:
        """Puts the twin of `body` where its links are: places (L, 3) m and rotations (L, 3, 3) in
        the world frame.
        """
        self._laid[body.name] = body
        links = [
            RigidTransform(RotationMatrix.ProjectToRotationMatrix(to_drake(turn)), to_drake(place))
            for place, turn in zip(places, turns, strict=True)
        ]
        self._put(self._twins[body.name], links)

    def lift(self, bodies: Iterable[Body]) -> None:
        """Takes the twins of `bodies` away."""
        for body in bodies:
            if self._laid.pop(body.name, None):
                self._put(self._twins[body.name], None)

    def lift_all(self) -> None:
        """Takes all twins away."""
        self.lift(tuple(self._laid.values()))

    def _put(self, twin: StaticProxy, links: Sequence[RigidTransform] | None) -> None:
        """Puts a twin where its links are; None: away."""
        for part in twin.parts:
            pose = part.away if links is None else links[part.link] @ part.pose
            self._scene_graph.ChangeShape(
                self._context, self._source, part.geometry, part.shape, pose
            )
        # Drake adds such a shape anew. Where it then touched one on a body that is welded to the
        # world, Drake would crash.
        moved = GeometrySet([part.geometry for part in twin.parts])
        self._filters.Apply(CollisionFilterDeclaration().ExcludeBetween(moved, self._welded))
        for number, (frame, away) in enumerate(twin.places):
            frame.SetPoseInParentFrame(
                self._plant_context, away if links is None else links[number]
            )


class RunContext:
    """A plant with the one context that all its runs use in turn.

    A new context costs as much as a run. What falls below `floor` (m) has fallen out of the world.
    What never moves outside `region` is not in the plant; None if everything is.
    """

    def __init__(
        self, built: Built, robot: Pose, clock: Clock, floor: float, region: Region | None = None
    ) -> None:
        """Everything where it starts. `robot` takes the robot's own frame to the world frame."""
        self.built = built
        self.clock = clock
        self.floor = floor
        self.region = region
        self.diagram_context = built.diagram.CreateDefaultContext()
        self.plant_context = built.plant.GetMyMutableContextFromRoot(self.diagram_context)
        # The plant's default context has all models at the world's origin.
        for body, origin in [
            (built.robot, robot),
            *((body, Pose()) for body in built.moving.values()),
        ]:
            for link, pose in zip(body.links, body.poses, strict=True):
                if link.is_floating_base_body():
                    built.plant.SetFloatingBaseBodyPoseInWorldFrame(
                        self.plant_context, link, transform(origin @ pose)
                    )
        start = cast(Floats, built.plant.GetPositionsAndVelocities(self.plant_context))
        self.presence = Presence(built, self.diagram_context)
        self.hold = Hold(built, self.plant_context, start)
        self.twins = Twins(built, self.diagram_context)
