"""The context of reading one file: where other files come from, what the user allows, and the notes
on unread elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from ddenv.errors import UserError
from ddenv.settings import Ignorable
from ddenv.text import first_of
from ddenv.world.access import MissingFiles, Unsupported
from ddenv.world.files.resources import Resources, how_to_fetch
from ddenv.world.model import Note, World
from ddenv.world.scenario import PLAIN, Reading
from ddenv.world.sdf.standin import ALL_MISSING, AUTO, StandIn, matching, parse_stand_ins
from ddenv.world.sdf.xml import Element, complain, floats, parse, place
from ddenv.world.tinyxml import strict_fault

# Maximum number of models: a few files that include each other could ask for more than any machine
# can hold.
MOST_MODELS = 50_000
VERSIONS = ("1.4", "1.5", "1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12")
# By parent: the children that need no note, since they are read or do not affect how a robot
# drives.
QUIET: dict[str, frozenset[str]] = {
    tag: frozenset(children.split())
    for tag, children in {
        "world": "model include population state frame gravity light gui scene physics "
        "spherical_coordinates magnetic_field "
        "atmosphere audio",
        "model": "link joint model include frame pose static self_collide allow_auto_disable",
        "include": "uri name pose placement_frame static",
        "link": (
            "pose inertial collision visual gravity self_collide kinematic light "
            "must_be_base_link velocity_decay"
        ),
        "inertial": "mass inertia pose density auto_inertia_params",
        "inertia": "ixx ixy ixz iyy iyz izz",
        "collision": "pose geometry surface max_contacts laser_retro density auto_inertia_params "
        "drake:proximity_properties",
        "surface": "friction bounce contact soft_contact",
        "friction": "ode bullet torsional",
        "bounce": "restitution_coefficient threshold",
        "visual": "pose geometry material cast_shadows transparency laser_retro meta "
        "visibility_flags",
        "joint": "pose parent child axis axis2 physics thread_pitch screw_thread_pitch "
        "gearbox_ratio gearbox_reference_body",
        "axis": "xyz limit dynamics use_parent_model_frame initial_position",
        "limit": "lower upper effort velocity stiffness dissipation",
        "dynamics": "damping friction spring_reference spring_stiffness",
        "velocity_decay": "linear angular",
    }.items()
}
QUIET["axis2"] = QUIET["axis"]
QUIET["add_model"] = QUIET["include"]
ONCE = {
    "pose",
    "geometry",
    "inertial",
    "surface",
    "material",
    "static",
    "scale",
    "gravity",
    "self_collide",
    "density",
}
ONCE |= {"axis", "axis2", "parent", "child", "limit"}
REASONS = {
    "plugin": "plugins are not run",
    "sensor": "only the robot's own sensors are simulated",
    "actor": "actors are not simulated",
    "road": "it is not drawn",
    "wind": "wind is not simulated",
    "enable_wind": "wind is not simulated",
    "gripper": "grippers are not simulated",
    "projector": "it is not drawn",
    "particle_emitter": "it is not drawn",
    "audio_source": "sound is not simulated",
    "audio_sink": "sound is not simulated",
    "battery": "batteries are not simulated",
    "mimic": "mimic joints are not simulated",
}
# By parent and child: physics that is not simulated although it affects motion, with the note.
WITHOUT = {
    ("dynamics", "friction"): "dry friction of joints is not simulated",
    ("dynamics", "spring_stiffness"): "springs of joints are not simulated",
    ("bounce", "restitution_coefficient"): "bouncing is not simulated",
    ("velocity_decay", "linear"): "velocity decay is not simulated",
    ("velocity_decay", "angular"): "velocity decay is not simulated",
}
# Substructures without a reader of their own; a reader notes its element itself.
INSIDE = frozenset(
    [
        "inertial",
        "inertia",
        "surface",
        "friction",
        "bounce",
        "axis",
        "axis2",
        "limit",
        "dynamics",
        "velocity_decay",
    ]
)


# A message names so many other files.
MOST_NAMED = 5


@dataclass(kw_only=True)
class Context:
    """Settings, notes and caches of one reading. `model` is the name of the world's model being
    read, for the notes.

    `used` are the URIs of stand-ins that were asked for, `missing` the first errors of missing
    files by URI, which one message lists, `unreadable` why those of these that were found cannot be
    used, `files` the parsed files, `guessed` what has a guessed shape: the model, and the URI.
    """

    resources: Resources
    reading: Reading = PLAIN
    notes: list[Note] = field(default_factory=list)
    model: str = ""
    stand_ins: dict[str, StandIn] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)
    assembled: int = 0
    missing: dict[str, UserError] = field(default_factory=dict)
    unreadable: dict[str, str] = field(default_factory=dict)
    files: dict[Path, Element] = field(default_factory=dict)
    guessed: list[tuple[str, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.stand_ins = parse_stand_ins(self.reading.stand_ins)

    def note(
        self, kind: Literal["replaced", "ignored"], element: Element, why: str, detail: str = ""
    ) -> None:
        """Notes that `element` was replaced or ignored."""
        self.notes.append(
            Note(
                kind=kind,
                model=self.model,
                place=place(element),
                what=f"<{element.tag}>",
                why=why,
                detail=detail,
            )
        )

    def note_tolerance(self, root: Element, text: bytes) -> None:
        """Notes what is no strict XML in `text`, the content of the file of `root`."""
        fault = strict_fault(text)
        if fault is None:
            return
        file = "/".join(root.source.parts[-2:])
        why = f"in {file}, {fault}; the file was read as Gazebo reads it"
        self.notes.append(
            Note(
                kind="ignored", model=self.model, place=place(root), what="a fault of XML", why=why
            )
        )

    def note_unused(self, root: Element) -> None:
        """Notes the stand-ins that nothing asked for: probably typing errors."""
        # `auto` asks for nothing as long as nothing is missing.
        for uri in sorted(
            uri for uri, own in self.stand_ins.items() if own != AUTO and uri not in self.used
        ):
            self.note(
                "ignored", root, f"the stand-in for '{uri}' is not used: no model or mesh names it"
            )

    def recorded(self, world: World) -> World:
        """`world`, with what was noted, found and guessed as it was read."""
        return replace(
            world,
            notes=tuple(self.notes),
            resources=self.resources.taken,
            found=tuple(self.resources.found.values()),
            absent=self.resources.absent(),
            guessed=tuple(self.guessed),
        )

    def complain_of_missing(self) -> None:
        """Raises MissingFiles with the first error, and the names of the other files."""
        if not self.missing:
            return
        first, *others = self.missing
        absent = _also("also missing", [uri for uri in others if uri not in self.unreadable])
        broken = _also("also unreadable", [uri for uri in others if uri in self.unreadable])
        message = f"{self.missing[first]}{absent}{broken}{how_to_fetch(self.missing)}"
        raise MissingFiles(message, dict.fromkeys(self.missing, "") | self.unreadable)

    def ignores(self, tag: str) -> bool:
        return tag in self.reading.ignore

    def stand_in(self, uri: str) -> tuple[str, StandIn] | None:
        """The stand-in for `uri`, with the text that the user gave for it; None if there is
        none.
        """
        key = matching(self.stand_ins, uri)
        if key is None or self.stand_ins[key] == AUTO:
            return None
        self.used.add(key)
        return self.reading.stand_ins[key], self.stand_ins[key]

    def may_guess(self, uri: str) -> bool:
        """Whether the user wants a guessed shape for `uri`, which is missing."""
        key = matching(self.stand_ins, uri)
        if key is None:
            return ALL_MISSING in self.stand_ins
        return self.stand_ins[key] == AUTO


def _also(what: str, uris: Sequence[str]) -> str:
    """The end of a sentence that names other files."""
    if uris:
        return f"; {what}: {first_of([repr(uri[:100]) for uri in uris], MOST_NAMED)}"
    return ""


def sdf_root(text: bytes, path: Path) -> Element:
    """The `<sdf>` element of a file of a supported version. Raises UserError."""
    root = parse(text, path, root="sdf")
    macro = first_macro(root) if b"xacro" in text else None
    if macro is not None:
        raise refuse_xacro(macro, "SDF", "new.sdf")
    if root.tag == "robot":
        raise complain(root, f"is a robot in URDF, and no world; {how_to_include(path)}")
    if root.tag != "sdf":
        raise complain(root, "expected <sdf> as the outermost element: is this an SDF file?")
    given = root.get("version", "").strip()
    if given not in VERSIONS:
        said = f"version '{given[:20]}' is not supported" if given else "has no version attribute"
        raise complain(root, f"{said}; use SDF {VERSIONS[0]} to {VERSIONS[-1]}")
    return root


def how_to_include(path: Path) -> str:
    """How a world gets the model that is in a file, as the end of a sentence."""
    return f"name it in one: <include><uri>{path.absolute().as_uri()}</uri></include>"


def first_macro(root: Element) -> Element | None:
    """The first element of xacro: with its usual prefix, or with one that the file gives to its
    namespace.
    """
    prefixes = {"xacro"}
    for element in root.iter():
        prefixes |= {
            name.removeprefix("xmlns:")
            for name, value in element.attrib.items()
            if value.endswith("xacro")
        }
        prefix, colon, _ = element.tag.partition(":")
        if colon and prefix in prefixes:
            return element
    return None


def refuse_xacro(element: Element, expected: str, file: str) -> UserError:
    """The error for macros. They hold Python, which only the user can trust."""
    advice = (
        f"run 'xacro FILE > {file}' and name that file ('pip install xacro' brings the command)"
    )
    return complain(element, f"is xacro, not {expected}; {advice}")


def version(element: Element) -> tuple[int, int]:
    """The SDF version of the file that `element` is in, such as (1, 6)."""
    root = element
    while root.parent is not None:
        root = root.parent
    major, minor = (root.get("version") or "1.9").split(".")
    return int(major), int(minor)


def refuse(element: Element, tag: Ignorable, message: str) -> UserError:
    """The error for an element that is not supported but can be left out with `--ignore`."""
    return Unsupported(
        f"{place(element)}: {message}; leave it out with --ignore {tag}", tag, element.source
    )


def note_unread(element: Element, context: Context) -> None:
    """Notes every child of `element`, and of its plain substructures, that matters but is not
    read.
    """
    quiet = QUIET[element.tag]
    once: set[str] = set()
    for child in element:
        if child.tag in ONCE:
            if child.tag in once:
                context.note("ignored", child, f"only the first <{child.tag}> is used")
            once.add(child.tag)
        if child.tag not in quiet:
            unknown = f"an unknown {'extension' if ':' in child.tag else 'element'} of SDF"
            context.note("ignored", child, REASONS.get(child.tag, unknown))
        elif len(child):
            if child.tag in INSIDE:
                note_unread(child, context)
        elif (element.tag, child.tag) in WITHOUT and any(floats(child)):
            context.note("ignored", child, WITHOUT[element.tag, child.tag])
