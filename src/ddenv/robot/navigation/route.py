"""The global planner: a path to the goal around the points on the map, by Dijkstra's search on a
grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ddenv.arrays import Floats, Integers
from ddenv.robot.navigation.footprint import Footprint, legs_beside
from ddenv.robot.protocol import Setup
from ddenv.world.pose import Point


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """A straight leg from (x, y) in the direction (cosine, sine), `length` m long."""

    x: float
    y: float
    cosine: float
    sine: float
    length: float


class Path:
    """Straight legs between at least two `corners` (x, y in m).

    `final` is True if the path ends at the goal, not at the map's border. `back` and `on` (m) are
    how much free ground each leg has before its start and after its end. `off` (m) is the robot's
    distance from the path.
    """

    def __init__(
        self, corners: list[Point], final: bool = True, back: float = 0.0, on: float = 0.0
    ) -> None:
        self.corners = corners
        self.final = final
        self.back = back
        self.on = on
        self.off = 0.0
        self._legs = []
        for (x, y), end in pairwise(corners):
            dx = end[0] - x
            dy = end[1] - y
            length = math.hypot(dx, dy)
            cosine, sine = (dx / length, dy / length) if length else (1.0, 0.0)
            self._legs.append(Leg(x=x, y=y, cosine=cosine, sine=sine, length=length))
        # The length of the path from the start of each leg.
        self._rests = list(accumulate(leg.length for leg in self._legs[::-1]))[::-1]
        self._number = 0
        self._along = 0.0

    @property
    def end(self) -> Point:
        return self.corners[-1]

    @property
    def left(self) -> float:
        """The length (m) of what is left of the path."""
        return self._rests[self._number] - self._along

    def locate(self, x: float, y: float) -> None:
        """Projects the robot at (x, y) onto the path: it never moves back along it, and reaches the
        legs in turn.
        """
        self.off = math.inf
        for number in range(self._number, min(self._number + 2, len(self._legs))):
            leg = self._legs[number]
            dx = x - leg.x
            dy = y - leg.y
            along = min(max(dx * leg.cosine + dy * leg.sine, 0.0), leg.length)
            off = math.hypot(dx - along * leg.cosine, dy - along * leg.sine)
            if off <= self.off:
                self.off = off
                self._number = number
                self._along = along

    def ahead(self, distance: float) -> Point:
        """The place `distance` (m) further along it, or its end."""
        number = self._number
        along = self._along + distance
        while along > self._legs[number].length and number + 1 < len(self._legs):
            along -= self._legs[number].length
            number += 1
        leg = self._legs[number]
        along = min(along, leg.length)
        return leg.x + along * leg.cosine, leg.y + along * leg.sine

    def rest(self) -> Floats:
        """The corners (K, 2) m of what is left of the path, beginning with the robot's projection
        onto it.
        """
        return np.array([self.ahead(0.0), *self.corners[self._number + 1 :]])


# Steps from a cell, counterclockwise from the x axis; step k runs along axis k % 4.
STEPS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
AXES = np.arange(8) % 4
LONGEST = 1e9  # longer than any path: only what cannot be passed is longer


class Grid:
    """`count` x `count` cells for Dijkstra's search. The cell at column x and row y has the number
    x * count + y.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        cells = np.arange(count * count)
        x, y = np.divmod(cells, count)
        inside = [
            (x + dx >= 0) & (x + dx < count) & (y + dy >= 0) & (y + dy < count) for dx, dy in STEPS
        ]
        # A step out of the grid leads back to its own cell.
        ends = [
            np.where(there, cells + dx * count + dy, cells)
            for there, (dx, dy) in zip(inside, STEPS, strict=True)
        ]
        to = np.stack(ends, axis=1).astype(np.int32)
        # The indices of the factors (4, cells), flattened, at a step's two ends.
        self._here = (AXES * len(cells) + cells[:, None]).ravel()
        self._there = (AXES * len(cells) + to).ravel()
        self._lengths = np.tile([np.hypot(dx, dy) / 2 for dx, dy in STEPS], len(cells))
        starts = np.arange(0, to.size + 1, len(STEPS), dtype=np.int32)
        self._graph = csr_matrix(
            (np.ones(to.size), to.ravel(), starts), shape=(len(cells), len(cells))
        )

    def search(self, factors: Floats, start: int) -> tuple[Floats, Integers]:
        """Searches the cheapest paths from `start` to all cells.

        Returns their lengths (cells,), in cells and infinite where there is none, and the last cell
        before each cell (cells,). `factors` (4, cells) multiply the length of a step along x, the
        first diagonal, y and the second diagonal in each cell: at least 1, infinite where the cell
        cannot be passed. A step counts with the mean of the factors at its two ends.
        """
        flat = factors.ravel()
        self._graph.data = (flat[self._here] + flat[self._there]) * self._lengths
        lengths, sources = dijkstra(
            self._graph, indices=start, return_predecessors=True, limit=LONGEST
        )
        return lengths, sources


