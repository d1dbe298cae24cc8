"""Poses of the named things in a model or world: SDF's pose frame semantics, of version 1.7 and
older.
"""

from __future__ import annotations

import math
from functools import cached_property
from pathlib import Path

from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.world.pose import HERE, Pose
from ddenv.world.sdf.context import Context, version
from ddenv.world.sdf.includes import Part, included
from ddenv.world.sdf.xml import Element, complain, name_of, numbers, text_of

# Maximum distance from the origin of a frame, m: larger numbers lose their millimetres.
FARTHEST = 1e6
OWN = ("", "__model__")
WORLD = "world"


class TooFar(UserError):
    """A pose that is farther away than `FARTHEST`."""


class Scope:
    """The frames inside one `<model>` or `<world>`; all poses are relative to its own frame."""

    def __init__(
        self,
        element: Element,
        files: tuple[Path, ...],
        context: Context,
        scopes: dict[int, Scope] | None = None,
    ) -> None:
        self.element = element
        # The models directly inside, in the file's order.
        self.parts: list[Part] = []
        for child in element:
            if child.tag == "model":
                self.parts.append(Part(element=child, at=child, name=name_of(child), files=files))
            elif child.tag == "include" and (part := included(child, files, context)) is not None:
                self.parts.append(part)
        self._context = context
        self._poses: dict[str, Pose] = {}
        # All scopes inside the outermost one, by the `id` of their element.
        self._scopes: dict[int, Scope] = {} if scopes is None else scopes

    def inside(self, part: Part) -> Scope:
        """The frames inside one of the `parts`, shared by all includes of one model."""
        key = id(part.element)
        if key not in self._scopes:
            self._scopes[key] = Scope(part.element, part.files, self._context, self._scopes)
        return self._scopes[key]

    def is_left_out(self, part: Part) -> bool:
        """Whether nothing is left of one of the `parts`, since all that it includes was left
        out.
        """
        if (
            part.element.find("link") is not None
            or next(part.element.iter("include"), None) is None
        ):
            return False
        inner = self.inside(part)
        return all(inner.is_left_out(each) for each in inner.parts)

    @cached_property
    def named(self) -> dict[str, Element | Part]:
        """Everything with a name here."""
        # Of equal names the kind added last wins, and within it the first in the file.
        named: dict[str, Element | Part] = {}
        for tag in ("joint", "link", "frame"):
            named.update((name_of(child), child) for child in reversed(self.element.findall(tag)))
        named.update((part.name, part) for part in reversed(self.parts))
        return named

    def pose(self, name: str, asker: Element) -> Pose:
        """The pose of the frame called `name`; errors point at `asker`. Raises UserError."""
        # A loop, since chains of frames may be longer than Python's stack.
        chain: dict[str, Pose] = {}
        at = name
        asked_by = asker
        while not (at in OWN or at in self._poses or (at == WORLD and self.element.tag != "model")):
            if at in chain:
                raise complain(
                    asker,
                    (
                        "the frames form a cycle: "
                        f"{shown([*list(chain)[list(chain).index(at) :], at])}"
                    ),
                )
            base, chain[at], asked_by = self._step(at, asked_by)
            at = base
        pose = self._poses.get(at, HERE)
        for each, local in reversed(chain.items()):
            pose = pose @ local
            self._poses[each] = pose
        return pose

    def _step(self, name: str, asker: Element) -> tuple[str, Pose, Element]:
        """The frame that `name` is placed relative to, its pose in that, and the element that says
        so. Raises UserError.
        """
        thing = self.named.get(name)
        if thing is None:
            if (merged := self._merged(name)) is not None:
                return merged.name, self.inside(merged).pose(name, asker), asker
            first, _, rest = name.partition("::")
            if rest and isinstance(part := self.named.get(first), Part):
                return first, self.inside(part).pose(rest, asker), asker
            raise complain(asker, f"there is no frame '{name}' here{nearest(name, self.named)}")
        if isinstance(thing, Part):
            element = thing.pose
            holder = thing.at
            default = ""
        else:
            element = thing.find("pose")
            holder = thing
            default = _carrier(thing)
        local = HERE if element is None else pose_of(element)
        local = self._by_placement_frame(thing, local) if isinstance(thing, Part) else local
        return _named_in(element) or default, local, holder if element is None else element

    def _merged(self, name: str) -> Part | None:
        """The merged model that has something of this name, such as `link` or `inner::link`."""
        first = name.partition("::")[0]
        return next(
            (part for part in self.parts if part.merged and first in self.inside(part).named), None
        )

    def place(self, holder: Element, default: str = "") -> Pose:
        """The pose in the `<pose>` of `holder`, which is relative to the frame `default` unless it
        names one.
        """
        element = holder.find("pose")
        return self._at(_named_in(element) or default, element, holder)

    def placed(self, part: Part) -> Pose:
        """The pose of one of the `parts`."""
        element = part.pose
        return self._by_placement_frame(part, self._at(_named_in(element), element, part.at))

    def _at(self, base: str, element: Element | None, holder: Element) -> Pose:
        local = HERE if element is None else pose_of(element)
        if element is not None and element.get("frame") and version(element) >= (1, 7):
            self._context.note(
                "ignored",
                element,
                "the attribute 'frame' has no effect since SDF 1.7; use relative_to",
            )
        if base in OWN:
            return local
        return self.pose(base, holder if element is None else element) @ local

    def _by_placement_frame(self, part: Part, pose: Pose) -> Pose:
        """The pose of `part`, if `pose` is that of its placement frame."""
        frame = part.placement_frame
        if frame:
            return pose @ self.inside(part).pose(frame, part.at).inverse()
        return pose

    def link(self, name: str, asker: Element) -> str | None:
        """The link that the frame `name` of this model is attached to, such as `link` or
        `inner::link`; None if there is none.

        Errors point at `asker`. Raises UserError.
        """
        seen: dict[str, None] = {}
        while name not in OWN:
            if name in seen:
                raise complain(
                    asker, f"the attachments of frames form a cycle: {shown([*seen, name])}"
                )
            seen[name] = None
            thing = self.named.get(name)
            first, _, rest = name.partition("::")
            if thing is None:
                if (merged := self._merged(name)) is not None:
                    return self.inside(merged).link(name, asker)
                thing = self.named.get(first) if rest else None
                link = self.inside(thing).link(rest, asker) if isinstance(thing, Part) else None
                return link and f"{first}::{link}"
            if isinstance(thing, Part):
                return self.inside(thing).canonical and f"{name}::{self.inside(thing).canonical}"
            if thing.tag == "link":
                return name
            name = _carrier(thing)
        return self.canonical

    @cached_property
    def canonical(self) -> str | None:
        """The link that a model's own frame is attached to: its `canonical_link`, else its first
        link.
        """
        named = self.element.get("canonical_link")
        first = self.element.find("link")
        if named:
            if named in OWN:
                return None
            return self.link(named, self.element)
        if first is not None:
            return name_of(first)
        for part in self.parts:
            link = self.inside(part).canonical
            if link is not None:
                if part.merged:
                    return link
                return f"{part.name}::{link}"
        return None

    def references(self) -> set[str]:
        """The names that poses and frames directly inside this world refer to."""
        frames = self.element.findall("frame")
        named = [_carrier(frame) for frame in frames]
        named += [
            _named_in(holder.find("pose"))
            for holder in (*frames, *(part.at for part in self.parts))
        ]
        # A model's name may itself hold colons.
        return {name for each in named for name in (each, each.split("::", 1)[0]) if name}


