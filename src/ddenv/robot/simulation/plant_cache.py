"""The simulator of one scenario: a plant that is built once and run many times, each time without
other models.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from typing import TypeVar

from ddenv.errors import UserError
from ddenv.robot.clock import Clock
from ddenv.robot.controllers import BUILT_IN, Listener, controllers
from ddenv.robot.drake.plant import build
from ddenv.robot.drake.region import LeftRegion, Region
from ddenv.robot.drake.run_context import RunContext
from ddenv.robot.drake.terrain_boxes import has_terrain, with_boxes
from ddenv.robot.piles.pile_simulator import PileCache, PileSimulator
from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.result import Ends, Progress, RunResult
from ddenv.robot.sensing.autonomy import Autonomy, SensorSuite, setup_of
from ddenv.robot.sensing.beams import Obstacles
from ddenv.robot.sensing.lidar import Lidar
from ddenv.robot.settled import Settled
from ddenv.robot.simulation.notice import Notice, still_boxes
from ddenv.robot.simulation.rest import Rest
from ddenv.robot.simulation.run import Run
from ddenv.robot.simulation.taking_part import ENDLESS, Hull, Reached, solids
from ddenv.world.drive import find_drive
from ddenv.world.extent import with_ground_boxes
from ddenv.world.model import Model, World
from ddenv.world.placement import spawn_pose
from ddenv.world.pose import Point
from ddenv.world.scenario import Scenario
from ddenv.world.whole import whole_of

YIELD = (
    0.1  # a margin for surfaces that sink into each other, and joints that exceed their limits, m
)


class Plant:
    """One plant of a scenario's world. Building it takes seconds; switching models off for a run
    takes milliseconds.

    All runs share one context. Equal `keep` and `seed` give the same result bit for bit, whatever
    ran before, and the same as a world that never had the removed models. `names` are the models in
    the plant; without `slices` it stays unknown who took part.
    """

    def __init__(self, world: World, robot: Model, scenario: Scenario) -> None:
        """Raises UserError for a robot or a controller that cannot drive, and for a world that
        Drake cannot simulate.
        """
        spawn = scenario.robot.spawn
        goal = scenario.goal
        self._whole = whole_of(world, scenario)
        # Boxes in place of planes, large enough for all models, the spawn and the goal.
        self._solid = with_ground_boxes(
            world, self._whole.corners, [(spawn.x, spawn.y, spawn.z), (goal.x, goal.y, spawn.z)]
        )
        self._robot = robot
        self._scenario = scenario
        self._drive = find_drive(robot, scenario.robot.wheels)
        self._controllers = controllers(scenario.controller, scenario.folder)
        names = frozenset(world.names)
        self._always = names - frozenset(world.elements(scenario.protected))
        self._clock = Clock.of(scenario)
        self._setup = setup_of(robot, self._drive, self._clock, scenario)
        self._obstacles = Obstacles.of(world) if scenario.sensors.lidar else None
        self._models = {model.name: model for model in world.models}
        self.pile_cache = PileCache(world, self._whole.moving)
        self._boxes = still_boxes(world)
        # False only to measure what sleeping saves: then all moving models are always simulated.
        self._sleeping = True
        self._solids = solids(self._solid)
        self._hull = Hull.of(robot)
        self._reach = self._hull.reach + YIELD
        # What decides in a run is known: no controller of the user's, and no model that collides
        # with itself. (Where slices were used beside such models, 23 of 274 implied tests
        # differed.)
        self.slices = scenario.controller.use in BUILT_IN and not any(
            model.self_collide for model in world.models
        )
        moving = [model for model in world.models if not model.static]
        self._way = Region.of((spawn.x, spawn.y), (goal.x, goal.y), ())
        self._surround(Region.of((spawn.x, spawn.y), (goal.x, goal.y), moving))
        self._build(names)

    def without(self, names: frozenset[str]) -> Plant:
        """A template of the same world without the moving models `names`: cheaper, and with the
        same bits.

        `names` are `removable`. The two share what they know about the world.
        """
        smaller = copy(self)
        smaller._build(self.names - names)
        return smaller

    def wider(self, place: Point, times: int) -> Plant:
        """A template of the same models with a larger region, see `Region.with_place`."""
        wider = copy(self)
        wider._surround(self._region.with_place(place, times))
        wider._build(self.names)
        return wider

    @property
    def removable(self) -> frozenset[str]:
        """The moving models that can be left out of the plant."""
        return frozenset(self.context.built.moving) - self._always

    def shapes_without(self, names: frozenset[str]) -> int:
        """The number of collision shapes in the plant, without those of the models `names`."""
        built = self.context.built
        return len(built.robot.geometry) + sum(
            len(geometry) for name, geometry in built.shapes() if name not in names
        )

    def _surround(self, region: Region) -> None:
        """From the next `_build` on, the plant has nothing outside `region` that never moves."""
        self._region = region
        bounded = None if self._reach >= ENDLESS else region
        models = self._solid.models
        self._far = frozenset() if bounded is None else region.far(models)
        self._grounds = {
            one.name: with_boxes(one, bounded, self._way) for one in models if has_terrain(one)
        }

    def _build(self, names: frozenset[str]) -> None:
        """Builds the plant with the models `names`. Everything else stays that of the whole
        world.
        """
        self.names = names
        near = [model for model in self._solid.models if model.name in names - self._far]
        near = [self._grounds.get(model.name, model) for model in near]
        world = replace(self._solid, models=tuple(near))
        scenario = self._scenario
        try:
            built = build(
                world, self._robot, self._drive, scenario.simulation, scenario.controller.motor_gain
            )
        except (ValueError, RuntimeError, SystemExit) as error:
            raise UserError(f"{world.path}: cannot be simulated: {error}") from error
        if not built.robot.base.is_floating_base_body():
            raise UserError(
                f"robot '{self._robot.name}': its first link must be free to move, not joined to "
                "the world or another link"
            )
        at = spawn_pose(scenario.robot.spawn) @ self._robot.pose.inverse()
        watched = self._region if self._far or self._grounds else None
        self.context = RunContext(built, at, self._clock, self._whole.floor, watched)
        self.rehearsals = PileSimulator(self.pile_cache, self.context)

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        ends: Ends | None = None,
        listener: Listener | None = None,
    ) -> RunResult:
        """As `Simulator.run`; `listener` hears the controller.

        Raises LeftRegion if something comes near what is not in the plant.
        """
        if unknown := keep - self.names:
            raise ValueError(f"no such model: {min(unknown)}")
        context = self.context
        scenario = self._scenario
        removed = self.names - keep - self._always
        kept = [body for name, body in context.built.moving.items() if name not in removed]
        present = self.names - removed
        context.presence.remove(removed)
        piles = self.rehearsals.piles(kept, present) if self._sleeping else []
        held = frozenset(context.built.moving) - set(context.built.twins)
        unusual = self.pile_cache.unusual(piles, present, held) | self._carriers(present)
        context.diagram_context.SetTime(0.0)
        scripts = [known.script for known in piles if known.script is not None]
        sleep = Sleep(context, kept, scripts, never=not self._sleeping)
        try:
            suite = SensorSuite(scenario.sensors, seed)
            lidar = None
            reached = None
            if scenario.sensors.lidar and self._obstacles:
                movers = [self._models[body.name] for body in kept]
                lidar = Lidar(scenario.sensors.lidar, self._obstacles, present, movers, suite.lidar)
            if self.slices and self._sleeping and self.pile_cache.usual is not None:
                reached = Reached(self._solids, self._hull, sleep, present, self._clock.period)
            setup = replace(self._setup, seed=seed)
            controller = self._controllers(setup)
            if listener is not None:
                listener.begin(setup)
            rest = None
            # Nobody knows whether a controller of the user's drives again.
            if ends is not None and scenario.controller.use in BUILT_IN:
                rest = Rest(ends, scenario.goal, self._clock.seconds)
            run = Run(
                context=context,
                scenario=scenario,
                drive=self._drive,
                sleep=sleep,
                notice=Notice(context, self._boxes, scenario.sensors, sleep, kept, present),
                autonomy=Autonomy(scenario, suite, self._drive, self._clock, controller, listener),
                lidar=lidar,
                reach=self._reach,
                rest=rest,
                reached=reached,
                unusual=unusual,
                kept=kept,
                seed=seed,
            )
            return run.execute(progress)
        finally:
            sleep.end()

    def _carriers(self, present: frozenset[str]) -> frozenset[str]:
        """What those models are tied to that are always kept, among the models `present`."""
        ties = self.pile_cache.ties
        return frozenset(
            name for always in self._always & set(ties) for name in ties[always] & present
        )


Result = TypeVar("Result")
HELD = 5e-6  # what a moving model that is switched off costs in each step of a run, s
# The minimum time to build a plant, and the time for each pair of shapes, s. A pair also takes 0.15
# kB.
BUILD = 0.05
PAIR = 1e-6
# A plant with more shapes than this gets no smaller ones beside it: each would take more than 150
# MB.
LARGEST = 1000
MOST = 4  # the maximum number of smaller plants at a time


class PlantCache:
    """Runs a scenario as `Plant` does, with the same results to the last bit, but in smaller
    plants where that saves time.

    It holds the template of the whole world and the last few smaller ones.
    """

    def __init__(self, world: World, robot: Model, scenario: Scenario) -> None:
        """Raises UserError as `Plant` does."""
        self._whole = Plant(world, robot, scenario)
        self._steps = Clock.of(scenario).last
        # The one that was used last comes last.
        self._smaller: list[Plant] = []

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        ends: Ends | None = None,
        listener: Listener | None = None,
    ) -> RunResult:
        """As `Plant.run`, in a plant that has all that comes near."""
        self._learn_piles()
        return self._within(
            lambda _: self._template(keep).run(keep, seed, progress, ends, listener)
        )

    def supports(self, elements: frozenset[str]) -> list[tuple[str, str]]:
        """Which models support which in the whole world; see `PileSimulator.supports`."""
        return self._within(lambda whole: whole.rehearsals.supports(whole.names, elements))

    def settled(self) -> Settled:
        """How the whole world settles."""
        return self._within(lambda whole: whole.rehearsals.settled(whole.names))

    def ties(self, elements: frozenset[str]) -> list[tuple[str, str]] | None:
        """Each of `elements` that starts away from the robot with each one that it is tied to, as
        `PileCache.ties`; sorted.

        None: unknown.
        """
        if not self._whole.slices:
            return None
        self._learn_piles()
        ties = self._whole.pile_cache.ties
        return sorted(
            (name, other) for name in elements & set(ties) for other in elements & ties[name]
        )

    def _learn_piles(self) -> None:
        """Finds out how the piles of the whole world move, if that is unknown."""
        self._within(lambda whole: whole.rehearsals.learn(whole.names))

    def _within(self, work: Callable[[Plant], Result]) -> Result:
        """Does `work`, again from its beginning in a larger plant each time that something leaves
        the plant's region.
        """
        times = 1
        while True:
            try:
                return work(self._whole)
            except LeftRegion as left:
                place = left.place
            times *= 2
            # Held plants would take as much memory as the new ones.
            self._smaller = []
            self._whole = self._whole.wider(place, times)
            gc.collect()

    def _template(self, keep: frozenset[str]) -> Plant:
        """A template that has at least the models `keep`, chosen for the least time of one run."""
        removed = self._whole.removable - keep
        able = [one for one in (self._whole, *self._smaller) if keep <= one.names]
        template = min(able, key=lambda one: len(one.removable), default=self._whole)
        needless = template.removable & removed
        shapes = template.shapes_without(needless)
        if shapes <= LARGEST and BUILD + PAIR * shapes**2 < HELD * len(needless) * self._steps:
            if len(self._smaller) == MOST:
                del self._smaller[0]
                # Drake's diagrams refer to themselves: without a collection they would stay in
                # memory, some 20 MB each.
                gc.collect()
            template = template.without(needless)
        if template is not self._whole:
            self._smaller = [*(one for one in self._smaller if one is not template), template]
        return template
