"""Runs as an MCAP file: what Foxglove, Rerun and `ros2 bag` show. The streams are made again from the seeds, bit for bit.

Transforms, sensors, estimate, commands and models of each run are messages, as ROS 2 has them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from itertools import islice
from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

from ddenv.engine.judging import rows_of
from ddenv.engine.ros_messages import (
    DEFINITIONS,
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
    nanoseconds,
    pose,
    transform,
    twist,
    vector,
)
from ddenv.engine.single_test import plan
from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.robot.protocol import Estimate, Imu, Reading, Scan, Setup, Twist, WheelSpeeds
from ddenv.robot.result import Progress, RunResult
from ddenv.robot.simulation.template import Variants
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.runs.nearest import nearest
from ddenv.runs.reasons import GOAL, F, reasons
from ddenv.runs.subject import Subject, read_subject
from ddenv.world import scenario
from ddenv.world.access import write_file
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


def write_mcap(run: Path, target: Path, progress: Callable[[str, float], None]) -> list[str]:
    """Makes the failing run, that of what is left, and one that reaches its goal again (`_chosen` says which), and writes their
    streams to `target`; returns a line about each.

    `progress(name, seconds)` gets the simulated time, s. Raises UserError, also for runs by a simulator of the user's own and for
    runs that give other bits here; then nothing is written.
    """
    if target.exists():
        raise UserError(f"{target}: exists already; choose another name")
    with RunFile(run) as file:
        subject = read_subject(file)
        if subject.scenario.oracle is not None:
            raise UserError(f"{run}: a simulator of your own made it; only runs on Drake have streams to write")
        chosen = [_named(subject, name, test) for name, test in _chosen(file)]
        stored = {one.test: rows_of(file, one.test) for one in chosen}
    if not chosen:
        raise UserError(f"{run}: f is not known yet, so there is no run to write; run it first: ddenv resume {run}")
    template = Variants(subject.world, subject.robot, subject.scenario)
    said, output = [], BytesIO()
    writer = Writer(output)
    schemas = {name: writer.register_msgdef(name, text) for name, text in DEFINITIONS.items()}
    for one in chosen:
        streams = Streams()
        result = template.run(one.models, one.seed, _progress(progress, one.name), one.full, streams)
        if not np.array_equal(result.trajectory, stored[one.test]):
            raise UserError(f"{run}: test {one.test} gives other bits here: another Drake or another processor made it")
        for topic, kind, seconds, message in messages(one, result, streams, subject):
            whole = topic if topic.startswith("/") else f"/{one.name}/{topic}"
            writer.write_message(whole, schemas[kind], message, nanoseconds(seconds))
        said.append(f"/{one.name}: test {one.test}, seed {one.seed}, {result.simulated_seconds:.1f} s")
    writer.finish()  # type: ignore[no-untyped-call]
    write_file(target, output.getvalue())
    return said


def _progress(progress: Callable[[str, float], None], name: str) -> Progress:
    return lambda seconds, *_: progress(name, seconds)


def _chosen(file: RunFile) -> Iterator[tuple[str, int]]:
    """Names and tests: one that shows f, the last one of what is left, and one that reaches its goal.

    That is in the nearest world that passes, where it is known, and then the first one has its seed; else in what is left
    without a model of it.
    """
    state = fold(file.events())
    passes = nearest(file, state)
    pair = None if passes is None else passes.parting
    if state.f_test is not None:
        alike = pair is not None and state.tests[pair.with_test - 1].outcome == F
        yield "whole", pair.with_test if alike and pair is not None else state.f_test.id
    if state.evidence_test is not None:
        yield "left", state.evidence_test
    if pair is not None:
        yield "passing", pair.without_test
        return
    found = () if current(state) is None else reasons(file, state)
    passing = (each.parting for each in found if each.parting and each.ends[0].kind == GOAL)
    for parting in islice(passing, 1):
        yield "passing", parting.without_test


def _named(subject: Subject, name: str, number: int) -> Chosen:
    (trial,) = plan(subject, test=number)
    cut = subject.state is not None and subject.state.tests[number - 1].cut
    return Chosen(name, number, trial.keep, trial.seed, not cut)


# The messages.


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
        "twist": {"twist": twist(guess.speed, guess.turn_rate)},
    }


def _imu(seconds: float, imu: Imu, yaw: float, base: str) -> Message:
    return {
        "header": header(seconds, base),
        "orientation": pose(Pose.from_rpy(0.0, 0.0, 0.0, imu.roll, imu.pitch, yaw))["orientation"],
        "angular_velocity": vector(0.0, 0.0, imu.yaw_rate),
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
        "scan_time": 1.0 / lidar.rate,
        "range_min": lidar.nearest,
        "range_max": lidar.range,
        "ranges": scan.ranges.tolist(),
    }


def _commanded(seconds: float, command: Twist | WheelSpeeds, base: str) -> Row:
    if isinstance(command, WheelSpeeds):
        names = sorted(command.speeds)
        return "cmd_wheels", WHEELS, seconds, _wheels(seconds, names, [command.speeds[name] for name in names])
    values = {"header": header(seconds, base), "twist": twist(command.speed, command.turn_rate)}
    return "cmd_vel", TWIST, seconds, values


def _wheels(seconds: float, joints: Sequence[str], speeds: Sequence[float]) -> Message:
    """Speeds of wheel joints, rad/s."""
    return {"header": header(seconds, ""), "name": list(joints), "velocity": [float(speed) for speed in speeds]}


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