def path_to(cell: int, sources: Integers) -> list[int]:
    """The cells from the start of a search to `cell`, both included; `sources` are from
    `Grid.search`.
    """
    path = [cell]
    while sources[path[-1]] >= 0:
        path.append(int(sources[path[-1]]))
    return path[::-1]


# The search's grid is coarser than the map by this factor. Points keep their exact places, so that
# no gap is lost.
COARSER = 2
# The additional cost of a path right beside an obstacle, and how fast it decays with the distance,
# 1/m.
WEIGHT = 4.0
FALL = 5.0
# The factor for a direction in which only a shorter robot would fit: the straightened path may fit
# this one.
TIGHT = 1.5
HEAVY = 50.0  # the factor for blocked cells where the robot already is: it has to get out of there
APART = 3  # a path can be cut short at corners that are at most this many cells apart
NEARER = 0.015  # a shortcut may come nearer to an obstacle by this, m
STRAIGHT = (
    1.03  # a path at most this many times longer than the straight line is not searched again
)
# Before and after a narrow place the path goes straight on for the first of these distances (m)
# that is free.
STRAIGHT_ON = np.array([0.8, 0.5, 0.25])
# The sharpest turn there, as the cosine of its angle.
SHARPEST = -0.3
DIRECTIONS = tuple(
    (math.cos(axis * math.pi / 4), math.sin(axis * math.pi / 4)) for axis in AXES[:4]
)


