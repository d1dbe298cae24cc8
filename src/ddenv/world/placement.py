"""How a world starts, without simulating it: whether the robot has room, how far it drops, which
models are inside others.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product, starmap

import numpy as np

from ddenv.errors import UserError
from ddenv.text import count, first_of
from ddenv.world.drive import turning_links
from ddenv.world.extent import (
    Bounds,
    around,
    bounds,
    filled_bounds,
    model_bounds,
    shape_bounds,
    stacked,
    vertices_of,
)
from ddenv.world.hull import half_spaces
from ddenv.world.model import Collision, Ground, Mesh, Model, Plane, Terrain, World, is_ground
from ddenv.world.passage import Clearance, clearance
from ddenv.world.pose import Pose
from ddenv.world.scenario import Goal, Spawn
from ddenv.world.terrain import height_above

# Tolerated overlap, m: contacts at rest overlap slightly, and numbers in files are rounded.
TOLERANCE = 0.02
# A collision that is so many times as wide as what is seen of its model is named.
LARGER = 3.0
# What is seen of a thin sheet counts as so wide, m.
THIN = 0.05
UNLIKE = {
    "unseen": "models without a visual, which can be hit but not seen",
    "passable": "models without a collision, which can be seen but not hit",
    "larger": f"models whose collision is more than {LARGER:g} times as wide as what is seen",
}
# A line names so many models.
MOST_NAMES = 3
# The steps in which a free place is looked for, and how far, m.
STEP = 0.2
FAR = 2.0


def spawn_pose(spawn: Spawn) -> Pose:
    """The pose of the robot's model frame in the world at the start."""
    return Pose.from_rpy(spawn.x, spawn.y, spawn.z, 0.0, 0.0, spawn.yaw)


def check_spawn(world: World, robot: Model, spawn: Spawn, goal: Goal | None = None) -> None:
    """Raises UserError if the robot, placed at `spawn`, stands inside a model or below the ground;
    it names a free place nearby.
    """
    if found := stands_inside(world, robot, spawn, goal):
        why, free = found
        if free is None:
            hint = "move the spawn"
        else:
            hint = f"free nearby: --spawn={free.x:g},{free.y:g},{free.z:g},{free.yaw:g}"
        raise UserError(f"spawn ({spawn.x:g}, {spawn.y:g}, {spawn.z:g}): {why}; {hint}")


def stands_inside(
    world: World, robot: Model, spawn: Spawn, goal: Goal | None = None
) -> tuple[str, Spawn | None] | None:
    """That the robot at `spawn` stands inside a model, in words, and the nearest free place; None
    if its own is free.

    That is on a grid of `STEP`; None if there is none within `FAR`. Places from which a way leads
    to the `goal` come first. Raises UserError for a robot without collision shapes.
    """
    shapes, boxes = _shapes(world)
    if (found := _obstacle(shapes, boxes, robot, spawn)) is None:
        return None
    model, depth, collision = found

    def moved(x: float, y: float, z: float) -> Spawn:
        places = {
            "x": round(spawn.x + x, 2),
            "y": round(spawn.y + y, 2),
            "z": round(spawn.z + z, 2),
        }
        return spawn.model_copy(update=places)

    # At this height, or just above what the robot is inside of.
    heights = [0.0, depth + 0.01]
    sides = [number * STEP for number in range(-round(FAR / STEP), round(FAR / STEP) + 1)]
    moves = sorted(product(sides, sides, heights), key=lambda move: math.hypot(*move))
    places: Iterable[Spawn] = starmap(moved, moves)
    if goal is not None:
        places = _by_room(places, world, robot, spawn, goal)
    free = next((place for place in places if _obstacle(shapes, boxes, robot, place) is None), None)
    # The hull of a hollow mesh fills space that looks free.
    is_hull = isinstance(collision.shape, Mesh) and collision.piece is None
    what = "the convex hull of model" if is_hull else "model"
    return f"the robot stands inside {what} '{model.name}' by {depth:.2f} m", free


def _by_room(
    places: Iterable[Spawn], world: World, robot: Model, spawn: Spawn, goal: Goal
) -> list[Spawn]:
    """Places near `spawn`, sorted: outdoors last if the goal is not, first those from which the
    robot gets to the goal.
    """
    room, width = _clearance(world, robot, spawn, goal)
    end = room.near((goal.x, goal.y), goal.tolerance)
    outdoors = room.outdoors()
    outdoors &= not outdoors[end].any()
    # Where it stands, it has less room than between two columns that block it.
    inside = room.joined(width - room.cell, end)
    worse = 2 * outdoors + ~inside

    def badness(place: Spawn) -> int:
        column = (np.array((place.x, place.y)) - room.middles[0, 0]) / room.cell
        return int(worse[tuple(np.rint(column).astype(int))])

    return sorted(places, key=badness)


