"""Builds Drake's plant from plain data: a world's models and one robot.

What never moves is registered on the world body, which keeps its many boxes out of Drake's tree of
moving geometry. There is no visual geometry: nobody looks at a worker.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import cast

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    SceneGraph,
    SceneGraphInspector,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    Frame,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    UniversalJoint,
    WeldJoint,
)
from pydrake.multibody.tree import Joint as DrakeJoint
from pydrake.systems.framework import Diagram, DiagramBuilder

from ddenv.robot.drake.shapes import Solid, link_solids, to_drake, transform, wheel_friction
from ddenv.world.drive import Drive
from ddenv.world.extent import Bounds, bounds
from ddenv.world.model import Inertia, Joint, Link, Model, World, held_with, is_fixed, still_links
from ddenv.world.pose import Pose
from ddenv.world.scenario import Simulation

# Where the twins of models wait that are not at rest: this deep, and this far from each other, m.
# Shapes in one place would make Drake's search for contacts slow.
DEEP = -1e5
DEEPER = -2e5
APART = 1e3
MANY = 8  # a model with more shapes than this has a twin with bodies of its own, see `StaticProxy`


@dataclass(frozen=True, kw_only=True)
class Part:
    """A collision shape of a twin on the world's body, at `pose` in the frame of the model's link
    with the number `link`.

    While it is not needed it waits at `away` in the world.
    """

    geometry: GeometryId
    link: int
    shape: Shape
    pose: RigidTransform
    away: RigidTransform


@dataclass(frozen=True)
class StaticProxy:
    """What stands for a model where it lies at rest: `parts`, or where it has many shapes a body
    for each link.

    `geometry` are its shapes, `places` the frames that such bodies are welded to, each with where
    it waits in the world while it is not needed. To move a shape of the world takes Drake longer
    the more shapes the plant has: half a millisecond in a world of boards, 12 ms among 3,200. To
    move a frame takes it microseconds, but each body costs 14 us in every step.
    """

    geometry: tuple[GeometryId, ...]
    parts: tuple[Part, ...] = ()
    places: tuple[tuple[FixedOffsetFrame, RigidTransform], ...] = ()


@dataclass(frozen=True, kw_only=True)
class Body:
    """A model in the plant, the first link first.

    `links` are the links' bodies, `poses` their start poses in the world frame, `geometry` the
    collision geometry of the links that can move. `bounds` are the boxes around the links in each
    link's own frame; None for a link that cannot move or has no geometry.
    """

    name: str
    instance: ModelInstanceIndex
    links: tuple[RigidBody, ...]
    poses: tuple[Pose, ...]
    geometry: tuple[GeometryId, ...]
    bounds: tuple[Bounds | None, ...]

    @property
    def base(self) -> RigidBody:
        return self.links[0]


@dataclass(frozen=True, kw_only=True)
class Built:
    """The plant of a world.

    `static` is the geometry that never moves, by model: that of static models, and of links of
    dynamic models that are fixed to the world. `moving` are the dynamic models in the order in
    which they were added; `twins` stand for those of them that float. `own_pairs` are the
    geometries of each two links of a model that touch each other: none, unless it collides with
    itself. `apart` are sets of shapes that never touch each other, since others touch in their
    place (`Placed.touches`).
    """

    diagram: Diagram
    plant: MultibodyPlant
    scene_graph: SceneGraph
    robot: Body
    static: dict[str, tuple[GeometryId, ...]]
    moving: dict[str, Body]
    twins: dict[str, StaticProxy]
    own_pairs: dict[str, list[tuple[list[GeometryId], list[GeometryId]]]]
    apart: tuple[tuple[GeometrySet, GeometrySet], ...]

    def shapes(self) -> list[tuple[str, tuple[GeometryId, ...]]]:
        """The collision shapes of each model but the robot: first those that never move, then those
        that can.
        """
        return [
            *self.static.items(),
            *((name, body.geometry) for name, body in self.moving.items()),
        ]


def build(
    world: World, robot: Model, drive: Drive, simulation: Simulation, motor_gain: float
) -> Built:
    """The finished plant. `motor_gain` (N m s/rad) turns a wheel's speed error into torque.

    Raises ValueError or RuntimeError for what cannot be simulated, such as a moving link without
    inertia.
    """
    config = MultibodyPlantConfig(
        time_step=simulation.time_step,
        contact_model="point",
        discrete_contact_approximation=simulation.contact,
        # Sampled outputs would be extra state to reset between two runs.
        use_sampled_output_ports=False,
    )
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(config, builder)
    plant.mutable_gravity_field().set_gravity_vector(np.array(world.gravity))
    wheels = wheel_friction(robot, drive)
    # The order in which models are added is the order of the solver's unknowns, which decides the
    # last bits of every result. The robot comes first.
    models = sorted(world.models, key=_place_in_order)
    static, touched_by = _add_still(plant, models, wheels)
    driver = _add_moving(plant, scene_graph, robot, "robot", None)
    for joint in (joint for joint in robot.joints if joint.name in drive.joints):
        actuator = plant.AddJointActuator(
            joint.name, plant.GetJointByName(joint.name, driver.instance), joint.effort
        )
        actuator.set_controller_gains(PdControllerGains(p=0.0, d=motor_gain))
    moving = {
        model.name: _add_moving(plant, scene_graph, model, f"model/{model.name}", wheels)
        for model in models
        if not model.static and model.links
    }
    # Those that can lie anywhere, and touch themselves nowhere.
    twins = {
        model.name: _twin(plant, model, wheels)
        for model in models
        if model.name in moving
        and not model.self_collide
        and all("world" not in (j.parent, j.child) for j in model.joints)
    }
    filters = scene_graph.collision_filter_manager()
    for body in moving.values():
        own = GeometrySet(list(static[body.name])), GeometrySet(list(body.geometry))
        filters.Apply(CollisionFilterDeclaration().ExcludeBetween(*own))
    plant.Finalize()
    apart = _apart(scene_graph.model_inspector(), touched_by, [driver, *moving.values()])
    for one, other in apart:
        filters.Apply(CollisionFilterDeclaration().ExcludeBetween(one, other))
    # Drake has filtered links that a joint connects.
    filtered = scene_graph.model_inspector().CollisionFiltered
    shapes = {
        name: map(plant.GetCollisionGeometriesForBody, body.links) for name, body in moving.items()
    }
    own_pairs = {
        name: [
            pair
            for pair in combinations(filter(None, found), 2)
            if not filtered(pair[0][0], pair[1][0])
        ]
        for name, found in shapes.items()
    }
    return Built(
        diagram=builder.Build(),
        plant=plant,
        scene_graph=scene_graph,
        robot=driver,
        static=static,
        moving=moving,
        twins=twins,
        own_pairs=own_pairs,
        apart=apart,
    )


def _apart(
    inspector: SceneGraphInspector, touched_by: dict[str, list[GeometryId]], bodies: Sequence[Body]
) -> tuple[tuple[GeometrySet, GeometrySet], ...]:
    """The pairs of sets of shapes that never touch each other; none if there is nothing that only
    some shapes can touch.
    """
    if not touched_by["spheres"]:
        return ()
    moving = [geometry for body in bodies for geometry in body.geometry]
    spheres = {geometry for geometry in moving if isinstance(inspector.GetShape(geometry), Sphere)}
    others = [geometry for geometry in moving if geometry not in spheres]
    return (
        (GeometrySet(touched_by["spheres"]), GeometrySet(others)),
        (GeometrySet(touched_by["others"]), GeometrySet(list(spheres))),
    )


def _add_still(
    plant: MultibodyPlant, models: Sequence[Model], wheels: float
) -> tuple[dict[str, tuple[GeometryId, ...]], dict[str, list[GeometryId]]]:
    """The geometry of what never moves, by model, and by what it touches (`Placed.touches`).

    Its order does not depend on how shapes are grouped into models, either.
    """
    solids = [
        (model.name, solid)
        for model in models
        for link in still_links(model)
        for solid in link_solids(model, link, wheels, corners=False)
    ]
    solids.sort(key=lambda pair: (pair[1].pose.position, pair[1].pose.quaternion, pair[1].touches))
    geometry: dict[str, list[GeometryId]] = {model.name: [] for model in models}
    touched_by: dict[str, list[GeometryId]] = {"all": [], "spheres": [], "others": []}
    for name, solid in solids:
        [identity] = _register(plant, plant.world_body(), Pose(), [solid])
        geometry[name].append(identity)
        touched_by[solid.touches].append(identity)
    return {name: tuple(identities) for name, identities in geometry.items()}, touched_by


def _place_in_order(model: Model) -> tuple[object, ...]:
    """What sorts models by where they are and what shapes they have; by name only where these are
    equal.

    So a run does not depend on the order of the models in a file.
    """
    shapes = [
        (link.pose, [(one.pose, one.shape) for one in link.collisions]) for link in model.links
    ]
    return model.pose.position, model.pose.quaternion, repr(shapes), model.name


def _twin(plant: MultibodyPlant, model: Model, wheels: float) -> StaticProxy:
    # Without corners: the model rests on nothing while its twin stands for it.
    solids = [link_solids(model, link, wheels, corners=False) for link in model.links]
    if sum(map(len, solids)) <= MANY:
        parts: list[Part] = []
        for number, link in enumerate(model.links):
            for solid in solids[number]:
                name = str(plant.num_collision_geometries())
                away = RigidTransform(
                    to_drake(np.array([APART * plant.num_collision_geometries(), 0.0, DEEP]))
                )
                geometry = plant.RegisterCollisionGeometry(
                    plant.world_body(), away, solid.shape, name, solid.surface
                )
                place = transform(link.pose.inverse() @ solid.pose)
                parts.append(
                    Part(geometry=geometry, link=number, shape=solid.shape, pose=place, away=away)
                )
        return StaticProxy(tuple(part.geometry for part in parts), parts=tuple(parts))
    instance = plant.AddModelInstance(f"twin/{model.name}")
    shapes: list[GeometryId] = []
    places: list[tuple[FixedOffsetFrame, RigidTransform]] = []
    for link, of_link in zip(model.links, solids, strict=True):
        away = RigidTransform(to_drake(np.array([APART * plant.num_bodies(), 0.0, DEEPER])))
        loose = FixedOffsetFrame(f"at/{link.name}", plant.world_frame(), away, instance)
        frame = cast(FixedOffsetFrame, plant.AddFrame(loose))
        body = plant.AddRigidBody(link.name, instance, SpatialInertia.Zero())
        plant.AddJoint(WeldJoint(f"weld/{link.name}", frame, body.body_frame(), RigidTransform()))
        shapes += _register(plant, body, link.pose.inverse(), of_link)
        places.append((frame, away))
    return StaticProxy(tuple(shapes), places=tuple(places))


def _add_moving(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    model: Model,
    instance_name: str,
    wheels: float | None,
) -> Body:
    """Adds a model of the world, or (`wheels` is None) the robot."""
    instance = plant.AddModelInstance(instance_name)
    still = {link.name for link in still_links(model)}
    bodies = []
    for link in model.links:
        inertia = SpatialInertia.Zero() if link.name in still else _inertia(model, link)
        bodies.append(plant.AddRigidBody(link.name, instance, inertia))
    geometry: list[GeometryId] = []
    boxes: list[Bounds | None] = []
    for link, body in zip(model.links, bodies, strict=True):
        if link.name in still:
            boxes.append(None)
            continue
        solids = link_solids(model, link, wheels, corners=wheels is not None)
        geometry += _register(plant, body, link.pose.inverse(), solids)
        boxes.append(bounds(link.collisions, link.pose.inverse()))
    if not model.self_collide:
        scene_graph.collision_filter_manager().Apply(
            CollisionFilterDeclaration().ExcludeWithin(GeometrySet(geometry))
        )
    by_name = {link.name: (link, body) for link, body in zip(model.links, bodies, strict=True)}
    for joint in model.joints:
        _add_joint(plant, joint, by_name, instance_name)
    if not model.gravity:
        plant.set_gravity_enabled(instance, False)
    poses = tuple(link.pose for link in model.links)
    return Body(
        name=model.name,
        instance=instance,
        links=tuple(bodies),
        poses=poses,
        geometry=tuple(geometry),
        bounds=tuple(boxes),
    )


def _inertia(model: Model, link: Link) -> SpatialInertia:
    if link.inertia is not None:
        return spatial_inertia(link.inertia, link.pose)
    together = held_with(model, link.name)
    if not any(one.inertia is not None for one in model.links if one.name in together):
        why = "has no <inertial>, and neither has any link fixed to it"
        raise ValueError(f"link '{link.name}' of the moving model '{model.name}' {why}")
    return SpatialInertia.Zero()


def _register(
    plant: MultibodyPlant, body: RigidBody, frame: Pose, solids: Iterable[Solid]
) -> list[GeometryId]:
    """Registers `solids` on `body`; `frame` is the pose of the world in the body's frame."""
    identities = []
    for solid in solids:
        # Drake requires different names.
        name = str(plant.num_collision_geometries())
        place = transform(frame @ solid.pose)
        identities.append(
            plant.RegisterCollisionGeometry(body, place, solid.shape, name, solid.surface)
        )
    return identities


