"""What the official SDF checker (`ign sdf -k`, libsdformat 12) refuses although we read it: in a
world, and in what it includes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ddenv.errors import UserError
from ddenv.world.access import Missing, Unusable, is_directives
from ddenv.world.files.resources import Resources
from ddenv.world.model import World
from ddenv.world.sdf.context import sdf_root, version
from ddenv.world.sdf.inertia import moments_of, tensor_of
from ddenv.world.sdf.known_elements import fault, known_children
from ddenv.world.sdf.xml import Element, number_or_nan, parse, place, text_of

# The checker's slack for rounded numbers, as a part of the greatest moment of inertia that the body
# can have.
SLACK = 5 * float(np.finfo(float).eps)
RESERVED_IN = frozenset(
    ["world", "model", "link", "joint", "frame", "collision", "visual", "light", "sensor", "actor"]
)
# What a frame can be attached to.
FRAMES = ("model", "link", "joint", "frame", "include")
INCLUDABLE = ("model", "actor", "light")
SENSORS = (
    "air_pressure altimeter boundingbox boundingbox_camera camera contact custom depth "
    "depth_camera force_torque gps gpu_lidar gpu_ray imu lidar logical_camera magnetometer "
    "multicamera navsat ray rfid rfidtag rgbd rgbd_camera segmentation segmentation_camera sonar "
    "thermal thermal_camera wide_angle_camera wideanglecamera wireless_receiver "
    "wireless_transmitter"
)
TYPES = {"light": frozenset(["point", "spot", "directional"]), "sensor": frozenset(SENSORS.split())}
Refusal = tuple[str, Element]


def refused(world: World) -> list[tuple[str, str]]:
    """What the official checker would refuse in `world`: the reason, and file, line and XPath; each
    file in its own order.
    """
    if is_directives(world.path):
        return []
    checker = _Checker(Resources(world.resources))
    return [(why, place(at)) for why, at in checker.check(sdf_root(world.text, world.path))]


@dataclass
class _Checker:
    """Reads included files, each once. `names` has what a world or model holds by name: a model, or
    None for anything else.
    """

    resources: Resources
    files: dict[Path, Element] = field(default_factory=dict)
    names: dict[Element, dict[str, Element | None]] = field(default_factory=dict)

    def check(self, root: Element) -> Iterator[Refusal]:
        """What is refused in a file, and in all that it includes."""
        roots = [root]
        for each in roots:
            yield from self._inside(each, version(each) >= (1, 8), is_known=True)
            for include in each.iter("include"):
                included = self._root_of(include)
                if included is not None and included.tag == "sdf" and included not in roots:
                    roots.append(included)

    def _inside(self, element: Element, no_colons: bool, *, is_known: bool) -> Iterator[Refusal]:
        """What is refused below `element`. Nothing is known of what an element holds that is not
        `is_known` itself.
        """
        yield from self._names(element, no_colons)
        if element.tag == "inertial" and not _is_accepted(element):
            yield "an inertia that no body has", element
        known = known_children().get(element.tag, {}) if is_known else {}
        for child in element:
            if child.tag in known and (why := fault(child, known[child.tag])):
                yield why, child
            if child.tag == "frame" and element.tag in ("world", "model"):
                yield from self._frame(child, element)
            # Nothing that belongs to a plugin or to an extension is looked at, and of an include
            # what it opens.
            if child.tag not in ("plugin", "include") and ":" not in child.tag:
                yield from self._inside(child, no_colons, is_known=child.tag in known)

    def _names(self, element: Element, no_colons: bool) -> Iterator[Refusal]:
        names: set[str] = set()
        repeated: list[Element] = []
        for child in element:
            name = self._name(child)
            if child.tag == "plugin" or name is None:
                continue
            if name in names:
                repeated.append(child)
            names.add(name)
            if no_colons and "::" in name and child.tag != "include":
                yield "'::' in a name", child
            if child.tag in RESERVED_IN and (
                name == "world" != child.tag or name[:2] == name[-2:] == "__"
            ):
                yield "a name that is reserved", child
            if child.tag in TYPES and child.get("type") not in (None, *TYPES[child.tag]):
                yield f"a <{child.tag}> of an unknown type", child
        if repeated:
            yield f"a <{element.tag}> with two parts of the same name", repeated[0]

    def _frame(self, frame: Element, holder: Element) -> Iterator[Refusal]:
        pose = frame.find("pose")
        to = frame.get("attached_to", "")
        if to and (to == frame.get("name") or not self._holds(holder, to)):
            yield "a <frame> that is attached to nothing", frame
        relative_to = "" if pose is None else pose.get("relative_to", "")
        if relative_to and not self._holds(holder, relative_to):
            yield "a <frame> whose pose is relative to nothing", frame

    def _holds(self, holder: Element, path: str) -> bool:
        """Whether `holder` has something to attach a frame to at `path`, such as arm::hand."""
        if path == ("world" if holder.tag == "world" else "__model__"):
            return True
        names = self._names_in(holder)
        if path in names:
            return True
        first, _, rest = path.partition("::")
        model = names.get(first)
        return bool(rest) and model is not None and self._holds(model, rest)

    def _names_in(self, holder: Element) -> dict[str, Element | None]:
        if holder not in self.names:
            names = self.names[holder] = {}
            for child in (child for child in holder if child.tag in FRAMES):
                model = self._model_of(child) if child.tag == "include" else child
                names[self._name(child) or ""] = (
                    model if model is not None and model.tag == "model" else None
                )
        return self.names[holder]

    def _name(self, element: Element) -> str | None:
        """The name of `element`; that of an include is its own, or that of what it includes."""
        if element.tag != "include":
            return element.get("name")
        own = text_of(element.find("name"))
        model = None if own else self._model_of(element)
        return own or (None if model is None else model.get("name"))

    def _model_of(self, include: Element) -> Element | None:
        """What `include` includes; None if that was not read."""
        root = self._root_of(include)
        if root is None or root.tag == "robot":
            return root
        return next((child for child in root if child.tag in INCLUDABLE), None)

    def _root_of(self, include: Element) -> Element | None:
        """The root of the file that `include` names; None if it was not read."""
        try:
            path, text = self.resources.sdf(text_of(include.find("uri")), include.source.parent)
            if path not in self.files:
                self.files[path] = parse(text, path, root="sdf")
        except (Missing, Unusable, UserError):
            return None
        return self.files[path]


def _is_accepted(inertial: Element) -> bool:
    """Whether neither the mass nor a moment is negative, and no moment exceeds the sum of the other
    two.
    """
    inertia = inertial.find("inertia")
    if inertia is None:
        return True
    moments, products = moments_of(inertia)
    tensor = tensor_of(moments, products)
    largest = np.abs(tensor).max()
    if not (number_or_nan(inertial, "mass", 1.0) >= 0.0 and math.isfinite(largest)):
        return False
    # Numbers near the largest ones would overflow.
    tensor /= largest or 1.0
    # Without products these are the moments themselves, unrounded.
    low, middle, high = np.linalg.eigvalsh(tensor) if any(products) else np.sort(np.diag(tensor))
    slack = SLACK * abs(np.trace(tensor))
    return bool(low >= -slack and high <= low + middle + slack)