def _carrier(thing: Element) -> str:
    """What a joint or a frame is fixed to; empty for a link."""
    if thing.tag == "joint":
        return text_of(thing.find("child"))
    return thing.get("attached_to", "").strip()


def shown(names: list[str]) -> str:
    """A chain of names, cut to one line."""
    cut = [name[:40] for name in names]
    return " -> ".join(cut if len(cut) <= 6 else [*cut[:4], f"... ({len(cut) - 5} more)", cut[-1]])


def pose_of(element: Element) -> Pose:
    """The pose in a `<pose>`: roll, pitch, yaw (rad or degrees) or a quaternion. Raises UserError,
    also TooFar.
    """
    if not text_of(element):
        return HERE
    form = (element.get("rotation_format") or "euler_rpy").strip()
    if form not in ("euler_rpy", "quat_xyzw"):
        raise complain(
            element, f"rotation_format '{form[:40]}' is unknown; use euler_rpy or quat_xyzw"
        )
    if form == "quat_xyzw":
        x, y, z, *turn = numbers(element, 7)
        length = math.hypot(*turn)
        if not 1e-9 < length < 1e9:
            raise complain(element, "the quaternion has no usable length")
        i, j, k, w = (part / length for part in turn)
        pose = Pose((x, y, z), (w, i, j, k))
    else:
        x, y, z, *angles = numbers(element, 6)
        in_degrees = element.get("degrees", "").strip().lower() in ("1", "true")
        scale = math.pi / 180 if in_degrees else 1.0
        if any(angles):
            pose = Pose.from_rpy(x, y, z, *(angle * scale for angle in angles))
        else:
            pose = Pose((x, y, z))
    if max(abs(x), abs(y), abs(z)) > FARTHEST:
        raise TooFar(str(complain(element, f"is farther than {FARTHEST:g} m away")))
    return pose


def _named_in(pose: Element | None) -> str:
    """The frame that a `<pose>` is relative to; empty if it names none."""
    if pose is None:
        return ""
    old = pose.get("frame") if pose.get("frame") and version(pose) < (1, 7) else ""
    return (pose.get("relative_to") or old or "").strip()
