"""What all runs in one plant share: its context, and what is filtered out and held still there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

from pydrake.systems.framework import Context

from ddenv.arrays import Floats
from ddenv.robot.clock import Clock
from ddenv.robot.drake.articulation import transform
from ddenv.robot.drake.hold import Hold
from ddenv.robot.drake.plant import Built
from ddenv.robot.drake.presence import Presence
from ddenv.robot.drake.region import Region
from ddenv.robot.drake.twins import Twins
from ddenv.world.pose import Pose


@dataclass(frozen=True)
class RunContext:
    """A plant with the one context that all its runs use in turn.

    A new context costs as much as a run. What falls below `floor` (m) has fallen out of the world. What never moves outside
    `region` is not in the plant; None if everything is.
    """

    built: Built
    diagram_context: Context
    plant_context: Context
    presence: Presence
    hold: Hold
    twins: Twins
    clock: Clock
    floor: float
    region: Region | None

    @classmethod
    def of(cls, built: Built, robot: Pose, clock: Clock, floor: float, region: Region | None = None) -> RunContext:
        """Everything where it starts. `robot` takes the robot's own frame to the world frame."""
        context = built.diagram.CreateDefaultContext()
        plant_context = built.plant.GetMyMutableContextFromRoot(context)
        _place(built, plant_context, robot)
        start = cast(Floats, built.plant.GetPositionsAndVelocities(plant_context))
        presence = Presence(built, context)
        return cls(
            built,
            context,
            plant_context,
            presence,
            Hold(built, plant_context, start),
            Twins(built, context),
            clock,
            floor,
            region,
        )


def _place(built: Built, plant_context: Context, robot: Pose) -> None:
    """Puts all models where they start; the plant's default context has them at the world's origin."""
    for body, origin in [(built.robot, robot), *((body, Pose()) for body in built.moving.values())]:
        for link, pose in zip(body.links, body.poses, strict=True):
            if link.is_floating_base_body():
                built.plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context, link, transform(origin @ pose))