def _clearance(world: World, robot: Model, spawn: Spawn, goal: Goal) -> tuple[Clearance, float]:
    """The clearance of the robot on the height on which it comes to stand, and its width, m."""
    own = bounds(robot.collisions, robot.pose.inverse())
    assert own is not None
    size = own[1] - own[0]
    # Which side is its front is not known.
    width = float(size[:2].min())
    level = spawn.z + float(own[0][2]) - drop(world, robot, spawn)
    return clearance(
        world, width, float(size[2]), level, [(spawn.x, spawn.y), (goal.x, goal.y)]
    ), width


def note_passage(world: World, robot: Model, spawn: Spawn, goal: Goal) -> Iterator[tuple[str, str]]:
    """That no way from the start to the goal is wide enough for the robot."""
    room, width = _clearance(world, robot, spawn, goal)
    start = room.near((spawn.x, spawn.y), width / 2)
    end = room.near((goal.x, goal.y), goal.tolerance)
    if room.joined(width + room.cell / 2, start)[end].any():
        return
    widest = room.widest(start, end)
    wide = (
        f"no way from start to goal is wider than {widest:.2f} m: the robot is {width:.2f} m wide"
    )
    yield "passage", wide if widest else "no way leads from start to goal"


def at_start(world: World, robot: Model, spawn: Spawn) -> Model | None:
    """The first model that the robot at `spawn` stands inside of. Raises UserError for a robot
    without collision shapes.
    """
    found = _obstacle(*_shapes(world), robot, spawn)
    if found is None:
        return None
    return found[0]


def _shapes(world: World) -> tuple[list[tuple[Model, Collision]], Bounds]:
    """All shapes, one model after another, and the boxes around them."""
    shapes = [(model, one) for model in world.models for one in model.collisions]
    return shapes, stacked(filled_bounds(one) for _, one in shapes)


def _obstacle(
    shapes: Sequence[tuple[Model, Collision]], boxes: Bounds, robot: Model, spawn: Spawn
) -> tuple[Model, float, Collision] | None:
    """The first model that the robot at `spawn` is inside of, how deep, m, and in which shape; None
    if its place is free.

    `boxes` are around the shapes of all models, which come one model after another.
    """
    place = spawn_pose(spawn) @ robot.pose.inverse()
    own = bounds(robot.collisions, place)
    if own is None:
        raise UserError(f"robot.model: '{robot.name}' has no collision shapes")
    bodies = [hull(one, place) for one in robot.collisions if not isinstance(one.shape, Ground)]
    found: tuple[Model, float, Collision] | None = None
    near = ((own[0] <= boxes[1]) & (boxes[0] <= own[1])).all(axis=1)
    for model, one in (shapes[number] for number in np.flatnonzero(near).tolist()):
        if found is not None and found[0] is not model:
            break
        depth = max(_depth(body, one) for body in bodies)
        if depth > (TOLERANCE if found is None else found[1]):
            found = model, depth, one
    return found


def _depth(body: Hull, obstacle: Collision) -> float:
    """How deep a body is inside an obstacle, m."""
    if isinstance(obstacle.shape, Terrain):
        return body.radius - height_above(obstacle.shape, obstacle.pose, body.vertices)
    if not isinstance(obstacle.shape, Plane):
        return overlap(body, hull(obstacle))
    up = np.array(obstacle.pose.rotate((0.0, 0.0, 1.0)))
    return float(up @ obstacle.pose.position - (body.vertices @ up).min()) + body.radius


# Models at rest in a saved world overlap by millimetres; this is more, m.
INSIDE = 0.03
# A robot that starts higher than this above the surface below it drops, m.
DROP = 0.15
# Wheels this far above the ground do not touch it, m: what is below is taken as large as the box
# around it.
HANGING = 0.05
# The maximum number of pairs of shapes that are compared: two fine meshes take a tenth of a second.
MOST_PAIRS = 500


@dataclass(frozen=True, slots=True)
class Inside:
    """The model `name` starts `depth` (m) deep inside `other`."""

    name: str
    other: str
    depth: float


def notes_on_start(
    world: World, robot: Model, spawn: Spawn, goal: Goal | None = None
) -> Iterator[tuple[str, str]]:
    """What is wrong with the start of the robot in `world`, and with its `goal`: a word and a
    sentence for each.
    """
    height = drop(world, robot, spawn)
    if height > DROP:
        yield (
            "drop",
            (
                f"the robot starts {height:.2f} m above the surface below it and drops; lower the "
                "spawn's z"
            ),
        )
    if world.gravity[2] >= 0.0:
        yield (
            "gravity",
            f"gravity is {world.gravity[2]:g} m/s^2 upwards: the robot does not stay on the ground",
        )
    hanging = drop(world, replace(robot, links=turning_links(robot)), spawn) - height
    if hanging > HANGING:
        yield (
            "wheels",
            (
                "no wheel touches anything: the robot stands on its body, its wheels "
                f"{hanging:.2f} m above the ground"
            ),
        )
    if goal is not None:
        yield from _note_goal(world, goal, spawn.z)
        yield from note_passage(world, robot, spawn, goal)
    yield from note_inside(world)


