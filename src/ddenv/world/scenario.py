"""A scenario: which robot goes where in which world, what its failure is, and how to reduce the
world.

Written as one YAML file, validated here. Lengths are in m, angles in rad, times in s unless a
field's name says otherwise.
"""

from __future__ import annotations

import math
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, create_model, model_validator
from pydantic_core import PydanticCustomError

from ddenv import settings
from ddenv.settings import FARTHEST, TURNS, Ignorable, MeshReading
from ddenv.text import Data, Names

# Maximum of all other numbers.
LARGEST = 1e6
Coordinate = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST, allow_inf_nan=False)]
Angle = Annotated[float, Field(ge=-TURNS, le=TURNS, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Corner = tuple[Finite, Finite, Finite]
Positive = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST, allow_inf_nan=False)]


class Section(BaseModel):
    """A part of a scenario: unknown keys are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Spawn(Section):
    """Where the robot's model frame starts, in the world frame; `yaw` about the vertical."""

    x: Coordinate
    y: Coordinate
    z: Coordinate
    yaw: Angle = 0.0


class Reading(Section):
    """How the world's file is understood where it names other files.

    `model_path` are folders that hold models. `stand_ins` maps the beginning of a URI to a simple
    shape that stands in for what cannot be found there, such as `cylinder:0.3,1.0`, or `*`, all
    that is missing, to `auto`. `ignore` names kinds of elements to leave out instead of refusing
    the file. With `inside`, each collision of a model that never moves is a model of its own. What
    collides in place of a mesh that is not convex is `mesh`: its convex pieces, or its convex hull.
    """

    model_path: tuple[Path, ...] = ()
    stand_ins: dict[str, str] = {}
    ignore: tuple[Ignorable, ...] = ()
    inside: bool = False
    mesh: MeshReading = "pieces"


PLAIN = Reading()


class Wheels(Section):
    """The joints of the robot's driven wheels by name, those on its left and those on its right."""

    left: Names = Field(min_length=1)
    right: Names = Field(min_length=1)


class Robot(Section):
    """`model` is an SDF or URDF file, relative to the scenario's folder.

    Without `wheels`, every joint that turns about one axis is a driven wheel, on the side of the
    model's x axis where it is.
    """

    model: Path
    spawn: Spawn
    wheels: Wheels | None = None


class Goal(Section):
    """The goal is reached when the robot is within `tolerance` of (x, y), seen from above."""

    x: Coordinate
    y: Coordinate
    tolerance: Positive = 0.5


class Lidar(Section):
    """A range sensor that turns about the robot's vertical; by default a SICK LMS1xx as a Husky
    carries it.

    `x`, `y`, `z` (m) are its place in the frame of the robot's first link. Beams are spread evenly
    over `angle`, the middle one straight ahead.
    """

    rate: Positive = Field(default=10.0, description="scan rate, Hz")
    beams: int = Field(default=541, ge=2, le=10_000)
    angle: Positive = Field(
        default=math.radians(270), le=math.tau, description="field of view, rad"
    )
    range: Positive = Field(default=20.0, description="maximum range, m")
    nearest: NotNegative = Field(default=0.05, description="minimum range, m")
    noise: NotNegative = Field(default=0.01, description="standard deviation of a range, m")
    x: Coordinate = 0.30
    y: Coordinate = 0.0
    z: Coordinate = 0.36


class Sensors(Section):
    """Standard deviations of what is wrong with the robot's measurements, how often it measures,
    and its range sensor.

    The noise is drawn anew at every reading, a `*_bias` once in a run. A period is rounded to whole
    time steps.
    """

    compass: NotNegative = Field(default=0.02, description="compass heading, rad")
    compass_bias: NotNegative = Field(default=0.0, description="constant error of the compass, rad")
    gyro: NotNegative = Field(default=0.01, description="IMU yaw rate, rad/s")
    gyro_bias: NotNegative = Field(default=0.0, description="constant error of the yaw rate, rad/s")
    tilt: NotNegative = Field(default=0.005, description="IMU roll and pitch, rad")
    odometry: NotNegative = Field(
        default=0.02, description="wheel speeds, as a fraction of the speed"
    )
    odometry_bias: NotNegative = Field(
        default=0.0, description="constant error of the wheel speeds, as a fraction of the speed"
    )
    view_range: NotNegative = Field(
        default=0.0,
        description="how far the robot sees models, m; 0: it only feels what it touches",
    )
    view_angle: Positive = Field(
        default=math.tau, le=math.tau, description="field of view about its heading, rad"
    )
    compass_rate: Positive = Field(default=10.0, description="reading rate, Hz")
    imu_rate: Positive = Field(default=20.0, description="reading rate, Hz")
    odometry_rate: Positive = Field(default=20.0, description="reading rate, Hz")
    lidar: Lidar | None = Field(default=None, description="a robot without one is blind")


