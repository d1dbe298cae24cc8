"""Draws the world, the robot and the marks of a run on the stage."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from meshcat.geometry import Object

from ddenv.scene import colors, mesh
from ddenv.scene.colors import Color
from ddenv.scene.mesh import Surface, edges_of, lines, merge, outline, paint, plain
from ddenv.scene.shot import Shot
from ddenv.scene.stage import Path, Stage
from ddenv.scene.wheels import Wheels
from ddenv.world.model import Model, Plane, World, is_ground, jointed_links
from ddenv.world.pose import Pose, Vector

WORLD: Path = ("world",)
MODELS = (*WORLD, "models")
LEFT_OUT = (*WORLD, "left-out")
REMOVED = (*WORLD, "removed")
ROBOT = (*WORLD, "robot")
EVIDENCE = (*WORLD, "trajectory-of-f")
TRAIL = (*WORLD, "trail")
# The robot of a second run, its path, and where the two runs part.
GHOST = (*WORLD, "ghost")
GHOST_TRAIL = (*WORLD, "ghost-trail")
PARTING = (*WORLD, "parting")
PARTS: Path = (*WORLD, "parts")
MOST_LETTERS = 200  # of partitions
# Points in one piece of a growing trail: only the last piece is sent again.
PIECE = 24
GROUND_SIZE = 240.0
GRID_SIZE = 60.0  # m
STEEP = 1e-6  # a plane whose unit normal has a smaller z is vertical
LINE = 0.025  # radius of drawn trajectories, m
ABOVE = 0.05  # height of drawn trajectories above the robot's lowest point, m


def safe_name(number: int, name: str) -> str:
    """A name for the browser's tree: unique by its number, without special characters of paths or
    pages.
    """
    kept = "".join(char if char.isalnum() or char in "-_. " else "_" for char in name)[:40]
    return f"{number:03d} {kept}"


def path_on_ground(samples: np.ndarray, lowest: float, above: float = ABOVE) -> np.ndarray:
    """Points (N, 3) below a robot at rows (t, x, y, z, qw, qx, qy, qz) whose lowest point has z =
    `lowest` in its frame.
    """
    w, x, y, z = samples[:, 4:8].T
    up = np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    return samples[:, 1:4] + (lowest + above) * up


# The letter of a partition over a model: the letter, its colour as in CSS, where it belongs, x, y,
# z in m, and what the browser calls the model, "" where it cannot move.
Letter = tuple[str, str, float, float, float, str]


class Scenery:
    """The objects of one run: elements that can move one by one, all others together, anew for each
    environment.

    A browser takes some 10 ms for each object of its own.
    """

    def __init__(self, stage: Stage, world: World, wheels: Wheels, elements: Iterable[str]) -> None:
        """`wheels` are those of the robot, which has its other parts, too."""
        self._stage = stage
        self.scale = 1.0  # of lines, see `scale_of`
        self._first = {model.name: model.links[0].pose for model in world.models}
        # What the browser calls the elements that can move, and with these the links at joints.
        self.keys: dict[str, str] = {}
        self.movers: dict[str, str] = {}
        self._placed: frozenset[str] = frozenset()
        self._pieces = 0
        elements = frozenset(elements)
        # The surfaces of elements that are drawn together, and the edges of all elements.
        self._painted: dict[str, list[Surface]] = {}
        self._edges: dict[str, np.ndarray] = {}
        surfaces = [
            self._draw_model(number, model, model.name in elements)
            for number, model in enumerate(world.models)
        ]
        self.surface = merge(surfaces)
        self.ground = self._draw_ground(world)
        self.wheels = wheels
        self._lowest = self._draw_robot()
        # The lowest and the highest corner of each model.
        self._boxes = {
            model.name: (surface.vertices.min(axis=0), surface.vertices.max(axis=0))
            for model, surface in zip(world.models, surfaces, strict=True)
            if len(surface.vertices)
        }

    def height(self, x: float, y: float) -> float:
        """Height of the highest surface at (x, y), m."""
        ground = None if self.ground is None else _height_of(self.ground, x, y)
        heights = [
            height for height in (mesh.height_at(self.surface, x, y), ground) if height is not None
        ]
        return max(heights, default=0.0)

    def show(self, shot: Shot) -> None:
        for name, key in self.keys.items():
            self._stage.show((*MODELS, key), name in shot.models)
        for path, thing in self._together(shot):
            self._stage.draw(path, thing, shadow=path[: len(MODELS)] == MODELS)

    def _together(self, shot: Shot) -> Iterator[tuple[Path, Object | None]]:
        """What shows the elements that never move, and the edges of those that are gone; None where
        nothing is left to show.
        """
        items = [
            item for name, items in self._painted.items() if name in shot.models for item in items
        ]
        for name, solid in (("still", True), ("still clear", False)):
            some = [item for item in items if (item.alpha == 1) == solid]
            yield (*MODELS, name), merge(some).thing() if some else None
        for group, names, color in (
            (LEFT_OUT, shot.left_out, colors.LEFT_OUT),
            (REMOVED, shot.removed, colors.REMOVED),
        ):
            ends = [self._edges[name] for name in sorted(names) if name in self._edges]
            yield (*group, "all"), lines(np.concatenate(ends), color) if ends else None

    def place_robot(self, pose: Pose, turned: tuple[float, float] = (0.0, 0.0)) -> None:
        """Puts the robot's first link at `pose`, its left and right wheels `turned`, rad."""
        self._stage.move(ROBOT, pose, newest_only=True)
        for wheel in self.wheels.all:
            self._stage.move((*ROBOT, wheel.key), wheel.pose(turned), newest_only=True)

    def place_models(self, poses: Mapping[str, Pose]) -> None:
        """Puts the first links of these elements, and links at joints, at their poses, and all
        others where they start.
        """
        for name in self._placed - set(poses):
            self._stage.move((*MODELS, self.movers[name]), Pose())
        self._placed = frozenset(name for name in poses if name in self.movers)
        for name in sorted(self._placed):
            self._stage.move(
                (*MODELS, self.movers[name]), self.moved(name, poses[name]), newest_only=True
            )

    def moved(self, name: str, pose: Pose) -> Pose:
        """How far a moving model is from its start once its first link is at `pose`."""
        return pose @ self._first[name].inverse()

    def way(self, samples: np.ndarray, ghost: bool) -> bytes:
        """The message that draws the robot's path in a whole run, for one browser."""
        path, color = (GHOST_TRAIL, colors.GHOST_TRAIL) if ghost else (TRAIL, colors.TRAIL)
        return self._stage.drawn(path, self._tube(self._points(samples), color))

    def ghost_of(self, model: Model) -> list[bytes]:
        """The messages that draw a model, as the ghost sees it, for one browser."""
        surface = merge([replace(one, tints=None, alpha=1.0) for one in paint(model)])
        if len(surface.faces):
            return [self._stage.drawn((*GHOST_TRAIL, "model"), plain(surface, colors.GHOST))]
        return []

    def still(self, shot: Shot) -> list[bytes]:
        """The messages that show the environment of `shot` in one browser, but for elements that
        have a name there (`keys`).
        """
        return [self._stage.drawn(path, thing) for path, thing in self._together(shot)]

    def parts(self, groups: Iterable[tuple[str, Color, Iterable[str]]]) -> list[Letter]:
        """Draws edges around the models of each partition: its letter, its colour, its models.
        Returns the first letters.

        They stand over the models where these start; the browser lets the letters and edges of
        models that can move follow them.
        """
        self._stage.delete(PARTS)
        places = list[Letter]()
        edges = dict[Color, list[np.ndarray]]()
        for letter, color, names in groups:
            for name, (low, high) in [
                (name, box) for name in names if (box := self._boxes.get(name)) is not None
            ]:
                ends = edges_of(low, high)
                (x, y) = ((low + high) / 2)[:2]
                listed = len(places) < MOST_LETTERS
                key = self.keys.get(name, "") if listed else ""
                if key:
                    self._stage.draw((*PARTS, key), lines(ends, color), shadow=False)
                else:
                    edges.setdefault(color, []).append(ends)
                if listed:
                    css = f"#{colors.hexadecimal(color):06x}"
                    places.append((letter, css, float(x), float(y), float(high[2]), key))
        # One object for each colour: of thousands of partitions, a browser would take minutes to
        # make one each.
        for number, (color, all_ends) in enumerate(edges.items()):
            self._stage.draw(
                (*PARTS, str(number)), lines(np.concatenate(all_ends), color), shadow=False
            )
        return places

    def evidence(self, samples: np.ndarray | None) -> None:
        tube = None if samples is None else self._tube(self._points(samples), colors.EVIDENCE)
        self._stage.draw(EVIDENCE, tube, shadow=False)

    def trail(self, samples: np.ndarray) -> None:
        """Draws the robot's path so far; fewer `samples` than before start a new one."""
        points = self._points(samples)
        pieces = -(-max(0, len(points) - 1) // PIECE)
        if pieces < self._pieces or not pieces:
            self._stage.delete(TRAIL)
            self._pieces = 0
        for piece in range(max(0, self._pieces - 1), pieces):
            tube = self._tube(points[piece * PIECE : (piece + 1) * PIECE + 1], colors.TRAIL)
            self._stage.draw((*TRAIL, str(piece)), tube, shadow=False)
        self._pieces = pieces

    def _points(self, samples: np.ndarray) -> np.ndarray:
        return path_on_ground(samples, self._lowest, self.scale * ABOVE)

    def _tube(self, points: np.ndarray, color: Color) -> Object | None:
        """A drawn trajectory; None for one without length."""
        tube = mesh.tube(points, self.scale * LINE)
        if len(tube.faces):
            return plain(tube, color, glow=0.4)
        return None

    def _draw_model(self, number: int, model: Model, element: bool) -> Surface:
        painted = paint(model)
        shape = merge(painted)
        if element and len(shape.vertices):
            self._edges[model.name] = outline(model, shape)
        if element and model.static:
            self._painted[model.name] = painted
            return shape
        key = safe_name(number, model.name)
        links = jointed_links(model)
        pieces = {} if links else {key: painted}
        for count, (name, link) in enumerate(links.items()):
            self._first[name] = link.pose
            self.movers[name] = f"{key}/link {count}"
            pieces[self.movers[name]] = paint(replace(model, links=(link,)))
        for place, items in pieces.items():
            for part, item in enumerate(items):
                self._stage.draw((*MODELS, place, str(part)), item.thing(), shadow=item.alpha == 1)
        if element:
            self.keys[model.name] = self.movers[model.name] = key
        return shape

    def _draw_ground(self, world: World) -> Pose | None:
        """Draws the plane that is highest at the origin, which may slope. Returns its pose there;
        None without planes.
        """
        solids = [one for model in world.models if is_ground(model) for one in model.collisions]
        planes = [one.pose for one in solids if isinstance(one.shape, Plane)]
        places = [
            (height, plane)
            for plane in planes
            if (height := _height_of(plane, 0.0, 0.0)) is not None
        ]
        if not places:
            return None
        height, plane = max(places, key=lambda place: place[0])
        pose = Pose((0.0, 0.0, height), plane.quaternion)
        sheet = mesh.box((GROUND_SIZE, GROUND_SIZE, 0.02)).at(pose @ Pose((0.0, 0.0, -0.01)))
        self._stage.draw((*WORLD, "ground"), plain(sheet, colors.GROUND, offset=2), shadow=False)
        half = GRID_SIZE / 2
        at = np.arange(-half, half + 0.5)
        across = np.array([[[x, -half, 0.002], [x, half, 0.002]] for x in at]).reshape(-1, 3)
        grid = Surface(np.concatenate([across, across[:, [1, 0, 2]]]), mesh.EMPTY.faces).at(pose)
        self._stage.draw((*WORLD, "grid"), lines(grid.vertices, colors.GRID), shadow=False)
        return pose

    def _draw_robot(self) -> float:
        body = self.wheels.body
        to_first = body.links[0].pose.inverse()
        pieces: list[tuple[Path, Pose, list[Surface]]] = [
            ((), Pose(), [item.at(to_first) for item in paint(body)])
        ]
        pieces += [
            ((wheel.key,), Pose(wheel.position), [wheel.painted]) for wheel in self.wheels.all
        ]
        lowest = 0.0
        for place, pose, painted in pieces:
            for part, item in enumerate(painted):
                lowest = min(lowest, float(item.at(pose).vertices[:, 2].min()))
                self._stage.draw((*ROBOT, *place, str(part)), item.thing())
                ghost = plain(item, colors.GHOST, glow=0.2)
                self._stage.draw((*GHOST, *place, str(part)), ghost, shadow=False)
            if place:
                self._stage.move((*ROBOT, *place), pose)
                self._stage.move((*GHOST, *place), pose)
        self._stage.show(GHOST, False)
        return lowest


def _height_of(plane: Pose, x: float, y: float) -> float | None:
    """The height of `plane` at (x, y), m; None if it is vertical."""
    a, b, c = plane.rotate((0.0, 0.0, 1.0))
    px, py, pz = plane.position
    if abs(c) > STEEP:
        return pz - (a * (x - px) + b * (y - py)) / c
    return None


# What stands in a ring.
PIN = (
    mesh.frustum(0.0, 0.13, 0.4).at(Pose((0.0, 0.0, 0.75))),
    mesh.sphere(0.13).at(Pose((0.0, 0.0, 0.97))),
)
FLAG = (
    mesh.frustum(0.025, 0.025, 1.5).at(Pose((0.0, 0.0, 0.75))),
    mesh.box((0.55, 0.02, 0.34)).at(Pose((0.28, 0.0, 1.33))),
)


def mark(
    stage: Stage,
    name: str,
    position: Vector,
    radius: float,
    color: Color,
    scale: float = 1.0,
    inside: tuple[Surface, ...] = (),
) -> None:
    """Draws a ring of `radius` m around `position`, with what stands `inside`, visible from afar
    and from above.
    """
    path = (*WORLD, name)
    shapes = [
        mesh.ring(radius, 0.05 * scale),
        *(replace(one, vertices=scale * one.vertices) for one in inside),
    ]
    stage.draw(path, plain(merge(shapes), color, glow=0.35), shadow=False)
    stage.move(path, Pose(position))
