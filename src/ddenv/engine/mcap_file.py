"""Runs as an MCAP file of ROS 2 messages, made again from the seeds, bit for bit: m, s, rad, and
quaternions x, y, z, w. What a message lacks is written as zeros, empty texts and empty lists.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from mcap_ros2.writer import Writer

from ddenv.engine.judging import rows_of
from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.robot.protocol import Reading, Setup, Twist, WheelSpeeds
from ddenv.robot.result import RunResult
from ddenv.robot.simulation.plant_cache import PlantCache
from ddenv.runfile.fold import fold
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.runs.experiment import Experiment, read_subject
from ddenv.runs.reasons import GOAL, F, nearest, reasons
from ddenv.words.claims import shown
from ddenv.world import scenario
from ddenv.world.access import write_file
from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Mesh, Model, Shape, Sphere, Visual
from ddenv.world.pose import Pose

Message = dict[str, Any]
Color = tuple[float, float, float, float]
# Topic, kind, time (s), message. Topics without a slash in front get the run's name.
Row = tuple[str, str, float, Message]
# All runs are in one frame, and all transforms on one topic, as tools expect; other frames begin
# with the run's name.
MAP = "map"
TRANSFORMS = "/tf"
RESULT = "/result"
ROBOT_COLOR = (0.95, 0.75, 0.1, 1.0)
LEFT_COLOR = (0.85, 0.45, 0.15, 1.0)
ALWAYS_COLOR = (0.6, 0.6, 0.6, 1.0)
# The kinds of messages.
TF = "tf2_msgs/msg/TFMessage"
ODOMETRY = "nav_msgs/msg/Odometry"
SCAN = "sensor_msgs/msg/LaserScan"
IMU = "sensor_msgs/msg/Imu"
WHEELS = "sensor_msgs/msg/JointState"
TWIST = "geometry_msgs/msg/TwistStamped"
PLACE = "geometry_msgs/msg/PoseStamped"
WORDS = "std_msgs/msg/String"
MARKERS = "visualization_msgs/msg/MarkerArray"
KINDS = (TF, ODOMETRY, SCAN, IMU, WHEELS, TWIST, PLACE, WORDS, MARKERS)
# Kinds of markers.
CUBE = 1
SPHERE = 2
CYLINDER = 3
TRIANGLES = 11

# The fields of messages and of their parts.
_FIELDS = {
    TF: "geometry_msgs/TransformStamped[] transforms",
    ODOMETRY: "std_msgs/Header header; string child_frame_id; "
    "geometry_msgs/PoseWithCovariance pose; geometry_msgs/TwistWithCovariance twist",
    SCAN: "std_msgs/Header header; float32 angle_min; float32 angle_max; float32 angle_increment; "
    "float32 time_increment; "
    "float32 scan_time; float32 range_min; float32 range_max; float32[] ranges; float32[] "
    "intensities",
    IMU: "std_msgs/Header header; geometry_msgs/Quaternion orientation; float64[9] "
    "orientation_covariance; "
    "geometry_msgs/Vector3 angular_velocity; float64[9] angular_velocity_covariance; "
    "geometry_msgs/Vector3 linear_acceleration; float64[9] linear_acceleration_covariance",
    WHEELS: (
        "std_msgs/Header header; string[] name; float64[] position; float64[] velocity; "
        "float64[] effort"
    ),
    TWIST: "std_msgs/Header header; geometry_msgs/Twist twist",
    PLACE: "std_msgs/Header header; geometry_msgs/Pose pose",
    WORDS: "string data",
    MARKERS: "visualization_msgs/Marker[] markers",
    "builtin_interfaces/Time": "int32 sec; uint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec; uint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp; string frame_id",
    "std_msgs/ColorRGBA": "float32 r; float32 g; float32 b; float32 a",
    "geometry_msgs/Vector3": "float64 x; float64 y; float64 z",
    "geometry_msgs/Point": "float64 x; float64 y; float64 z",
    "geometry_msgs/Quaternion": "float64 x; float64 y; float64 z; float64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position; geometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose; float64[36] covariance",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear; geometry_msgs/Vector3 angular",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist; float64[36] covariance",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation; "
    "geometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": "std_msgs/Header header; string child_frame_id; "
    "geometry_msgs/Transform transform",
    "sensor_msgs/CompressedImage": "std_msgs/Header header; string format; uint8[] data",
    "visualization_msgs/UVCoordinate": "float32 u; float32 v",
    "visualization_msgs/MeshFile": "string filename; uint8[] data",
    "visualization_msgs/Marker": "std_msgs/Header header; string ns; int32 id; int32 type; "
    "int32 action; geometry_msgs/Pose pose; "
    "geometry_msgs/Vector3 scale; std_msgs/ColorRGBA color; builtin_interfaces/Duration "
    "lifetime; bool frame_locked; "
    "geometry_msgs/Point[] points; std_msgs/ColorRGBA[] colors; string texture_resource; "
    "sensor_msgs/CompressedImage texture; "
    "visualization_msgs/UVCoordinate[] uv_coordinates; string text; string mesh_resource; "
    "visualization_msgs/MeshFile mesh_file; "
    "bool mesh_use_embedded_materials",
}


def definition(kind: str) -> str:
    """The definition of a kind of messages and of all that it uses, as ROS 2 joins them."""
    names = [kind]
    # What a part uses is added while the list is gone through.
    for name in names:
        used = (each.split()[0].partition("[")[0] for each in _FIELDS[name].split("; "))
        names += [each for each in dict.fromkeys(used) if each in _FIELDS and each not in names]
    texts = ["\n".join([f"MSG: {name}", *_FIELDS[name].split("; ")]) for name in names]
    return f"\n{'=' * 80}\n".join(texts).removeprefix(f"MSG: {kind}\n")


@dataclass
class Streams:
    """What a controller was given and what it commanded, in order."""

    setup: Setup | None = None
    heard: list[tuple[Reading, Twist | WheelSpeeds]] = field(default_factory=list)

    def begin(self, setup: Setup) -> None:
        self.setup = setup
        self.heard = []

    def hear(self, reading: Reading, command: Twist | WheelSpeeds) -> None:
        self.heard.append((reading, command))


def write_mcap(run: Path, target: Path) -> list[str]:
    """Makes the runs of `_chosen` again, and writes their streams to `target`; returns a line about
    each.

    Raises UserError, also for runs that give other bits here; then nothing is written.
    """
    if target.exists():
        raise UserError(f"{target}: exists already; choose another name")
    with RunFile(run) as file:
        subject = read_subject(file)
        if subject.scenario.oracle is not None:
            raise UserError(
                f"{run}: a simulator of your own made it; only runs on Drake have streams to write"
            )
        state = fold(file.events())
        chosen = [
            (name, state.test(number), rows_of(file, number))
            for name, number in _chosen(file, state)
        ]
    if not chosen:
        raise UserError(
            f"{run}: f is not known yet, so there is no run to write; run it first: ddenv resume "
            f"{run}"
        )
    template = PlantCache(subject.world, subject.robot, subject.scenario)
    said = []
    output = BytesIO()
    writer = Writer(output)
    schemas = {kind: writer.register_msgdef(kind, definition(kind)) for kind in KINDS}
    writer.write_message(RESULT, schemas[WORDS], {"data": shown(state)}, nanoseconds(0.0))
    for name, test, rows in chosen:
        streams = Streams()
        models = frozenset(state.models_of(test))
        result = template.run(models, test.seed, listener=streams)
        # A test that ended early is written to its end.
        if not np.array_equal(result.trajectory[: len(rows)], rows):
            raise UserError(
                f"{run}: test {test.id} gives different bits here: another Drake or processor "
                "made it"
            )
        for topic, kind, seconds, message in messages(name, models, result, streams, subject):
            whole = topic if topic.startswith("/") else f"/{name}/{topic}"
            writer.write_message(whole, schemas[kind], message, nanoseconds(seconds))
        said.append(f"/{name}: test {test.id}, seed {test.seed}, {result.simulated_seconds:.1f} s")
    writer.finish()  # type: ignore[no-untyped-call]
    write_file(target, output.getvalue())
    return said


def _chosen(file: RunFile, state: RunState) -> Iterator[tuple[str, int]]:
    """Names and tests: one that shows f, the last one of what is left, and one that reaches its
    goal: in the nearest world that passes, where it is known (then the first one has its seed),
    else in what is left without a model of it.
    """
    passes = nearest(file, state)
    pair = None if passes is None else passes.parting
    if state.f_test is not None:
        alike = None if pair is None or state.test(pair.with_test).outcome != F else pair.with_test
        yield "whole", alike or state.f_test.id
    if state.evidence_test is not None:
        yield "left", state.evidence_test
    if pair is not None:
        yield "passing", pair.without_test
        return
    for each in () if current(state) is None else reasons(file, state):
        if each.parting and each.ends[0].kind == GOAL:
            yield "passing", each.parting.without_test
            return


def messages(
    run: str, models: frozenset[str], result: RunResult, streams: Streams, subject: Experiment
) -> Iterator[Row]:
    """What is still, what moved, and what the robot sensed and did in a run of these models."""
    goal = subject.scenario.goal
    removable = frozenset(subject.elements)
    base = f"{run}/base_link"
    yield (
        "goal",
        PLACE,
        0.0,
        {"header": header(0.0, MAP), "pose": pose(Pose((goal.x, goal.y, 0.0)))},
    )
    drawn = []
    for model in subject.world.models:
        if model.name in models or model.name not in removable:
            # What moves is drawn in a frame of its own.
            frame = f"{run}/{model.name}" if model.name in result.motions else MAP
            drawn.append(
                (model, model.name, frame, LEFT_COLOR if model.name in models else ALWAYS_COLOR)
            )
    yield "models", MARKERS, 0.0, _markers(drawn)
    yield "robot", MARKERS, 0.0, _markers([(subject.robot, "robot", base, ROBOT_COLOR)])
    moved = {base: result.trajectory} | {
        f"{run}/{name}": rows for name, rows in result.motions.items()
    }
    for child, rows in moved.items():
        for seconds, *at in rows.tolist():
            yield TRANSFORMS, TF, seconds, {"transforms": [transform(seconds, MAP, child, at)]}
    for name, seconds in sorted(result.first_touched.items(), key=lambda touched: touched[1]):
        yield "touched", WORDS, seconds, {"data": name}
    joints = streams.setup.joints if streams.setup else ()
    for reading, command in streams.heard:
        yield from _sensed(reading, joints, base, subject.scenario.sensors.lidar)
        if isinstance(command, WheelSpeeds):
            names = sorted(command.speeds)
            speeds = _wheels(reading.time, names, [command.speeds[name] for name in names])
            yield "cmd_wheels", WHEELS, reading.time, speeds
        else:
            asked = twist(command.speed, command.turn_rate)
            yield (
                "cmd_vel",
                TWIST,
                reading.time,
                {"header": header(reading.time, base), "twist": asked},
            )


def _sensed(
    reading: Reading, joints: Sequence[str], base: str, lidar: scenario.Lidar | None
) -> Iterator[Row]:
    at = reading.time
    guess = reading.estimate
    covariance = [0.0] * 36
    # Of x, y and the turn about z.
    for place, deviation in zip((0, 7, 35), guess.spread, strict=True):
        covariance[place] = deviation**2
    orientation = turn(math.cos(guess.heading / 2), 0.0, 0.0, math.sin(guess.heading / 2))
    yield (
        "odom",
        ODOMETRY,
        at,
        {
            "header": header(at, MAP),
            "child_frame_id": base,
            "pose": {
                "pose": {"position": vector(guess.x, guess.y), "orientation": orientation},
                "covariance": covariance,
            },
            "twist": {"twist": twist(guess.speed, guess.turn_rate)},
        },
    )
    if reading.wheels is not None:
        yield "joint_states", WHEELS, at, _wheels(at, joints, reading.wheels)
    if reading.imu is not None:
        imu = reading.imu
        yaw = reading.estimate.heading
        yield (
            "imu",
            IMU,
            at,
            {
                "header": header(at, base),
                "orientation": pose(Pose.from_rpy(0.0, 0.0, 0.0, imu.roll, imu.pitch, yaw))[
                    "orientation"
                ],
                "angular_velocity": vector(0.0, 0.0, imu.yaw_rate),
                # In ROS 2, -1 says that it is not measured.
                "linear_acceleration_covariance": [-1.0, *[0.0] * 8],
            },
        )
    if reading.scan is not None and lidar is not None:
        scan = reading.scan
        frame = f"{base}/lidar"
        there = transform(scan.time, base, frame, (*scan.origin, 1.0, 0.0, 0.0, 0.0))
        yield TRANSFORMS, TF, scan.time, {"transforms": [there]}
        angles = scan.angles
        yield (
            "scan",
            SCAN,
            scan.time,
            {
                "header": header(scan.time, frame),
                "angle_min": float(angles[0]),
                "angle_max": float(angles[-1]),
                "angle_increment": float(angles[1] - angles[0]),
                "scan_time": 1.0 / lidar.rate,
                "range_min": lidar.nearest,
                "range_max": lidar.range,
                "ranges": scan.ranges.tolist(),
            },
        )


def _wheels(seconds: float, joints: Sequence[str], speeds: Sequence[float]) -> Message:
    """Speeds of wheel joints, rad/s."""
    return {
        "header": header(seconds, ""),
        "name": list(joints),
        "velocity": [float(speed) for speed in speeds],
    }


def _markers(models: Iterable[tuple[Model, str, str, Color]]) -> Message:
    drawn: list[Message | None] = []
    for model, name, frame, color in models:
        origin = Pose() if frame == MAP else model.links[0].pose.inverse()
        # Each visual, or each collision of a link that has none.
        for item in (item for link in model.links for item in link.visuals or link.collisions):
            own = item.color if isinstance(item, Visual) else None
            drawn.append(
                marker(len(drawn) + 1, frame, name, origin @ item.pose, item.shape, own or color)
            )
    return {"markers": [one for one in drawn if one]}


def nanoseconds(seconds: float) -> int:
    return round(1e9 * seconds)


def header(seconds: float, frame: str) -> Message:
    whole, part = divmod(nanoseconds(seconds), 1_000_000_000)
    return {"stamp": {"sec": whole, "nanosec": part}, "frame_id": frame}


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Message:
    return {"x": float(x), "y": float(y), "z": float(z)}


def turn(w: float = 1.0, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Message:
    return {"x": float(x), "y": float(y), "z": float(z), "w": float(w)}


def twist(speed: float, turn_rate: float) -> Message:
    return {"linear": vector(speed), "angular": vector(0.0, 0.0, turn_rate)}


def transform(seconds: float, frame: str, child: str, pose: Sequence[float]) -> Message:
    """`pose` is x, y, z, qw, qx, qy, qz of `child` in `frame`."""
    return {
        "header": header(seconds, frame),
        "child_frame_id": child,
        "transform": {"translation": vector(*pose[:3]), "rotation": turn(*pose[3:7])},
    }


def pose(at: Pose) -> Message:
    return {"position": vector(*at.position), "orientation": turn(*at.quaternion)}


def marker(
    number: int, frame: str, name: str, at: Pose, shape: Shape, color: Color
) -> Message | None:
    """A shape at `at` in `frame`; None for a plane, which has no end."""
    # The kind of marker, its size along its axes, m, and the corners of its triangles.
    kind = CUBE
    points = list[Sequence[float]]()
    size: tuple[float, ...] = (1.0, 1.0, 1.0)
    match shape:
        case Box():
            size = shape.size
        case Sphere():
            kind = SPHERE
            size = (2 * shape.radius,) * 3
        case Ellipsoid():
            kind = SPHERE
            size = tuple(2 * radius for radius in shape.radii)
        case Cylinder():
            kind = CYLINDER
            size = (2 * shape.radius, 2 * shape.radius, shape.length)
        case Capsule():
            kind = CYLINDER
            size = (2 * shape.radius, 2 * shape.radius, shape.length + 2 * shape.radius)
        case Mesh():
            kind = TRIANGLES
            points = shape.vertices[shape.faces].reshape(-1, 3).tolist()
        case _:
            return None
    return {
        "header": header(0.0, frame),
        "ns": name,
        "id": number,
        "type": kind,
        "pose": pose(at),
        "scale": vector(*size),
        "color": dict(zip("rgba", color, strict=True)),
        "frame_locked": True,
        "points": [vector(*point) for point in points],
    }
