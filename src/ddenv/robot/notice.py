"""When a run's robot first noticed each model: had it in view of its range sensor, or touched it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from pydrake.systems.framework import Context

from ddenv.robot.drake.plant import Body
from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.surroundings import Surroundings
from ddenv.world.pose import Vector
from ddenv.world.scenario import Sensors

# Rows of a recording that are looked at together: enough to spread the cost of numpy's calls over.
TOGETHER = 32
# The least part of a direction along an axis: one that is along the other axis still has a crossing, far away.
PARALLEL = 1e-12


def distances(low: np.ndarray, high: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """How far (...) the boxes from `low` to `high` (..., 3) along the world's axes are from the points `eye` (..., 3), m."""
    return np.linalg.norm(np.maximum(np.maximum(low - eye, eye - high), 0.0), axis=-1)


def first_in_view(
    low: np.ndarray, high: np.ndarray, eyes: np.ndarray, headings: np.ndarray, view_range: float, view_angle: float
) -> np.ndarray:
    """In which row (N,) each of N boxes is in view for the first time, see `in_view`; -1 for those that never are.

    `low` and `high` (T, N, 3), `eyes` (T, 3), all in m, and `headings` (T,) in rad have a row for each instant.
    """
    first = np.full(low.shape[1], -1)
    for start in range(0, len(eyes), TOGETHER):
        rows = slice(start, start + TOGETHER)
        eye = eyes[rows]
        lowest, highest = low[rows].min(axis=0) - eye.max(axis=0), eye.min(axis=0) - high[rows].max(axis=0)
        least = np.linalg.norm(np.maximum(np.maximum(lowest, highest), 0.0), axis=1)
        near = np.flatnonzero((first < 0) & (least <= view_range))
        seen = in_view(low[rows, near], high[rows, near], eye[:, None], headings[rows, None], view_range, view_angle)
        ever = seen.any(axis=0)
        first[near[ever]] = start + seen.argmax(axis=0)[ever]
    return first


def in_view(
    low: np.ndarray, high: np.ndarray, eye: np.ndarray, heading: np.ndarray, view_range: float, view_angle: float
) -> np.ndarray:
    """Of which boxes (...) some part is in view of `eye`: within `view_range` (m) and, seen from above, the field of view.

    `low` and `high` (..., 3) are the boxes' corners, `eye` (..., 3) is where it is looked from, m, and `heading` (...) the middle
    of the field of view, rad, all in the world frame; `view_angle` is its full width, rad. A box that is above, below or
    around `eye` is in the field of view.
    """
    seen = distances(low, high, eye) <= view_range
    if view_angle >= math.tau:
        return seen
    eye, heading = np.broadcast_to(eye, low.shape)[seen], np.broadcast_to(heading, seen.shape)[seen]
    low, high = low[seen] - eye, high[seen] - eye
    drop = np.maximum(np.maximum(low[:, 2], -high[:, 2]), 0.0)
    x, y = np.clip(0.0, low[:, :2], high[:, :2]).T
    offset = np.arctan2(y, x) - heading
    # What is nearest within the field of view is the nearest of the whole box, or lies on an edge of the field.
    shown = np.abs(offset - math.tau * np.round(offset / math.tau)) <= view_angle / 2
    shown |= (x == 0) & (y == 0)
    for edge in (heading - view_angle / 2, heading + view_angle / 2):
        shown |= np.hypot(_ways(low[:, :2], high[:, :2], edge), drop) <= view_range
    seen[seen] = shown
    return seen


