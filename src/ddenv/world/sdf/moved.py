"""Writes a world in which models have moved: its own text with other poses; all other bytes
stay.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence

from ddenv.world.files.resources import Resources
from ddenv.world.model import World
from ddenv.world.pose import Pose
from ddenv.world.scenario import Reading
from ddenv.world.sdf.frames import pose_of
from ddenv.world.sdf.read import parse_world
from ddenv.world.sdf.xml import (
    Edit,
    Element,
    edited,
    name_of,
    parse,
    tag_end,
    with_child,
    with_words,
)

# Two poses nearer than this are the same, m and sine of half the angle.
SAME = 1e-5
_FORMAT = re.compile(rb"""\s+(?:rotation_format|degrees)\s*=\s*(?:"[^"]*"|'[^']*')""")
_SPACE = re.compile(rb"\s*")


def with_places(
    world: World, places: Mapping[str, Sequence[Pose]], reading: Reading
) -> tuple[bytes, list[str]]:
    """The text of `world` with the links of some models at `places`, and the names of those that
    could not be moved.

    `places` are the poses of all links of a model in the world frame; `reading` is how the world
    was read. A model whose links moved against each other can only be moved if `<state>` holds its
    links; one that others depend on stays.
    """
    asked = {name: there for name, there in places.items() if name not in world.anchors}
    wanted = link_poses(world)
    while True:
        moved = {name: there for name, there in asked.items() if not _are_same(wanted[name], there)}
        text = _written(world, moved)
        again = parse_world(text, world.path, reading, Resources(world.resources))
        # What was written is read again: only that shows that each model is where it has to be.
        found = link_poses(again)
        wrong = {
            name
            for name, there in found.items()
            if not _are_same(there, moved.get(name, wanted[name]))
        }
        if not wrong & set(asked):
            return text, [
                name for name, there in places.items() if not _are_same(found[name], there)
            ]
        asked = {name: there for name, there in asked.items() if name not in wrong}


def link_poses(world: World) -> dict[str, list[Pose]]:
    """The poses of all links in the world frame, by model."""
    return {model.name: [link.pose for link in model.links] for model in world.models}


def _are_same(poses: Sequence[Pose], others: Sequence[Pose]) -> bool:
    return all(is_same(one, other) for one, other in zip(poses, others, strict=True))


def _written(world: World, places: Mapping[str, Sequence[Pose]]) -> bytes:
    root = parse(world.text, world.path)
    elements = {
        element.start: element for element in root.iter() if element.tag in ("model", "include")
    }
    edits: list[Edit] = []
    for model in (model for model in world.models if model.name in places):
        there = places[model.name]
        at, *entries = [elements[start] for start, _ in model.spans]
        turn = there[0] @ model.links[0].pose.inverse()
        own = (entries or [at])[0].find("pose")
        if entries:
            by_name = {link.name: place for link, place in zip(model.links, there, strict=True)}
            edits += _saved(world.text, entries[0], by_name, turn, "")
        elif own is not None and (own.get("relative_to") or own.get("frame")):
            edits.append(
                _replaced(world.text, own, pose_of(own) @ model.pose.inverse() @ turn @ model.pose)
            )
        elif own is not None:
            edits.append(_replaced(world.text, own, turn @ pose_of(own)))
        if own is None:
            # A new first child, indented like the one that was the first.
            holder = (entries or [at])[0]
            space = (_SPACE.match(world.text, tag_end(world.text, holder)) or [b""])[0].decode()
            edits.append(
                with_child(world.text, holder, f"{space}<pose>{_numbers(turn @ model.pose)}</pose>")
            )
    return edited(world.text, edits)


def is_same(one: Pose, other: Pose) -> bool:
    """Whether two poses are the same but for rounding."""
    half_turn = math.hypot(*(one.inverse() @ other).quaternion[1:])
    return math.dist(one.position, other.position) < SAME and half_turn < SAME


def _saved(
    text: bytes, entry: Element, links: Mapping[str, Pose], turn: Pose, prefix: str
) -> Iterator[Edit]:
    """The entry of a model in `<state>`, where all poses are in the world frame."""
    own = entry.find("pose")
    if own is not None:
        yield _replaced(text, own, turn @ pose_of(own))
    for link in entry.findall("link"):
        there = links.get(prefix + name_of(link))
        pose = link.find("pose")
        if there is not None and pose is not None:
            yield _replaced(text, pose, there)
    for inner in entry.findall("model"):
        yield from _saved(text, inner, links, turn, f"{prefix}{name_of(inner)}::")


def _replaced(text: bytes, pose: Element, place: Pose) -> Edit:
    start, end, new = with_words(text, pose, _numbers(place))
    return start, end, _FORMAT.sub(b"", new)


def _numbers(pose: Pose) -> str:
    # Adding zero turns -0 into 0.
    return " ".join(f"{round(value, 9) + 0.0:.10g}" for value in (*pose.position, *pose.rpy()))
