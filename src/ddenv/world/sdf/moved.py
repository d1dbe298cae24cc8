"""Writes a world in which models have moved: its own text with other poses; all other bytes stay."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence

from ddenv.world.files.resources import Resources
from ddenv.world.model import Model, World
from ddenv.world.pose import Pose
from ddenv.world.scenario import Reading
from ddenv.world.sdf.frames import pose_of
from ddenv.world.sdf.read import parse_world
from ddenv.world.sdf.xml import Edit, Element, edited, name_of, parse, tag_end, with_child, with_words

# Two poses nearer than this are the same, m and sine of half the angle.
SAME = 1e-5
_FORMAT = re.compile(rb"""\s+(?:rotation_format|degrees)\s*=\s*(?:"[^"]*"|'[^']*')""")
_SPACE = re.compile(rb"\s*")


def with_places(world: World, places: Mapping[str, Sequence[Pose]], reading: Reading) -> tuple[bytes, list[str]]:
    """The text of `world` with the links of some models at `places`, and the names of those that could not be moved.

    `places` are the poses of all links of a model in the world frame; `reading` is how the world was read. A model whose links
    moved against each other can only be moved if `<state>` holds its links; one that others are placed relative to stays.
    """
    asked = {name: there for name, there in places.items() if name not in world.anchors}
    while True:
        text, wanted = _written(world, asked)
        again = parse_world(text, world.path, reading, Resources(world.resources))
        # What was written is read again: only that shows that each model is where it has to be.
        wrong = {model.name for model in again.models if not _is_at(model, wanted[model.name])}
        if not wrong & set(asked):
            return text, [name for name, there in places.items() if not _is_at(again.model(name), there)]
        asked = {name: there for name, there in asked.items() if name not in wrong}


def _is_at(model: Model, places: Sequence[Pose]) -> bool:
    return all(is_same(link.pose, place) for link, place in zip(model.links, places, strict=True))


def _written(world: World, places: Mapping[str, Sequence[Pose]]) -> tuple[bytes, dict[str, Sequence[Pose]]]:
    """The text, and where the links of all models should then be."""
    root = parse(world.text, world.path)
    elements = {element.start: element for element in root.iter() if element.tag in ("model", "include")}
    edits: list[Edit] = []
    wanted: dict[str, Sequence[Pose]] = {}
    for model in world.models:
        starts = [link.pose for link in model.links]
        wanted[model.name] = there = places.get(model.name, starts)
        if _is_at(model, there):
            wanted[model.name] = starts
            continue
        at, *entries = [elements[start] for start, _ in model.spans]
        turn = there[0] @ model.links[0].pose.inverse()
        if entries:
            by_name = {link.name: place for link, place in zip(model.links, there, strict=True)}
            edits += _saved(world.text, entries[0], by_name, turn, "")
            if entries[0].find("pose") is None:
                edits.append(_inserted(world.text, entries[0], turn @ model.pose))
        else:
            edits.append(_placed(world.text, at, model, turn))
    return edited(world.text, edits), wanted


def is_same(one: Pose, other: Pose) -> bool:
    """Whether two poses are the same but for rounding."""
    half_turn = math.hypot(*(one.inverse() @ other).quaternion[1:])
    return math.dist(one.position, other.position) < SAME and half_turn < SAME


def _saved(text: bytes, entry: Element, links: Mapping[str, Pose], turn: Pose, prefix: str) -> Iterator[Edit]:
    """The entry of a model in `<state>`, where all poses are in the world frame."""
    own = entry.find("pose")
    if own is not None:
        yield _replaced(text, own, turn @ pose_of(own))
    for link in entry.findall("link"):
        there, pose = links.get(prefix + name_of(link)), link.find("pose")
        if there is not None and pose is not None:
            yield _replaced(text, pose, there)
    for inner in entry.findall("model"):
        yield from _saved(text, inner, links, turn, f"{prefix}{name_of(inner)}::")


def _placed(text: bytes, at: Element, model: Model, turn: Pose) -> Edit:
    """The element of a model in the world; its pose may be relative to a frame."""
    own = at.find("pose")
    if own is None:
        return _inserted(text, at, turn @ model.pose)
    if not (own.get("relative_to") or own.get("frame")):
        return _replaced(text, own, turn @ pose_of(own))
    return _replaced(text, own, pose_of(own) @ model.pose.inverse() @ turn @ model.pose)


def _replaced(text: bytes, pose: Element, place: Pose) -> Edit:
    start, end, new = with_words(text, pose, _numbers(place))
    return start, end, _FORMAT.sub(b"", new)


def _inserted(text: bytes, holder: Element, place: Pose) -> Edit:
    """A new first child, indented like the one that was the first."""
    space = _SPACE.match(text, tag_end(text, holder))
    assert space is not None
    return with_child(text, holder, f"{space.group().decode()}<pose>{_numbers(place)}</pose>")


def _numbers(pose: Pose) -> str:
    # Adding zero turns -0 into 0.
    return " ".join(f"{round(value, 9) + 0.0:.10g}" for value in (*pose.position, *pose.rpy()))
