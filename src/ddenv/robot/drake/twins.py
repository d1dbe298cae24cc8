"""Models at rest as part of the ground: each has a twin that never moves, and is put where the model lies.

A body that is only held still costs time in every step, and what lies on it makes it part of the solver's problem. So the body of
a model at rest waits far away (`Hold`), where it touches nothing, and its twin takes its place.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

from pydrake.geometry import SourceId
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
        self._source = cast(SourceId, built.plant.get_source_id())
        self._parts = built.twins
        self._laid: dict[str, Body] = {}

    def lay(self, body: Body, places: Floats, turns: Floats) -> None:
        """Puts the twin of `body` where its links are: places (L, 3) m and rotations (L, 3, 3) in the world frame."""
        self._laid[body.name] = body
        for part in self._parts[body.name]:
            turn = RotationMatrix.ProjectToRotationMatrix(to_drake(turns[part.link]))
            self._put(part, RigidTransform(turn, to_drake(places[part.link])) @ part.pose)

    def lift(self, bodies: Iterable[Body]) -> None:
        """Takes the twins of `bodies` away."""
        for body in bodies:
            if self._laid.pop(body.name, None):
                for part in self._parts[body.name]:
                    self._put(part, part.away)

    def lift_all(self) -> None:
        """Takes all twins away."""
        self.lift(tuple(self._laid.values()))

    def _put(self, part: Part, pose: RigidTransform) -> None:
        self._scene_graph.ChangeShape(self._context, self._source, part.geometry, part.shape, pose)
