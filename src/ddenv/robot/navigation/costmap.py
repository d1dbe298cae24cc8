"""What the lidar has seen around the robot: a square map that rolls along with it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.robot.protocol import Setup
from ddenv.robot.sensing.estimate import Estimate
from ddenv.robot.sensing.sensors import Imu, Scan

# Points nearer to the robot than this part of its padding count as touched.
TOUCHED = 0.6
# Turns a direction, with its parts the other way round, to the left.
LEFT = np.array([-1.0, 1.0])


@dataclass(frozen=True, slots=True)
class Footprint:
    """How far the robot reaches from its origin, m: `ahead`, `behind`, and to each `side`, which are taken as equal.

    What is nearer than `margin` (m) counts as touched.
    """

    ahead: float
    behind: float
    side: float
    margin: float = 0.0

    @classmethod
    def of(cls, setup: Setup) -> Footprint:
        """That of the robot of `setup`."""
        ahead, behind, left, right = setup.footprint
        return cls(ahead, behind, max(left, right), TOUCHED * setup.settings.planner.padding)

    @property
    def inscribed(self) -> float:
        """Radius (m) about the origin that the robot covers however it is turned."""
        return min(self.ahead, self.behind, self.side)

    @property
    def circumscribed(self) -> float:
        """Radius (m) about the origin beyond which the robot never reaches."""
        return float(np.hypot(max(self.ahead, self.behind), self.side))

    def apart(self, points: np.ndarray, places: np.ndarray) -> np.ndarray:
        """How far (K, N) m `points` (3, N), the third row 1, are from the footprint with its margin at least; inside below 0.

        `places` (2, K, 3) turn such a point into how far ahead and how far aside of the robot it is, for each of K places.
        """
        beyond = places.reshape(-1, 3) @ points
        count = places.shape[1]
        beyond[:count] -= (self.ahead - self.behind) / 2
        np.abs(beyond, out=beyond)
        beyond[:count] -= (self.ahead + self.behind) / 2 + self.margin
        beyond[count:] -= self.side + self.margin
        return np.maximum(beyond[:count], beyond[count:])


def legs_beside(
    points: np.ndarray,
    starts: np.ndarray,
    ends: np.ndarray,
    back: np.ndarray | float,
    on: np.ndarray | float,
    side: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Which straight legs are free of `points` (N, 2), N > 0, and how near (m) the nearest point is to each; both (K,).

    A leg from `starts` (K, 2) to `ends` (K, 2) is free if no point is within `side` of it, from `back` (K,) before its start to
    `on` (K,) after its end. All in m.
    """
    ways = ends - starts
    lengths = np.sqrt((ways * ways).sum(axis=1, keepdims=True))
    np.maximum(lengths, 1e-9, out=lengths)
    ways = ways / lengths
    across_them = ways[:, ::-1] * LEFT
    along = ways @ points.T
    along -= (ways * starts).sum(axis=1, keepdims=True)
    across = across_them @ points.T
    across -= (across_them * starts).sum(axis=1, keepdims=True)
    np.abs(across, out=across)
    after = along - lengths
    hit = along > -np.asarray(back)[..., None]
    hit &= across < side
    hit &= after < np.asarray(on)[..., None]
    beyond = np.maximum(np.negative(along, out=along), after, out=along)
    np.maximum(beyond, 0.0, out=beyond)
    beyond *= beyond
    across *= across
    across += beyond
    return ~hit.any(axis=1), np.sqrt(across.min(axis=1))


# A beam that goes this much farther than a cell, in cells, has shown that nothing is there any more.
PASSED = 1.5
# Tilted more than this (rad), beams pass over or under what they would clear.
LEVEL = 0.12


