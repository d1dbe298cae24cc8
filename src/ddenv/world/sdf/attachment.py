"""Which link a frame is attached to: what the ends of joints name."""

from __future__ import annotations

from ddenv.world.sdf.context import Context
from ddenv.world.sdf.frames import OWN, Scope, shown
from ddenv.world.sdf.parts import Part
from ddenv.world.sdf.xml import Element, complain, name_of, text_of


def link_of(scope: Scope, name: str, asker: Element, context: Context) -> str | None:
    """The link that the frame `name` of a model is attached to, such as `link` or `inner::link`; None where there is none.

    Complaints are about `asker`. Raises UserError.
    """
    seen: dict[str, None] = {}
    while name not in OWN:
        if name in seen:
            raise complain(asker, f"frames are attached to each other in a circle: {shown([*seen, name])}")
        seen[name] = None
        thing = scope.named.get(name)
        if thing is None:
            return _inside(scope, name, asker, context) if "::" in name else None
        if isinstance(thing, Part):
            return _joined(name, _canonical(scope.inside(thing), asker, context))
        if thing.tag == "link":
            return name
        name = text_of(thing.find("child")) if thing.tag == "joint" else (thing.get("attached_to") or "").strip()
    return _canonical(scope, asker, context)


def _inside(scope: Scope, name: str, asker: Element, context: Context) -> str | None:
    first, rest = name.split("::", 1)
    thing = scope.named.get(first)
    if not isinstance(thing, Part):
        return None
    return _joined(first, link_of(scope.inside(thing), rest, asker, context))


def _joined(model: str, link: str | None) -> str | None:
    return None if link is None else f"{model}::{link}"


def _canonical(scope: Scope, asker: Element, context: Context) -> str | None:
    """The link that a model's own frame is attached to: the one it names, else its first."""
    key = id(scope.element)
    if key not in context.canonical:
        context.canonical[key] = _find_canonical(scope, asker, context)
    return context.canonical[key]


def _find_canonical(scope: Scope, asker: Element, context: Context) -> str | None:
    named = scope.element.get("canonical_link")
    if named:
        return None if named in OWN else link_of(scope, named, asker, context)
    first = scope.element.find("link")
    if first is not None:
        return name_of(first)
    for part in scope.parts:
        link = _joined(part.name, _canonical(scope.inside(part), asker, context))
        if link is not None:
            return link
    return None