def spatial_inertia(inertia: Inertia, link: Pose) -> SpatialInertia:
    """`inertia` about the origin of the frame `link`, in its axes. Raises RuntimeError for an
    impossible inertia.
    """
    place = transform(link.inverse() @ inertia.pose)
    central = RotationalInertia(*inertia.moments, *inertia.products).ReExpress(place.rotation())
    return SpatialInertia.MakeFromCentralInertia(inertia.mass, place.translation(), central)


# Drake's ball joint has roll, pitch and yaw, and locks (gimbal lock) where the child's x axis is
# parallel to the parent's z axis.
# These joint axes, the same on both sides, are oblique to every axis of the world, so that no swing
# about one of those, like that of something that hangs straight down, reaches the lock.
BALL_AXES = np.array([[0.8, 0.0, -0.6], [0.36, 0.8, 0.48], [0.48, -0.6, 0.64]])


def _add_joint(
    plant: MultibodyPlant,
    joint: Joint,
    links: dict[str, tuple[Link, RigidBody]],
    instance_name: str,
) -> None:
    """Adds `joint` between two of `links`, or between one of them and the world. Raises ValueError
    for an unknown kind.
    """
    # The axes of both frames, as columns, are the same in the start pose, so that every joint
    # position is 0 there.
    axes = BALL_AXES if joint.kind == "ball" else np.eye(3)
    if joint.kind == "universal":
        first = np.array(joint.axis)
        second = np.array(joint.axis2)
        # Exactly orthogonal: the axes of a file are so only to a few digits.
        second = second - first * (first @ second)
        second /= math.sqrt(second @ second)
        axes = np.column_stack([first, second, np.cross(first, second)])
    at = RigidTransform(RotationMatrix(to_drake(axes)), to_drake(np.array(joint.pose.position)))
    frames: list[Frame] = []
    for end, name in (("parent", joint.parent), ("child", joint.child)):
        pose, body = (
            (Pose(), plant.world_body())
            if name == "world"
            else (links[name][0].pose, links[name][1])
        )
        place = transform(pose).inverse() @ at
        frames.append(
            plant.AddFrame(
                FixedOffsetFrame(f"{instance_name}/{joint.name}/{end}", body.body_frame(), place)
            )
        )
    parent, child = frames
    plant.AddJoint(_joint(joint, parent, child))


def _joint(joint: Joint, parent: Frame, child: Frame) -> DrakeJoint:
    if is_fixed(joint):
        return WeldJoint(joint.name, parent, child, RigidTransform())
    axis = to_drake(np.array(joint.axis))
    match joint.kind:
        case "revolute" | "continuous":
            return RevoluteJoint(
                joint.name, parent, child, axis, joint.lower, joint.upper, joint.damping
            )
        case "prismatic":
            return PrismaticJoint(
                joint.name, parent, child, axis, joint.lower, joint.upper, joint.damping
            )
        case "ball":
            return BallRpyJoint(joint.name, parent, child, joint.damping)
        case "universal":
            return UniversalJoint(joint.name, parent, child, joint.damping)
    raise ValueError(f"joint '{joint.name}': {joint.kind} joints cannot be simulated")
