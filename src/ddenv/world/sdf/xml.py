"""XML that remembers where it stands: elements with their file, line and bytes, so that every complaint can point."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser

from ddenv.errors import UserError

# Deeper than any world that a program wrote; what reads it calls itself once for each level.
DEEPEST = 100
_TAG_END = re.compile(rb"""(?:[^'">]|"[^"]*"|'[^']*')*>""")


class Element(ElementTree.Element):
    """An XML element with its file (`source`), its first `line`, its byte `start` and `end` in it, and its `parent`."""

    __slots__ = ("end", "line", "parent", "source", "start")

    source: Path
    line: int
    start: int
    end: int
    parent: Element | None


class _Builder(ElementTree.TreeBuilder):
    """Builds `Element`s; `expat` tells where in the file each of them is."""

    def __init__(self, text: bytes, source: Path) -> None:
        super().__init__(element_factory=Element)
        self.text = text
        self.source = source
        self.open: list[Element] = []
        self.expat = None

    def start(self, tag, attributes):
        element = super().start(tag, attributes)
        element.source = self.source
        element.line = self.expat.CurrentLineNumber
        element.start = self.expat.CurrentByteIndex
        element.parent = self.open[-1] if self.open else None
        self.open.append(element)
        if len(self.open) > DEEPEST:
            raise UserError(f"{self.source}:{element.line}: elements are nested more than {DEEPEST} deep")
        return element

    def end(self, tag):
        element = self.open.pop()
        # Where expat says that `<a/>` ends depends on its version, so such elements are told by their own tag.
        found = _TAG_END.match(self.text, element.start)
        if found and not found.group().endswith(b"/>"):
            found = _TAG_END.match(self.text, self.expat.CurrentByteIndex)
        element.end = found.end() if found else len(self.text)
        return super().end(tag)


def parse(text: bytes, path: Path) -> Element:
    """The root element of `text`. Raises UserError with file and line for anything that is not plain, safe XML."""
    if not text.strip():
        raise UserError(f"{path}: the file is empty; expected an SDF file")
    if text.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in text[:100]:
        raise UserError(f"{path}: is UTF-16 or UTF-32, or no text at all; save it as UTF-8")
    builder = _Builder(text, path)
    parser = DefusedXMLParser(target=builder, forbid_dtd=True, forbid_entities=True, forbid_external=True)
    builder.expat = parser.parser
    try:
        parser.feed(text)
        return parser.close()
    except ElementTree.ParseError as error:
        reason = str(error).split(":")[0]
        raise UserError(f"{path}:{error.position[0]}: not well-formed XML: {reason}") from None
    except DefusedXmlException:
        line = builder.expat.CurrentLineNumber
        why = "its entities can read other files and fill the memory"
        raise UserError(f"{path}:{line}: a DOCTYPE is refused ({why}); remove it") from None
    except (LookupError, ValueError) as error:
        raise UserError(f"{path}: cannot be decoded: {error}; save it as UTF-8") from None


def xpath(element: Element) -> str:
    """Where `element` stands, such as /sdf/world/model[@name='box']/link[@name='link']/pose."""
    steps = []
    node: Element | None = element
    while node is not None:
        name = node.get("name")
        steps.append(node.tag if name is None or node.tag == "world" else f"{node.tag}[@name='{name[:80]}']")
        node = node.parent
    return "/" + "/".join(reversed(steps))


def place(element: Element) -> str:
    """File, line and XPath of `element`."""
    return f"{element.source}:{element.line}: {xpath(element)}"


def complain(element: Element, message: str) -> UserError:
    """A UserError that says where: file, line and XPath."""
    return UserError(f"{place(element)}: {message}")


def text_of(element: Element | None) -> str:
    """The text of `element` without the blanks around it; empty where there is no element."""
    return "" if element is None else (element.text or "").strip()


def name_of(element: Element) -> str:
    """The name attribute. Raises UserError where there is none."""
    name = element.get("name")
    if not name or not name.strip():
        raise complain(element, "has no name attribute; give it one")
    return name


def floats(element: Element) -> tuple[float, ...]:
    """All numbers in the text of `element`, which may be infinite or NaN; none at all if one of the words is no number."""
    text = element.text or ""
    # Python would also take 1_000, and the digits of other scripts.
    if "_" in text or not text.isascii():
        return ()
    try:
        return tuple([float(word) for word in text.split()])
    except ValueError:
        return ()


def numbers(element: Element, count: int) -> tuple[float, ...]:
    """The `count` finite numbers that are the text of `element`."""
    values = floats(element)
    if len(values) != count or not all(map(math.isfinite, values)):
        shown = " ".join((element.text or "").split())[:60]
        wanted = "one finite number" if count == 1 else f"{count} finite numbers"
        raise complain(element, f"expected {wanted}, found '{shown}'")
    return values


def number(parent: Element, tag: str, default: float) -> float:
    """The number in child `tag` of `parent`, or `default` where there is none."""
    child = parent.find(tag)
    return default if child is None else numbers(child, 1)[0]


def truth(parent: Element, tag: str, default: bool) -> bool:
    """SDF's booleans: true, false, 1, 0."""
    child = parent.find(tag)
    if child is None:
        return default
    word = (child.text or "").strip().lower()
    if word in ("1", "true"):
        return True
    if word in ("0", "false"):
        return False
    raise complain(child, f"expected true or false, found '{word[:60]}'")
