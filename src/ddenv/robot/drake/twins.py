"""Models at rest as part of the ground: each has a twin that never moves, and is put where the model lies.

A body that is only held still costs time in every step, and what lies on it makes it part of the solver's problem. So the body of
a model at rest waits far away (`Hold`), where it touches nothing, and its twin takes its place.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import cast

from pydrake.geometry import CollisionFilterDeclaration, GeometrySet, SourceId
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context

from ddenv.arrays import Floats
from ddenv.robot.drake.articulation import to_drake
from ddenv.robot.drake.plant import Body, Built, Part


class Twins:
    """The twins of one context, all away at first."""

    def __init__(self, built: Built, context: Context) -> None:
        self._scene_graph = built.scene_graph
        self._context = built.scene_graph.GetMyMutableContextFromRoot(context)
        self._plant_context = built.plant.GetMyMutableContextFromRoot(context)
        self._source = cast(SourceId, built.plant.get_source_id())
        self._twins = built.twins
        self._filters = self._scene_graph.collision_filter_manager(self._context)
        self._welded = GeometrySet([shape for twin in built.twins.values() if twin.places for shape in twin.geometry])
        self._laid: dict[str, Body] = {}

    def lay(self, body: Body, places: Floats, turns: Floats) -> None:
        """Puts the twin of `body` where its links are: places (L, 3) m and rotations (L, 3, 3) in the world frame."""
        self._laid[body.name] = body
        twin = self._twins[body.name]
        links = [
            RigidTransform(RotationMatrix.ProjectToRotationMatrix(to_drake(turn)), to_drake(place))
            for place, turn in zip(places, turns, strict=True)
        ]
        self._put(twin.parts, [links[part.link] @ part.pose for part in twin.parts])
        # A twin has either parts or places.
        for place, link in zip(twin.places, links, strict=False):
            place.frame.SetPoseInParentFrame(self._plant_context, link)

    def lift(self, bodies: Iterable[Body]) -> None:
        """Takes the twins of `bodies` away."""
        for body in bodies:
            if self._laid.pop(body.name, None):
                twin = self._twins[body.name]
                self._put(twin.parts, [part.away for part in twin.parts])
                for place in twin.places:
                    place.frame.SetPoseInParentFrame(self._plant_context, place.away)

    def lift_all(self) -> None:
        """Takes all twins away."""
        self.lift(tuple(self._laid.values()))

    def _put(self, parts: Sequence[Part], poses: Sequence[RigidTransform]) -> None:
        for part, pose in zip(parts, poses, strict=True):
            self._scene_graph.ChangeShape(self._context, self._source, part.geometry, part.shape, pose)
        # Drake adds such a shape anew. Where it then touched one on a body that is welded to the world, Drake would crash.
        moved = GeometrySet([part.geometry for part in parts])
        self._filters.Apply(CollisionFilterDeclaration().ExcludeBetween(moved, self._welded))
