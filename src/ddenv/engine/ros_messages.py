"""ROS 2 messages as plain data, with their definitions: what Foxglove, Rerun and `ros2 bag` read.

Names, fields and units are those of ROS 2 (common_interfaces and geometry2): m, s, rad, and quaternions x, y, z, w. What a
message lacks is written as zeros, empty texts and empty lists.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Mesh, Shape, Sphere
from ddenv.world.pose import Pose

Message = dict[str, Any]

_TIME = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec")
_DURATION = ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec")
_HEADER = ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id")
_VECTOR = ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z")
_POINT = ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z")
_TURN = ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w")
_POSE = ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation")
_TWIST = ("geometry_msgs/Twist", "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular")
_TRANSFORM = ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation")
_STAMPED = (
    "geometry_msgs/TransformStamped",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
)
_POSE_COVARIANCE = ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance")
_TWIST_COVARIANCE = ("geometry_msgs/TwistWithCovariance", "geometry_msgs/Twist twist\nfloat64[36] covariance")
_COLOR = ("std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a")
_IMAGE = ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data")
_UV = ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v")
_MESH_FILE = ("visualization_msgs/MeshFile", "string filename\nuint8[] data")
_MARKER = (
    "visualization_msgs/Marker",
    "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\n"
    "std_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\nbool frame_locked\ngeometry_msgs/Point[] points\n"
    "std_msgs/ColorRGBA[] colors\nstring texture_resource\nsensor_msgs/CompressedImage texture\n"
    "visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\nvisualization_msgs/MeshFile mesh_file\n"
    "bool mesh_use_embedded_materials",
)


def _definition(own: str, *parts: tuple[str, str]) -> str:
    """A definition with those that it uses, as ROS 2 joins them."""
    return "".join([own, *(f"\n{'=' * 80}\nMSG: {name}\n{text}" for name, text in parts)])


_BASE = (_TIME, _HEADER)
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
# By name: the whole text of each definition.
DEFINITIONS = {
    TF: _definition("geometry_msgs/TransformStamped[] transforms", _STAMPED, _TRANSFORM, _VECTOR, _TURN, *_BASE),
    ODOMETRY: _definition(
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist",
        *(_POSE_COVARIANCE, _TWIST_COVARIANCE, _POSE, _TWIST, _POINT, _VECTOR, _TURN, *_BASE),
    ),
    SCAN: _definition(
        "std_msgs/Header header\nfloat32 angle_min\nfloat32 angle_max\nfloat32 angle_increment\nfloat32 time_increment\n"
        "float32 scan_time\nfloat32 range_min\nfloat32 range_max\nfloat32[] ranges\nfloat32[] intensities",
        *_BASE,
    ),
    IMU: _definition(
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
        *(_TURN, _VECTOR, *_BASE),
    ),
    WHEELS: _definition(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort", *_BASE
    ),
    TWIST: _definition("std_msgs/Header header\ngeometry_msgs/Twist twist", _TWIST, _VECTOR, *_BASE),
    PLACE: _definition("std_msgs/Header header\ngeometry_msgs/Pose pose", _POSE, _POINT, _TURN, *_BASE),
    WORDS: "string data",
    MARKERS: _definition(
        "visualization_msgs/Marker[] markers",
        *(_MARKER, _DURATION, _POSE, _POINT, _VECTOR, _TURN, _COLOR, _IMAGE, _UV, _MESH_FILE, *_BASE),
    ),
}
# Kinds of markers.
CUBE, SPHERE, CYLINDER, TRIANGLES = 1, 2, 3, 11


def nanoseconds(seconds: float) -> int:
    return round(1e9 * seconds)


def header(seconds: float, frame: str) -> Message:
    whole, part = divmod(nanoseconds(seconds), 1_000_000_000)
    return {"stamp": {"sec": whole, "nanosec": part}, "frame_id": frame}


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Message:
    return {"x": float(x), "y": float(y), "z": float(z)}


def turn(w: float = 1.0, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Message:
    return {"x": float(x), "y": float(y), "z": float(z), "w": float(w)}


def heading(yaw: float) -> Message:
    return turn(math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))


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
    number: int, frame: str, name: str, at: Pose, shape: Shape, color: tuple[float, float, float, float]
) -> Message | None:
    """A shape at `at` in `frame`; None for a plane, which has no end."""
    drawn = _drawn(shape)
    if drawn is None:
        return None
    kind, size, points = drawn
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


def _drawn(shape: Shape) -> tuple[int, Sequence[float], Iterable[Sequence[float]]] | None:
    """The kind of marker, its size along its axes, m, and the corners of its triangles."""
    match shape:
        case Box():
            return CUBE, shape.size, ()
        case Sphere():
            return SPHERE, (2 * shape.radius,) * 3, ()
        case Ellipsoid():
            return SPHERE, tuple(2 * radius for radius in shape.radii), ()
        case Cylinder():
            return CYLINDER, (2 * shape.radius, 2 * shape.radius, shape.length), ()
        case Capsule():
            return CYLINDER, (2 * shape.radius, 2 * shape.radius, shape.length + 2 * shape.radius), ()
        case Mesh():
            return TRIANGLES, (1.0, 1.0, 1.0), shape.vertices[shape.faces].reshape(-1, 3).tolist()
        case _:
            return None
