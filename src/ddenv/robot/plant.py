"""Builds Drake's plant from plain data: a world's models and one robot.

Static models are registered directly on the world body, which keeps their many boxes out of the tree of moving geometry.
There is no visual geometry: nobody looks at a worker.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import AddContactMaterial, GeometryId, ProximityProperties, SceneGraph
from pydrake.geometry import Box as DrakeBox
from pydrake.geometry import Cylinder as DrakeCylinder
from pydrake.geometry import Shape as DrakeShape
from pydrake.geometry import Sphere as DrakeSphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    ModelInstanceIndex,
    PdControllerGains,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    WeldJoint,
)
from pydrake.systems.framework import Diagram, DiagramBuilder

from ddenv.world.model import Box, Collision, Cylinder, Inertia, Joint, Link, Model, Plane, Shape, Sphere, World
from ddenv.world.pose import Pose
from ddenv.world.scenario import Simulation

# Every surface has the same compliance, written down because Drake would otherwise derive it from the masses of the
# world, and removing a model would change the contacts of all others. Two such surfaces in series give 1e5 N/m: a
# Husky sinks in by 1.4 mm.
STIFFNESS = 2e5  # N/m
DISSIPATION = 5.0  # s/m, Hunt-Crossley
GROUND_SIZE = (200.0, 200.0, 1.0)  # m; a half space crashes Drake in worlds of hundreds of boxes
CORNER_RADIUS = 0.002  # m


@dataclass(frozen=True)
class Body:
    """A model in the plant: its links' bodies and start poses, the first link first, and the geometry of all of them."""

    name: str
    instance: ModelInstanceIndex
    links: tuple[RigidBody, ...]
    poses: tuple[Pose, ...]
    geometry: tuple[GeometryId, ...]

    @property
    def base(self) -> RigidBody:
        return self.links[0]


@dataclass(frozen=True)
class Built:
    """The plant of a world: `static` holds the geometry of each static model, `moving` the dynamic ones in the file's order."""

    diagram: Diagram
    plant: MultibodyPlant
    scene_graph: SceneGraph
    robot: Body
    static: dict[str, tuple[GeometryId, ...]]
    moving: dict[str, Body]


def build(world: World, robot: Model, simulation: Simulation, motor_gain: float) -> Built:
    """The finished plant. `motor_gain` (N m s/rad) turns a wheel's speed error into torque.

    Raises ValueError or RuntimeError for what cannot be simulated, such as a moving link without inertia.
    """
    config = MultibodyPlantConfig(
        time_step=simulation.time_step,
        contact_model="point",
        discrete_contact_approximation=simulation.contact,
        # Outputs that follow the state need no extra state, and nothing then has to be reset between two runs.
        use_sampled_output_ports=False,
    )
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlant(config, builder)
    plant.mutable_gravity_field().set_gravity_vector(np.array(world.gravity))
    static = {model.name: _add_static(plant, model) for model in world.models if model.static}
    # The order in which moving models are added decides the order of the solver's unknowns, hence the last bits of every
    # result: it is always the file's order, with the robot first.
    driver = _add_moving(plant, robot, "robot", corners=False)
    _add_motors(plant, robot, driver, motor_gain)
    moving = {
        model.name: _add_moving(plant, model, f"model/{model.name}", corners=True)
        for model in world.models
        if not model.static
    }
    plant.Finalize()
    return Built(builder.Build(), plant, scene_graph, driver, static, moving)


def transform(pose: Pose) -> RigidTransform:
    """`pose` as Drake's transform."""
    return RigidTransform(Quaternion(np.array(pose.quaternion)), np.array(pose.position))


def _add_static(plant: MultibodyPlant, model: Model) -> tuple[GeometryId, ...]:
    return tuple(_register(plant, plant.world_body(), Pose(), model.links, corners=False))


def _add_moving(plant: MultibodyPlant, model: Model, instance_name: str, corners: bool) -> Body:
    instance = plant.AddModelInstance(instance_name)
    links = tuple(plant.AddRigidBody(link.name, instance, _inertia(model, link)) for link in model.links)
    by_name = {link.name: (link.pose, body) for link, body in zip(model.links, links, strict=True)}
    geometry = []
    for link, body in zip(model.links, links, strict=True):
        geometry += _register(plant, body, link.pose.inverse(), (link,), corners)
    for joint in model.joints:
        _add_joint(plant, joint, by_name, instance_name)
    return Body(model.name, instance, links, tuple(link.pose for link in model.links), tuple(geometry))


