"""Inside models (`reading.inside`): each collision of a model that never moves becomes a model of
its own, such as `house/wall_12`, which a reduction can remove. What is written is the file's own
text without these elements; models from other files are first copied into it, in place of their
`<include>`.
"""

from __future__ import annotations

import math
import posixpath
from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from ddenv.world.access import Missing, Unusable
from ddenv.world.files.resources import Resources
from ddenv.world.model import Collision, Link, Model, Note, Shared, Visual, World, is_ground
from ddenv.world.sdf.frames import Scope
from ddenv.world.sdf.includes import Part
from ddenv.world.sdf.xml import Edit, Element, edited, place, tag_end, text_of

# Elements and attributes by which others may name a link: then it stays where its last collision
# goes.
NAMING = ("joint", "frame", "gripper")
REFERENCES = ("relative_to", "attached_to", "frame", "placement_frame", "expressed_in")


def opened(world: World, root: Element) -> World:
    """`world` with the collisions of its models as models; `root` is the XML of its text."""
    at = {element.start: element for element in root.iter() if element.tag in ("model", "include")}
    models: list[Model] = []
    shared = list(world.shared)
    notes = list(world.notes)
    taken = set(world.names)
    for model in world.models:
        element = at[model.spans[0][0]]
        if len(model.collisions) < 2 or is_ground(model):
            models.append(model)
            continue
        closed = ""
        if not model.static:
            closed = "it can move"
        elif len({(link.name, one.name) for link in model.links for one in link.collisions}) == 1:
            closed = (
                "it is one mesh; 'ddenv world convert' writes its pieces as collisions of their own"
            )
        elif model.name in world.anchors:
            closed = "other models depend on it"
        elif element.tag == "include" or element.find(".//include") is not None:
            closed = (
                "parts of it are in files that cannot be copied into this one; 'ddenv world "
                "convert' does it"
            )
        links = {} if closed else dict(_links(element))
        parts = [
            part for link in model.links if links for part in _parts(model, link, links[link.name])
        ]
        names = {part.name for part in parts}
        if len(names) < len(parts) or not taken.isdisjoint(names):
            closed = "two of its parts, or a part and a model, have one name"
        if closed:
            notes.append(
                Note(
                    kind="ignored",
                    model=model.name,
                    place=place(element),
                    what="--inside",
                    why=f"it stays whole, since {closed}",
                )
            )
            models.append(model)
            continue
        taken |= names
        models += parts
        shared += _emptied(model, element, links, parts)
    return replace(world, models=tuple(models), shared=tuple(shared), notes=tuple(notes))


def _links(element: Element, prefix: str = "") -> Iterator[tuple[str, Element]]:
    """The links in a `<model>` and in those nested in it, by the names that `Model.links` has."""
    for child in element:
        if child.tag == "link":
            yield prefix + child.get("name", ""), child
        elif child.tag == "model":
            yield from _links(child, f"{prefix}{child.get('name')}::")


def _parts(model: Model, link: Link, element: Element) -> Iterator[Model]:
    """The collisions of a link as models, each with its pieces, and with the visuals that are
    nearest to it.
    """
    named = {
        tag: {child.get("name"): child for child in element.findall(tag)}
        for tag in ("collision", "visual")
    }
    shown: dict[int, list[Visual]] = {}
    for visual in link.visuals if link.collisions else ():
        gaps = [math.dist(visual.pose.position, one.pose.position) for one in link.collisions]
        shown.setdefault(gaps.index(min(gaps)), []).append(visual)
    prefix = "/".join([model.name, *link.name.split("::")]) if len(model.links) > 1 else model.name
    whole = [list(pieces) for _, pieces in groupby(enumerate(link.collisions), key=_mesh_or_number)]
    for numbered in whole:
        name = numbered[0][1].name
        visuals = tuple(visual for number, _ in numbered for visual in shown.get(number, ()))
        elements = [named["collision"][name], *(named["visual"][visual.name] for visual in visuals)]
        pieces = tuple(piece for _, piece in numbered)
        yield replace(
            model,
            name=prefix if len(whole) == 1 < len(model.links) else f"{prefix}/{name}",
            pose=pieces[0].pose,
            links=(replace(link, collisions=pieces, visuals=visuals),),
            spans=tuple((one.start, one.end) for one in elements),
            line=elements[0].line,
            inside=model.name,
        )


