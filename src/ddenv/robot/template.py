"""A world that is built once and run many times, each time without other models."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from ddenv.errors import UserError
from ddenv.robot.clock import Clock
from ddenv.robot.drive import find_drive
from ddenv.robot.hold import Hold
from ddenv.robot.notice import Notice
from ddenv.robot.place import transform
from ddenv.robot.plant import Body, Built, build
from ddenv.robot.presence import Presence
from ddenv.robot.rehearsal import Rehearsals
from ddenv.robot.result import RunResult
from ddenv.robot.run import Run
from ddenv.robot.sleep import Sleep
from ddenv.robot.surroundings import Surroundings
from ddenv.world.extent import shape_bounds
from ddenv.world.ground import with_ground_boxes
from ddenv.world.model import Model, World, is_ground
from ddenv.world.pose import Pose
from ddenv.world.scenario import Scenario

# A robot this far below everything that it could stand on has fallen out of the world, m.
FALL = 2.0


class Template:
    """The simulator of one scenario. Building it costs seconds; switching models off for a run costs milliseconds.

    All runs share one context. The same `keep` and `seed` give the same result bit for bit, whatever was run before, and the
    same as a world that never had the removed models.
    """

    def __init__(self, world: World, robot: Model, scenario: Scenario) -> None:
        """Raises UserError for a robot that cannot drive, and for a world that Drake cannot simulate."""
        self._scenario = scenario
        self._drive = find_drive(robot)
        self._built = _build(world, robot, scenario)
        self._surroundings = Surroundings.of(world, robot, self._built)
        self._names = frozenset(model.name for model in world.models)
        grounds = frozenset(model.name for model in world.models if is_ground(model))
        self._always = self._names & frozenset(scenario.protected) | grounds
        self._floor = lowest(world) - FALL
        self._clock = Clock.of(scenario)
        self._context = self._built.diagram.CreateDefaultContext()
        self._plant_context = self._built.plant.GetMyMutableContextFromRoot(self._context)
        self._place()
        start = self._built.plant.GetPositionsAndVelocities(self._plant_context)
        self._presence = Presence(self._built, self._context)
        self._hold = Hold(self._built, self._plant_context, start)
        self._rehearsals = Rehearsals(
            world, self._built, self._context, self._presence, self._hold, self._clock, self._floor
        )
        # False only to measure what sleeping gains: then all models are simulated all the time.
        self._sleeping = True

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Callable[[float, tuple[float, ...]], None] | None = None,
    ) -> RunResult:
        """Runs the robot in the world with the models `keep`; protected models and grounds are always there.

        `progress(time, pose)` is told the simulated time (s) and the robot's x, y, z (m), qw, qx, qy, qz at each recorded
        sample. Raises ValueError for names that the world does not have.
        """
        unknown = keep - self._names
        if unknown:
            raise ValueError(f"no such model: {min(unknown)}")
        removed = self._names - keep - self._always
        kept = [body for name, body in self._built.moving.items() if name not in removed]
        present = self._names - removed
        with self._presence.without(removed), self._asleep(kept, present) as sleep:
            notice = Notice(self._surroundings, self._scenario.sensors, self._plant_context, sleep, kept, present)
            run = Run(
                self._built,
                self._context,
                self._scenario,
                self._drive,
                self._clock,
                sleep,
                notice,
                self._floor,
                kept,
                seed,
            )
            return run.execute(progress)

    @contextmanager
    def _asleep(self, kept: Sequence[Body], present: frozenset[str]) -> Iterator[Sleep]:
        """The moving models `kept` at their start, in a world of which the models `present` are left."""
        scripts = self._rehearsals.scripts(kept, present) if self._sleeping else []
        self._context.SetTime(0.0)
        sleep = Sleep(
            self._built,
            self._plant_context,
            self._presence,
            self._hold,
            self._clock,
            self._floor,
            kept,
            scripts,
            never=not self._sleeping,
        )
        try:
            yield sleep
        finally:
            sleep.end()

    def _place(self) -> None:
        """Puts everything where it starts; the plant's default context has it all in the world's origin."""
        plant, spawn = self._built.plant, self._scenario.robot.spawn
        at = Pose.from_rpy(spawn.x, spawn.y, spawn.z, 0.0, 0.0, spawn.yaw)
        for body, origin in [(self._built.robot, at), *((body, Pose()) for body in self._built.moving.values())]:
            for link, pose in zip(body.links, body.poses, strict=True):
                if link.is_floating_base_body():
                    plant.SetFloatingBaseBodyPoseInWorldFrame(self._plant_context, link, transform(origin @ pose))


def _build(world: World, robot: Model, scenario: Scenario) -> Built:
    try:
        spawn, goal = scenario.robot.spawn, scenario.goal
        places = [(spawn.x, spawn.y, spawn.z), (goal.x, goal.y, spawn.z)]
        built = build(with_ground_boxes(world, places), robot, scenario.simulation, scenario.controller.motor_gain)
    except (ValueError, RuntimeError, SystemExit) as error:
        raise UserError(f"{world.path}: cannot be simulated: {error}") from error
    if not built.robot.base.is_floating_base_body():
        raise UserError(
            f"robot '{robot.name}': its first link must be free to move, not joined to the world or another link"
        )
    return built


def lowest(world: World) -> float:
    """A height (m) that no surface of the world lies below."""
    collisions = [collision for model in world.models for collision in model.collisions]
    return min((float(shape_bounds(one.shape, one.pose)[0][2]) for one in collisions), default=0.0)