class Costmap:
    """Cells in which a beam has ended, aligned with the frame of the estimates. Each cell keeps the last place that was hit in it.

    A cell's slot is its number modulo the map's width: as the map rolls, what drops out at one side makes place for what comes
    in at the other. What was not seen counts as free. `spots` (3, N) are all places that were hit, x and y in m and 1,
    `version` counts how often something appeared that is not beside what was there, or went away altogether.
    """

    def __init__(self, setup: Setup) -> None:
        planner = setup.settings.planner
        self.resolution = planner.resolution
        self.count = max(round(planner.size / planner.resolution), 4)
        self.spots = np.empty((3, 0))
        self.version = 0
        body = Footprint.of(setup)
        # One cell of the rim stays: a robot that turns may still hit what is there.
        self._middle = (body.ahead - body.behind) / 2
        self._half = (body.ahead + body.behind) / 2 - self.resolution
        self._side = body.side - self.resolution
        # The wheels stand this far below the frame that the points are in.
        self._lowest = planner.lowest - setup.radius
        self._slots = np.empty(0, dtype=int)
        # The slots that were hit when the version last changed, and those that are among or beside them, (count^2,).
        self._known = self._slots
        self._around = np.zeros(self.count**2, dtype=bool)
        beside = (-1, 0, 1)
        self._beside = np.array([[dx * self.count + dy] for dx in beside for dy in beside])
        self._hit = np.zeros(self.count**2, dtype=bool)
        self._places = np.ones((3, self.count**2))
        self._angles: np.ndarray | None = None
        self._beams = np.empty((2, 0))
        # The cell in the middle, and how far the nearest of three neighbouring beams went.
        self._cell: tuple[int, int] | None = None
        self._far = np.empty(0)

    @property
    def points(self) -> np.ndarray:
        """The places that were hit, (N, 2) m."""
        return self.spots[:2].T

    def see(self, scan: Scan, estimate: Estimate, imu: Imu | None = None) -> None:
        """Take in what `scan` shows to a robot at `estimate`, tilted as `imu` says."""
        if scan.angles is not self._angles:
            self._angles, self._beams = scan.angles, np.stack([np.cos(scan.angles), np.sin(scan.angles)])
            # The outermost beams clear nothing, nor is there anything beyond them.
            self._far = np.zeros(len(scan.angles))
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
        self._keep(self._slots[near], self.spots[:, near])

    def _mark(self, scan: Scan, estimate: Estimate, roll: float, pitch: float) -> None:
        turn = _rotation(roll, pitch, estimate.heading)
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
        """Drop what is out of the map, under the robot or, if the beams are level, where they have passed through."""
        (slots,) = self._hit.nonzero()
        spots = self._places.take(slots, axis=1)
        cosine, sine = math.cos(estimate.heading), math.sin(estimate.heading)
        x, y = estimate.x, estimate.y
        seen = np.array([[cosine, sine, -cosine * x - sine * y], [-sine, cosine, sine * x - cosine * y]]) @ spots
        seen[0] -= self._middle
        beyond = np.abs(seen)
        gone = (beyond[0] < self._half) & (beyond[1] < self._side)
        cell = math.floor(x / self.resolution), math.floor(y / self.resolution)
        if cell != self._cell:
            self._cell = cell
            middle = [[(part + 0.5) * self.resolution] for part in cell]
            gone |= (np.abs(spots[:2] - middle) > self.count * self.resolution / 2).any(axis=0)
        if level and len(scan.ranges) > 2:
            gone |= self._seen_through(scan, seen[0] + (self._middle - scan.origin[0]), seen[1] - scan.origin[1])
        if gone.any():
            self._hit[slots[gone]] = False
            slots, spots = slots[~gone], spots[:, ~gone]
        self._keep(slots, spots)

    def _seen_through(self, scan: Scan, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Past which places (N,), seen from the lidar, the nearest beam and those beside it went on."""
        ranges, first, far = scan.ranges, scan.angles[0], self._far
        np.minimum(ranges[1:-1], ranges[2:], out=far[1:-1])
        np.minimum(far[1:-1], ranges[:-2], out=far[1:-1])
        step = (scan.angles[-1] - first) / (len(ranges) - 1)
        beams = np.arctan2(y, x)
        beams -= first
        beams /= step
        nearest = np.rint(beams, out=beams).astype(int)
        return np.sqrt(x * x + y * y) + PASSED * self.resolution < far.take(nearest, mode="clip")

    def _keep(self, slots: np.ndarray, spots: np.ndarray) -> None:
        same = len(slots) == len(self._slots) and bool((slots == self._slots).all())
        self._slots, self.spots = slots, spots
        if same:
            return
        around = np.zeros(self.count**2, dtype=bool)
        around[(slots + self._beside) % len(around)] = True
        if self._around[slots].all() and around[self._known].all():
            return
        self._known, self._around = slots, around
        self.version += 1


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