def _mesh_or_number(numbered: tuple[int, Collision]) -> tuple[str, int]:
    """What the pieces of one `<collision>` have in common, and no others."""
    number, collision = numbered
    if collision.piece is None:
        return ("", number)
    return (collision.name, id(collision.piece.mesh))


def _emptied(
    model: Model, element: Element, links: dict[str, Element], parts: list[Model]
) -> Iterator[Shared]:
    """The links and models that go with the last of their parts."""
    spans: dict[tuple[int, int], set[str]] = {}
    for part in parts:
        at: Element | None = links[part.links[0].name]
        while at is not None and at is not element:
            spans.setdefault((at.start, at.end), set()).add(part.name)
            at = at.parent
    named = any(one.tag in NAMING or any(map(one.get, REFERENCES)) for one in element.iter())
    if not named and len(model.spans) == 1:
        yield from (Shared(span, frozenset(names)) for span, names in spans.items())
    whole = frozenset(part.name for part in parts)
    yield from (Shared(span, whole) for span in model.spans)


# Children of an `<include>` that say which model it is; all others belong to the model, and win
# over the file's own.
OF_INCLUDES = ("uri", "name", "placement_frame")
# The maximum size of all copies, bytes: a small world may include a large file a thousand times.
MOST_COPIED = 50_000_000
# Meshes: the URI, the folder of the file that has it, and the URI in the copy.
Moved = dict[tuple[str, str, str], None]


def has_includes(part: Part) -> bool:
    """Whether `part`, or a model in it, is in another file than the world."""
    return part.at is not part.element or part.element.find(".//include") is not None


def with_copies(
    text: bytes, path: Path, scope: Scope, parts: Collection[Part], resources: Resources
) -> bytes:
    """`text`, the content of the world `path`, with `parts` and all that they include written out;
    what cannot be copied stays.

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
    """The bytes of a model with all that it includes; `known` has those of other models by the `id`
    of their element.
    """
    key = id(part.element)
    if key not in known:
        inner = scope.inside(part)
        known[key] = (
            part.element.end
            - part.element.start
            + sum(_size(one, inner, known) for one in inner.parts)
        )
    return known[key]


def _copies(
    part: Part, scope: Scope, text: bytes, folder: str, resources: Resources, moved: Moved
) -> Iterator[Edit]:
    """The changes of `text`, the content of the file that names `part`; relative URIs in that file
    start in `folder`.
    """
    if part.at is part.element:
        for inner in scope.inside(part).parts:
            yield from _copies(inner, scope.inside(part), text, folder, resources, moved)
        return
    if part.merged:
        return
    uri = text_of(part.at.find("uri"))
    try:
        source, copied = resources.sdf(uri, part.at.source.parent)
    except (Missing, Unusable):
        return
    # A URDF file, and a stand-in for a file, have no `<model>` that could be copied.
    if source != part.element.source or not copied.startswith(b"<model", part.element.start):
        return
    folder = _joined(
        folder, posixpath.dirname(uri) if uri.rpartition("/")[2] == source.name else uri
    )
    edits: list[Edit] = []
    for inner in scope.inside(part).parts:
        edits += _copies(inner, scope.inside(part), copied, folder, resources, moved)
    for mesh in part.element.iter("mesh"):
        name = mesh.find("uri")
        if name is not None:
            new = _joined(folder, text_of(name))
            moved[text_of(name), str(source.parent), new] = None
            edits.append((tag_end(copied, name), name.end, f"{escape(new)}</uri>".encode()))
    given = [child for child in part.at if child.tag not in OF_INCLUDES]
    for tag in {child.tag for child in given} & {"pose", "static"}:
        edits += [(child.start, child.end, b"") for child in part.element.findall(tag)]
    own = {"name": part.name, "placement_frame": part.placement_frame}
    own["canonical_link"] = part.element.get("canonical_link", "")
    tag = "".join(f" {name}={quoteattr(value)}" for name, value in own.items() if value)
    # An empty `<model .../>` has no end tag.
    inside = (
        edited(copied[: part.element.end], edits)[tag_end(copied, part.element) :] or b"</model>"
    )
    start = f"<model{tag}>".encode() + b"".join(text[child.start : child.end] for child in given)
    yield part.at.start, part.at.end, start + inside


def _joined(folder: str, uri: str) -> str:
    if "://" in uri:
        return uri
    return posixpath.join(folder, uri)
