"""Inside models (`reading.inside`): each collision of a model that never moves becomes a model of its own, such as `house/wall_12`,
which a reduction can remove. What is written is the file's own text without these elements.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from ddenv.world.model import Link, Model, Note, Shared, Visual, World, is_ground
from ddenv.world.sdf.xml import Element, place

# Elements and attributes by which others may name a link: then it stays where its last collision goes.
NAMING = ("joint", "frame", "gripper")
REFERENCES = ("relative_to", "attached_to", "frame", "placement_frame", "expressed_in")


def opened(world: World, root: Element) -> World:
    """`world` with the collisions of its models as models; `root` is the XML of its text."""
    at = {element.start: element for element in root.iter() if element.tag in ("model", "include")}
    models: list[Model] = []
    shared, notes = list(world.shared), list(world.notes)
    taken = {model.name for model in world.models}
    for model in world.models:
        element = at[model.spans[0][0]]
        if len(model.collisions) < 2 or is_ground(model):
            models.append(model)
            continue
        closed = ""
        if not model.static:
            closed = "it can move"
        elif model.name in world.anchors:
            closed = "other models are placed relative to it"
        elif element.tag == "include" or element.find(".//include") is not None:
            closed = "parts of it are in files that cannot be copied into this one; 'ddenv world convert' does it"
        links = {} if closed else dict(_links(element))
        parts = [part for link in model.links if links for part in _parts(model, link, links[link.name])]
        names = {part.name for part in parts}
        if len(names) < len(parts) or not taken.isdisjoint(names):
            closed = "two of its parts, or a part and a model, have one name"
        if closed:
            notes.append(Note("ignored", model.name, place(element), "--inside", f"it stays whole, since {closed}"))
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
            yield prefix + (child.get("name") or ""), child
        elif child.tag == "model":
            yield from _links(child, f"{prefix}{child.get('name')}::")


def _parts(model: Model, link: Link, element: Element) -> Iterator[Model]:
    """The collisions of a link as models, each with the visuals that are nearest to it."""
    named = {tag: {child.get("name"): child for child in element.findall(tag)} for tag in ("collision", "visual")}
    shown: dict[int, list[Visual]] = {}
    for visual in link.visuals if link.collisions else ():
        gaps = [math.dist(visual.pose.position, one.pose.position) for one in link.collisions]
        shown.setdefault(gaps.index(min(gaps)), []).append(visual)
    prefix = "/".join([model.name, *link.name.split("::")]) if len(model.links) > 1 else model.name
    for number, collision in enumerate(link.collisions):
        visuals = tuple(shown.get(number, ()))
        elements = [named["collision"][collision.name], *(named["visual"][visual.name] for visual in visuals)]
        yield replace(
            model,
            name=prefix if len(link.collisions) == 1 < len(model.links) else f"{prefix}/{collision.name}",
            pose=collision.pose,
            links=(replace(link, collisions=(collision,), visuals=visuals),),
            spans=tuple((one.start, one.end) for one in elements),
            line=elements[0].line,
            inside=model.name,
        )


def _emptied(model: Model, element: Element, links: dict[str, Element], parts: list[Model]) -> Iterator[Shared]:
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
