"""Draws the world, the robot and the marks of a run on the stage."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from meshcat.geometry import (
    LineBasicMaterial,
    LineSegments,
    Mesh,
    MeshLambertMaterial,
    PointsGeometry,
    TriangularMeshGeometry,
)

from ddenv.scene import colors, mesh
from ddenv.scene.colors import Color
from ddenv.scene.mesh import Surface
from ddenv.scene.shot import Shot
from ddenv.scene.stage import Path, Stage
from ddenv.world.model import Collision, Link, Model, Plane, Visual, World, is_ground
from ddenv.world.pose import Pose, Vector

WORLD: Path = ("world",)
MODELS, LEFT_OUT, REMOVED = (*WORLD, "models"), (*WORLD, "left-out"), (*WORLD, "removed")
ROBOT, EVIDENCE, TRAIL = (*WORLD, "robot"), (*WORLD, "trajectory-of-f"), (*WORLD, "trail")
# Points in one piece of a growing trail: only the last piece is sent again.
PIECE = 24
GROUND_SIZE, GRID_SIZE = 240.0, 60.0  # m
STEEP = 1e-6  # a plane whose unit normal has a smaller z is vertical
LINE = 0.025  # radius of drawn trajectories, m
ABOVE = 0.05  # height of drawn trajectories above the robot's lowest point, m


@dataclass(frozen=True)
class Painted:
    """A surface of one transparency; `tints` (N, 3) are the colours of its vertices."""

    surface: Surface
    tints: np.ndarray
    alpha: float

    def thing(self) -> Mesh:
        geometry = TriangularMeshGeometry(self.surface.vertices, self.surface.faces, color=self.tints)
        # Only the outside is drawn: two-sided faces would cast shadows on themselves.
        return Mesh(geometry, MeshLambertMaterial(vertexColors=True, side=0, opacity=self.alpha))


def paint(model: Model) -> list[Painted]:
    """All visuals of a model, in the frame of its poses. A link without visuals shows its collisions."""
    groups: dict[float, list[tuple[Surface, Color]]] = {}
    default = colors.default_color(model)
    shown = [(item.shape, item.pose, _color(item) or default) for link in model.links for item in _shown(link)]
    vary = len(shown) > 20
    for number, (shape, pose, color) in enumerate(shown):
        if not isinstance(shape, Plane):
            color = colors.varied(color, number) if vary else color
            groups.setdefault(color[3], []).append((mesh.of_shape(shape).at(pose), color))
    return [_painted(parts, alpha) for alpha, parts in groups.items() if alpha > 0]


def _shown(link: Link) -> tuple[Visual, ...] | tuple[Collision, ...]:
    return link.visuals or link.collisions


def _color(item: Visual | Collision) -> Color | None:
    return item.color if isinstance(item, Visual) else None


def _painted(parts: list[tuple[Surface, Color]], alpha: float) -> Painted:
    tints = np.concatenate([np.tile(color[:3], (len(part.vertices), 1)) for part, color in parts])
    return Painted(mesh.merge([part for part, _ in parts]), tints, alpha)


def plain(shape: Surface, color: Color, *, glow: float = 0.0, offset: int = 0) -> Mesh:
    """An object of one colour. `glow` 0..1 is its own light; with `offset` above 0, others in the same plane are drawn over it."""
    options: dict[str, Any] = {}
    if glow:
        red, green, blue, _ = color
        options["emissive"] = colors.hexadecimal((glow * red, glow * green, glow * blue, 1.0))
    if offset:
        options |= {"polygonOffset": True, "polygonOffsetFactor": offset, "polygonOffsetUnits": offset}
    material = MeshLambertMaterial(color=colors.hexadecimal(color), opacity=color[3], side=0, **options)
    return Mesh(TriangularMeshGeometry(shape.vertices, shape.faces), material)


def lines(ends: np.ndarray, color: Color) -> LineSegments:
    """Line segments between pairs of `ends` (2 N, 3)."""
    material = LineBasicMaterial(color=colors.hexadecimal(color), opacity=color[3])
    return LineSegments(PointsGeometry(np.asarray(ends, dtype=np.float32).T), material)


def outline(model: Model, shape: Surface) -> np.ndarray:
    """Ends (24, 3) of the 12 edges of the box around `shape` in the axes of the model; world frame."""
    own = shape.at(model.pose.inverse()).vertices
    low, high = own.min(axis=0), own.max(axis=0)
    corners = np.array([[(high if bit >> axis & 1 else low)[axis] for axis in range(3)] for bit in range(8)])
    pairs = [(a, a | 1 << axis) for axis in range(3) for a in range(8) if not a >> axis & 1]
    return Surface(corners[np.array(pairs).ravel()], shape.faces).at(model.pose).vertices


def safe_name(number: int, name: str) -> str:
    """A name for the browser's tree: unique by its number, without special characters of paths or pages."""
    kept = "".join(char if char.isalnum() or char in "-_. " else "_" for char in name)[:40]
    return f"{number:03d} {kept}"