class Planner(Section):
    """How the controller `costmap` finds its way, as move_base does: a map of what the lidar sees
    rolls along with the robot.
    """

    size: float = Field(default=12.0, ge=4, le=100, description="length and width of the map, m")
    resolution: float = Field(default=0.1, ge=0.02, le=0.5, description="cell size of the map, m")
    padding: NotNegative = Field(default=0.05, description="clearance kept around the robot, m")
    inflation: NotNegative = Field(
        default=0.6, description="distance within which obstacles add cost, m"
    )
    look_ahead: Positive = Field(default=0.8, description="look-ahead distance on the plan, m")
    replan: Positive = Field(default=2.0, description="maximum time between two plans, s")
    patience: Positive = Field(
        default=4.0, description="time without progress before the robot tries to recover, s"
    )
    recoveries: int = Field(
        default=6, ge=0, description="attempts to recover in a row before the robot gives up"
    )
    lowest: Coordinate = Field(
        default=0.1, description="minimum height of an obstacle above where the robot stands, m"
    )


class Controller(Section):
    """Who drives the robot, at a fixed period, and within which limits.

    `use` is `straight` (to the goal in a straight line), `costmap` (around what the lidar sees, see
    `planner`), or your own `module:Class`, whose module is searched in the scenario's folder first
    and which is given `options`.
    """

    use: str = Field(default="straight", pattern=r"^(straight|costmap|[\w.]+:\w+)$")
    options: Data = {}
    period: Positive = Field(
        default=0.05, description="time between two commands, s; a whole number of time steps"
    )
    speed: Positive = Field(default=1.0, description="maximum forward speed, m/s")
    acceleration: Positive = Field(default=1.0, description="maximum forward acceleration, m/s^2")
    turn_rate: Positive = Field(default=1.0, description="maximum commanded turn rate, rad/s")
    heading_gain: Positive = Field(default=1.5, description="turn rate per heading error, 1/s")
    skid: Positive = Field(
        default=0.43,
        le=1,
        description="share of a commanded turn that is carried out; 1 without skidding",
    )
    motor_gain: Positive = Field(
        default=30.0, description="wheel torque per wheel speed error, N m s/rad"
    )
    planner: Planner = Planner()
    answer_within: Positive = Field(
        default=1.0, description="real time that your own controller has for a command, s"
    )


def _with_as_printed(schema: Data) -> None:
    one = settings.SETTINGS["as_printed"]
    schema["properties"][one.name] = {
        "type": "boolean",
        "default": one.default,
        "description": one.summary,
    }


class _Printed(Section):
    """`as_printed: true` in a scenario file stands for the settings that it sets; it is not kept
    beside them.
    """

    model_config = ConfigDict(json_schema_extra=_with_as_printed)

    @model_validator(mode="before")
    @classmethod
    def _spelled_out(cls, data: Any) -> Any:
        if not isinstance(data, dict) or "as_printed" not in data:
            return data
        given = {key: value for key, value in data.items() if key != "as_printed"}
        if not isinstance(data["as_printed"], bool):
            raise _wrong(f"should be true or false, found {data['as_printed']!r:.40}")
        if not data["as_printed"]:
            return given
        for name, value in settings.PRINTED.items():
            if given.setdefault(name, value) != value:
                raise _wrong(
                    f"the paper has {name}: {value}, but {name} is {given[name]!r:.40}; leave "
                    "one of them out"
                )
        return given

    @property
    def as_printed(self) -> bool:
        """Whether all of the settings that it stands for are the paper's."""
        return settings.is_printed(self.__dict__)


