"""Where the named things of a model or a world are (the pose frame semantics of SDF 1.7 and, as far as they go, of older files)."""

from __future__ import annotations

import difflib
import math
from functools import cached_property
from pathlib import Path

from ddenv.world.pose import Pose
from ddenv.world.sdf.context import Context
from ddenv.world.sdf.parts import Part, parts
from ddenv.world.sdf.xml import Element, complain, name_of, numbers, text_of

# Nothing stands farther from the origin of its frame: numbers beyond lose their millimetres, m.
FARTHEST = 1e6
OWN = ("", "__model__")


class Scope:
    """The frames inside one `<model>` or `<world>`; all poses are in its own frame."""

    def __init__(self, element: Element, files: tuple[Path, ...], context: Context) -> None:
        self.element = element
        self.parts = parts(element, files, context)
        self._context = context
        self._poses: dict[str, Pose] = {}
        self._open: list[str] = []

    def inside(self, part: Part) -> Scope:
        """The frames inside one of the `parts`; models included from one file share them."""
        scopes = self._context.scopes
        key = id(part.element)
        if key not in scopes:
            scopes[key] = Scope(part.element, part.files, self._context)
        return scopes[key]

    @cached_property
    def _named(self) -> dict[str, Element | Part]:
        # Where names stand twice, the first of these kinds wins.
        named: dict[str, Element | Part] = {}
        for tag in ("joint", "link", "frame"):
            named.update((name_of(child), child) for child in reversed(self.element.findall(tag)))
        named.update((part.name, part) for part in reversed(self.parts))
        return named

    def pose(self, name: str, asker: Element) -> Pose:
        """The pose of the frame called `name`; complaints are about `asker`. Raises UserError."""
        if name in OWN or (name == "world" and self.element.tag != "model"):
            return Pose()
        if name in self._poses:
            return self._poses[name]
        thing = self._find(name, asker)
        if name in self._open:
            circle = " -> ".join((*self._open[self._open.index(name) :], name))
            raise complain(asker, f"frames are given relative to each other in a circle: {circle}")
        self._open.append(name)
        pose = self._resolve(name, thing, asker)
        self._open.pop()
        self._poses[name] = pose
        return pose

    def place(self, holder: Element, default: str = "") -> Pose:
        """The pose in the `<pose>` of `holder`, which is relative to the frame `default` unless it names one."""
        element = holder.find("pose")
        return self._place(element, default, holder if element is None else element)

    def placed(self, part: Part) -> Pose:
        """The pose of one of the `parts`."""
        element = part.pose
        pose = self._place(element, "", part.at if element is None else element)
        frame = part.placement_frame
        return pose @ self.inside(part).pose(frame, part.at).inverse() if frame else pose

    def link_of(self, name: str, asker: Element) -> str | None:
        """The link that the frame `name` is attached to, such as `link` or `inner::link`; None where there is none."""
        seen: list[str] = []
        while True:
            if name in seen:
                raise complain(asker, f"frames are attached to each other in a circle: {' -> '.join((*seen, name))}")
            seen.append(name)
            if name in OWN:
                return self._canonical(asker)
            thing = self._named.get(name)
            if thing is None and "::" in name:
                return self._link_inside(name, asker)
            if thing is None:
                return None
            if isinstance(thing, Part):
                inside = self.inside(thing).link_of("", asker)
                return None if inside is None else f"{name}::{inside}"
            if thing.tag == "link":
                return name
            name = text_of(thing.find("child")) if thing.tag == "joint" else thing.get("attached_to") or ""

    def _link_inside(self, name: str, asker: Element) -> str | None:
        first, rest = name.split("::", 1)
        thing = self._named.get(first)
        if not isinstance(thing, Part):
            return None
        inside = self.inside(thing).link_of(rest, asker)
        return None if inside is None else f"{first}::{inside}"

    def _canonical(self, asker: Element) -> str | None:
        """The link that the model's own frame is attached to: the one it names, else its first."""
        named = self.element.get("canonical_link")
        if named:
            return self.link_of(named, asker) if named not in OWN else None
        first = self.element.find("link")
        if first is not None:
            return name_of(first)
        for part in self.parts:
            inside = self.inside(part).link_of("", asker)
            if inside is not None:
                return f"{part.name}::{inside}"
        return None

    def _find(self, name: str, asker: Element) -> Element | Part:
        """What is called `name`; of `a::b` the part `a`."""
        thing = self._named.get(name)
        if thing is not None:
            return thing
        first = self._named.get(name.split("::", 1)[0]) if "::" in name else None
        if isinstance(first, Part):
            return first
        near = difflib.get_close_matches(name, self._named, n=1)
        hint = f" (did you mean '{near[0]}'?)" if near else ""
        raise complain(asker, f"there is no frame '{name[:80]}' here{hint}")

    def _resolve(self, name: str, thing: Element | Part, asker: Element) -> Pose:
        if isinstance(thing, Part):
            if name != thing.name:
                return self.pose(thing.name, asker) @ self.inside(thing).pose(name.split("::", 1)[1], asker)
            return self.placed(thing)
        if thing.tag == "joint":
            return self.place(thing, text_of(thing.find("child")))
        return self.place(thing, (thing.get("attached_to") or "") if thing.tag == "frame" else "")

    def _place(self, element: Element | None, default: str, asker: Element) -> Pose:
        if element is None:
            return self.pose(default, asker)
        base = element.get("relative_to") or element.get("frame") or default
        pose = pose_of(element)
        return pose if base in OWN else self.pose(base, asker) @ pose

    def references(self) -> set[str]:
        """The first names of all frames of this world that poses and frames directly inside it are given relative to."""
        holders = [*self.element.findall("frame"), *(part.at for part in self.parts)]
        named = [holder.get("attached_to") or "" for holder in holders]
        for pose in (holder.find("pose") for holder in holders):
            named += [] if pose is None else [pose.get("relative_to") or pose.get("frame") or ""]
        return {name.split("::", 1)[0] for name in named if name}


def pose_of(element: Element) -> Pose:
    """The numbers of a `<pose>`: roll, pitch and yaw, or a quaternion, in rad or degrees. Raises UserError."""
    if not text_of(element):
        return Pose()
    if (element.get("rotation_format") or "euler_rpy") == "quat_xyzw":
        x, y, z, *turn = numbers(element, 7)
        pose = Pose((x, y, z), _unit(element, (turn[3], turn[0], turn[1], turn[2])))
    else:
        x, y, z, *angles = numbers(element, 6)
        scale = math.pi / 180 if (element.get("degrees") or "").strip() in ("1", "true") else 1.0
        pose = Pose.from_rpy(x, y, z, *(angle * scale for angle in angles)) if any(angles) else Pose((x, y, z))
    if max(abs(x), abs(y), abs(z)) > FARTHEST:
        raise complain(element, f"is farther than {FARTHEST:g} m away")
    return pose


def _unit(element: Element, quaternion: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    length = math.hypot(*quaternion)
    if not 1e-9 < length < 1e9:
        raise complain(element, "a quaternion needs a length above zero")
    w, x, y, z = (part / length for part in quaternion)
    return w, x, y, z
