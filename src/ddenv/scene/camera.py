"""Places the camera and the sun: the path from start to goal fills the picture, seen at an angle
from its right side.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.scene import colors
from ddenv.scene.draw import WORLD
from ddenv.scene.mesh import EMPTY, Surface, hides
from ddenv.scene.stage import DRAWN, Stage
from ddenv.world.pose import Pose, Vector, vector

# A robot whose start and goal are nearer to each other than this, m, is small itself, as the hand
# of an arm is.
NEAR = 1.5
SMALLEST = 0.1
FIELD_OF_VIEW = 38.0  # vertical, degrees
# Of the camera above the horizon, degrees: the first from which most of the way is seen, over the
# walls of a building.
ELEVATIONS = (32.0, 50.0, 68.0)
SEEN = 5  # places of the way that are looked at
EYE = 0.3  # their height above the ground, m
ASIDE = 20.0  # rotation of the camera from perpendicular to the path towards the start, degrees
_CAMERA = ("Cameras", "default", "rotated", DRAWN)


@dataclass(frozen=True, slots=True)
class View:
    """The camera looks at `center`, m; `camera` and `sun` are relative to it, m; `radius` is the
    visible distance around it, m.
    """

    center: Vector
    camera: Vector
    sun: Vector
    radius: float


def scale_of(start: Vector, goal: Vector) -> float:
    """The size of what is drawn around a robot: 1 for one that drives, less for a small one."""
    return min(1.0, max(SMALLEST, math.dist(start[:2], goal[:2]) / NEAR))


def view(start: Vector, goal: Vector, around: Surface = EMPTY) -> View:
    """The view of a robot that moves from `start` to `goal`, and is seen over what is `around`."""
    dx = goal[0] - start[0]
    dy = goal[1] - start[1]
    scale = scale_of(start, goal)
    radius = max(2.5 * scale, 0.5 * math.hypot(dx, dy) + 1.8 * scale)
    along = math.atan2(dy, dx)
    center = vector(0.5 * (a + b) for a, b in zip(start, goal, strict=True))
    cameras = [
        _polar(2.2 * radius, along - math.radians(90 + ASIDE), elevation)
        for elevation in ELEVATIONS
    ]
    places = np.linspace(start, goal, SEEN) + np.array([0.0, 0.0, EYE * scale])
    camera = min(cameras, key=lambda camera: sum(hides(around, place, camera) for place in places))
    sun = _polar(3.0 * radius, along - math.radians(165), 50.0)
    return View(center, camera, sun, radius)


def _polar(distance: float, azimuth: float, elevation: float) -> Vector:
    flat = distance * math.cos(math.radians(elevation))
    return (
        flat * math.cos(azimuth),
        flat * math.sin(azimuth),
        distance * math.sin(math.radians(elevation)),
    )


def set_up(stage: Stage, view: View) -> None:
    # The viewer's camera orbits the scene's origin, so the world is moved instead of the camera.
    x, y, z = view.center
    stage.move(WORLD, Pose((-x, -y, -z)))
    east, north, up = view.camera
    # In the camera's frame y points upwards.
    for name, value in (
        ("fov", FIELD_OF_VIEW),
        ("near", 0.1),
        ("far", 600.0),
        ("position", [east, up, -north]),
    ):
        stage.set(_CAMERA, name, value)
    lights = ("PointLightNegativeX", "PointLightPositiveX", "FillLight", "SpotLight")
    for path in (("Grid",), ("Axes",), *(("Lights", name) for name in lights)):
        stage.show(path, False)
    stage.set(("Lights", "AmbientLight", DRAWN), "intensity", 0.62)
    reach = 1.7 * view.radius
    sides = {
        "left": -reach,
        "right": reach,
        "top": reach,
        "bottom": -reach,
        "near": 0.1,
        "far": 8 * view.radius,
    }
    camera = {"type": "OrthographicCamera", **sides}
    shadow = {
        "bias": -0.0004,
        "normalBias": 0.01,
        "radius": 2,
        "mapSize": [2048, 2048],
        "camera": camera,
    }
    matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *view.sun, 1]
    light = {"type": "DirectionalLight", "color": 0xFFFAF2, "intensity": 0.62, "matrix": matrix}
    stage.draw_json(("Lights", "Sun"), {**light, "castShadow": True, "shadow": shadow})
    for name, color in zip(("top_color", "bottom_color"), colors.SKY, strict=True):
        stage.set(("Background",), name, list(color))
