"""Copies models from other files into the text of a world, in place of their `<include>`, so that parts of them can be removed."""

from __future__ import annotations

import posixpath
from collections.abc import Collection, Iterator
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from ddenv.world.access import Missing, Unusable
from ddenv.world.files.resources import Resources
from ddenv.world.sdf.frames import Scope
from ddenv.world.sdf.includes import Part
from ddenv.world.sdf.xml import Edit, edited, tag_end, text_of

# Children of an `<include>` that say which model it is; all others belong to the model, and win over the file's own.
NAMING = ("uri", "name", "placement_frame")
# The maximum size of all copies, bytes: a small world may include a large file a thousand times.
MOST_COPIED = 50_000_000
# Meshes: the URI, the folder of the file that has it, and the URI in the copy.
Moved = dict[tuple[str, str, str], None]


def has_includes(part: Part) -> bool:
    """Whether `part`, or a model in it, is in another file than the world."""
    return part.at is not part.element or part.element.find(".//include") is not None


def with_copies(text: bytes, path: Path, scope: Scope, parts: Collection[Part], resources: Resources) -> bytes:
    """`text`, the content of the world `path`, with `parts` and all that they include written out; what cannot be copied stays.

    `resources` learns where the meshes of the copies are.
    """
    sizes: dict[int, int] = {}
    if sum(_size(part, scope, sizes) for part in parts) > MOST_COPIED:
        return text
    edits: list[Edit] = []
    moved: Moved = {}
    for part in parts:
        edits += _copies(part, scope, text, "", resources, moved)
    for uri, folder, new in moved:
        resources.rename(uri, folder, new, str(path.parent))
    return edited(text, edits)


def _size(part: Part, scope: Scope, known: dict[int, int]) -> int:
    """The bytes of a model with all that it includes; `known` has those of other models by the `id` of their element."""
    key = id(part.element)
    if key not in known:
        inner = scope.inside(part)
        known[key] = part.element.end - part.element.start + sum(_size(one, inner, known) for one in inner.parts)
    return known[key]


def _copies(part: Part, scope: Scope, text: bytes, folder: str, resources: Resources, moved: Moved) -> Iterator[Edit]:
    """The changes of `text`, the content of the file that names `part`; relative URIs in that file start in `folder`."""
    if part.at is part.element:
        for inner in scope.inside(part).parts:
            yield from _copies(inner, scope.inside(part), text, folder, resources, moved)
        return
    uri = text_of(part.at.find("uri"))
    try:
        source, copied = resources.sdf(uri, part.at.source.parent)
    except (Missing, Unusable):
        return
    # A URDF file, and a stand-in for a file, have no `<model>` that could be copied.
    if source != part.element.source or not copied.startswith(b"<model", part.element.start):
        return
    folder = _joined(folder, posixpath.dirname(uri) if uri.rpartition("/")[2] == source.name else uri)
    edits: list[Edit] = []
    for inner in scope.inside(part).parts:
        edits += _copies(inner, scope.inside(part), copied, folder, resources, moved)
    for mesh in part.element.iter("mesh"):
        name = mesh.find("uri")
        if name is not None:
            new = _joined(folder, text_of(name))
            moved[text_of(name), str(source.parent), new] = None
            edits.append((tag_end(copied, name), name.end, f"{escape(new)}</uri>".encode()))
    given = [child for child in part.at if child.tag not in NAMING]
    for tag in {child.tag for child in given} & {"pose", "static"}:
        edits += [(child.start, child.end, b"") for child in part.element.findall(tag)]
    own = {"name": part.name, "placement_frame": part.placement_frame}
    own["canonical_link"] = part.element.get("canonical_link", "")
    tag = "".join(f" {name}={quoteattr(value)}" for name, value in own.items() if value)
    # An empty `<model .../>` has no end tag.
    inside = edited(copied[: part.element.end], edits)[tag_end(copied, part.element) :] or b"</model>"
    start = f"<model{tag}>".encode() + b"".join(text[child.start : child.end] for child in given)
    yield part.at.start, part.at.end, start + inside


def _joined(folder: str, uri: str) -> str:
    return uri if "://" in uri else posixpath.join(folder, uri)
