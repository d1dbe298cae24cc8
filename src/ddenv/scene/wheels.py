"""The robot's wheels, which turn as far as its way makes them roll."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ddenv.errors import UserError
from ddenv.scene import mesh
from ddenv.scene.mesh import Surface, paint
from ddenv.text import Data
from ddenv.world.drive import Drive, find_drive, rolled, wheel_links
from ddenv.world.model import Model
from ddenv.world.pose import Pose, Vector, pose_of
from ddenv.world.scenario import Wheels as Named

# Spokes, so that a plain wheel is seen to turn: their width, as part of its radius, and how far
# they stand out of it, m.
SPOKE = 0.12
OUT = 0.003
SPOKE_COLOR = (0.75, 0.76, 0.78, 1.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Wheel:
    """A wheel: its name in the browser, what is drawn around its centre, and in the first link's
    frame its place and `axis`.

    `side` is 0 on the left, 1 on the right. It turns about `axis` as it rolls forward.
    """

    key: str
    painted: Surface
    position: Vector
    axis: Vector
    side: int

    def pose(self, turned: tuple[float, float]) -> Pose:
        """Its pose in the first link's frame, once left and right wheels have `turned`, rad."""
        half = turned[self.side] / 2
        x, y, z = (math.sin(half) * part for part in self.axis)
        return Pose(self.position, (math.cos(half), x, y, z))


class Wheels:
    """The wheels of a robot; none if it has no wheels on two sides, as a robot of another simulator
    may.
    """

    def __init__(self, robot: Model, named: Named | None = None, skid: float = 1.0) -> None:
        """`named` and `skid` are the scenario's wheels and the skid of its controller."""
        self._robot = robot
        self._skid = skid
        self._drive: Drive | None = None
        with suppress(UserError):
            self._drive = find_drive(robot, named)
        self.all = () if self._drive is None else tuple(self._made(self._drive))

    @property
    def body(self) -> Model:
        """The robot without its wheels."""
        joints = () if self._drive is None else self._drive.joints
        driven = (joint for joint in self._robot.joints if joint.name in joints)
        turned = {link.name for joint in driven for link in wheel_links(self._robot, joint)}
        return replace(
            self._robot, links=tuple(link for link in self._robot.links if link.name not in turned)
        )

    def turned(self, rows: np.ndarray) -> np.ndarray:
        """How far left and right wheels have turned at each row of a motion, shape (N, 2), rad; see
        `rolled`.
        """
        if self._drive is None:
            return np.zeros((len(rows), 2))
        return rolled(self._robot, self._drive, self._skid, rows)

    def data(self) -> list[Data]:
        return [{"key": each.key, "axis": list(each.axis), "side": each.side} for each in self.all]

    def _made(self, drive: Drive) -> Iterator[Wheel]:
        joints = {joint.name: joint for joint in self._robot.joints}
        to_first = self._robot.links[0].pose.inverse()
        for number, (name, left, sign) in enumerate(
            zip(drive.joints, drive.left, drive.signs, strict=True)
        ):
            joint = joints[name]
            links = replace(self._robot, links=tuple(wheel_links(self._robot, joint)))
            x, y, z = (sign * part for part in to_first.rotate(joint.axis))
            place = (to_first @ joint.pose).position
            to_wheel = Pose(place).inverse() @ to_first
            wheel = mesh.merge([item.at(to_wheel) for item in paint(links)])
            # Two bars that cross on the axis, on both faces of the wheel.
            along = wheel.vertices @ (x, y, z) if len(wheel.vertices) else np.zeros(1)
            width = float(np.ptp(along)) + 2 * OUT
            middle = float(along.min() + along.max()) / 2
            # The shortest turn from y, along which the bars are made, to the axis.
            turn = (1 + y, z, 0.0, -x) if y > -1 + 1e-9 else (0.0, 1.0, 0.0, 0.0)
            at = pose_of((middle * x, middle * y, middle * z, *turn))
            long = 1.7 * drive.radius
            thick = SPOKE * drive.radius
            bars = [mesh.box(size).at(at) for size in ((long, width, thick), (thick, width, long))]
            spokes = mesh.merge(bars).painted(SPOKE_COLOR)
            whole = replace(mesh.merge([wheel, spokes]), alpha=1.0)
            yield Wheel(
                key=f"wheel {number}",
                painted=whole,
                position=place,
                axis=(x, y, z),
                side=0 if left else 1,
            )