class Planner:
    """Finds paths on which the robot, aligned with each leg, touches nothing and keeps its
    `padding` on both sides.
    """

    def __init__(self, setup: Setup) -> None:
        planner = setup.settings.planner
        self._goal = setup.goal
        self._tolerance = setup.tolerance
        self._body = Footprint.of(setup)
        self._side = self._body.side + planner.padding
        self._reach = max(self._body.ahead, self._body.behind)
        self._inflation = max(planner.inflation, self._side)
        self._step = COARSER * planner.resolution
        self._grid = Grid(max(round(planner.size / self._step), 3))
        x, y = np.divmod(np.arange(self._grid.count**2), self._grid.count)
        self._cells = np.stack([x, y], axis=1) * self._step
        self._border = np.flatnonzero(
            (np.minimum(x, y) == 0) | (np.maximum(x, y) == self._grid.count - 1)
        )
        middle = self._grid.count // 2
        self._start = middle * (self._grid.count + 1)
        self._close = np.flatnonzero(
            np.hypot(x - middle, y - middle) * self._step <= self._body.inscribed * 1.5
        )

    def plan(self, points: Floats, x: float, y: float) -> Path | None:
        """A path from (x, y) to the goal, or to the best place at the map's border if the goal lies
        beyond; None if there is none.

        It avoids `points` (N, 2). All in m.
        """
        straight = Path([(x, y), self._goal], back=self._body.inscribed, on=self._body.inscribed)
        if not len(points):
            return straight
        ends = np.array(straight.corners)
        free, near = legs_beside(points, ends[:1], ends[1:], 0.0, self._body.ahead, self._side)
        if free[0] and near[0] >= self._inflation:
            return straight
        start = (x, y)
        corner = (np.rint(np.array(start) / self._step) - self._grid.count // 2) * self._step
        factors, near = self._costs(points - corner)
        factors[:, self._close] = np.minimum(factors[:, self._close], HEAVY)
        lengths, sources = self._grid.search(factors, self._start)
        goal_is_free = bool(np.hypot(*(points - self._goal).T).min() >= self._side)
        to = self._target(lengths, corner, goal_is_free)
        if to is None:
            return None
        # A path has two ends, even if the robot is in the goal's cell already.
        route = path_to(to, sources) if to != self._start else [to, to]
        places = self._cells[route] + corner
        left = math.dist(places[-1], self._goal)
        if goal_is_free and left <= self._step:
            places[-1] = self._goal
        elif to == self._start:
            places[-1] = start
        places[0] = start
        corners = self._cut_short(places, near[route], points)
        # A place at the map's border only leads to a goal beyond it, however near it is to the
        # goal.
        ahead = np.array(self._goal) - corner
        on_map = bool((ahead > -self._step).all() and (ahead < self._grid.count * self._step).all())
        final = left <= self._tolerance and on_map
        return Path(corners, final=final, back=self._body.inscribed, on=self._body.inscribed)

    def room(self, path: Path, points: Floats) -> float | None:
        """The distance (m) of the nearest of `points` (N, 2) m from what is left of `path`; None if
        one blocks it.
        """
        rest = path.rest()
        inflation: float = self._inflation
        if not len(points) or len(rest) < 2:
            return inflation
        back = np.full(len(rest) - 1, path.back)
        # What is beside the robot now does not block its path.
        back[0] = -min(self._body.ahead, path.left)
        free, near = legs_beside(points, rest[:-1], rest[1:], back, path.on, self._body.side)
        if free.all():
            return min(float(near.min()), inflation)
        return None

    def is_best(self, path: Path, points: Floats) -> bool:
        """Whether no path can be much better than what is left of `path`: it is free, with room,
        and nearly straight.
        """
        room = self.room(path, points)
        if room is None or room < self._inflation:
            return False
        return path.left + math.dist(path.end, self._goal) <= STRAIGHT * math.dist(
            path.ahead(0.0), self._goal
        )

    def _target(self, lengths: Floats, corner: Floats, goal_is_free: bool) -> int | None:
        """The cell to go to, None if none can be reached."""
        left = np.hypot(*(self._cells + corner - self._goal).T)
        if left.min() < self._step:
            # The goal is on the map: go there, or as near to it as still counts as reached.
            enough = max(self._tolerance, self._step) if goal_is_free else self._tolerance
            left[~((lengths < np.inf) & (left <= enough))] = np.inf
            best = int(left.argmin())
            if left[best] < np.inf:
                return best
            return None
        whole = lengths[self._border] * self._step + left[self._border]
        best = int(whole.argmin())
        if whole[best] < np.inf:
            return int(self._border[best])
        return None

    def _costs(self, points: Floats) -> tuple[Floats, Floats]:
        """The factors (4, cells) for `Grid.search`, and the distance of the nearest point to each
        cell (cells,), m.
        """
        count = self._grid.count
        step = self._step
        widest = max(self._inflation, math.hypot(self._reach, self._side))
        around = np.arange(-math.ceil(widest / step), math.ceil(widest / step) + 1)
        cells = np.rint(points / step).astype(int)[:, :, None] + around
        apart = cells * step - points[:, :, None]
        inside = (cells >= 0) & (cells < count)
        near = (apart[:, 0, :, None] ** 2 + apart[:, 1, None, :] ** 2) <= widest**2
        near &= inside[:, 0, :, None] & inside[:, 1, None, :]
        dx = np.broadcast_to(apart[:, 0, :, None], near.shape)[near]
        dy = np.broadcast_to(apart[:, 1, None, :], near.shape)[near]
        numbers = (cells[:, 0, :, None] * count + cells[:, 1, None, :])[near]
        nearest = np.full(count * count, self._inflation)
        np.minimum.at(nearest, numbers, np.hypot(dx, dy))
        costs = np.where(
            nearest < self._inflation, np.exp(FALL * (self._body.inscribed - nearest)), 0.0
        )
        factors = np.tile(1.0 + WEIGHT * np.minimum(costs, 1.0), (4, 1))
        for factor, (cosine, sine) in zip(factors, DIRECTIONS, strict=True):
            tight = (np.abs(cosine * dx + sine * dy) < self._reach) & (
                np.abs(cosine * dy - sine * dx) < self._side
            )
            is_tight = np.zeros(count * count, dtype=bool)
            is_tight[numbers[tight]] = True
            factor[is_tight] *= TIGHT
        factors[:, nearest < self._side] = np.inf
        return factors, nearest

    def _cut_short(self, places: Floats, near: Floats, points: Floats) -> list[Point]:
        """The corners of a path along `places` (K, 2) m that is as free, but straight wherever it
        can be.

        `near` (K,) m is the distance of the nearest point to each place: no leg comes nearer than
        what it replaces.
        """
        turns = np.any(np.diff(places, 2, axis=0).round(6), axis=1)
        kept = np.ones(len(places), dtype=bool)
        kept[1:-1] = turns | (np.arange(1, len(places) - 1) % APART == 0)
        chosen = np.flatnonzero(kept)
        corners = [0]
        at = 0
        while at < len(chosen) - 1:
            ends = chosen[at + 1 :]
            starts = np.broadcast_to(places[chosen[at]], (len(ends), 2))
            back = 0.0 if at == 0 else self._reach
            free, beside = legs_beside(points, starts, places[ends], back, self._reach, self._side)
            least = np.minimum.accumulate(near[chosen[at] :])[ends - chosen[at]]
            good = np.flatnonzero(free & (beside >= least - NEARER))
            at += 1 + (int(good[-1]) if len(good) else 0)
            corners.append(int(chosen[at]))
        return [(float(x), float(y)) for x, y in self._ease(places[corners], points)]

    def _ease(self, corners: Floats, points: Floats) -> Floats:
        """Moves `corners` (K, 2) m away from narrow places, so that the robot gets there aligned
        and leaves straight.
        """
        for number in range(1, len(corners) - 1):
            sides = corners[[number - 1, number + 1]]
            here = corners[number]
            _, near = legs_beside(points, sides, np.stack([here, here]), 0.0, 0.0, self._side)
            narrow = int(near.argmin())
            way = here - sides[narrow]
            if near[narrow] >= self._body.circumscribed or not way.any():
                continue
            tries = here + np.outer(STRAIGHT_ON, way / np.hypot(*way))
            # Beside the robot as it stands now there may be no room for it to be turned.
            on = [
                0.0 if number + 2 * side - 1 == 0 else self._reach for side in (narrow, 1 - narrow)
            ]
            ends = np.repeat([sides[narrow], sides[1 - narrow]], len(tries), axis=0)
            free, _ = legs_beside(
                points,
                np.tile(tries, (2, 1)),
                ends,
                self._reach,
                np.repeat(on, len(tries)),
                self._side,
            )
            # The cosines of the angles by which the path then turns there.
            come = tries - sides[narrow]
            go = sides[1 - narrow] - tries
            lengths = np.hypot(*come.T) * np.hypot(*go.T)
            cosines = (come * go).sum(axis=1) / np.maximum(lengths, 1e-9)
            good = free.reshape(2, -1).all(axis=0) & (cosines >= SHARPEST)
            if good.any():
                corners[number] = tries[good.argmax()]
        return corners
