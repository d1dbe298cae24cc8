"""The streams of a run as messages: transforms, sensors, estimate, commands, models."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from ddenv.engine.ros_messages import (
    IMU,
    MARKERS,
    ODOMETRY,
    PLACE,
    SCAN,
    TF,
    TWIST,
    WHEELS,
    WORDS,
    Message,
    header,
    heading,
    marker,
    pose,
    transform,
    twist,
    vector,
)
from ddenv.engine.single_test import Subject
from ddenv.robot.protocol import Estimate, Imu, Reading, Scan, Setup, Twist, WheelSpeeds
from ddenv.robot.result import RunResult
from ddenv.world import scenario
from ddenv.world.model import Link, Model, Shape
from ddenv.world.pose import Pose

Color = tuple[float, float, float, float]
# Topic, kind, time (s), message. Topics without a slash in front get the run's name.
Row = tuple[str, str, float, Message]
# All runs are in one frame, and all transforms on one topic, as tools expect; other frames begin with the run's name.
MAP, TRANSFORMS = "map", "/tf"
ROBOT_COLOR, LEFT_COLOR, ALWAYS_COLOR = (0.95, 0.75, 0.1, 1.0), (0.85, 0.45, 0.15, 1.0), (0.6, 0.6, 0.6, 1.0)


@dataclass(frozen=True)
class Chosen:
    """A test to write, under a name of its own; `full` if it was not cut short."""

    name: str
    test: int
    models: frozenset[str]
    seed: int
    full: bool

    def frame(self, name: str) -> str:
        return f"{self.name}/{name}"


@dataclass
class Streams:
    """What a controller was given and what it commanded, in order."""

    setup: Setup | None = None
    heard: list[tuple[Reading, Twist | WheelSpeeds]] = field(default_factory=list)

    def begin(self, setup: Setup) -> None:
        self.setup, self.heard = setup, []

    def hear(self, reading: Reading, command: Twist | WheelSpeeds) -> None:
        self.heard.append((reading, command))


def messages(one: Chosen, result: RunResult, streams: Streams, subject: Subject) -> Iterator[Row]:
    """What is still, what moved, and what the robot sensed and did."""
    goal, removable, base = subject.scenario.goal, frozenset(subject.elements), one.frame("base_link")
    there = [model for model in subject.world.models if model.name in one.models or model.name not in removable]
    yield "goal", PLACE, 0.0, {"header": header(0.0, MAP), "pose": pose(Pose((goal.x, goal.y, 0.0)))}
    yield "models", MARKERS, 0.0, {"markers": [*_of_models(one, there, result)]}
    yield "robot", MARKERS, 0.0, {"markers": [*_of_robot(subject.robot, base)]}
    for child, rows in ((base, result.trajectory), *((one.frame(name), rows) for name, rows in result.motions.items())):
        for seconds, *at in rows.tolist():
            yield TRANSFORMS, TF, seconds, {"transforms": [transform(seconds, MAP, child, at)]}
    for name, seconds in sorted(result.first_touched.items(), key=lambda touched: touched[1]):
        yield "touched", WORDS, seconds, {"data": name}
    joints = streams.setup.joints if streams.setup else ()
    for reading, command in streams.heard:
        yield from _sensed(reading, joints, base, subject.scenario.sensors.lidar)
        yield _commanded(reading.time, command, base)


def _sensed(reading: Reading, joints: Sequence[str], base: str, lidar: scenario.Lidar | None) -> Iterator[Row]:
    at = reading.time
    yield "odom", ODOMETRY, at, _odometry(at, reading.estimate, base)
    if reading.wheels is not None:
        yield "joint_states", WHEELS, at, _wheels(at, joints, reading.wheels)
    if reading.imu is not None:
        yield "imu", IMU, at, _imu(at, reading.imu, reading.estimate.heading, base)
    if reading.scan is not None and lidar is not None:
        scan, frame = reading.scan, f"{base}/lidar"
        there = transform(scan.time, base, frame, (*scan.origin, 1.0, 0.0, 0.0, 0.0))
        yield TRANSFORMS, TF, scan.time, {"transforms": [there]}
        yield "scan", SCAN, scan.time, _scan(scan, frame, lidar)


def _odometry(seconds: float, guess: Estimate, base: str) -> Message:
    covariance = [0.0] * 36
    # Of x, y and the turn about z.
    for place, deviation in zip((0, 7, 35), guess.spread, strict=True):
        covariance[place] = deviation**2
    at = {"position": vector(guess.x, guess.y), "orientation": heading(guess.heading)}
    return {
        "header": header(seconds, MAP),
        "child_frame_id": base,
        "pose": {"pose": at, "covariance": covariance},
        "twist": {"twist": twist(guess.speed, guess.turn_rate), "covariance": [0.0] * 36},
    }


def _imu(seconds: float, imu: Imu, yaw: float, base: str) -> Message:
    return {
        "header": header(seconds, base),
        "orientation": pose(Pose.from_rpy(0.0, 0.0, 0.0, imu.roll, imu.pitch, yaw))["orientation"],
        "orientation_covariance": [0.0] * 9,
        "angular_velocity": vector(0.0, 0.0, imu.yaw_rate),
        "angular_velocity_covariance": [0.0] * 9,
        "linear_acceleration": vector(),
        # In ROS 2, -1 says that it is not measured.
        "linear_acceleration_covariance": [-1.0, *[0.0] * 8],
    }


def _scan(scan: Scan, frame: str, lidar: scenario.Lidar) -> Message:
    angles = scan.angles
    return {
        "header": header(scan.time, frame),
        "angle_min": float(angles[0]),
        "angle_max": float(angles[-1]),
        "angle_increment": float(angles[1] - angles[0]),
        "time_increment": 0.0,
        "scan_time": 1.0 / lidar.rate,
        "range_min": lidar.nearest,
        "range_max": lidar.range,
        "ranges": scan.ranges.tolist(),
        "intensities": [],
    }


def _commanded(seconds: float, command: Twist | WheelSpeeds, base: str) -> Row:
    if isinstance(command, WheelSpeeds):
        names = sorted(command.speeds)
        return "cmd_wheels", WHEELS, seconds, _wheels(seconds, names, [command.speeds[name] for name in names])
    values = {"header": header(seconds, base), "twist": twist(command.speed, command.turn_rate)}
    return "cmd_vel", TWIST, seconds, values


def _wheels(seconds: float, joints: Sequence[str], speeds: Sequence[float]) -> Message:
    """Speeds of wheel joints, rad/s."""
    speeds = [float(speed) for speed in speeds]
    return {"header": header(seconds, ""), "name": list(joints), "position": [], "velocity": speeds, "effort": []}


def _of_models(one: Chosen, models: Iterable[Model], result: RunResult) -> Iterator[Message]:
    """A marker for each shape: of a model that moves in its own frame, else in that of the map."""
    number = 0
    for model in models:
        moves = model.name in result.motions
        frame, origin = (one.frame(model.name), model.links[0].pose.inverse()) if moves else (MAP, Pose())
        color = LEFT_COLOR if model.name in one.models else ALWAYS_COLOR
        for shape, at, own in _shapes(model):
            number += 1
            if drawn := marker(number, frame, model.name, origin @ at, shape, own or color):
                yield drawn


def _of_robot(robot: Model, base: str) -> Iterator[Message]:
    origin = robot.links[0].pose.inverse()
    for number, (shape, at, color) in enumerate(_shapes(robot)):
        if drawn := marker(number, base, "robot", origin @ at, shape, color or ROBOT_COLOR):
            yield drawn


def _shapes(model: Model) -> Iterator[tuple[Shape, Pose, Color | None]]:
    """Shape, pose and colour of each visual, or of each collision of a link that has none."""
    for link in model.links:
        yield from _of_link(link)


def _of_link(link: Link) -> Iterator[tuple[Shape, Pose, Color | None]]:
    if link.visuals:
        return ((item.shape, item.pose, item.color) for item in link.visuals)
    return ((item.shape, item.pose, None) for item in link.collisions)
