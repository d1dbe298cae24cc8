"""The numbers of a world and of its scenario, such as "green_patch_01.friction" and "spawn.yaw": which there are, how far each may
change, and the world or scenario with another value; of the world's text only that number is changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

from pydantic import ValidationError

from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.world.extent import bounds
from ddenv.world.files.resources import Resources
from ddenv.world.model import Box, Cylinder, Model, Sphere, World, is_ground
from ddenv.world.placement import INSIDE, overlap_of, stands_inside
from ddenv.world.pose import Pose
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.moved import Edit, edited, with_places
from ddenv.world.sdf.read import parse_world
from ddenv.world.sdf.xml import Element, floats, parse, tag_end
from ddenv.world.whole import whole_of

# Less than this part of a number does not matter where its kind names no smaller difference that does.
PART = 0.05
# Two models that never move may stand so deep in each other, m: barrels on thin patches of ground do.
SUNK = 0.1


@dataclass(frozen=True, slots=True)
class Kind:
    """What a number is: `range` has its lowest and highest value that are tried, from its present one and the robot's length, m.

    Differences below `matters` do not matter, nor below `PART` of the present value if they are `relative` to it.
    """

    unit: str
    matters: float
    range: Callable[[float, float], tuple[float, float]]
    relative: bool = True


def _around(lengths: float, unit: str = "m") -> Kind:
    return Kind(unit, 0.01, lambda now, length: (now - lengths * length, now + lengths * length), relative=False)


def _from_zero_to(most: float, unit: str, matters: float) -> Kind:
    return Kind(unit, matters, lambda now, _: (0.0, max(most, 2.0 * now)))


def _times(least: float, most: float, unit: str) -> Kind:
    return Kind(unit, 1e-6, lambda now, _: (min(least * now, most * now), max(least * now, most * now)))


_ANGLE = Kind("rad", math.radians(1.0), lambda now, _: (now - math.pi, now + math.pi), relative=False)
_SIZE = _times(0.1, 3.0, "m")
# The kinds of a model's numbers, those first that promise most.
OF_MODELS = {
    "friction": _from_zero_to(1.0, "", 0.002),
    "x": _around(3.0),
    "y": _around(3.0),
    "radius": _SIZE,
    "length": _SIZE,
    "size_x": _SIZE,
    "size_y": _SIZE,
    "size_z": _SIZE,
    "yaw": _ANGLE,
    "z": _around(1.0),
    "mass": _times(0.1, 10.0, "kg"),
}
# Those of a scenario, with the keys under which it has them.
OF_SCENARIO: dict[str, tuple[Kind, tuple[str, ...]]] = {
    "controller.speed": (_times(0.1, 3.0, "m/s"), ("controller", "speed")),
    "spawn.y": (_around(3.0), ("robot", "spawn", "y")),
    "spawn.yaw": (_ANGLE, ("robot", "spawn", "yaw")),
    "spawn.x": (_around(3.0), ("robot", "spawn", "x")),
    "goal.y": (_around(3.0), ("goal", "y")),
    "goal.x": (_around(3.0), ("goal", "x")),
    "lidar.range": (_times(0.1, 3.0, "m"), ("sensors", "lidar", "range")),
    "lidar.noise": (_from_zero_to(0.3, "m", 0.005), ("sensors", "lidar", "noise")),
    "sensors.compass": (_from_zero_to(0.5, "rad", 0.005), ("sensors", "compass")),
    "sensors.compass_bias": (_from_zero_to(0.5, "rad", 0.005), ("sensors", "compass_bias")),
    "sensors.gyro": (_from_zero_to(0.5, "rad/s", 0.005), ("sensors", "gyro")),
    "sensors.gyro_bias": (_from_zero_to(0.5, "rad/s", 0.005), ("sensors", "gyro_bias")),
    "sensors.tilt": (_from_zero_to(0.2, "rad", 0.002), ("sensors", "tilt")),
    "sensors.odometry": (_from_zero_to(0.5, "", 0.005), ("sensors", "odometry")),
    "sensors.odometry_bias": (_from_zero_to(0.5, "", 0.005), ("sensors", "odometry_bias")),
}
OPTIONS = "controller.options."
# An option of an own controller is tried from a tenth to ten times of what it is; what that may mean, only its author knows.
_OPTION = Kind("", 1e-6, lambda now, _: tuple(sorted((0.1 * now, 10.0 * now))) if now else (-1.0, 1.0))  # type: ignore[arg-type, return-value]  # two


@dataclass(frozen=True, slots=True)
class Number:
    """A number that may be changed: its value `now`, and the `low`est and `high`est value that are tried, in `unit`.

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