def _wrong(words: str) -> PydanticCustomError:
    return PydanticCustomError("as_printed", "{words}", {"words": words})


def _section(name: str, section: str, base: type[Section] = Section) -> Any:
    """The model of a section whose keys are settings."""
    declaration = settings.SECTIONS[section]
    hints = get_type_hints(declaration)
    fields: Data = {
        each.name: (hints[each.name], _field(each))
        for each in settings.declared(section, declaration)
        if each.stored
    }
    return create_model(
        name, __base__=base, __module__=__name__, __doc__=declaration.__doc__, **fields
    )


def _field(one: settings.Setting) -> Any:
    finite = False if one.kind is float else None
    limits: Data = {"ge": one.least, "gt": one.above, "le": one.most, "allow_inf_nan": finite}
    given = {limit: value for limit, value in limits.items() if value is not None}
    return Field(one.default, description=one.summary, **given)


# Type checkers see the declarations.
if TYPE_CHECKING:

    class Reduction(settings.Reduction, Section):
        pass

    class FailureSpec(settings.Failure, Section):
        pass

    class Simulation(settings.Simulation, Section):
        pass

else:
    Reduction = _section("Reduction", "reduction", _Printed)
    FailureSpec = _section("FailureSpec", "failure")
    Simulation = _section("Simulation", "simulation")


def seed_of(reduction: Reduction, run: int) -> int:
    """The seed of run number `run` of each environment."""
    if reduction.seeds == "consecutive":
        return reduction.seed + run
    # Some simulators take no more than 31 bits.
    return int.from_bytes(blake2b(f"{reduction.seed} {run}".encode(), digest_size=4).digest()) >> 1


class Oracle(Section):
    """What runs the robot in place of Drake: any simulator, as a command or as a class in Python.

    `command` is started in `folder`, by default the scenario's, without a shell; `{world}` stands
    for an SDF file, `{scenario}` for a scenario in that world, `{seed}` for a number and `{log}`
    for the file of its pose log (without it, what the command prints). `use` is a `module:Class` in
    its place, whose module is searched in `folder` first.
    """

    command: str | None = Field(default=None, min_length=1)
    use: str | None = Field(default=None, pattern=r"^[\w.]+:\w+$")
    name: str = Field(default="", max_length=40, description="its name in results")
    folder: Path | None = Field(
        default=None,
        description="where the command starts or the module lies, if not in the scenario's folder",
    )

    @model_validator(mode="after")
    def _one_of_two(self) -> Oracle:
        if (self.command is None) == (self.use is None):
            raise PydanticCustomError("oracle", "needs either command, or use: a class in Python")
        return self

    @property
    def program(self) -> str:
        """The command or the class, as it is written."""
        return self.command or self.use or ""


class Whole(Section):
    """What a part of a world has from the whole of it, so that its runs stay the same to the last
    bit. `ddenv export` writes it.

    What is lower than `floor` (m) has fallen out of the world. `corners` (m) are the lowest and the
    highest of the box around its models: the ground reaches beyond it. `moving` models can move,
    and share the time that is spent on how piles move.
    """

    floor: Finite
    corners: tuple[Corner, Corner] | None
    moving: int = Field(ge=0, le=10_000_000)


class Scenario(Section):
    """Everything one reduction needs to know. `world` is an SDF file or model directives, relative
    to the scenario's folder.

    `folder` is where an own controller's module and an oracle's command or module are found, by
    default the scenario's folder.
    """

    name: str = Field(min_length=1, max_length=80)
    description: str = ""
    world: Path
    folder: Path = Path()
    reading: Reading = PLAIN
    robot: Robot
    goal: Goal
    sensors: Sensors = Sensors()
    controller: Controller = Controller()
    oracle: Oracle | None = Field(default=None, description="a simulator other than Drake")
    failure: FailureSpec = FailureSpec()
    reduction: Reduction = Reduction()
    simulation: Simulation = Simulation()
    protected: Names = Field(default=(), description="models that always stay")
    whole: Whole | None = Field(default=None, description="the world that this one is a part of")