def _inertia(model: Model, link: Link) -> SpatialInertia:
    if link.inertia is None:
        raise ValueError(f"link '{link.name}' of the moving model '{model.name}' has no <inertial>")
    return spatial_inertia(link.inertia, link.pose)


def spatial_inertia(inertia: Inertia, link: Pose) -> SpatialInertia:
    """`inertia` about the origin of the frame `link`, in its axes. Raises RuntimeError for impossible inertias."""
    place = transform(link.inverse() @ inertia.pose)
    central = RotationalInertia(*inertia.moments, *inertia.products).ReExpress(place.rotation())
    return SpatialInertia.MakeFromCentralInertia(inertia.mass, place.translation(), central)


def _add_joint(
    plant: MultibodyPlant, joint: Joint, by_name: dict[str, tuple[Pose, RigidBody]], instance_name: str
) -> None:
    parent_pose, parent = (Pose(), plant.world_body()) if joint.parent == "world" else by_name[joint.parent]
    child_pose, child = by_name[joint.child]
    # Both frames have the world's axes in the start pose, so that the joint's axis is the one given in the world frame.
    at = RigidTransform(RotationMatrix.Identity(), np.array(joint.pose.position))
    frames = [
        plant.AddFrame(
            FixedOffsetFrame(f"{instance_name}/{joint.name}/{end}", body.body_frame(), transform(pose).inverse() @ at)
        )
        for end, pose, body in (("parent", parent_pose, parent), ("child", child_pose, child))
    ]
    if joint.kind == "fixed":
        plant.AddJoint(WeldJoint(joint.name, *frames, RigidTransform()))
        return
    plant.AddJoint(RevoluteJoint(joint.name, *frames, np.array(joint.axis), joint.lower, joint.upper, joint.damping))


def _add_motors(plant: MultibodyPlant, robot: Model, body: Body, gain: float) -> None:
    for joint in robot.joints:
        if joint.kind != "fixed":
            actuator = plant.AddJointActuator(joint.name, plant.GetJointByName(joint.name, body.instance), joint.effort)
            actuator.set_controller_gains(PdControllerGains(p=0.0, d=gain))


def _register(
    plant: MultibodyPlant, body: RigidBody, frame: Pose, links: Iterable[Link], corners: bool
) -> list[GeometryId]:
    """Registers the collisions of `links` on `body`; `frame` is the world seen from the body."""
    identities = []
    for link in links:
        for collision in link.collisions:
            for shape, pose in _shapes(collision, corners):
                # Drake wants names that differ; nobody reads them.
                name = str(plant.num_collision_geometries())
                place = transform(frame @ pose)
                identities.append(plant.RegisterCollisionGeometry(body, place, shape, name, surface(collision.mu)))
    return identities


def surface(mu: float) -> ProximityProperties:
    """A surface with the friction coefficient `mu`.

    Drake combines two surfaces as 2 a b / (a + b), which lies between the smaller of the two, as Gazebo's ODE has it, and
    twice that. Static and dynamic friction are the same: a difference makes wheels stick and slip at the time step's rate.
    """
    properties = ProximityProperties()
    AddContactMaterial(DISSIPATION, STIFFNESS, CoulombFriction(mu, mu), properties)
    return properties


def _shapes(collision: Collision, corners: bool) -> list[tuple[DrakeShape, Pose]]:
    shape, pose = collision.shape, collision.pose
    if isinstance(shape, Plane):
        return [(DrakeBox(*GROUND_SIZE), pose @ Pose((0.0, 0.0, -GROUND_SIZE[2] / 2)))]
    shapes = [(_shape(shape), pose)]
    if corners and isinstance(shape, Box):
        shapes += [(DrakeSphere(CORNER_RADIUS), pose @ Pose(corner)) for corner in _corners(shape)]
    return shapes


def _corners(box: Box) -> list[tuple[float, float, float]]:
    """Centres of spheres in the corners of a moving box: a face that rests on one point alone would creep."""
    halves = [max(size / 2 - CORNER_RADIUS, 0.0) for size in box.size]
    signs = [(sx, sy, sz) for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]
    return [tuple(sign * half for sign, half in zip(triple, halves, strict=True)) for triple in signs]


def _shape(shape: Shape) -> DrakeShape:
    if isinstance(shape, Box):
        return DrakeBox(*shape.size)
    if isinstance(shape, Cylinder):
        return DrakeCylinder(shape.radius, shape.length)
    if isinstance(shape, Sphere):
        return DrakeSphere(shape.radius)
    raise ValueError(f"{type(shape).__name__} cannot be simulated")