def _note_goal(world: World, goal: Goal, height: float) -> Iterator[tuple[str, str]]:
    """That the goal lies inside a model at this height, m."""
    # Meshes may be ground, too.
    solid = (
        (model, one)
        for model in world.models
        for one in model.collisions
        if not isinstance(one.shape, Ground | Mesh)
    )
    place = Hull(np.array([[goal.x, goal.y, height]]))
    blocker = next((model.name for model, one in solid if _depth(place, one) > TOLERANCE), None)
    if blocker is not None:
        yield "goal", f"at the height of the start, the goal lies inside {blocker}; move the goal"


def note_floor(
    world: World, robot: Model, spawn: Spawn, removable: Collection[str]
) -> Iterator[tuple[str, str]]:
    """That everything stands on one of the `removable` models, so that a test without it only shows
    that the robot falls.
    """
    standing = bounds(robot.collisions, spawn_pose(spawn) @ robot.pose.inverse())
    if standing is None or any(is_ground(model) for model in world.models):
        return
    boxes = {model.name: model_bounds(model) for model in world.models}
    for model in world.models:
        others = [box for name, box in boxes.items() if name != model.name and box is not None]
        above = stacked([*others, standing])
        if (
            model.static
            and model.name in removable
            and any(_carries(one, above) for one in model.collisions)
        ):
            why = f"everything stands on '{model.name}': without it the robot falls"
            yield "floor", f"{why}; --protect '{model.name}' saves the tests without it"


def _carries(collision: Collision, boxes: Bounds) -> bool:
    """Whether the middles of all boxes lie above a shape."""
    low, high = shape_bounds(collision.shape, collision.pose)
    middles = (boxes[0] + boxes[1]) / 2
    within = (low[:2] <= middles[:, :2]) & (middles[:, :2] <= high[:2])
    return bool(within.all() and (middles[:, 2] >= high[2]).all())


def note_inside(world: World) -> Iterator[tuple[str, str]]:
    """What is wrong with the start of the models alone."""
    pairs = inside(world)
    if pairs:
        deepest = max(pairs, key=lambda pair: pair.depth)
        more = f", and {count(len(pairs) - 1, 'more pair')}" if len(pairs) > 1 else ""
        start = f"{deepest.name} starts {deepest.depth:.2f} m inside {deepest.other}"
        yield "inside", f"{start}{more}: they push each other apart"


def note_unseen(world: World, among: Collection[str]) -> Iterator[tuple[str, str]]:
    """What `among` these models the robot may hit where nothing is seen, or not hit where something
    is.

    A world without any visual is not made to be looked at.
    """
    if not any(model.visuals for model in world.models):
        return
    # A visual that was not read may be there.
    unread = {note.model for note in world.notes if note.kind == "ignored"}
    models = [model for model in world.models if model.name in among and model.name not in unread]
    kinds = {model.name: _unlike(model) for model in models}
    for about, words in UNLIKE.items():
        names = [name for name, kind in kinds.items() if kind == about]
        if names:
            yield about, f"{words}: {first_of(names, MOST_NAMES)}"


def _unlike(model: Model) -> str:
    """The key of UNLIKE that says how the collisions of a model differ from its visuals; "" if they
    do not.
    """
    hit = model_bounds(model)
    seen = around(shape_bounds(visual.shape, visual.pose) for visual in model.visuals)
    if seen is None:
        if hit is None:
            return ""
        return "unseen"
    size = seen[1] - seen[0]
    if hit is None:
        # Nobody minds driving over what is flat, such as the lines on a floor.
        if size[2] > THIN:
            return "passable"
        return ""
    is_larger = ((hit[1] - hit[0])[:2] > LARGER * np.maximum(size, THIN)[:2]).any()
    if is_larger:
        return "larger"
    return ""


def inside(world: World) -> list[Inside]:
    """Models of which one can move, and one starts deeper than `INSIDE` in the other."""
    shapes, boxes = _shapes(world)
    deepest: dict[tuple[str, str], float] = {}
    for first, second in islice(_near(shapes, boxes), MOST_PAIRS):
        (model, shape) = shapes[first]
        (other, obstacle) = shapes[second]
        # What cannot move, or has no end, is the obstacle.
        if model.static or isinstance(shape.shape, Ground):
            (model, shape), (other, obstacle) = (other, obstacle), (model, shape)
        depth = _depth(hull(shape), obstacle)
        if depth > INSIDE:
            pair = model.name, other.name
            deepest[pair] = max(depth, deepest.get(pair, 0.0))
    return [Inside(*pair, depth) for pair, depth in deepest.items()]