def numbers_of(scenario: Scenario, world: World, robot: Model, kept: Iterable[str]) -> dict[str, Number]:
    """The numbers by name, of the models `kept` and of the scenario. Those that promise most come first."""
    box = bounds(robot.collisions)
    length = 1.0 if box is None else float((box[1] - box[0])[:2].max())
    models = [world.model(name) for name in kept if name not in world.anchors]
    values = [
        (kind, f"{model.name}.{what}", value)
        for what, kind in OF_MODELS.items()
        for model in models
        if (value := _of_model(world, model, what)) is not None
    ]
    data = scenario.model_dump()
    values += [
        (kind, name, value) for name, (kind, keys) in OF_SCENARIO.items() if (value := _at(data, keys)) is not None
    ]
    options = scenario.controller.options if ":" in scenario.controller.use else {}
    values += [
        (_OPTION, f"{OPTIONS}{name}", float(value))
        for name, value in options.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    ]
    return {name: _number(kind, name, value, length) for kind, name, value in values}


def chosen(numbers: Mapping[str, Number], globs: Iterable[str]) -> list[Number]:
    """The numbers whose names match, in their order; all without globs. Raises UserError for a glob that matches none."""
    globs = list(globs)
    for glob in globs:
        if not any(fnmatchcase(name, glob) for name in numbers):
            near = nearest(glob, list(numbers))
            raise UserError(
                f"--number: there is no number '{glob}'{near}; one is such as {', '.join(list(numbers)[:3])}"
            )
    return [one for name, one in numbers.items() if not globs or any(fnmatchcase(name, glob) for glob in globs)]


def _number(kind: Kind, name: str, now: float, length: float) -> Number:
    low, high = (float(f"{end:.9g}") for end in kind.range(now, length))
    resolution = max(kind.matters, PART * abs(now) if kind.relative else 0.0)
    return Number(name, now, low, high, max(high - now, now - low), resolution, kind.unit)


def _at(data: Any, keys: Iterable[str]) -> float | None:
    for key in keys:
        data = None if data is None else data[key]
    return None if data is None else float(data)


def _of_model(world: World, model: Model, what: str) -> float | None:
    """A number of a model; None if it has none of that kind, or if it does not stand in the world's own text."""
    x, y, z = model.pose.position
    if what in ("x", "y", "z", "yaw"):
        return {"x": x, "y": y, "z": z, "yaw": model.pose.yaw()}[what]
    if not world.text.startswith(b"<model", model.spans[0][0]):
        return None
    if what == "friction":
        frictions = {one.mu for one in model.collisions}
        return frictions.pop() if len(frictions) == 1 else None
    if what == "mass":
        inertia = model.links[0].inertia if len(model.links) == 1 and not model.static else None
        return None if inertia is None else inertia.mass
    shapes = [one.shape for one in model.collisions]
    match shapes[0] if len(shapes) == 1 else None, what:
        case Box(size), "size_x" | "size_y" | "size_z":
            return size["xyz".index(what[-1])]
        case Cylinder(radius) | Sphere(radius), "radius":
            return radius
        case Cylinder(_, length), "length":
            return length
    return None


# Other values.


def changed(scenario: Scenario, world: World, changes: Mapping[str, float]) -> tuple[Scenario, World]:
    """The scenario and the world with these values of numbers. Raises NotPossible."""
    data, places = scenario.model_dump(), dict[tuple[str, ...], float]()
    for name, value in changes.items():
        if name in OF_SCENARIO:
            places[OF_SCENARIO[name][1]] = value
        elif name.startswith(OPTIONS):
            places["controller", "options", name.removeprefix(OPTIONS)] = value
        else:
            world = _with(scenario, world, name, value)
    for (*keys, last), value in places.items():
        section = data
        for key in keys:
            section = section[key]
        section[last] = round(value) if isinstance(section[last], int) else value
    try:
        return (Scenario.model_validate(data) if places else scenario), world
    except ValidationError as error:
        raise NotPossible(error.errors()[0]["msg"]) from None


def part_of(
    scenario: Scenario, world: World, kept: frozenset[str], changes: Mapping[str, float]
) -> tuple[Scenario, World]:
    """The part of the world with the models `kept` and those that always stay, and with these values, as `ddenv export` writes it.

    A simulator of the user's own leaves models out of the world's text itself. Raises NotPossible.
    """
    stays = kept | ({model.name for model in world.models} - set(world.elements(frozenset(scenario.protected))))
    whole = whole_of(world, scenario)
    scenario, world = changed(scenario, world, changes)
    if scenario.oracle is None:
        world = replace(world, models=tuple(model for model in world.models if model.name in stays))
    return scenario.model_copy(update={"whole": whole}), world


def check(scenario: Scenario, world: World, robot: Model, kept: frozenset[str], name: str, value: float) -> None:
    """Raises NotPossible if a number cannot have a value: then the robot stands in a model at its start, or a changed model in
    another one that it did not stand in.
    """
    try:
        there, after = part_of(scenario, world, kept, {name: value})
        found = stands_inside(after, robot, there.robot.spawn)
    except UserError as error:
        raise NotPossible(str(error)) from None
    if found is not None:
        raise NotPossible(found[0])
    owner = name.rpartition(".")[0]
    if name in OF_SCENARIO or owner not in kept:
        return
    model, new = world.model(owner), after.model(owner)
    for other in after.models:
        # What stands on the ground may sink into it, and two that never move push nothing apart.
        if other.name == owner or (model.static and is_ground(other)):
            continue
        tolerance = SUNK if model.static and other.static else INSIDE
        depth = overlap_of(new, other)
        if depth > tolerance and depth > overlap_of(model, world.model(other.name)) + tolerance:
            raise NotPossible(f"{owner} would be {depth:.2f} m inside {other.name}")


