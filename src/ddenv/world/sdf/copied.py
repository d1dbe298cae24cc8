"""Copies models from other files into the text of a world, in place of their `<include>`, so that parts of them can be removed."""

from __future__ import annotations

import posixpath
from collections.abc import Collection, Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

from ddenv.world.access import Missing, Unusable
from ddenv.world.files.resources import Resources
from ddenv.world.sdf.frames import Scope
from ddenv.world.sdf.includes import Part
from ddenv.world.sdf.xml import Edit, edited, tag_end, text_of

# Children of an `<include>` that say which model it is; all others belong to the model, and win over the file's own.
NAMING = ("uri", "name", "placement_frame")


def has_includes(part: Part) -> bool:
    """Whether `part`, or a model in it, is in another file than the world."""
    return part.at is not part.element or part.element.find(".//include") is not None


def with_copies(text: bytes, path: Path, scope: Scope, parts: Collection[Part], resources: Resources) -> bytes:
    """`text`, the content of the world `path`, with `parts` and all that they include written out; what cannot be copied stays.

    `resources` learns where the meshes of the copies are.
    """
    edits: list[Edit] = []
    for part in parts:
        edits += _copies(part, scope, text, "", path.parent, resources)
    return edited(text, edits)


def _copies(part: Part, scope: Scope, text: bytes, folder: str, base: Path, resources: Resources) -> Iterator[Edit]:
    """The changes of `text`, the content of the file that names `part`; relative URIs in that file start in `folder`."""
    if part.at is part.element:
        for inner in scope.inside(part).parts:
            yield from _copies(inner, scope.inside(part), text, folder, base, resources)
        return
    uri = text_of(part.at.find("uri"))
    try:
        source, copied = resources.sdf(uri, part.at.source.parent)
    except (Missing, Unusable):
        return
    # A URDF file, a stand-in or a built-in model has no `<model>` that could be copied.
    if source != part.element.source or not copied.startswith(b"<model", part.element.start):
        return
    own = posixpath.dirname(uri) if uri.rpartition("/")[2] == source.name else uri
    yield part.at.start, part.at.end, _copy(part, scope, (text, copied), _joined(folder, own), base, resources)


def _copy(part: Part, scope: Scope, texts: tuple[bytes, bytes], folder: str, base: Path, resources: Resources) -> bytes:
    """The `<model>` of an include: `texts` are the including file and the included one."""
    text, copied = texts
    edits: list[Edit] = []
    for inner in scope.inside(part).parts:
        edits += _copies(inner, scope.inside(part), copied, folder, base, resources)
    for mesh in part.element.iter("mesh"):
        uri = mesh.find("uri")
        if uri is not None:
            moved = _joined(folder, text_of(uri))
            resources.rename(text_of(uri), mesh.source.parent, moved, base)
            edits.append((tag_end(copied, uri), uri.end, quoteattr(moved)[1:-1].encode() + b"</uri>"))
    given = [child for child in part.at if child.tag not in NAMING]
    for tag in {child.tag for child in given} & {"pose", "static"}:
        edits += [(child.start, child.end, b"") for child in part.element.findall(tag)]
    begin = tag_end(copied, part.element)
    inside = edited(copied[: part.element.end], edits)[begin:]
    words = {"name": part.name, "placement_frame": part.placement_frame}
    words["canonical_link"] = part.element.get("canonical_link") or ""
    tag = "".join(f" {name}={quoteattr(value)}" for name, value in words.items() if value)
    return f"<model{tag}>".encode() + b"".join(text[one.start : one.end] for one in given) + (inside or b"</model>")


def _joined(folder: str, uri: str) -> str:
    return uri if "://" in uri else posixpath.join(folder, uri)
