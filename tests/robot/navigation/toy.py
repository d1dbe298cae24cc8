"""A robot without weight among circles and walls, all seen from above: it moves exactly as
commanded, and its lidar is exact but for a little noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ddenv.robot.navigation.navigate import Navigator
from ddenv.robot.protocol import Estimate, Imu, Reading, Scan, Setup, Twist
from ddenv.world.pose import wrap
from ddenv.world.scenario import Controller, Planner

HUSKY = (0.49, 0.49, 0.34, 0.34)
PERIOD = 0.05
LIDAR = (0.30, 0.0, 0.36)
ANGLES = np.linspace(-math.radians(135), math.radians(135), 541)
RANGE = 20.0
NOISE = 0.01


@dataclass(frozen=True)
class Ground:
    """Circles (x, y, radius) and walls (x, y, x, y), all in m."""

    circles: tuple[tuple[float, float, float], ...] = ()
    walls: tuple[tuple[float, float, float, float], ...] = ()

    def ranges(self, x: float, y: float, heading: float) -> np.ndarray:
        """How far the beams of a lidar at (x, y) go; infinite where they meet nothing."""
        dx, dy = np.cos(ANGLES + heading), np.sin(ANGLES + heading)
        nearest = np.full(len(ANGLES), np.inf)
        for cx, cy, radius in self.circles:
            along = dx * (cx - x) + dy * (cy - y)
            inside = radius**2 - (dx * (cy - y) - dy * (cx - x)) ** 2
            way = along - np.sqrt(np.maximum(inside, 0.0))
            np.minimum(nearest, way, out=nearest, where=(inside > 0) & (way > 0))
        for ax, ay, bx, by in self.walls:
            cross = dx * (by - ay) - dy * (bx - ax)
            cross = np.where(np.abs(cross) < 1e-12, 1e-12, cross)
            way = ((ax - x) * (by - ay) - (ay - y) * (bx - ax)) / cross
            part = ((ax - x) * dy - (ay - y) * dx) / cross
            np.minimum(nearest, way, out=nearest, where=(way > 0) & (part >= 0) & (part <= 1))
        return np.where(nearest <= RANGE, nearest, np.inf)

    def room(self, x: float, y: float, heading: float) -> float:
        """How far (m) the robot's footprint is from everything; negative when it stands in
        something.
        """
        ahead, behind, left, right = HUSKY
        px, py, radius = self._posts
        cosine, sine = math.cos(heading), math.sin(heading)
        along, across = cosine * (px - x) + sine * (py - y), cosine * (py - y) - sine * (px - x)
        beyond = np.stack(
            [np.maximum(along - ahead, -behind - along), np.maximum(across - left, -right - across)]
        )
        apart = np.hypot(*np.maximum(beyond, 0.0)) + np.minimum(beyond.max(axis=0), 0.0) - radius
        return float(apart.min(initial=math.inf))

    @cached_property
    def _posts(self) -> np.ndarray:
        """Everything as circles (3, N): x, y, radius; walls as points close together."""
        posts = list(self.circles)
        for ax, ay, bx, by in self.walls:
            parts = np.linspace(0, 1, max(int(math.hypot(bx - ax, by - ay) / 0.02), 1) + 1)
            posts += [(ax + part * (bx - ax), ay + part * (by - ay), 0.0) for part in parts]
        return np.array(posts).reshape(-1, 3).T


@dataclass
class Drive:
    """What happened: one entry for each period."""

    navigator: Navigator
    times: list[float] = field(default_factory=list)
    poses: list[tuple[float, float, float]] = field(default_factory=list)
    twists: list[Twist] = field(default_factory=list)

    def rooms(self, ground: Ground) -> list[float]:
        return [ground.room(*pose) for pose in self.poses]


def setup(goal: tuple[float, float], tolerance: float = 0.5, **settings) -> Setup:
    planner = Planner(**settings.pop("planner", {}))
    controller = Controller(use="costmap", planner=planner, **settings)
    return Setup(
        goal=goal,
        tolerance=tolerance,
        start=(0.0, 0.0, 0.0),
        joints=("left", "right"),
        left=(True, False),
        radius=0.165,
        track=0.57,
        footprint=HUSKY,
        period=PERIOD,
        speed=controller.speed,
        acceleration=controller.acceleration,
        turn_rate=controller.turn_rate,
        settings=controller,
    )


def drive(
    given: Setup,
    ground: Callable[[float], Ground] | Ground,
    *,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    until: float = 60.0,
    slips: Callable[[float], bool] = lambda time: False,
    blind: bool = False,
    seed: int = 0,
) -> Drive:
    """Drives until the robot has arrived or given up, at most `until` s; while it `slips` it does
    not move.
    """
    random = np.random.default_rng(seed)
    drove = Drive(Navigator(given))
    x, y, heading = start
    twist = Twist(0.0, 0.0)
    for tick in range(round(until / PERIOD)):
        time = tick * PERIOD
        here = ground if isinstance(ground, Ground) else ground(time)
        scan = None
        if not blind and tick % 2 == 0:
            eye = x + LIDAR[0] * math.cos(heading), y + LIDAR[0] * math.sin(heading)
            ranges = here.ranges(*eye, heading) + NOISE * random.standard_normal(len(ANGLES))
            scan = Scan(time, ANGLES, ranges, LIDAR)
        estimate = Estimate(x, y, heading, twist.speed, twist.turn_rate)
        twist = drove.navigator.step(
            Reading(time, estimate, imu=Imu(twist.turn_rate, 0.0, 0.0), scan=scan)
        )
        drove.times.append(time)
        drove.poses.append((x, y, heading))
        drove.twists.append(twist)
        if drove.navigator.arrived or drove.navigator.gave_up:
            break
        if not slips(time):
            heading = wrap(heading + PERIOD / 2 * twist.turn_rate)
            x, y = (
                x + PERIOD * twist.speed * math.cos(heading),
                y + PERIOD * twist.speed * math.sin(heading),
            )
            heading = wrap(heading + PERIOD / 2 * twist.turn_rate)
    return drove
