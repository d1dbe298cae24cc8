"""The numbers of a world and of its scenario, such as "green_patch_01.friction" and "spawn.yaw":
which there are, how far each may change, and the world or scenario with another value; of the
world's text only that number is changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import product
from typing import Any

from pydantic import ValidationError

from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.text import Names
from ddenv.world.access import is_directives
from ddenv.world.extent import bounds
from ddenv.world.files.resources import Resources
from ddenv.world.model import Box, Cylinder, Model, Sphere, World, is_ground
from ddenv.world.placement import INSIDE, overlap_of, stands_inside
from ddenv.world.pose import Pose
from ddenv.world.scenario import Scenario, Sensors
from ddenv.world.sdf.moved import with_places
from ddenv.world.sdf.read import parse_world
from ddenv.world.sdf.xml import (
    Edit,
    Element,
    edited,
    floats,
    parse,
    text_of,
    with_child,
    with_words,
)
from ddenv.world.whole import whole_of

# Less than this part of a number does not matter, unless it is a place or an angle.
PART = 0.05
# Two models that never move may stand so deep in each other, m: barrels on thin patches of ground
# do.
SUNK = 0.1


@dataclass(frozen=True, slots=True)
class Kind:
    """Of numbers in `unit`: less than `matters` does not matter, and `range` has the lowest and the
    highest value to try, from the present one and the robot's length, m.
    """

    unit: str
    matters: float
    range: Callable[[float, float], tuple[float, float]]


def _times(unit: str, least: float, most: float) -> Kind:
    return Kind(unit, 1e-6, lambda now, _: (least * now, most * now))


def _up_to(unit: str, matters: float, most: float) -> Kind:
    return Kind(unit, matters, lambda now, _: (0.0, max(most, 2.0 * now)))


_PLACE = Kind("m", 0.01, lambda now, length: (now - 3.0 * length, now + 3.0 * length))
_HEIGHT = Kind("m", 0.01, lambda now, length: (now - length, now + length))
_ANGLE = Kind("rad", math.radians(1.0), lambda now, _: (now - math.pi, now + math.pi))
_SIZE = _times("m", 0.1, 3.0)
_ERROR = _up_to("", 0.005, 0.5)
# An option of an own controller: what it means, only its author knows.
_OPTION = Kind(
    "",
    1e-6,
    lambda now, _: (min(0.1 * now, 10.0 * now), max(0.1 * now, 10.0 * now)) if now else (-1.0, 1.0),
)
SIZES = ("radius", "length", "size_x", "size_y", "size_z")
# The numbers of a model, those first that promise most.
OF_MODELS = {
    "friction": _up_to("", 0.002, 1.0),
    "x": _PLACE,
    "y": _PLACE,
    **dict.fromkeys(SIZES, _SIZE),
}
OF_MODELS |= {"yaw": _ANGLE, "z": _HEIGHT, "mass": _times("kg", 0.1, 10.0)}
# Those of a scenario, with the keys under which it has them.
OF_SCENARIO: dict[str, tuple[Kind, Names]] = {
    "controller.speed": (_times("m/s", 0.1, 3.0), ("controller", "speed")),
    "spawn.y": (_PLACE, ("robot", "spawn", "y")),
    "spawn.yaw": (_ANGLE, ("robot", "spawn", "yaw")),
    "spawn.x": (_PLACE, ("robot", "spawn", "x")),
    "goal.y": (_PLACE, ("goal", "y")),
    "goal.x": (_PLACE, ("goal", "x")),
    "lidar.range": (_times("m", 0.1, 3.0), ("sensors", "lidar", "range")),
    "lidar.noise": (_up_to("m", 0.005, 0.3), ("sensors", "lidar", "noise")),
}
_NOISES = [
    name
    for name in Sensors.model_fields
    if name.removesuffix("_bias") in ("compass", "gyro", "tilt", "odometry")
]
OF_SCENARIO |= {f"sensors.{name}": (_ERROR, ("sensors", name)) for name in _NOISES}
OPTIONS = "controller.options."


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A number that may be changed: its value `now`, and the `low`est and `high`est value that are
    tried, in `unit`.

    A change is measured against `scale`; less than `resolution` does not matter.
    """

    name: str
    now: float
    low: float
    high: float
    scale: float
    resolution: float
    unit: str


class NotPossible(ValueError):
    """A number cannot have a value; the message says why."""


