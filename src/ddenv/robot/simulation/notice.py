"""When the robot first noticed each model in a run: had it in view, or touched it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.framework import Context, OutputPort

from ddenv.arrays import Booleans, Floats, Integers, Objects
from ddenv.robot.drake.plant import Body, Built
from ddenv.robot.piles.sleep import Sleep
from ddenv.world.extent import bounds, filled_bounds, stacked
from ddenv.world.model import Model, Plane, World, still_links
from ddenv.world.pose import Vector
from ddenv.world.scenario import Sensors


class Notice:
    """The models that the robot notices in one run. `first_touched` maps a model to the time (s) when it was first touched."""

    def __init__(
        self,
        around: Surroundings,
        sensors: Sensors,
        plant_context: Context,
        sleep: Sleep,
        kept: Sequence[Body],
        present: frozenset[str],
    ) -> None:
        """`present` are the models that are kept; `kept` are the moving ones among them, in the order of `sleep`."""
        self.first_touched: dict[str, float] = {}
        self._around = around
        self._sensors = sensors
        self._context = plant_context
        self._sleep = sleep
        self._moving = np.array([body.name for body in kept], dtype=object)
        self._present: Booleans = np.array([name in present for name in around.names], dtype=bool)
        self._untouched = self._present.copy()
        self._solid: Booleans = np.array([any(body.bounds) for body in kept], dtype=bool)
        self._untouched_moving = self._solid.copy()
        self._views: list[tuple[float, Vector, float]] = []
        self._boxes: list[tuple[Floats, Floats]] = []

    def feel(self, now: float, place: Vector) -> None:
        """Notes what the robot touches at the time `now` (s); `place` (m) is the position of its first link.

        Call it after the motors got their command: then Drake computes the contacts that the next step needs in any case, once and
        with the same bits. Contacts that begin and end between two calls are missed.
        """
        if not self._may_touch(np.array(place)):
            return
        for name in self._touched():
            self.first_touched[name] = now
            self._untouched &= self._around.names != name
            self._untouched_moving &= self._moving != name

    def look(self, now: float, place: Vector, heading: float) -> None:
        """Notes where the robot is at the time `now` (s), and in which direction (rad) it looks."""
        if not self._sensors.view_range:
            return
        self._views.append((now, place, heading))
        if len(self._moving):
            self._boxes.append(self._sleep.boxes())

    def first_sensed(self, measured: Mapping[str, float]) -> dict[str, float]:
        """When (s) each model was first in view or touched, in order of time; `measured` is when the lidar first hit it."""
        # All rows at once: checking each at its time would cost many times as much.
        first = dict(self.first_touched)
        for name, met in measured.items():
            first[name] = min(met, first.get(name, math.inf))
        for name, seen in self._seen():
            first[name] = min(seen, first.get(name, math.inf))
        return dict(sorted(first.items(), key=lambda item: item[1]))

    def _may_touch(self, place: Floats) -> bool:
        """Whether the robot might touch something that it has not touched yet."""
        around = self._around
        if (distances(around.low, around.high, place)[self._untouched] < around.reach).any():
            return True
        moving = self._untouched_moving
        return bool(moving.any() and (distances(*self._sleep.boxes(), place)[moving] < around.reach).any())

    def _touched(self) -> Iterator[str]:
        """The models that the robot touches for the first time."""
        robot, owners = self._around.robot, self._around.owners
        try:
            results: Any = self._around.contacts.Eval(self._context)
        # If the contacts cannot be computed, the next step reports it.
        except (RuntimeError, ValueError, SystemExit):
            return
        for number in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(number).point_pair()
            name, other = owners.get(pair.id_A.get_value()), pair.id_B
            if name is None:
                name, other = owners.get(other.get_value()), pair.id_A
            # Most contacts are with the ground that the robot stands on: they fail the cheaper checks, which come first.
            if name is not None and name not in self.first_touched and other.get_value() in robot:
                yield name

    def _seen(self) -> Iterator[tuple[str, float]]:
        """The models that were in view, with the time (s) when they first were; a model may come twice."""
        if not self._views:
            return
        times, places, headings = zip(*self._views, strict=True)
        eyes = np.array(places)
        # Thousands of boxes would take as long as the run.
        far = np.maximum(self._around.low - eyes.max(axis=0), eyes.min(axis=0) - self._around.high).max(axis=1)
        shown = self._present & self._around.visible & (far <= self._sensors.view_range)
        still: list[Floats] = [
            np.broadcast_to(side[shown], (len(times), shown.sum(), 3)) for side in (self._around.low, self._around.high)
        ]
        groups: list[tuple[Objects, Floats, Floats]] = [(self._around.names[shown], still[0], still[1])]
        if self._boxes:
            low, high = (np.array(sides)[:, self._solid] for sides in zip(*self._boxes, strict=True))
            groups.append((self._moving[self._solid], low, high))
        for names, low, high in groups:
            rows = first_in_view(
                low, high, eyes, np.array(headings), self._sensors.view_range, self._sensors.view_angle
            )
            yield from ((name, times[row]) for name, row in zip(names, rows, strict=True) if row >= 0)


# The least component of a direction along an axis: a ray along the other axis then still crosses, far away.
PARALLEL = 1e-12


def first_in_view(
    low: Floats, high: Floats, eyes: Floats, headings: Floats, view_range: float, view_angle: float
) -> Integers:
    """The first row (N,) in which each of N boxes is in view, see `in_view`; -1 for boxes that never are.

    `low` and `high` (T, N, 3) m, `eyes` (T, 3) m and `headings` (T,) rad have a row for each of T instants, world frame.
    """
    first = np.full(low.shape[1], -1)
    for row, (eye, heading) in enumerate(zip(eyes, headings, strict=True)):
        (unseen,) = (first < 0).nonzero()
        seen = in_view(low[row, unseen], high[row, unseen], eye, heading, view_range, view_angle)
        first[unseen[seen]] = row
    return first


def in_view(low: Floats, high: Floats, eye: Floats, heading: Floats, view_range: float, view_angle: float) -> Booleans:
    """Which boxes (...) are partly in view of `eye`: within `view_range` (m) and, seen from above, in the field of view.

    `low` and `high` (..., 3) m are the boxes' corners, `eye` (..., 3) m is the viewpoint and `heading` (...) rad the middle of the
    field of view, all in the world frame; `view_angle` (rad) is its full width. A box above, below or around `eye` is always in
    the field of view.
    """
    seen: Booleans = distances(low, high, eye) <= view_range
    if view_angle >= math.tau:
        return seen
    eye, heading = np.broadcast_to(eye, low.shape)[seen], np.broadcast_to(heading, seen.shape)[seen]
    low, high = low[seen] - eye, high[seen] - eye
    drop = np.maximum(np.maximum(low[:, 2], -high[:, 2]), 0.0)
    x, y = np.clip(0.0, low[:, :2], high[:, :2]).T
    offset = np.arctan2(y, x) - heading
    # The nearest visible point is the nearest point of the whole box, or lies on an edge of the field of view.
    shown = np.abs(offset - math.tau * np.round(offset / math.tau)) <= view_angle / 2
    shown |= (x == 0) & (y == 0)
    for edge in (heading - view_angle / 2, heading + view_angle / 2):
        shown |= np.hypot(_entry(low[:, :2], high[:, :2], edge), drop) <= view_range
    seen[seen] = shown
    return seen


def _entry(low: Floats, high: Floats, direction: Floats) -> Floats:
    """The distance (N,) along `direction` (N,) rad from the origin to rectangles (N, 2), m; infinite where the ray misses."""
    ray = np.column_stack([np.cos(direction), np.sin(direction)])
    ray = np.where(np.abs(ray) < PARALLEL, PARALLEL, ray)
    enter = np.maximum(np.minimum(low / ray, high / ray).max(axis=1), 0.0)
    leave = np.maximum(low / ray, high / ray).min(axis=1)
    return np.where(leave >= enter, enter, np.inf)


def distances(low: Floats, high: Floats, eye: Floats) -> Floats:
    """The distances (...) of the points `eye` (..., 3) from the boxes between `low` and `high` (..., 3), m; 0 inside."""
    return np.asarray(np.linalg.norm(np.maximum(np.maximum(low - eye, eye - high), 0.0), axis=-1))


# A model, the lowest and the highest corner (3,) m of a box around parts of it that never move, and whether these are visible.
Still = tuple[str, Floats, Floats, bool]


@dataclass(frozen=True)
class Surroundings:
    """One robot in one world.

    `contacts` is the plant's port of contacts. `robot` are the ids of the robot's geometry; `owners` maps the ids of all other
    geometry to the names of its models. The robot touches nothing beyond `reach` (m) from the origin of its first link.

    `names` (N,) are the models with parts that never move, `low` and `high` (N, 3) m the corners of the boxes around those parts. A
    ground model has a second, endless box around all that is below its plane, which is not `visible` (N,).
    """

    contacts: OutputPort
    robot: frozenset[int]
    owners: dict[int, str]
    reach: float
    names: Objects
    low: Floats
    high: Floats
    visible: Booleans

    @classmethod
    def of(cls, boxes: Sequence[Still], reach: float, built: Built) -> Surroundings:
        """`boxes` are those of `still_boxes`; the robot has no point beyond `reach` (m) from its first link's origin."""
        geometry = [*built.static.items(), *((name, body.geometry) for name, body in built.moving.items())]
        geometry += [(name, twin.geometry) for name, twin in built.twins.items()]
        low, high = stacked((low, high) for _, low, high, _ in boxes)
        return cls(
            contacts=built.plant.get_contact_results_output_port(),
            robot=frozenset(one.get_value() for one in built.robot.geometry),
            owners={one.get_value(): name for name, members in geometry for one in members},
            reach=reach,
            names=np.array([name for name, *_ in boxes], dtype=object),
            low=low,
            high=high,
            visible=np.array([visible for *_, visible in boxes], dtype=bool),
        )


def still_boxes(world: World) -> list[Still]:
    """The boxes around all parts of `world` that never move."""
    return [(model.name, *box) for model in world.models for box in _boxes(model)]


def _boxes(model: Model) -> Iterator[tuple[Floats, Floats, bool]]:
    """The lowest and the highest corner (3,) of each box around the parts of `model` that never move, and if it is visible."""
    collisions = [collision for link in still_links(model) for collision in link.collisions]
    if (box := bounds(collisions)) is not None:
        yield *box, True
    for collision in collisions:
        if isinstance(collision.shape, Plane):
            yield *filled_bounds(collision), False