def path_on_ground(samples: np.ndarray, lowest: float) -> np.ndarray:
    """Points (N, 3) below a robot at rows (t, x, y, z, qw, qx, qy, qz) whose lowest point has z = `lowest` in its frame."""
    w, x, y, z = samples[:, 4:8].T
    up = np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    return samples[:, 1:4] + (lowest + ABOVE) * up


class Scenery:
    """The objects of one run. Every element is drawn once; a change of environment only shows and hides elements."""

    def __init__(self, stage: Stage, world: World, robot: Model, elements: Iterable[str]) -> None:
        self._stage = stage
        self._first = {model.name: model.links[0].pose for model in world.models}
        self._keys: dict[str, str] = {}
        self._moved: set[str] = set()
        self._pieces = 0
        elements = frozenset(elements)
        surfaces = [
            self._draw_model(number, model, model.name in elements) for number, model in enumerate(world.models)
        ]
        self.surface = mesh.merge(surfaces)
        self.ground = _ground(world)
        self._draw_ground()
        self._lowest = self._draw_robot(robot)

    def height(self, x: float, y: float) -> float:
        """Height of the highest surface at (x, y), m."""
        ground = None if self.ground is None else _height_of(self.ground, x, y)
        heights = [height for height in (mesh.height_at(self.surface, x, y), ground) if height is not None]
        return max(heights, default=0.0)

    def show(self, shot: Shot) -> None:
        """Shows the environment of `shot`, all models at their initial poses."""
        for name, key in self._keys.items():
            self._stage.show((*MODELS, key), name in shot.models)
            self._stage.show((*LEFT_OUT, key), name in shot.left_out)
            self._stage.show((*REMOVED, key), name in shot.removed)
        for name in self._moved:
            self._stage.move((*MODELS, self._keys[name]), Pose())
        self._moved.clear()

    def place_robot(self, pose: Pose) -> None:
        """Puts the robot's first link at `pose`."""
        self._stage.move(ROBOT, pose, newest_only=True)

    def place_model(self, name: str, pose: Pose) -> None:
        """Puts the first link of a moving model at `pose`."""
        if name in self._keys:
            self._moved.add(name)
            self._stage.move((*MODELS, self._keys[name]), pose @ self._first[name].inverse(), newest_only=True)

    def evidence(self, samples: np.ndarray | None) -> None:
        """Draws the robot's path in the run that shows f."""
        self._stage.delete(EVIDENCE)
        if samples is not None and len(samples):
            path = mesh.tube(path_on_ground(samples, self._lowest), LINE)
            self._draw_path(EVIDENCE, path, colors.EVIDENCE)

    def trail(self, samples: np.ndarray) -> None:
        """Draws the robot's path so far; fewer `samples` than before start a new one."""
        points = path_on_ground(samples, self._lowest) if len(samples) else np.zeros((0, 3))
        pieces = -(-max(0, len(points) - 1) // PIECE)
        if pieces < self._pieces or not pieces:
            self._stage.delete(TRAIL)
            self._pieces = 0
        for piece in range(max(0, self._pieces - 1), pieces):
            path = mesh.tube(points[piece * PIECE : (piece + 1) * PIECE + 1], LINE)
            self._draw_path((*TRAIL, str(piece)), path, colors.TRAIL)
        self._pieces = pieces

    def _draw_path(self, at: Path, tube: Surface, color: Color) -> None:
        if len(tube.faces):
            self._stage.draw(at, plain(tube, color, glow=0.4), shadow=False)

    def _draw_model(self, number: int, model: Model, element: bool) -> Surface:
        key = safe_name(number, model.name)
        painted = paint(model)
        for part, item in enumerate(painted):
            self._stage.draw((*MODELS, key, str(part)), item.thing(), shadow=item.alpha == 1)
        shape = mesh.merge([item.surface for item in painted])
        if element:
            self._keys[model.name] = key
            if len(shape.vertices):
                edges = outline(model, shape)
                self._stage.draw((*LEFT_OUT, key), lines(edges, colors.LEFT_OUT), shadow=False)
                self._stage.draw((*REMOVED, key), lines(edges, colors.REMOVED), shadow=False)
        return shape

    def _draw_ground(self) -> None:
        if self.ground is None:
            return
        pose = self.ground
        sheet = mesh.box((GROUND_SIZE, GROUND_SIZE, 0.02)).at(pose @ Pose((0.0, 0.0, -0.01)))
        self._stage.draw((*WORLD, "ground"), plain(sheet, colors.GROUND, offset=2), shadow=False)
        half = GRID_SIZE / 2
        at = np.arange(-half, half + 0.5)
        across = np.array([[[x, -half, 0.002], [x, half, 0.002]] for x in at]).reshape(-1, 3)
        grid = Surface(np.concatenate([across, across[:, [1, 0, 2]]]), mesh.EMPTY.faces).at(pose)
        self._stage.draw((*WORLD, "grid"), lines(grid.vertices, colors.GRID), shadow=False)

    def _draw_robot(self, robot: Model) -> float:
        to_first = robot.links[0].pose.inverse()
        lowest = 0.0
        for part, item in enumerate(paint(robot)):
            item = Painted(item.surface.at(to_first), item.tints, item.alpha)
            lowest = min(lowest, float(item.surface.vertices[:, 2].min()))
            self._stage.draw((*ROBOT, str(part)), item.thing())
        return lowest


def _ground(world: World) -> Pose | None:
    """The pose at the origin of the plane that is highest there, which may slope; None without planes."""
    planes = (
        collision.pose
        for model in world.models
        if is_ground(model)
        for collision in model.collisions
        if isinstance(collision.shape, Plane)
    )
    grounds = [
        Pose((0.0, 0.0, height), plane.quaternion)
        for plane in planes
        if (height := _height_of(plane, 0.0, 0.0)) is not None
    ]
    return max(grounds, key=lambda ground: ground.position[2], default=None)


def _height_of(plane: Pose, x: float, y: float) -> float | None:
    """The height of `plane` at (x, y), m; None if it is vertical."""
    a, b, c = plane.rotate((0.0, 0.0, 1.0))
    px, py, pz = plane.position
    return pz - (a * (x - px) + b * (y - py)) / c if abs(c) > STEEP else None


def mark(stage: Stage, name: str, position: Vector, radius: float, color: Color) -> None:
    """Draws a ring of `radius` m around `position` with a pin above it, visible from afar and from above."""
    path = (*WORLD, name)
    pin = [
        mesh.ring(radius, 0.05),
        mesh.frustum(0.0, 0.13, 0.4).at(Pose((0.0, 0.0, 0.75))),
        mesh.sphere(0.13).at(Pose((0.0, 0.0, 0.97))),
    ]
    stage.draw(path, plain(mesh.merge(pin), color, glow=0.35), shadow=False)
    stage.move(path, Pose(position))


def flag(stage: Stage, name: str, position: Vector, radius: float, color: Color) -> None:
    """Draws a ring of `radius` m around `position` with a flag in it."""
    path = (*WORLD, name)
    parts = [
        mesh.ring(radius, 0.05),
        mesh.cylinder(0.025, 1.5).at(Pose((0.0, 0.0, 0.75))),
        mesh.box((0.55, 0.02, 0.34)).at(Pose((0.28, 0.0, 1.33))),
    ]
    stage.draw(path, plain(mesh.merge(parts), color, glow=0.35), shadow=False)
    stage.move(path, Pose(position))


def circle(stage: Stage, name: str, position: Vector, radius: float, color: Color) -> None:
    """Draws a ring of `radius` m around `position`."""
    path = (*WORLD, name)
    stage.draw(path, plain(mesh.ring(radius, 0.05), color, glow=0.35), shadow=False)
    stage.move(path, Pose(position))