def numbers_of(
    scenario: Scenario, world: World, robot: Model, kept: Iterable[str]
) -> dict[str, Number]:
    """The numbers by name, of the models `kept` and of the scenario. Those that promise most come
    first.
    """
    box = bounds(robot.collisions)
    length = 1.0 if box is None else float((box[1] - box[0])[:2].max())
    # Those of directives stand in files of their own.
    kept = () if is_directives(world.path) else kept
    models = [
        one for one in map(world.model, kept) if one.name not in world.anchors and not one.inside
    ]
    values: list[tuple[Kind, str, Any]] = [
        (kind, f"{model.name}.{what}", _of_model(world, model, what))
        for what, kind in OF_MODELS.items()
        for model in models
    ]
    for name, (kind, (*keys, last)) in OF_SCENARIO.items():
        section: Any = scenario
        for key in keys:
            section = getattr(section, key)
        values.append((kind, name, getattr(section, last, None)))
    options = scenario.controller.options if ":" in scenario.controller.use else {}
    values += [
        (_OPTION, f"{OPTIONS}{name}", value)
        for name, value in options.items()
        if type(value) in (int, float)
    ]
    found = {}
    for kind, name, now in (
        (kind, name, float(value)) for kind, name, value in values if value is not None
    ):
        low, high = (float(f"{end:.9g}") for end in kind.range(now, length))
        resolution = max(
            kind.matters, 0.0 if kind in (_PLACE, _HEIGHT, _ANGLE) else PART * abs(now)
        )
        found[name] = Number(
            name=name,
            now=now,
            low=low,
            high=high,
            scale=max(high - now, now - low),
            resolution=resolution,
            unit=kind.unit,
        )
    return found


def chosen(numbers: Mapping[str, Number], globs: Iterable[str]) -> list[Number]:
    """The numbers whose names match, in their order; all without globs. Raises UserError for a glob
    that matches none.
    """
    globs = list(globs)
    for glob in globs:
        if not any(fnmatchcase(name, glob) for name in numbers):
            near = nearest(glob, numbers)
            raise UserError(
                f"--number: there is no number '{glob}'{near}; examples: "
                f"{', '.join(list(numbers)[:3])}"
            )
    return [
        one
        for name, one in numbers.items()
        if not globs or any(fnmatchcase(name, glob) for glob in globs)
    ]


def _of_model(world: World, model: Model, what: str) -> float | None:
    """A number of a model; None if it has none of that kind, or if it does not stand in the world's
    own text.
    """
    if what == "yaw":
        return model.pose.yaw()
    if what in ("x", "y", "z"):
        return model.pose.position["xyz".index(what)]
    if not world.text.startswith(b"<model", model.spans[0][0]):
        return None
    if what == "friction":
        frictions = {one.mu for one in model.collisions}
        return frictions.pop() if len(frictions) == 1 else None
    if what == "mass":
        return _mass(model)
    return _size(model, what)


def _mass(model: Model) -> float | None:
    inertia = model.links[0].inertia if len(model.links) == 1 and not model.static else None
    return None if inertia is None else inertia.mass


def _size(model: Model, what: str) -> float | None:
    match [one.shape for one in model.collisions], what:
        case [Box(size)], "size_x" | "size_y" | "size_z":
            return size["xyz".index(what[-1])]
        case ([Cylinder(radius, _)], "radius") | ([Sphere(radius)], "radius"):
            return radius
        case [Cylinder(_, length)], "length":
            return length
    return None


# Other values.


def changed(
    scenario: Scenario, world: World, changes: Mapping[str, float]
) -> tuple[Scenario, World]:
    """The scenario and the world with these values of numbers. Raises NotPossible."""
    data = scenario.model_dump()
    of_scenario = False
    for name, value in changes.items():
        if name not in OF_SCENARIO and not name.startswith(OPTIONS):
            world = _with(scenario, world, name, value)
            continue
        own = ("controller", "options", name.removeprefix(OPTIONS))
        *keys, last = OF_SCENARIO[name][1] if name in OF_SCENARIO else own
        section = data
        of_scenario = True
        for key in keys:
            section = section[key]
        section[last] = round(value) if isinstance(section[last], int) else value
    try:
        return (Scenario.model_validate(data) if of_scenario else scenario), world
    except ValidationError as error:
        raise NotPossible(error.errors()[0]["msg"]) from None


def part_of(
    scenario: Scenario, world: World, kept: frozenset[str], changes: Mapping[str, float]
) -> tuple[Scenario, World]:
    """The part of the world with the models `kept` and those that always stay, and with these
    values, as `ddenv export` writes it.

    A simulator of the user's own leaves models out of the world's text itself. Raises NotPossible.
    """
    gone = set(world.elements(scenario.protected)) - kept
    whole = whole_of(world, scenario)
    scenario, world = changed(scenario, world, changes)
    if scenario.oracle is None:
        world = replace(
            world, models=tuple(model for model in world.models if model.name not in gone)
        )
    return scenario.model_copy(update={"whole": whole}), world


