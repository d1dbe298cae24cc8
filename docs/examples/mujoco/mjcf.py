"""A world and a robot of ddenv as MJCF, MuJoCo's own format; needs no MuJoCo.

Boxes, cylinders, spheres, capsules, ellipsoids and planes stay what they are. A mesh is its convex
hull, as in Drake. Models that never move belong to MuJoCo's world body, links of all others are
bodies of their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from ddenv.world.drive import Drive
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Joint,
    Link,
    Mesh,
    Model,
    Plane,
    Sphere,
    World,
    is_fixed,
)
from ddenv.world.pose import Pose

# A robot on a slope must not creep.
OPTIONS = {"cone": "elliptic", "impratio": "10", "integrator": "implicitfast"}
# Stands for no limit: rad, m or N m.
ENDLESS = 1e6


class Unsupported(Exception):
    """What this example does not translate, in one line."""


def mjcf(world: World, robot: Model, start: Pose, drive: Drive, gain: float, step: float) -> str:
    """The text of an MJCF file: the robot's model frame is at `start`, and an actuator for each of
    `drive.joints`, in that order, turns a wheel at the wanted speed, rad/s.

    `gain` (N m s/rad) turns a wheel's speed error into torque, `step` (s) is the time step. Raises
    Unsupported.
    """
    models = (robot, *world.models)
    file = Writer([one.mu for model in models for one in model.collisions])
    option = SubElement(
        file.root, "option", timestep=text(step), gravity=text(*world.gravity), **OPTIONS
    )
    # With several contacts of a pair of shapes, a wheel on the edge of a box is pushed back from
    # the box's side.
    SubElement(option, "flag", multiccd="disable")
    for number, model in enumerate(models):
        # Poses of the robot are those in its own file.
        frame = Pose() if number else start @ robot.pose.inverse()
        file.add_static(model) if model.static else file.add_moving(number, model, frame)
    efforts = {joint.name: min(joint.effort, ENDLESS) for joint in robot.joints}
    motors = SubElement(file.root, "actuator")
    for name in drive.joints:
        limits = text(-efforts[name], efforts[name])
        SubElement(motors, "velocity", joint=named(0, name), kv=text(gain), forcerange=limits)
    indent(file.root)
    return tostring(file.root, encoding="unicode")


def named(number: int, name: str) -> str:
    """The name of a body or a joint in MJCF: that of a model with this number; the robot has 0, the
    world's models count from 1.
    """
    return f"{number} {name}"


def text(*numbers: float) -> str:
    return " ".join(f"{number:.12g}" for number in numbers)


class Writer:
    """An MJCF file that grows. `frictions` are those of all surfaces."""

    def __init__(self, frictions: Sequence[float]) -> None:
        self.root = Element("mujoco")
        SubElement(
            self.root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false"
        )
        self._assets = SubElement(self.root, "asset")
        self._world = SubElement(self.root, "worldbody")
        self._contact = SubElement(self.root, "contact")
        # Of two surfaces MuJoCo takes the friction of the one with the higher priority. Gazebo's
        # ODE takes the smaller one: so the smoother a surface, the higher its priority.
        self._priority = {
            mu: number for number, mu in enumerate(sorted(set(frictions), reverse=True))
        }

    def add_static(self, model: Model) -> None:
        for collision in model.collisions:
            self._add_shape(self._world, collision, Pose())

    def add_moving(self, number: int, model: Model, frame: Pose) -> None:
        """Adds a model whose poses are given in `frame`."""
        bodies: dict[str, Element] = {}
        for link, parent, joint in in_order(model):
            above = self._world if parent is None else bodies[parent.name]
            place = (frame if parent is None else parent.pose.inverse()) @ link.pose
            body = SubElement(above, "body", name=named(number, link.name), **at(place))
            if not model.gravity:
                body.set("gravcomp", "1")
            if joint is None:
                SubElement(body, "freejoint")
            else:
                add_joints(body, joint, link, named(number, joint.name))
            if link.inertia is not None:
                add_inertia(body, link)
            for collision in link.collisions:
                self._add_shape(body, collision, link.pose.inverse())
            bodies[link.name] = body
        if not model.self_collide:
            names = [body.get("name", "") for body in bodies.values()]
            for place, one in enumerate(names):
                for other in names[place + 1 :]:
                    SubElement(self._contact, "exclude", body1=one, body2=other)

    def _add_shape(self, body: Element, collision: Collision, frame: Pose) -> None:
        shape = {
            "friction": text(collision.mu, 0, 0),
            "priority": str(self._priority[collision.mu]),
        }
        SubElement(body, "geom", **self._shape(collision), **at(frame @ collision.pose), **shape)

    def _shape(self, collision: Collision) -> dict[str, str]:
        match collision.shape:
            case Box((x, y, z)):
                return {"type": "box", "size": text(x / 2, y / 2, z / 2)}
            case Cylinder(radius, length):
                return {"type": "cylinder", "size": text(radius, length / 2)}
            case Sphere(radius):
                return {"type": "sphere", "size": text(radius)}
            case Capsule(radius, length):
                return {"type": "capsule", "size": text(radius, length / 2)}
            case Ellipsoid(radii):
                return {"type": "ellipsoid", "size": text(*radii)}
            case Plane():
                return {"type": "plane", "size": "0 0 1"}
            case Mesh(_, vertices):
                name = f"mesh {len(self._assets)}"
                SubElement(self._assets, "mesh", name=name, vertex=text(*vertices.ravel()))
                return {"type": "mesh", "mesh": name}
        raise Unsupported(f"a {type(collision.shape).__name__} is no shape of MuJoCo's")


def in_order(model: Model) -> Iterator[tuple[Link, Link | None, Joint | None]]:
    """The links of a model, each with the link that it hangs on and the joint between them, parents
    first.

    Without a joint a link floats; without a link it hangs on the world. Raises Unsupported where
    joints form a loop.
    """
    joints: dict[str, Joint] = {}
    for joint in model.joints:
        if joint.child in joints:
            raise Unsupported(f"'{model.name}': link '{joint.child}' hangs on two joints")
        joints[joint.child] = joint
    links = {link.name: link for link in model.links}
    waiting = list(model.links)
    done: set[str] = {"world"}
    while waiting:
        ready = [
            link for link in waiting if link.name not in joints or joints[link.name].parent in done
        ]
        if not ready:
            raise Unsupported(f"'{model.name}': its joints form a loop")
        for link in ready:
            joint = joints.get(link.name)
            yield link, None if joint is None else links.get(joint.parent), joint
        done |= {link.name for link in ready}
        waiting = [link for link in waiting if link.name not in done]


def at(place: Pose) -> dict[str, str]:
    return {"pos": text(*place.position), "quat": text(*place.quaternion)}


def add_joints(body: Element, joint: Joint, link: Link, name: str) -> None:
    """Adds `joint` to the body of the link that it moves; MuJoCo gives it in the axes of that
    link.
    """
    if is_fixed(joint):
        return
    frame = link.pose.inverse()
    common = {"pos": text(*(frame @ joint.pose).position), "damping": text(joint.damping)}
    if joint.kind == "ball":
        SubElement(body, "joint", type="ball", name=name, **common)
        return
    if joint.kind not in ("revolute", "continuous", "prismatic", "universal"):
        raise Unsupported(f"joint '{joint.name}': this example has no {joint.kind} joints")
    kind = "slide" if joint.kind == "prismatic" else "hinge"
    limits = {}
    if joint.kind in ("revolute", "prismatic") and (
        joint.lower > -ENDLESS or joint.upper < ENDLESS
    ):
        limits["range"] = text(max(joint.lower, -ENDLESS), min(joint.upper, ENDLESS))
    SubElement(
        body,
        "joint",
        type=kind,
        name=name,
        axis=text(*frame.rotate(joint.axis)),
        **limits,
        **common,
    )
    if joint.axis2 is not None:
        SubElement(
            body,
            "joint",
            type=kind,
            name=f"{name} 2",
            axis=text(*frame.rotate(joint.axis2)),
            **common,
        )


def add_inertia(body: Element, link: Link) -> None:
    assert link.inertia is not None
    place = link.pose.inverse() @ link.inertia.pose
    (xx, yy, zz), (xy, xz, yz) = link.inertia.moments, link.inertia.products
    turn = place.rotation()
    own = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    full = (own[0, 0], own[1, 1], own[2, 2], own[0, 1], own[0, 2], own[1, 2])
    SubElement(
        body,
        "inertial",
        pos=text(*place.position),
        mass=text(link.inertia.mass),
        fullinertia=text(*full),
    )
