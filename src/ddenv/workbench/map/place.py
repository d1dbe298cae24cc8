"""What a map shows: a place, read in a thread since worlds can be large, and the current state of a
run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError
from ddenv.runfile.snapshot import Snapshot
from ddenv.workbench.shared.background import call_if_open
from ddenv.world.pose import Point, Vector

if TYPE_CHECKING:
    import numpy as np
    from textual.screen import Screen

    from ddenv.map.footprints import Footprint
    from ddenv.runfile.state import Candidate, Trial
    from ddenv.world.model import Model, World
    from ddenv.world.pose import Pose
    from ddenv.world.scenario import Scenario

# The layers of the map, which can be hidden.
LAYERS = {
    "partitions": "the parts of this round, by letter and colour",
    "removed": "where removed models stood",
    "pinned": "which models are pinned",
    "sensed": "the order in which the robot sensed the models",
    "participants": "models that affected the last similar run",
    "path": "the robot's path on the last similar run",
    "original": "the robot's path in f itself",
    "failure": "where the robot ended in f",
    "names": "the models' names, as n does on every map",
}
# Outlines, (N, 2) m, of a model where it may move, each with its verdict, such as "f".
Limits = tuple[tuple[str, "np.ndarray"], ...]
# How long to retry a run file that another program has locked, s.
PATIENCE = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """What the map shows besides the run, in m: where the robot starts (x, y, yaw), its goal and
    the models.

    `elements` are the names of the models that may be removed, `movable` the models that can move,
    by name.
    """

    prints: tuple[Footprint, ...] = ()
    spawn: Vector | None = None
    goal: Point | None = None
    elements: frozenset[str] = frozenset()
    movable: dict[str, Model] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """The robot's way in a finished test, `points` (N, 2) m, which the legend calls `name`.

    The robot is now at `robot`, x, y m and yaw rad, and came through the first `gone` points;
    without it only the way is shown.
    """

    name: str
    points: np.ndarray
    robot: Vector | None = None
    gone: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """All that a map shows: a world, the current state of its run, and the `candidate` whose models
    stand out.

    `layers` are from LAYERS; `selection` are the names of the models that the user selected. With
    `ways`, one or two, these are shown in place of the run's own paths; they part at `parting`, m.
    `apart` are the sign and the words of the models that are not in both, for the legend. `limits`
    say how far a model may move.
    """

    place: Place = field(default_factory=Place)
    snapshot: Snapshot = field(default_factory=Snapshot)
    candidate: Candidate | Trial | None = None
    layers: frozenset[str] = frozenset(LAYERS) - {"sensed", "participants", "names"}
    selection: frozenset[str] = frozenset()
    ways: tuple[Way, ...] = ()
    parting: Point | None = None
    apart: tuple[str, str] | None = None
    limits: Limits = ()

    @property
    def start(self) -> Point | None:
        if self.place.spawn is None:
            return None
        return self.place.spawn[:2]

    @property
    def failure(self) -> Point | None:
        position = self.snapshot.state.f_position
        if position is None:
            return None
        return position[:2]

    @property
    def same_paths(self) -> bool:
        """Whether the last similar run has the same path as f: before the first reduction it is
        f.
        """
        original = self.snapshot.original
        evidence = self.snapshot.evidence
        return original is None or original == evidence


class MovedPrints:
    """The footprints of a place's models, with the movable ones wherever they are."""

    def __init__(self, place: Place) -> None:
        self.place = place
        self._prints = place.prints
        self._numbers = {
            each.name: number
            for number, each in enumerate(place.prints)
            if each.name in place.movable
        }
        self._poses: dict[str, Pose] = {}

    def at(self, poses: Mapping[str, Pose]) -> tuple[Footprint, ...]:
        """All footprints with the first links of these models at `poses`, and the others where they
        start.

        The same object if nothing has moved.
        """
        from ddenv.map.footprints import footprint

        known = {name: pose for name, pose in poses.items() if name in self._numbers}
        changed = {
            self._numbers[name]: self.place.prints[self._numbers[name]]
            for name in set(self._poses) - set(known)
        }
        for name, pose in known.items():
            if pose != self._poses.get(name):
                model = self.place.movable[name]
                changed[self._numbers[name]] = footprint(
                    model, moved=pose @ model.links[0].pose.inverse()
                )
        self._poses = known
        if changed:
            self._prints = tuple(
                changed.get(number, each) for number, each in enumerate(self._prints)
            )
        return self._prints


def place_of(world: World, scenario: Scenario | None = None) -> Place:
    """The models of a world, with the scenario's start and goal if there is one."""
    from ddenv.map.footprints import footprints

    protected = frozenset(scenario.protected) if scenario else frozenset()
    movable = {model.name: model for model in world.models if not model.static}
    place = Place(
        prints=footprints(world), elements=frozenset(world.elements(protected)), movable=movable
    )
    if scenario is None:
        return place
    spawn = scenario.robot.spawn
    goal = scenario.goal
    return replace(place, spawn=(spawn.x, spawn.y, spawn.yaw), goal=(goal.x, goal.y))


def place_of_run(path: Path) -> Place:
    """The world and the scenario of a run file. Raises UserError."""
    # Reading scenarios needs pydantic, which is not needed for the first look at a run.
    from ddenv.runs.experiment import read_parts
    from ddenv.workbench.shared.observed import Busy, Observed

    until = time.monotonic() + PATIENCE
    while True:
        try:
            with Observed(path) as run:
                scenario, world, _ = read_parts(run)
            return place_of(world, scenario)
        except Busy:
            # The world is read only once, and other programs finish writing soon.
            if time.monotonic() > until:
                raise
            time.sleep(0.1)


def read_world(screen: Screen[Any], run: Path, show: Callable[[Place, str], None]) -> None:
    """Calls `show` with the place, and with what is wrong with it, once it is read in a thread. The
    first paint comes before.
    """

    def read() -> None:
        try:
            place = place_of_run(run)
            notice = ""
        except UserError as error:
            place = Place()
            notice = str(error)
        call_if_open(screen, show, place, notice)

    screen.call_after_refresh(screen.run_worker, read, thread=True, group="world", exclusive=True)
