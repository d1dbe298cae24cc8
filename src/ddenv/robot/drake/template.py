"""A world that is built once and run many times, each time without other models."""

from __future__ import annotations

import gc
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace

from ddenv.errors import UserError
from ddenv.robot.autonomy import Autonomy
from ddenv.robot.clock import Clock
from ddenv.robot.controllers import controllers
from ddenv.robot.drake.articulation import transform
from ddenv.robot.drake.drive import Drive, find_drive, footprint
from ddenv.robot.drake.plant import Body, Built, build
from ddenv.robot.drake.presence import Presence
from ddenv.robot.notice import Notice
from ddenv.robot.piles.moving_models import Hold
from ddenv.robot.piles.rehearsal import Rehearsals, Repertoire
from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.protocol import Setup
from ddenv.robot.result import Progress, RunResult
from ddenv.robot.run import Run, Stuck, seconds_for
from ddenv.robot.sensing.lidar import Lidar
from ddenv.robot.sensing.obstacles import Obstacles
from ddenv.robot.sensing.sensors import SensorSuite
from ddenv.robot.surroundings import Surroundings
from ddenv.world.extent import shape_bounds
from ddenv.world.ground import with_ground_boxes
from ddenv.world.model import Model, World, is_ground
from ddenv.world.placement import spawn_pose
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
        """Raises UserError for a robot or a controller that cannot drive, and for a world that Drake cannot simulate."""
        self._world = world
        self._solid = _with_ground(world, scenario)
        self._robot = robot
        self._scenario = scenario
        self._drive = find_drive(robot, scenario.robot.wheels)
        self._controllers = controllers(scenario.controller, scenario.folder)
        names = frozenset(model.name for model in world.models)
        grounds = frozenset(model.name for model in world.models if is_ground(model))
        self._always = names & frozenset(scenario.protected) | grounds
        self._floor = lowest(world) - FALL
        self._clock = Clock.of(scenario)
        self._setup = _setup(robot, self._drive, self._clock, scenario)
        self._obstacles = Obstacles.of(world) if scenario.sensors.lidar else None
        self._models = {model.name: model for model in world.models}
        self._repertoire = Repertoire(world)
        # False only to measure what sleeping gains: then all models are simulated all the time.
        self._sleeping = True
        self._build(names)

    def without(self, names: frozenset[str]) -> Template:
        """A template of the same world without the moving models `names`, which costs less and gives the same bits.

        The two share what they know of the world. Raises ValueError for a model that never moves or is always there.
        """
        wrong = names - self.removable
        if wrong:
            raise ValueError(f"cannot be left out: {min(wrong)}")
        smaller = copy(self)
        smaller._build(self._names - names)
        return smaller

    @property
    def names(self) -> frozenset[str]:
        """The models that it has."""
        return self._names

    @property
    def removable(self) -> frozenset[str]:
        """The moving models that it can be without."""
        return self._built.moving.keys() - self._always

    def shapes_without(self, names: frozenset[str]) -> int:
        """How many shapes there are in the plant but for those of the models `names`."""
        static, moving = self._built.static, self._built.moving
        kept = [shapes for name, shapes in static.items() if name not in names]
        kept += [body.geometry for name, body in moving.items() if name not in names]
        return len(self._built.robot.geometry) + sum(map(len, kept))

    def _build(self, names: frozenset[str]) -> None:
        """Builds the plant of the models `names`; everything else is that of the whole world."""
        self._names = names
        self._built = _build(_part(self._solid, names), self._robot, self._drive, self._scenario)
        self._surroundings = Surroundings.of(_part(self._world, names), self._robot, self._built)
        self._context = self._built.diagram.CreateDefaultContext()
        self._plant_context = self._built.plant.GetMyMutableContextFromRoot(self._context)
        self._place()
        start = self._built.plant.GetPositionsAndVelocities(self._plant_context)
        self._presence = Presence(self._built, self._context)
        self._hold = Hold(self._built, self._plant_context, start)
        self._rehearsals = Rehearsals(
            self._repertoire, self._built, self._context, self._presence, self._hold, self._clock, self._floor
        )

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        full: bool = True,
    ) -> RunResult:
        """Runs the robot in the world with the models `keep`; protected models and grounds are always there.

        `progress(time, pose)` is told the simulated time (s) and the robot's x, y, z (m), qw, qx, qy, qz at each recorded
        sample. A run that is not `full` ends as soon as the robot is stuck for good. Raises ValueError for names that the world
        does not have.
        """
        unknown = keep - self._names
        if unknown:
            raise ValueError(f"no such model: {min(unknown)}")
        removed = self._names - keep - self._always
        kept = [body for name, body in self._built.moving.items() if name not in removed]
        present = self._names - removed
        self._presence.remove(removed)
        with self._asleep(kept, present) as sleep:
            notice = Notice(self._surroundings, self._scenario.sensors, self._plant_context, sleep, kept, present)
            suite = SensorSuite(self._scenario.sensors, seed)
            run = Run(
                self._built,
                self._context,
                self._scenario,
                self._drive,
                self._clock,
                sleep,
                notice,
                self._autonomy(suite, seed),
                self._lidar(present, kept, suite),
                None if full else Stuck(seconds_for(self._scenario.controller)),
                self._floor,
                kept,
                seed,
            )
            return run.execute(progress)

    def _autonomy(self, suite: SensorSuite, seed: int) -> Autonomy:
        scenario, setup = self._scenario, replace(self._setup, seed=seed)
        controller = self._controllers(setup)
        return Autonomy(
            scenario.sensors, suite, self._drive, scenario.controller.skid, self._clock, setup.start, controller
        )

    def _lidar(self, present: frozenset[str], kept: Sequence[Body], suite: SensorSuite) -> Lidar | None:
        settings = self._scenario.sensors.lidar
        if settings is None or self._obstacles is None:
            return None
        return Lidar(settings, self._obstacles, present, [self._models[body.name] for body in kept], suite.lidar)

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
        plant = self._built.plant
        at = spawn_pose(self._scenario.robot.spawn) @ self._robot.pose.inverse()
        for body, origin in [(self._built.robot, at), *((body, Pose()) for body in self._built.moving.values())]:
            for link, pose in zip(body.links, body.poses, strict=True):
                if link.is_floating_base_body():
                    plant.SetFloatingBaseBodyPoseInWorldFrame(self._plant_context, link, transform(origin @ pose))


