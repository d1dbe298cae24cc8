"""XML that remembers where it stands: elements with their line, bytes and path, so that every complaint can point."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from ddenv.errors import UserError


class Element(ElementTree.Element):
    """An XML element with its first `line`, its byte `start` and `end` in the file, and its `parent`."""

    line: int
    start: int
    end: int
    parent: Element | None


class _Builder(ElementTree.TreeBuilder):
    """Builds `Element`s; `expat` tells where in the file each of them is."""

    def __init__(self, text: bytes) -> None:
        super().__init__(element_factory=Element)
        self.text = text
        self.open: list[Element] = []
        self.expat = None

    def start(self, tag, attributes):
        element = super().start(tag, attributes)
        element.line = self.expat.CurrentLineNumber
        element.start = self.expat.CurrentByteIndex
        element.parent = self.open[-1] if self.open else None
        self.open.append(element)
        return element

    def end(self, tag):
        # For `<a/>` expat reports the end at the element's own start: either way the next `>` outside quotes closes it.
        self.open.pop().end = _after_tag(self.text, self.expat.CurrentByteIndex)
        return super().end(tag)


def _after_tag(text: bytes, start: int) -> int:
    quote = None
    for index in range(start, len(text)):
        char = text[index]
        if quote is not None:
            quote = None if char == quote else quote
        elif char in b"\"'":
            quote = char
        elif char == ord(">"):
            return index + 1
    return len(text)


def parse(text: bytes, path: Path) -> Element:
    """The root element of `text`. Raises UserError with file and line for anything that is not plain, safe XML."""
    if not text.strip():
        raise UserError(f"{path}: the file is empty; expected an SDF file")
    if text.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in text[:100]:
        raise UserError(f"{path}: is UTF-16 or UTF-32; save it as UTF-8")
    builder = _Builder(text)
    parser = DefusedXMLParser(target=builder, forbid_dtd=False, forbid_entities=True, forbid_external=True)
    builder.expat = parser.parser
    try:
        parser.feed(text)
        return parser.close()
    except ElementTree.ParseError as error:
        reason = str(error).split(":")[0]
        raise UserError(f"{path}:{error.position[0]}: not well-formed XML: {reason}") from None
    except DefusedXmlException:
        line = builder.expat.CurrentLineNumber
        raise UserError(f"{path}:{line}: XML entities are refused (they can read other files); remove them") from None
    except (LookupError, ValueError) as error:
        raise UserError(f"{path}: cannot be decoded: {error}; save it as UTF-8") from None


def xpath(element: Element) -> str:
    """Where `element` stands, such as /sdf/world/model[@name='box']/link[@name='link']/pose."""
    steps = []
    node: Element | None = element
    while node is not None:
        name = node.get("name")
        steps.append(node.tag if name is None or node.tag == "world" else f"{node.tag}[@name='{name}']")
        node = node.parent
    return "/" + "/".join(reversed(steps))


def complain(element: Element, path: Path, message: str) -> UserError:
    """A UserError that says where: file, line and XPath."""
    return UserError(f"{path}:{element.line}: {xpath(element)}: {message}")


def numbers(element: Element, path: Path, count: int) -> tuple[float, ...]:
    """The `count` finite numbers that are the text of `element`."""
    words = (element.text or "").split()
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    if len(values) != count or not all(math.isfinite(value) for value in values):
        shown = " ".join(words)[:60]
        wanted = "one finite number" if count == 1 else f"{count} finite numbers"
        raise complain(element, path, f"expected {wanted}, found '{shown}'")
    return values


def number(parent: Element, tag: str, path: Path, default: float) -> float:
    """The number in child `tag` of `parent`, or `default` where there is none."""
    child = parent.find(tag)
    return default if child is None else numbers(child, path, 1)[0]


def truth(parent: Element, tag: str, path: Path, default: bool) -> bool:
    """SDF's booleans: true, false, 1, 0."""
    child = parent.find(tag)
    if child is None:
        return default
    word = (child.text or "").strip().lower()
    if word in ("1", "true"):
        return True
    if word in ("0", "false"):
        return False
    raise complain(child, path, f"expected true or false, found '{word[:60]}'")
