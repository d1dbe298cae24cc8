"""What the lidar has seen around the robot: a square map that rolls along with it."""

from __future__ import annotations

import math

import numpy as np

from ddenv.robot.navigation.footprint import Footprint
from ddenv.robot.protocol import Setup
from ddenv.robot.sensing.estimate import Estimate
from ddenv.robot.sensing.readings import Imu, Scan

# A beam that goes this much farther than a cell, in cells, has shown that nothing is there any more.
PASSED = 1.5
# Tilted more than this (rad), beams pass over or under what they would clear.
LEVEL = 0.12


class Costmap:
    """Cells in which a beam has ended, aligned with the frame of the estimates. Each cell keeps the last place that was hit in it.

    A cell's slot is its number modulo the map's width: as the map rolls, what drops out at one side makes place for what comes
    in at the other. What was not seen counts as free. `points` (N, 2) m are all places that were hit, `version` counts the
    changes of the set of their cells.
    """

    def __init__(self, setup: Setup) -> None:
        planner = setup.settings.planner
        self.resolution = planner.resolution
        self.count = max(round(planner.size / planner.resolution), 4)
        self.points = np.empty((0, 2))
        self.version = 0
        self._footprint = Footprint.of(setup)
        # The wheels stand this far below the frame that the points are in.
        self._lowest = planner.lowest - setup.radius
        self._slots = np.empty(0, dtype=int)
        self._hit = np.zeros(self.count**2, dtype=bool)
        self._places = np.zeros((2, self.count**2))
        self._angles: np.ndarray | None = None
        self._beams = np.empty((2, 0))

    def see(self, scan: Scan, estimate: Estimate, imu: Imu | None = None) -> None:
        """Take in what `scan` shows to a robot at `estimate`, tilted as `imu` says."""
        if scan.angles is not self._angles:
            self._angles, self._beams = scan.angles, np.stack([np.cos(scan.angles), np.sin(scan.angles)])
        roll, pitch = (imu.roll, imu.pitch) if imu else (0.0, 0.0)
        self._mark(scan, estimate, roll, pitch)
        self._clear(scan, estimate, level=max(abs(roll), abs(pitch)) <= LEVEL)

    def forget(self, estimate: Estimate, beyond: float, beyond_unseen: float) -> None:
        """Clear the map where it is farther than `beyond` (m) from the robot, `beyond_unseen` (m) where no beam goes now."""
        dx, dy = (self.points - (estimate.x, estimate.y)).T
        bearings = np.arctan2(dy, dx) - estimate.heading
        bearings -= math.tau * np.round(bearings / math.tau)
        first, last = (self._angles[0], self._angles[-1]) if self._angles is not None else (0.0, 0.0)
        seen = (bearings >= first) & (bearings <= last)
        near = np.hypot(dx, dy) <= np.where(seen, beyond, beyond_unseen)
        self._hit[self._slots[~near]] = False
        self._keep(self._slots[near])

    def _mark(self, scan: Scan, estimate: Estimate, roll: float, pitch: float) -> None:
        turn = _rotation(roll, pitch, estimate.heading)
        start = turn @ scan.origin
        reach = (self.count / 2 - 1) * self.resolution - math.hypot(start[0], start[1])
        near = np.flatnonzero(scan.ranges < reach)
        x, y, height = (turn[:, :2] @ self._beams[:, near]) * scan.ranges[near] + start[:, None]
        solid = height >= self._lowest
        places = np.stack([x[solid] + estimate.x, y[solid] + estimate.y])
        cells = np.floor(places / self.resolution).astype(int) % self.count
        slots = cells[0] * self.count + cells[1]
        self._hit[slots] = True
        self._places[:, slots] = places

    def _clear(self, scan: Scan, estimate: Estimate, level: bool) -> None:
        """Drop what is out of the map, under the robot or, if the beams are level, where they have passed through."""
        slots = np.flatnonzero(self._hit)
        places = self._places[:, slots]
        cosine, sine = math.cos(estimate.heading), math.sin(estimate.heading)
        middle = [[(math.floor(part / self.resolution) + 0.5) * self.resolution] for part in (estimate.x, estimate.y)]
        gone = (np.abs(places - middle) > self.count * self.resolution / 2).any(axis=0)
        x, y = np.array([[cosine, sine], [-sine, cosine]]) @ (places - [[estimate.x], [estimate.y]])
        body = self._footprint
        # One cell of the rim stays: a robot that turns may still hit what is there.
        gone |= (
            (x < body.ahead - self.resolution)
            & (x > self.resolution - body.behind)
            & (np.abs(y) < body.side - self.resolution)
        )
        if level and len(scan.ranges) > 2:
            gone |= self._seen_through(scan, x - scan.origin[0], y - scan.origin[1])
        self._hit[slots[gone]] = False
        self._keep(slots[~gone])

    def _seen_through(self, scan: Scan, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Past which places (N,), seen from the lidar, the nearest beam and those beside it went on."""
        ranges, first = scan.ranges, scan.angles[0]
        # The outermost beams clear nothing, nor is there anything beyond them.
        far = np.zeros(len(ranges))
        np.minimum(ranges[1:-1], ranges[2:], out=far[1:-1])
        np.minimum(far[1:-1], ranges[:-2], out=far[1:-1])
        step = (scan.angles[-1] - first) / (len(ranges) - 1)
        beams = np.rint((np.arctan2(y, x) - first) / step).astype(int)
        return np.hypot(x, y) + PASSED * self.resolution < far[np.clip(beams, 0, len(ranges) - 1)]

    def _keep(self, slots: np.ndarray) -> None:
        self.version += not np.array_equal(slots, self._slots)
        self._slots = slots
        self.points = self._places[:, slots].T


def _rotation(roll: float, pitch: float, heading: float) -> np.ndarray:
    """From the robot's frame to one that is level and along the world's axes, (3, 3)."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    ch, sh = math.cos(heading), math.sin(heading)
    return np.array(
        [
            [ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr],
            [sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
