"""The costmap: what the lidar has seen around the robot, on a square grid that moves along with
it.
"""

from __future__ import annotations

import math

import numpy as np

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.robot.navigation.footprint import Footprint, seen_from
from ddenv.robot.protocol import Estimate, Imu, Scan, Setup

PASSED = 1.5  # a beam clears a cell if it goes farther than the cell by this many cells
# When the robot tilts more than this (rad), its beams pass above or below what they would clear.
LEVEL = 0.12
SPARE = 1e-6  # what rounding changes is less, m


class Costmap:
    """The occupied cells around the robot, aligned with the frame of the pose estimates. Cells that
    no beam has seen are free.

    Each occupied cell keeps the last point at which a beam ended in it. The cells are stored in
    slots, numbered modulo the map's width: as the map moves, cells that enter on one side take the
    slots of those that leave on the other. `spots` (3, N) are all those points: x and y in m, and
    1. `version` counts the changes: something appeared away from everything known, or something
    vanished altogether.
    """

    def __init__(self, setup: Setup) -> None:
        planner = setup.settings.planner
        self.resolution = planner.resolution
        self.count = max(round(planner.size / planner.resolution), 4)
        self.spots = np.empty((3, 0))
        self.version = 0
        body = Footprint.of(setup)
        # One cell of the rim is kept: a robot that turns may still hit what is there.
        self._middle = (body.ahead - body.behind) / 2
        self._half = (body.ahead + body.behind) / 2 - self.resolution
        self._side = body.side - self.resolution
        # The wheels stand this far below the frame of the points.
        self._lowest = planner.lowest - setup.radius
        self._slots: Integers = np.empty(0, dtype=int)
        # The occupied slots at the last change of the version, and those that are occupied or next
        # to one, (count^2,).
        self._known = self._slots
        self._around, self._hit = np.zeros((2, self.count**2), dtype=bool)
        beside = (-1, 0, 1)
        self._beside = np.array([[dx * self.count + dy] for dx in beside for dy in beside])
        self._places = np.ones((3, self.count**2))
        self._angles: Floats | None = None
        self._beams = np.empty((2, 0))
        # The robot's cell, and the least range of each three neighbouring beams, m.
        self._cell: tuple[int, int] | None = None
        self._far = np.empty(0)

    @property
    def points(self) -> Floats:
        """The points at which beams ended, (N, 2) m."""
        return self.spots[:2].T

    def see(self, scan: Scan, estimate: Estimate, imu: Imu | None = None) -> None:
        """Adds what `scan` shows, and clears what its beams pass through; `estimate` and `imu` are
        the robot's pose and tilt.
        """
        if scan.angles is not self._angles:
            self._angles = scan.angles
            self._beams = np.stack([np.cos(scan.angles), np.sin(scan.angles)])
            # The outermost beams, which have one neighbour only, clear nothing.
            self._far = np.zeros(len(scan.angles))
        # Nothing else of the scan is read: what ended the other beams takes no part in the run.
        scan = Scan(scan.time, scan.angles, scan.within(self._limits(scan, estimate)), scan.origin)
        roll, pitch = (imu.roll, imu.pitch) if imu else (0.0, 0.0)
        self._mark(scan, estimate, roll, pitch)
        self._clear(scan, estimate, level=max(abs(roll), abs(pitch)) <= LEVEL)

    def forget(self, estimate: Estimate, beyond: float, beyond_unseen: float) -> None:
        """Clears the map beyond `beyond` (m) from the robot, or beyond `beyond_unseen` (m) outside
        the lidar's field of view.
        """
        dx, dy = (self.points - (estimate.x, estimate.y)).T
        bearings = np.arctan2(dy, dx) - estimate.heading
        bearings -= math.tau * np.round(bearings / math.tau)
        first, last = (
            (self._angles[0], self._angles[-1]) if self._angles is not None else (0.0, 0.0)
        )
        seen = (bearings >= first) & (bearings <= last)
        near = np.hypot(dx, dy) <= np.where(seen, beyond, beyond_unseen)
        self._hit[self._slots[~near]] = False
        self._keep(self._slots[near], self.spots[:, near])

    def _limits(self, scan: Scan, estimate: Estimate) -> Floats:
        """The range (N,) m of each beam beyond which it marks nothing, and has passed all that is
        known in its direction.
        """
        count = len(scan.angles)
        limits = np.full(
            count, (self.count / 2 + PASSED) * self.resolution + math.hypot(*scan.origin[:2])
        )
        if count > 2 and self.spots.size:
            cosine = math.cos(estimate.heading)
            sine = math.sin(estimate.heading)
            dx = self.spots[0] - estimate.x
            dy = self.spots[1] - estimate.y
            x = cosine * dx + sine * dy - scan.origin[0]
            y = cosine * dy - sine * dx - scan.origin[1]
            passed = np.sqrt(x * x + y * y) + PASSED * self.resolution + SPARE
            # A place is cleared by its nearest beam and both neighbours; which one is nearest may
            # be a matter of rounding.
            beams = self._beams_at(scan, x, y) + np.arange(-2, 3)[:, None]
            # Each row by itself: numpy takes wrong values where it has to broadcast them.
            for row in beams.clip(0, count - 1):
                np.maximum.at(limits, row, passed)
        return limits

    def _mark(self, scan: Scan, estimate: Estimate, roll: float, pitch: float) -> None:
        """Marks the cells in which beams end, but for those that end on the ground before a tilted
        robot.
        """
        cr = math.cos(roll)
        sr = math.sin(roll)
        cp = math.cos(pitch)
        sp = math.sin(pitch)
        ch = math.cos(estimate.heading)
        sh = math.sin(estimate.heading)
        # From the robot's frame to the world frame.
        turn = np.array(
            [
                [ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr],
                [sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )
        start = turn @ scan.origin
        reach = (self.count / 2 - 1) * self.resolution - math.hypot(start[0], start[1])
        (near,) = (scan.ranges < reach).nonzero()
        ends = self._beams.take(near, axis=1)
        ends *= scan.ranges.take(near)
        places = turn[:, :2] @ ends
        solid = places[2] >= self._lowest - start[2]
        if not solid.all():
            places = places[:, solid]
        places = places[:2]
        places += ((start[0] + estimate.x,), (start[1] + estimate.y,))
        cells = np.floor(places / self.resolution).astype(int)
        cells %= self.count
        slots = cells[0] * self.count + cells[1]
        self._hit[slots] = True
        self._places[:2, slots] = places

    def _clear(self, scan: Scan, estimate: Estimate, level: bool) -> None:
        """Clears what is off the map, under the robot or, if the beams are `level`, where they have
        passed through.
        """
        (slots,) = self._hit.nonzero()
        spots = self._places.take(slots, axis=1)
        seen = seen_from(estimate)[:2] @ spots
        seen[0] -= self._middle
        beyond = np.abs(seen)
        gone = (beyond[0] < self._half) & (beyond[1] < self._side)
        cell = math.floor(estimate.x / self.resolution), math.floor(estimate.y / self.resolution)
        if cell != self._cell:
            self._cell = cell
            middle = [[(part + 0.5) * self.resolution] for part in cell]
            gone |= (np.abs(spots[:2] - middle) > self.count * self.resolution / 2).any(axis=0)
        if level and len(scan.ranges) > 2:
            # What the nearest beam and both its neighbours have passed.
            x = seen[0] + (self._middle - scan.origin[0])
            y = seen[1] - scan.origin[1]
            ranges = scan.ranges
            far = self._far
            np.minimum(ranges[1:-1], ranges[2:], out=far[1:-1])
            np.minimum(far[1:-1], ranges[:-2], out=far[1:-1])
            nearest = self._beams_at(scan, x, y)
            gone |= np.sqrt(x * x + y * y) + PASSED * self.resolution < far.take(
                nearest, mode="clip"
            )
        if gone.any():
            self._hit[slots[gone]] = False
            kept: Booleans = ~gone
            slots = slots[kept]
            spots = spots[:, kept]
        self._keep(slots, spots)

    def _beams_at(self, scan: Scan, x: Floats, y: Floats) -> Integers:
        """The numbers (N,) of the beams nearest to places in the lidar's frame; out of its view
        there are no such beams.
        """
        first = scan.angles[0]
        beams = np.arctan2(y, x)
        beams -= first
        beams /= (scan.angles[-1] - first) / (len(scan.angles) - 1)
        return np.rint(beams, out=beams).astype(int)

    def _keep(self, slots: Integers, spots: Floats) -> None:
        same = len(slots) == len(self._slots) and bool((slots == self._slots).all())
        self._slots = slots
        self.spots = spots
        if same:
            return
        around: Booleans = np.zeros(self.count**2, dtype=bool)
        around[(slots + self._beside) % len(around)] = True
        if self._around[slots].all() and around[self._known].all():
            return
        self._known = slots
        self._around = around
        self.version += 1
