"""When a run's robot first noticed each model: had it in view of its range sensor, or touched it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from pydrake.systems.framework import Context

from ddenv.robot.plant import Body
from ddenv.robot.sleep import Sleep
from ddenv.robot.surroundings import Surroundings
from ddenv.robot.view import distances, first_in_view
from ddenv.world.pose import Vector
from ddenv.world.scenario import Sensors

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
