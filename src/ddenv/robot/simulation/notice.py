"""When the robot first noticed each model in a run: had it in view, or touched it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ddenv.arrays import Booleans, Floats
from ddenv.robot.drake.plant import Body
from ddenv.robot.drake.run_context import RunContext
from ddenv.robot.piles.sleep import Sleep
from ddenv.world.extent import Bounds, bounds, stacked
from ddenv.world.model import World, still_links
from ddenv.world.pose import Vector
from ddenv.world.scenario import Sensors


class Notice:
    """The models that the robot notices in one run. `first_touched` maps a model to the time (s)
    when it was first touched.
    """

    def __init__(
        self,
        context: RunContext,
        boxes: Mapping[str, Bounds],
        sensors: Sensors,
        sleep: Sleep,
        kept: Sequence[Body],
        present: frozenset[str],
    ) -> None:
        """`boxes` are those of `still_boxes`. `present` are the models that are kept, `kept` the
        moving ones among them, in the order of `sleep`.
        """
        self.first_touched: dict[str, float] = {}
        self._first_seen: dict[str, float] = {}
        self._sensors = sensors
        self._context = context.plant_context
        self._sleep = sleep
        built = context.built
        self._contacts = built.plant.get_contact_results_output_port()
        self._robot = frozenset(one.get_value() for one in built.robot.geometry)
        # The owners of all other geometry.
        geometry = [*built.shapes(), *((name, twin.geometry) for name, twin in built.twins.items())]
        self._owners = {one.get_value(): name for name, members in geometry for one in members}
        # The owners of all boxes: those around what never moves, then one around each moving model.
        still = {name: box for name, box in boxes.items() if name in present}
        self._names = np.array([*still, *(body.name for body in kept)], dtype=object)
        self._low, self._high = stacked(still.values())
        self._unseen: Booleans = np.array(
            [True] * len(still) + [any(body.bounds) for body in kept], dtype=bool
        )

    def feel(self, now: float) -> None:
        """Notes what the robot touches at the time `now` (s).

        Call it after the motors got their command: then Drake computes the contacts that the next
        step needs in any case, once and with the same bits. Contacts that begin and end between two
        calls are missed.
        """
        try:
            results: Any = self._contacts.Eval(self._context)
        # If the contacts cannot be computed, the next step reports it.
        except (RuntimeError, ValueError, SystemExit):
            return
        for number in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(number).point_pair()
            name = self._owners.get(pair.id_A.get_value())
            other = pair.id_B
            if name is None:
                name = self._owners.get(other.get_value())
                other = pair.id_A
            # Most contacts are with the ground that the robot stands on: they fail the cheaper
            # checks, which come first.
            if (
                name is not None
                and name not in self.first_touched
                and other.get_value() in self._robot
            ):
                self.first_touched[name] = now

    def look(self, now: float, place: Vector, heading: float) -> None:
        """Notes what is in view at the time `now` (s) from `place` (m), in the direction `heading`
        (rad).
        """
        sensors = self._sensors
        unseen = self._unseen
        if not (sensors.view_range and unseen.any()):
            return
        low, high = self._sleep.boxes()
        low = np.vstack([self._low, low])
        high = np.vstack([self._high, high])
        eye = np.array(place)
        direction = np.array(heading)
        seen = in_view(
            low[unseen], high[unseen], eye, direction, sensors.view_range, sensors.view_angle
        )
        for name in self._names[unseen][seen]:
            self._first_seen.setdefault(name, now)
            self._unseen &= self._names != name

    def first_sensed(self, measured: Mapping[str, float]) -> dict[str, float]:
        """When (s) each model was first in view or touched, in order of time; `measured` is when
        the lidar first hit it.
        """
        first = dict(self.first_touched)
        for found in (measured, self._first_seen):
            for name, time in found.items():
                first[name] = min(time, first.get(name, math.inf))
        return dict(sorted(first.items(), key=lambda item: item[1]))


# The least component of a direction along an axis: a ray along the other axis then still crosses,
# far away.
PARALLEL = 1e-12


def in_view(
    low: Floats, high: Floats, eye: Floats, heading: Floats, view_range: float, view_angle: float
) -> Booleans:
    """Which boxes (...) are partly in view of `eye`: within `view_range` (m) and, seen from above,
    in the field of view.

    `low` and `high` (..., 3) m are the boxes' corners, `eye` (..., 3) m is the viewpoint and
    `heading` (...) rad the middle of the field of view, all in the world frame; `view_angle` (rad)
    is its full width. A box above, below or around `eye` is always in the field of view.
    """
    apart = np.linalg.norm(np.maximum(np.maximum(low - eye, eye - high), 0.0), axis=-1)
    seen: Booleans = np.asarray(apart <= view_range)
    if view_angle >= math.tau:
        return seen
    eye = np.broadcast_to(eye, low.shape)[seen]
    heading = np.broadcast_to(heading, seen.shape)[seen]
    low = low[seen] - eye
    high = high[seen] - eye
    drop = np.maximum(np.maximum(low[:, 2], -high[:, 2]), 0.0)
    x, y = np.clip(0.0, low[:, :2], high[:, :2]).T
    offset = np.arctan2(y, x) - heading
    # The nearest visible point is the nearest point of the whole box, or lies on an edge of the
    # field of view.
    shown = np.abs(offset - math.tau * np.round(offset / math.tau)) <= view_angle / 2
    shown |= (x == 0) & (y == 0)
    for edge in (heading - view_angle / 2, heading + view_angle / 2):
        shown |= np.hypot(_entry(low[:, :2], high[:, :2], edge), drop) <= view_range
    seen[seen] = shown
    return seen


def _entry(low: Floats, high: Floats, direction: Floats) -> Floats:
    """The distance (N,) along `direction` (N,) rad from the origin to rectangles (N, 2), m;
    infinite where the ray misses.
    """
    ray = np.column_stack([np.cos(direction), np.sin(direction)])
    ray = np.where(np.abs(ray) < PARALLEL, PARALLEL, ray)
    enter = np.maximum(np.minimum(low / ray, high / ray).max(axis=1), 0.0)
    leave = np.maximum(low / ray, high / ray).min(axis=1)
    return np.where(leave >= enter, enter, np.inf)


def still_boxes(world: World) -> dict[str, Bounds]:
    """The boxes around the parts of models that never move, without planes, by model."""
    boxes = {
        model.name: bounds(
            collision for link in still_links(model) for collision in link.collisions
        )
        for model in world.models
    }
    return {name: box for name, box in boxes.items() if box is not None}