def _setup(robot: Model, drive: Drive, clock: Clock, scenario: Scenario) -> Setup:
    settings, goal, spawn = scenario.controller, scenario.goal, scenario.robot.spawn
    return Setup(
        goal=(goal.x, goal.y),
        tolerance=goal.tolerance,
        start=(spawn.x, spawn.y, spawn.yaw),
        joints=drive.joints,
        left=drive.left,
        radius=drive.radius,
        track=drive.track,
        footprint=footprint(robot),
        period=clock.command_period,
        speed=settings.speed,
        acceleration=settings.acceleration,
        turn_rate=settings.turn_rate,
        settings=settings,
        options=settings.options,
    )


def _with_ground(world: World, scenario: Scenario) -> World:
    """`world` with boxes for its planes, large enough for all of it and the robot's way."""
    spawn, goal = scenario.robot.spawn, scenario.goal
    return with_ground_boxes(world, [(spawn.x, spawn.y, spawn.z), (goal.x, goal.y, spawn.z)])


def _part(world: World, names: frozenset[str]) -> World:
    """`world` with the models `names` alone."""
    return replace(world, models=tuple(model for model in world.models if model.name in names))


def _build(world: World, robot: Model, drive: Drive, scenario: Scenario) -> Built:
    try:
        built = build(world, robot, drive, scenario.simulation, scenario.controller.motor_gain)
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


# What a moving model that is switched off costs in each step of a run, s.
HELD = 5e-6
# What building costs at least, s, and for each pair of shapes, whether they can meet or not; a pair also takes 0.15 kB.
BUILD = 0.05
PAIR = 1e-6
# A plant of more shapes than this has no smaller ones beside it: each would take more than 150 MB.
LARGEST = 1000
# How many smaller plants there are at a time.
MOST = 4


class Variants:
    """The simulator of one scenario, as `Template` is, with the same results to the last bit.

    It holds the template of the whole world and the last few smaller ones.
    """

    def __init__(self, world: World, robot: Model, scenario: Scenario) -> None:
        """Raises UserError as `Template` does."""
        self._whole = Template(world, robot, scenario)
        self._steps = Clock.of(scenario).last
        # The one that was used last stands last.
        self._smaller: list[Template] = []

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        full: bool = True,
    ) -> RunResult:
        """As `Template.run`."""
        return self._template(keep).run(keep, seed, progress, full)

    def _template(self, keep: frozenset[str]) -> Template:
        """One that has at least the models `keep`, at the least cost for one run."""
        removed = self._whole.removable - keep
        able = [one for one in (self._whole, *self._smaller) if keep <= one.names]
        template = min(able, key=lambda one: len(one.removable), default=self._whole)
        needless = template.removable & removed
        if self._pays(needless, template):
            self._forget()
            template = template.without(needless)
        if template is not self._whole:
            self._smaller = [*(one for one in self._smaller if one is not template), template]
        return template

    def _pays(self, needless: frozenset[str], template: Template) -> bool:
        """Whether building a plant without the models `needless` costs less than one run with them."""
        shapes = template.shapes_without(needless)
        return shapes <= LARGEST and BUILD + PAIR * shapes**2 < HELD * len(needless) * self._steps

    def _forget(self) -> None:
        """Makes room for one more."""
        if len(self._smaller) < MOST:
            return
        del self._smaller[0]
        # Drake's diagrams refer to themselves: without this they would stay, some 20 MB each.
        gc.collect()
