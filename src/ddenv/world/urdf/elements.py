"""Elements of SDF made from those of a URDF file, which complaints then point to."""

from __future__ import annotations

from ddenv.world.sdf.xml import Element, complain, number


def element(tag: str, source: Element, text: str = "", **attributes: str) -> Element:
    """An SDF element with that text, which stands where `source` does and belongs to it."""
    made = Element(tag, attributes)
    made.text = text
    made.source, made.line, made.start, made.end = source.source, source.line, source.start, source.end
    made.parent = source
    return made


def twin(source: Element, **attributes: str) -> Element:
    """The SDF element for one of URDF that has the same tag, without what is in it."""
    made = element(source.tag, source, **attributes)
    made.parent = source.parent
    return made


def given(source: Element, attribute: str) -> str:
    """An attribute that URDF asks for. Raises UserError where it is missing."""
    value = source.get(attribute)
    if value is None or not value.strip():
        raise complain(source, f"has no attribute '{attribute}'")
    return value.strip()


def value(source: Element, attribute: str) -> float:
    """An attribute that is one finite number. Raises UserError."""
    holder = element(source.tag, source)
    holder.append(element(attribute, source, given(source, attribute)))
    return number(holder, attribute, 0.0)


def three(source: Element, attribute: str, default: str) -> str:
    """An attribute of three words, or `default`. Raises UserError."""
    text = source.get(attribute, default)
    if len(text.split()) != 3:
        raise complain(source, f"{attribute} must be three numbers, found '{text[:60]}'")
    return text


def pose(source: Element, relative_to: str = "") -> Element:
    """The `<pose>` that the `<origin>` in `source` stands for. Raises UserError."""
    origin = source.find("origin")
    holder = source if origin is None else origin
    words = "0 0 0 0 0 0" if origin is None else f"{three(origin, 'xyz', '0 0 0')} {three(origin, 'rpy', '0 0 0')}"
    return element("pose", holder, words, **({"relative_to": relative_to} if relative_to else {}))
