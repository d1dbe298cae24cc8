"""What the reading of one file carries along: where other files come from, what the user allows, and what was noted."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ddenv.errors import UserError
from ddenv.world.files.resources import Resources, Unusable
from ddenv.world.model import Note
from ddenv.world.scenario import PLAIN, Reading
from ddenv.world.sdf.standin import StandIn, matching, parse_stand_ins
from ddenv.world.sdf.xml import Element, complain, parse, place

VERSIONS = ("1.4", "1.5", "1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12")


@dataclass
class Context:
    """`model` is the name of the world's model that is being read, for the notes."""

    resources: Resources
    reading: Reading = PLAIN
    notes: list[Note] = field(default_factory=list)
    model: str = ""
    stand_ins: dict[str, StandIn] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)
    assembled: int = 0
    missing: dict[str, UserError] = field(default_factory=dict)
    files: dict[Path, Element] = field(default_factory=dict)
    scopes: dict[int, Any] = field(default_factory=dict)
    canonical: dict[int, str | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.stand_ins = parse_stand_ins(self.reading.stand_ins)

    def note(self, kind: Literal["replaced", "ignored"], element: Element, why: str, detail: str = "") -> None:
        """Remembers that `element` was not taken as it is."""
        self.notes.append(Note(kind, self.model, place(element), f"<{element.tag}>", why, detail))

    def miss(self, uri: str, error: UserError) -> None:
        """Remembers a complaint about a file that is nowhere, so that all of them can be told at once."""
        self.missing.setdefault(uri, error)

    def complain_of_missing(self) -> None:
        """Raises the first complaint about a file that is nowhere, with the names of the others."""
        if not self.missing:
            return
        (_, first), *others = self.missing.items()
        names = ", ".join(f"'{uri[:100]}'" for uri, _ in others[:5])
        more = f" and {len(others) - 5} more" if len(others) > 5 else ""
        raise UserError(f"{first}; also missing: {names}{more}") if others else first

    def ignores(self, tag: str) -> bool:
        return tag in self.reading.ignore

    def stand_in(self, uri: str) -> tuple[str, StandIn] | None:
        """What the user gave in place of `uri`, with the text it was given as."""
        key = matching(self.stand_ins, uri)
        if key is None:
            return None
        self.used.add(key)
        return self.reading.stand_ins[key], self.stand_ins[key]

    def root(self, element: Element, uri: str) -> Element:
        """The `<sdf>` of the file that `element` includes. Raises Missing, and UserError for a file that is no SDF."""
        try:
            path, text = self.resources.sdf(uri, element.source.parent)
        except Unusable as error:
            raise complain(element, f"'{uri[:200]}' cannot be included: {error}") from None
        if path not in self.files:
            self.files[path] = sdf_root(text, path)
        return self.files[path]


def sdf_root(text: bytes, path: Path) -> Element:
    """The `<sdf>` element of a file of a version that is known. Raises UserError."""
    root = parse(text, path)
    if root.tag != "sdf":
        raise complain(root, "expected <sdf> as the outermost element: is this an SDF file?")
    given = (root.get("version") or "").strip()
    if given not in VERSIONS:
        said = f"version '{given[:20]}' is unknown" if given else "has no version attribute"
        raise complain(root, f"{said}; SDF {VERSIONS[0]} to {VERSIONS[-1]} can be read")
    return root


def version(element: Element) -> tuple[int, int]:
    """The SDF version of the file that `element` is in, such as (1, 6)."""
    root = element
    while root.parent is not None:
        root = root.parent
    major, minor = (root.get("version") or "1.9").split(".")
    return int(major), int(minor)


def refuse(element: Element, message: str) -> UserError:
    """The complaint for what is not read, whose remedy is to leave it out by `--ignore`."""
    return complain(element, f"{message}; leave it out with --ignore {element.tag}")
