"""An arm as a simulator: Drake's own InverseDynamicsController moves it among the models of each
test's directives.

The hand comes down in front of a corridor between a shelf and a bin, and reaches into it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pydrake.geometry import DefaultProximityProperties, SceneGraphConfig
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.controllers import InverseDynamicsController
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

import ddenv

HERE = Path(__file__).parent
PERIOD = 0.1  # between two rows, s
UPPER_ARM, FOREARM, HAND, SHOULDER = (
    0.40,
    0.35,
    0.082,
    0.95,
)  # lengths, and the height of the shoulder, m
# The hand's way, straight from one place to the next: when it shall be where, s and m.
VIA = ((1.0, (0.33, -0.10, 0.95)), (2.0, (0.33, 0.0, 0.835)), (4.0, (0.74, 0.0, 0.835)))
STIFFNESS = 400.0  # of each joint, 1/s^2
ZERO = math.radians(0.4)  # how far the zero of a joint's encoder is off, standard deviation
CONTACT = MultibodyPlantConfig(time_step=0.01, contact_model="hydroelastic_with_fallback")
SURFACES = SceneGraphConfig(
    default_proximity_properties=DefaultProximityProperties(compliance_type="compliant")
)


def joints(x: float, y: float, z: float) -> list[float]:
    """The angles, rad, of the joints with which the level hand is at a place, m."""
    out, up = math.hypot(x, y) - HAND, z - SHOULDER
    elbow = math.acos((out**2 + up**2 - UPPER_ARM**2 - FOREARM**2) / (2 * UPPER_ARM * FOREARM))
    bend = math.atan2(FOREARM * math.sin(elbow), UPPER_ARM + FOREARM * math.cos(elbow))
    shoulder = math.atan2(out, up) - bend
    return [math.atan2(y, x), shoulder, elbow, math.pi / 2 - shoulder - elbow, 0.0]


def way(start: np.ndarray, off: np.ndarray) -> PiecewisePolynomial:
    """The joints' way from `start` along VIA, each angle `off` by as much as its encoder, rad."""
    times, places = zip(*VIA, strict=True)
    fine = np.linspace(times[0], times[-1], 13)
    hand = [np.interp(fine, times, along) for along in zip(*places, strict=True)]
    angles = [start, *(joints(*place) for place in zip(*hand, strict=True))]
    return PiecewisePolynomial.CubicShapePreserving(
        [0.0, *fine], np.transpose(angles) + off[:, None], True
    )


def with_hand(plant: MultibodyPlant) -> RigidBody:
    """Finishes `plant` with the gripper on the arm's flange, and returns its hand."""
    Parser(plant).AddModels(str(HERE / "gripper.urdf"))
    hand = plant.GetBodyByName("hand")
    # The flange's z axis is the hand's x axis.
    mount = RigidTransform(RollPitchYaw(0, -math.pi / 2, 0), [0, 0, 0.022])
    plant.WeldFrames(plant.GetFrameByName("flange"), hand.body_frame(), mount)
    plant.Finalize()
    return hand


def pose(plant: MultibodyPlant, context: Context, body: RigidBody) -> list[float]:
    there = plant.EvalBodyPoseInWorld(context, body)
    turn = there.rotation().ToQuaternion()
    return [*there.translation(), turn.x(), turn.y(), turn.z(), turn.w()]


class Reach:
    def __init__(self, setup: ddenv.SimulatorSetup) -> None:
        self.goal = setup.scenario["goal"]
        # The controller knows the arm, and nothing of what stands around it.
        self.alone = MultibodyPlant(0.0)
        Parser(self.alone).AddModels(str(HERE / "arm.urdf"))
        self.alone.WeldFrames(self.alone.world_frame(), self.alone.GetFrameByName("base"))
        with_hand(self.alone)

    def run(self, world: ddenv.SubWorld, seed: int, timeout: float) -> Iterator[ddenv.Row]:
        builder = DiagramBuilder()
        plant, _ = AddMultibodyPlant(CONTACT, SURFACES, builder)
        parser = Parser(plant)
        parser.package_map().Add("arm", str(HERE))
        parser.AddModels(str(world.path))
        hand, arm = with_hand(plant), plant.GetModelInstanceByName("arm")
        start = plant.GetDefaultPositions(arm)
        off = np.random.default_rng(seed).normal(0, ZERO, len(start))
        gains = np.full(len(start), STIFFNESS)
        control = InverseDynamicsController(self.alone, gains, 0 * gains, 2 * np.sqrt(gains), False)
        builder.AddSystem(control)
        wanted = builder.AddSystem(TrajectorySource(way(start, off), 1, True))
        builder.Connect(wanted.get_output_port(), control.get_input_port_desired_state())
        builder.Connect(plant.get_state_output_port(arm), control.get_input_port_estimated_state())
        builder.Connect(control.get_output_port_control(), plant.get_actuation_input_port(arm))

        simulator = Simulator(builder.Build())
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        plant.SetPositions(context, arm, start + off)
        bodies = {
            f"arm::{body.name()}": body for body in map(plant.get_body, plant.GetBodyIndices(arm))
        }
        free = map(plant.get_body, sorted(plant.GetFloatingBaseBodies()))
        bodies |= {plant.GetModelInstanceName(body.model_instance()): body for body in free}
        for time in np.arange(0, timeout + PERIOD / 2, PERIOD):
            simulator.AdvanceTo(time)
            at = pose(plant, context, hand)
            yield time, at, {name: pose(plant, context, body) for name, body in bodies.items()}
            if math.dist(at[:2], (self.goal["x"], self.goal["y"])) <= self.goal["tolerance"]:
                return ddenv.Ended(True)
        return ddenv.Ended(False)