def _near(shapes: Sequence[tuple[Model, Collision]], boxes: Bounds) -> Iterator[tuple[int, int]]:
    """The shapes of two models that may overlap, one of which can move.

    By the `boxes` around them, swept along x.
    """
    low, high = boxes
    free = np.array([not model.static for model, _ in shapes], dtype=bool)
    names = {id(model): number for number, (model, _) in enumerate(shapes)}
    owners = np.array([names[id(model)] for model, _ in shapes], dtype=int)
    if not free.any():
        return
    order = np.argsort(low[:, 0], kind="stable")
    ends = np.searchsorted(low[order, 0], high[:, 0])
    for place, number in enumerate(order.tolist()):
        others = order[place + 1 : ends[number]]
        deep = (
            np.minimum(high[number], high[others]) - np.maximum(low[number], low[others]) > INSIDE
        ).all(axis=1)
        able = (free[number] | free[others]) & (owners[number] != owners[others])
        yield from (
            (min(number, other), max(number, other)) for other in others[deep & able].tolist()
        )


def overlap_of(model: Model, other: Model) -> float:
    """How deep a model is inside another one, m; 0 if they do not overlap. Planes are no bodies."""
    bodies = [hull(one) for one in model.collisions if not isinstance(one.shape, Ground)]
    return max((_depth(body, one) for body in bodies for one in other.collisions), default=0.0)


def drop(world: World, robot: Model, spawn: Spawn) -> float:
    """How far the robot falls at least when it starts, m; 0 where nothing is below it: then the
    test says that it fell.

    Everything is taken as large as the box around it.
    """
    place = spawn_pose(spawn) @ robot.pose.inverse()
    bodies = [hull(one, place) for one in robot.collisions if not isinstance(one.shape, Ground)]
    boxes = [
        shape_bounds(one.shape, place @ one.pose)
        for one in robot.collisions
        if not isinstance(one.shape, Ground)
    ]
    heights = []
    for collision in world.collisions:
        if isinstance(collision.shape, Terrain):
            heights += [-depth for body in bodies if (depth := _depth(body, collision)) > -math.inf]
            continue
        low, high = shape_bounds(collision.shape, collision.pose)
        endless = isinstance(collision.shape, Plane)
        below = (
            bottom
            for bottom, top in boxes
            if endless or ((bottom < high)[:2].all() and (low < top)[:2].all())
        )
        # What is above the robot does not stop its fall.
        heights += [float(bottom[2] - high[2]) for bottom in below if low[2] <= bottom[2]]
    return max(0.0, min(heights, default=0.0))


@dataclass(frozen=True)
class Hull:
    """A convex body: the hull of `vertices` (N, 3) m, grown by `radius` m."""

    vertices: np.ndarray
    radius: float = 0.0


def hull(collision: Collision, place: Pose | None = None) -> Hull:
    """The convex body of a collision shape other than ground, moved by `place`."""
    pose = collision.pose if place is None else place @ collision.pose
    vertices, radius = vertices_of(collision.shape)
    return Hull(vertices @ pose.rotation().T + pose.position, radius)


def overlap(a: Hull, b: Hull) -> float:
    """The shortest move that separates two convex bodies, m; 0 if they do not overlap."""
    grown = a.radius + b.radius
    differences = _differences(a, b)
    if (differences.min(axis=0) > grown).any() or (differences.max(axis=0) < -grown).any():
        return 0.0
    try:
        depth = -float(half_spaces(differences)[:, 3].max())
    except ValueError:
        # All in one plane: two segments, or points.
        depth = 0.0
    if depth > 0.0:
        return depth + grown
    if grown:
        return max(0.0, grown - distance(a, b))
    return 0.0


def distance(a: Hull, b: Hull) -> float:
    """The distance between the hulls of the vertices, m; 0 if they touch."""
    from scipy.optimize import nnls

    differences = _differences(a, b)
    # Of all weighted means of the differences the one nearest to zero: least squares with a row
    # that asks for a sum of 1.
    weights, _ = nnls(
        np.vstack([differences.T, np.ones(len(differences))]), np.array([0.0, 0.0, 0.0, 1.0])
    )
    return float(np.linalg.norm(weights @ differences)) / float(weights.sum())


def _differences(a: Hull, b: Hull) -> np.ndarray:
    return np.asarray((a.vertices[:, None] - b.vertices).reshape(-1, 3))