def _with(scenario: Scenario, world: World, name: str, value: float) -> World:
    """The world with a number of a model changed. What was written is read again: only that shows that it is there."""
    owner, _, what = name.rpartition(".")
    model = world.model(owner)
    if what in ("x", "y", "z", "yaw"):
        text = _moved(scenario, world, model, what, value)
    else:
        text = edited(world.text, sorted(set(_edits(world, model, what, value))))
    try:
        after = parse_world(text, world.path, scenario.reading, Resources(world.resources))
    except UserError as error:
        raise NotPossible(str(error)) from None
    found = _of_model(after, after.model(owner), what)
    if found is None or not math.isclose(found, value, rel_tol=1e-6, abs_tol=1e-6):
        raise NotPossible(f"the world's text does not say the {what} of {owner} in a way that can be changed")
    return after


def _moved(scenario: Scenario, world: World, model: Model, what: str, value: float) -> bytes:
    """The text with a model in another place."""
    position, turn = list(model.pose.position), 0.0
    if what == "yaw":
        turn = value - model.pose.yaw()
    else:
        position["xyz".index(what)] = value
    x, y, z = position
    pose = _element(world, model).find("pose")
    words = [] if pose is None else (pose.text or "").split()
    if pose is not None and not pose.attrib and len(words) == 6 and len(model.spans) == 1:
        # A turn about the vertical is the last one of roll, pitch and yaw.
        place, now = (5, float(words[5]) + turn) if what == "yaw" else ("xyz".index(what), value)
        words[place] = f"{now:.9g}"
        return edited(world.text, [_said(world.text, pose, " ".join(words))])
    move = Pose.from_rpy(x, y, z, 0.0, 0.0, turn) @ Pose(model.pose.position).inverse()
    return with_places(world, {model.name: [move @ link.pose for link in model.links]}, scenario.reading)[0]


def _element(world: World, model: Model) -> Element:
    """The element of a model in the world's text."""
    return next(one for one in parse(world.text, world.path).iter() if one.start == model.spans[0][0])


def _edits(world: World, model: Model, what: str, value: float) -> Iterator[Edit]:
    """How the text of a model changes."""
    at = _element(world, model)
    text, number = world.text, f"{value:.9g}"
    if what == "mass":
        for element in at.iter("mass"):
            yield _said(text, element, number)
    elif what == "friction":
        for collision in at.iter("collision"):
            yield from _friction(text, collision, number)
    else:
        # What is drawn of the same size changes with it.
        tag, place = ("size", "xyz".index(what[-1])) if what.startswith("size_") else (what, 0)
        now = _of_model(world, model, what)
        for element in at.iter(tag):
            values = list(floats(element))
            if len(values) > place and values[place] == now and _is_shape(element):
                words = (element.text or "").split()
                yield _said(text, element, " ".join([*words[:place], number, *words[place + 1 :]]))


def _is_shape(element: Element) -> bool:
    return element.parent is not None and element.parent.tag in ("box", "cylinder", "sphere")


def _friction(text: bytes, collision: Element, number: str) -> Iterator[Edit]:
    """Both directions of a collision, in the place where its file says them."""
    for engine, tags in (("ode", ("mu", "mu2")), ("bullet", ("friction", "friction2"))):
        holder = collision.find(f"surface/friction/{engine}")
        if holder is not None:
            found = [(tag, holder.find(tag)) for tag in tags]
            yield from (_said(text, each, number) for _, each in found if each is not None)
            lacks = "".join(f"<{tag}>{number}</{tag}>" for tag, each in found if each is None)
            if lacks:
                yield _inside(text, holder, lacks)
            return
    new = f"<ode><mu>{number}</mu><mu2>{number}</mu2></ode>"
    holders = (collision.find("surface/friction"), collision.find("surface"), collision)
    wrapped = (new, f"<friction>{new}</friction>", f"<surface><friction>{new}</friction></surface>")
    holder, new = next((one, words) for one, words in zip(holders, wrapped, strict=True) if one is not None)
    yield _inside(text, holder, new)


def _said(text: bytes, element: Element, words: str) -> Edit:
    """`element` with other words in it."""
    start = text[element.start : tag_end(text, element)].removesuffix(b">").removesuffix(b"/").rstrip()
    return element.start, element.end, start + f">{words}</{element.tag}>".encode()


def _inside(text: bytes, holder: Element, new: str) -> Edit:
    """`holder` with new elements as its first ones."""
    end = tag_end(text, holder)
    if end == holder.end:
        return _said(text, holder, new)
    return end, end, new.encode()