def _ways(low: np.ndarray, high: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """How far (N,) from the origin rectangles (N, 2) begin along `direction` (N,), rad; infinite for those beside it, m."""
    ray = np.column_stack([np.cos(direction), np.sin(direction)])
    ray = np.where(np.abs(ray) < PARALLEL, PARALLEL, ray)
    enter = np.maximum(np.minimum(low / ray, high / ray).max(axis=1), 0.0)
    leave = np.maximum(low / ray, high / ray).min(axis=1)
    return np.where(leave >= enter, enter, np.inf)


# While the robot is this near to where it was, only what it can touch by that is looked at, m.
STRIDE = 0.5
NOWHERE = (math.inf, math.inf, math.inf)


class Notice:
    """The models that are noticed in one run; `first_touched` tells when each was, s."""

    def __init__(
        self,
        around: Surroundings,
        sensors: Sensors,
        plant_context: Context,
        sleep: Sleep,
        kept: Sequence[Body],
        present: frozenset[str],
    ) -> None:
        """`present` are the models that are there; `kept` are those of them that move, as `sleep` has them."""
        self.first_touched: dict[str, float] = {}
        self._around = around
        self._sensors = sensors
        self._context = plant_context
        self._sleep = sleep
        self._moving = np.array([body.name for body in kept], dtype=object)
        self._present = np.array([name in present for name in around.names], dtype=bool)
        self._untouched = self._present.copy()
        self._solid = np.array([any(body.bounds) for body in kept], dtype=bool)
        self._untouched_moving = self._solid.copy()
        # The boxes around what never moves within the stride, and how far from where the robot can touch none of it.
        self._low = self._high = np.empty((0, 3))
        self._stride_start = self._free_start = NOWHERE
        self._free = 0.0
        self._views: list[tuple[float, Vector, float]] = []
        self._boxes: list[tuple[np.ndarray, np.ndarray]] = []

    def feel(self, now: float, place: Vector) -> None:
        """Notices what the robot, whose first link is at `place` (m), touches at the time `now` (s).

        To be called when the motors have their command: then the contacts are those which the next step needs in any case,
        worked out once, with the same bits. What is touched only between two calls is missed.
        """
        if not (self._reaches(place) or self._reaches_moving(place)):
            return
        for name in self._touched():
            self.first_touched[name] = now
            self._untouched &= self._around.names != name
            self._untouched_moving &= self._moving != name
            self._stride_start = self._free_start = NOWHERE

    def look(self, now: float, place: Vector, heading: float) -> None:
        """Writes down from where, and in which direction (rad), the robot looks at the time `now` (s)."""
        if not self._sensors.view_range:
            return
        self._views.append((now, place, heading))
        if len(self._moving):
            self._boxes.append(self._sleep.boxes())

    def first_sensed(self, measured: Mapping[str, float]) -> dict[str, float]:
        """When (s) each model was seen or touched first, in the order of time; `measured` is when the lidar first met it."""
        # All rows at once: looking at each in its time would cost many times as much.
        first = dict(self.first_touched)
        for name, met in measured.items():
            first[name] = min(met, first.get(name, math.inf))
        for name, seen in self._seen():
            first[name] = min(seen, first.get(name, math.inf))
        return dict(sorted(first.items(), key=lambda item: item[1]))

    def _reaches(self, place: Vector) -> bool:
        """Whether the robot might touch anything for the first time that never moves."""
        if math.dist(place, self._free_start) < self._free:
            return False
        if not math.dist(place, self._stride_start) < STRIDE:
            self._stride_start = place
            apart = distances(self._around.low, self._around.high, np.array(place))
            near = self._untouched & (apart < self._around.reach + STRIDE)
            self._low, self._high = self._around.low[near], self._around.high[near]
        apart = float(distances(self._low, self._high, np.array(place)).min(initial=math.inf)) - self._around.reach
        self._free_start = place
        self._free = min(apart, STRIDE - math.dist(place, self._stride_start))
        return apart < 0

    def _reaches_moving(self, place: Vector) -> bool:
        """Whether the robot might touch anything for the first time that moves."""
        if not self._untouched_moving.any():
            return False
        apart = distances(*self._sleep.boxes(), np.array(place))
        return bool((apart[self._untouched_moving] < self._around.reach).any())

    def _touched(self) -> Iterator[str]:
        """The models that the robot touches for the first time."""
        robot, owners = self._around.robot, self._around.owners
        try:
            results = self._around.contacts.Eval(self._context)
        # Contacts that cannot be worked out are for the step that needs them to report.
        except (RuntimeError, ValueError, SystemExit):
            return
        for number in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(number).point_pair()
            name, other = owners.get(pair.id_A.get_value()), pair.id_B
            if name is None:
                name, other = owners.get(other.get_value()), pair.id_A
            # Most contacts are with what the robot stands on: no more is asked about them.
            if name is not None and name not in self.first_touched and other.get_value() in robot:
                yield name

    def _seen(self) -> Iterator[tuple[str, float]]:
        """The models that were in view, with the time (s) of the first; a model may come twice."""
        if not self._views:
            return
        times, places, headings = zip(*self._views, strict=True)
        shown = self._present & self._around.visible
        still = [
            np.broadcast_to(side[shown], (len(times), shown.sum(), 3)) for side in (self._around.low, self._around.high)
        ]
        groups = [(self._around.names[shown], *still)]
        if self._boxes:
            low, high = (np.array(sides)[:, self._solid] for sides in zip(*self._boxes, strict=True))
            groups.append((self._moving[self._solid], low, high))
        for names, low, high in groups:
            rows = first_in_view(
                low, high, np.array(places), np.array(headings), self._sensors.view_range, self._sensors.view_angle
            )
            yield from ((name, times[row]) for name, row in zip(names, rows, strict=True) if row >= 0)
