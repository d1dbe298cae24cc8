"""A scenario: which robot goes where in which world, what its failure is, and how to reduce the world.

Written as one YAML file, validated here. Lengths are in m, angles in rad, times in s unless a field's name says otherwise.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]

# What a world may have without being refused for it, if the user says so.
Ignorable = Literal["heightmap", "image", "mesh", "include", "joint"]
IGNORABLE: tuple[str, ...] = Ignorable.__args__


class Section(BaseModel):
    """A part of a scenario: unknown keys are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Spawn(Section):
    """Where the robot's model frame starts, in the world frame; `yaw` about the vertical."""

    x: Finite
    y: Finite
    z: Finite
    yaw: Finite = 0.0


class Reading(Section):
    """How the world's file is understood where it names other files.

    `model_path` are folders that hold models. `stand_ins` maps the beginning of a URI to a simple shape that stands in for what
    cannot be found there, such as `cylinder:0.3,1.0`. `ignore` names kinds of elements to leave out instead of refusing the file.
    """

    model_path: tuple[Path, ...] = ()
    stand_ins: dict[str, str] = {}
    ignore: tuple[Ignorable, ...] = ()


PLAIN = Reading()


class Robot(Section):
    """`model` is an SDF file, relative to the scenario's folder."""

    model: Path
    spawn: Spawn


class Goal(Section):
    """The goal is reached when the robot is within `tolerance` of (x, y), seen from above."""

    x: Finite
    y: Finite
    tolerance: Positive = 0.5


class Sensors(Section):
    """Standard deviations of what is wrong with the robot's measurements, and the view of its range sensor.

    The noise is drawn anew at every reading, a `*_bias` once in a run.
    """

    compass: NotNegative = Field(0.02, description="compass heading, rad")
    compass_bias: NotNegative = Field(0.0, description="constant error of the compass, rad")
    gyro: NotNegative = Field(0.01, description="IMU yaw rate, rad/s")
    gyro_bias: NotNegative = Field(0.0, description="constant error of the yaw rate, rad/s")
    odometry: NotNegative = Field(0.02, description="wheel speeds, as a fraction of the speed")
    odometry_bias: NotNegative = Field(
        0.0, description="constant error of the wheel speeds, as a fraction of the speed"
    )
    view_range: NotNegative = Field(
        0.0, description="how far the robot sees models, m; 0: it only feels what it touches"
    )
    view_angle: Positive = Field(math.tau, le=math.tau, description="field of view about its heading, rad")


class Controller(Section):
    """Go-to-goal driving at a fixed period."""

    period: Positive = Field(0.05, description="time between two commands, s; a whole number of time steps")
    speed: Positive = Field(1.0, description="greatest forward speed, m/s")
    acceleration: Positive = Field(1.0, description="greatest growth of the forward speed, m/s^2")
    turn_rate: Positive = Field(1.0, description="greatest commanded turn rate, rad/s")
    heading_gain: Positive = Field(1.5, description="turn rate for an error of the heading, 1/s")
    skid: Positive = Field(0.48, le=1, description="part of a commanded turn that a skid-steered robot carries out")
    motor_gain: Positive = Field(30.0, description="wheel torque for an error of its speed, N m s/rad")


class FailureSpec(Section):
    """What counts as the same failure: still short of the goal at `timeout`, within `epsilon` of where f ended."""

    epsilon: Positive = Field(0.5, description="greatest distance from the end of f, m")
    timeout: Positive = Field(45.0, description="simulated time the robot has, s")
    similarity: Literal["end-pose", "trajectory"] = "end-pose"


class Reduction(Section):
    """How the world is reduced."""

    algorithm: str = Field("ddenv", description="how the environment is searched; see `ddenv.schemas`")
    pair: str = Field("model2model/avg-trajectory-proximal", description="partitioning/prioritization")
    n_partitions: int = Field(2, ge=2, description="partitions in the first round")
    iterations: int = Field(3, ge=0, le=1000, description="re-runs of a candidate that did not show the failure")
    candidates: Literal["both", "partitions", "complements"] = "both"
    complement_order: Literal["paper", "far-first"] = "paper"
    growth: Literal["paper", "steady"] = Field(
        "paper", description="when n grows: after every round, or after a vain one"
    )
    skip: Literal["known", "implied"] = Field(
        "known", description="what is not tried: judged sets, or also their subsets"
    )
    delta: Positive = Field(0.5, description="change of the angular velocity where trajectoryseg cuts, rad/s")
    prior: Literal["spatial", "uniform"] = Field("spatial", description="where probdd and splitting begin")
    seed: int = Field(0, ge=0, lt=2**31)
    baseline_runs: int = Field(10, ge=1, le=1000, description="runs of the whole world before the first round")


class Simulation(Section):
    """How Drake simulates. `wall_timeout` bounds one test in real time."""

    time_step: Positive = Field(0.005, le=0.05)
    contact: Literal["lagged", "sap", "similar"] = "lagged"
    wall_timeout: Positive = 120.0


class Scenario(Section):
    """Everything one reduction needs to know. `world` is an SDF file, relative to the scenario's folder."""

    name: str = Field(min_length=1, max_length=80)
    description: str = ""
    world: Path
    reading: Reading = PLAIN
    robot: Robot
    goal: Goal
    sensors: Sensors = Sensors()
    controller: Controller = Controller()
    failure: FailureSpec = FailureSpec()
    reduction: Reduction = Reduction()
    simulation: Simulation = Simulation()
    protected: tuple[str, ...] = Field((), description="models that always stay")
