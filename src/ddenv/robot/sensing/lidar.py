"""The lidar of one run."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from ddenv.robot.sensing.beams import Ends, Fan, Shapes, cast
from ddenv.robot.sensing.obstacles import Obstacles
from ddenv.robot.sensing.readings import Scan
from ddenv.world import scenario
from ddenv.world.model import Model
from ddenv.world.pose import Pose


class Lidar:
    """Measures the models of a world that are there, never the robot itself.

    `present` are their names, `moving` those of them that move. `first_seen` tells when (s) a beam first ended on each model, a
    ground among them.
    """

    def __init__(
        self,
        settings: scenario.Lidar,
        obstacles: Obstacles,
        present: frozenset[str],
        moving: Sequence[Model],
        random: np.random.Generator,
    ) -> None:
        self._settings = settings
        self._random = random
        self._fan = Fan.of(settings)
        self._names = obstacles.names
        self.first_seen: dict[str, float] = {}
        self._unseen = np.ones(len(obstacles.names), dtype=bool)

        there = np.array([name in present for name in obstacles.names], dtype=bool)
        (rows,) = there[obstacles.owners].nonzero()
        self._owners = obstacles.owners[rows]
        self._shapes = Shapes.of(obstacles, rows)
        (self._movers,) = (obstacles.links[rows] >= 0).nonzero()
        first = dict(zip((model.name for model in moving), _firsts(moving), strict=True))
        owners = [obstacles.names[owner] for owner in self._owners[self._movers]]
        self._links = obstacles.links[rows][self._movers] + np.array([first[name] for name in owners], dtype=int)
        # In the frames of their links, for as long as the run.
        self._centers = self._shapes.centers[:, self._movers]
        self._frames = self._shapes.frames[:, :, self._movers]

    def scan(self, now: float, pose: tuple[float, ...], places: np.ndarray, turns: np.ndarray) -> Scan:
        """One turn at `now` (s).

        `pose` is x, y, z (m) and the quaternion w, x, y, z of the robot's first link; `places` (L, 3) m and `turns` (L, 3, 3)
        are the poses of all links of the moving models, model after model. All are in the world frame.
        """
        self._move(places, turns)
        settings = self._settings
        mount = (settings.x, settings.y, settings.z)
        lidar = Pose(tuple(pose[:3]), tuple(pose[3:])) @ Pose(mount)
        ends = cast(self._fan, self._shapes, np.array(lidar.position), lidar.rotation().T)
        # One draw for each beam, whatever it meets: what is removed elsewhere changes no other range.
        ranges = ends.distances + settings.noise * self._random.standard_normal(len(self._fan.angles))
        ranges[(ranges < settings.nearest) | (ranges > settings.range)] = np.inf
        self._notice(now, ends, ranges)
        return Scan(now, self._fan.angles, ranges, mount)

    def _move(self, places: np.ndarray, turns: np.ndarray) -> None:
        """Moves the shapes to where their links are."""
        if not len(self._movers):
            return
        turn = turns[self._links].transpose(1, 2, 0)
        first, second, third = (turn[:, axis] for axis in range(3))
        a, b, c = self._centers
        self._shapes.centers[:, self._movers] = first * a + second * b + third * c + places[self._links].T
        a, b, c = self._frames
        frames = first[:, None] * a + second[:, None] * b + third[:, None] * c
        self._shapes.frames[:, :, self._movers] = frames

    def _notice(self, now: float, ends: Ends, ranges: np.ndarray) -> None:
        """Remembers the models on which a beam ended that measured something, for the first time."""
        owners = self._owners[ends.shapes]
        fresh = self._unseen[owners]
        if not fresh.any():
            return
        seen = np.unique(owners[fresh & np.isfinite(ranges[ends.beams])])
        self._unseen[seen] = False
        self.first_seen |= {self._names[owner]: now for owner in seen.tolist()}


def _firsts(models: Sequence[Model]) -> list[int]:
    """The number of each model's first link among those of all `models`."""
    return [0, *accumulate(len(model.links) for model in models)][:-1]