def check(
    scenario: Scenario,
    world: World,
    robot: Model,
    kept: frozenset[str],
    changes: Mapping[str, float],
) -> None:
    """Raises NotPossible if numbers cannot have these values: then the robot stands in a model at
    its start, or a changed model in another one that it did not stand in.
    """
    try:
        there, after = part_of(scenario, world, kept, changes)
        found = stands_inside(after, robot, there.robot.spawn)
    except UserError as error:
        raise NotPossible(str(error)) from None
    if found is not None:
        raise NotPossible(found[0])
    owners = {name.rpartition(".")[0] for name in changes if name not in OF_SCENARIO} & kept
    for owner, other in product(sorted(owners), after.models):
        before = world.model(owner)
        model = after.model(owner)
        # What stands on the ground may sink into it, and two that never move push nothing apart.
        if other.name == owner or (model.static and is_ground(other)):
            continue
        tolerance = SUNK if model.static and other.static else INSIDE
        depth = overlap_of(model, other)
        if depth > tolerance and depth > overlap_of(before, other) + tolerance:
            raise NotPossible(f"{owner} would be {depth:.2f} m inside {other.name}")


def _with(scenario: Scenario, world: World, name: str, value: float) -> World:
    """The world with a number of a model changed. What was written is read again: only that shows
    that it is there.
    """
    owner, _, what = name.rpartition(".")
    model = world.model(owner)
    at = next(one for one in parse(world.text, world.path).iter() if one.start == model.spans[0][0])
    number = f"{value:.9g}"
    pose = at.find("pose")
    words = text_of(pose).split()
    if what == "friction":
        edits = [
            edit
            for collision in at.iter("collision")
            for edit in _friction(world.text, collision, number)
        ]
    elif what not in ("x", "y", "z", "yaw"):
        edits = list(_sizes(world, model, at, what, number))
    elif pose is not None and not pose.attrib and len(words) == 6 and len(model.spans) == 1:
        # A turn about the vertical is the last one of roll, pitch and yaw.
        turned = float(words[5]) + value - model.pose.yaw()
        place, word = (5, f"{turned:.9g}") if what == "yaw" else ("xyz".index(what), number)
        words[place] = word
        edits = [with_words(world.text, pose, " ".join(words))]
    else:
        places = {owner: [move_of(model, what, value) @ link.pose for link in model.links]}
        edits = [(0, len(world.text), with_places(world, places, scenario.reading)[0])]
    text = edited(world.text, edits)
    try:
        after = parse_world(text, world.path, scenario.reading, Resources(world.resources))
    except UserError as error:
        raise NotPossible(str(error)) from None
    found = _of_model(after, after.model(owner), what)
    if found is None or not math.isclose(found, value, rel_tol=1e-6, abs_tol=1e-6):
        raise NotPossible(
            f"the world file does not give the {what} of {owner} in a form that can be changed"
        )
    return after


def move_of(model: Model, what: str, value: float) -> Pose:
    """How a model moves in the world where one of its x, y, z (m) and yaw (rad) has this value; not
    at all for other numbers.
    """
    turn = value - model.pose.yaw() if what == "yaw" else 0.0
    x, y, z = (
        value if axis == what else now for axis, now in zip("xyz", model.pose.position, strict=True)
    )
    return Pose.from_rpy(x, y, z, 0.0, 0.0, turn) @ Pose(model.pose.position).inverse()


def _sizes(world: World, model: Model, at: Element, what: str, number: str) -> Iterator[Edit]:
    """The changes of a mass or a size; what is drawn of the same size changes with it."""
    now = _of_model(world, model, what)
    tag, place = ("size", "xyz".index(what[-1])) if what in SIZES[2:] else (what, 0)
    for element in at.iter(tag):
        values = floats(element)
        words = text_of(element).split()
        of_shape = element.parent is not None and element.parent.tag in (
            "box",
            "cylinder",
            "sphere",
        )
        if len(values) > place and values[place] == now and (of_shape or what == "mass"):
            yield with_words(
                world.text, element, " ".join([*words[:place], number, *words[place + 1 :]])
            )


def _friction(text: bytes, collision: Element, number: str) -> Iterator[Edit]:
    """Both directions of a collision, where its file says them."""
    for engine, tags in (("ode", ("mu", "mu2")), ("bullet", ("friction", "friction2"))):
        if (holder := collision.find(f"surface/friction/{engine}")) is not None:
            said = {tag: holder.find(tag) for tag in tags}
            yield from (
                with_words(text, each, number) for each in said.values() if each is not None
            )
            if lacks := "".join(
                f"<{tag}>{number}</{tag}>" for tag, each in said.items() if each is None
            ):
                yield with_child(text, holder, lacks)
            return
    holder = collision
    new = f"<ode><mu>{number}</mu><mu2>{number}</mu2></ode>"
    for path, tag in (("surface/friction", "friction"), ("surface", "surface")):
        if (found := collision.find(path)) is not None:
            holder = found
            break
        new = f"<{tag}>{new}</{tag}>"
    yield with_child(text, holder, new)
