"""XML elements that know their file, line and byte range, so that every error message can point at
its cause.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

from ddenv.errors import UserError
from ddenv.world.tinyxml import Element as Element
from ddenv.world.tinyxml import NotXml, parse_xml

# (start, end, text): the bytes from start to end are replaced.
Edit = tuple[int, int, bytes]
_TAG_END = re.compile(rb"""(?:[^'">]|"[^"]*"|'[^']*')*>""")


def parse(text: bytes, path: Path, root: str = "") -> Element:
    """The element called `root` of `text`, or else its first one. Raises UserError with file, line
    and column.
    """
    if not text.strip():
        raise UserError(f"{path}: the file is empty; expected an SDF file")
    try:
        return parse_xml(text, path, root)
    except NotXml as error:
        where = f"{path}:{error.line}:{error.column}" if error.line else str(path)
        raise UserError(f"{where}: {error.why}") from None


def tag_end(text: bytes, element: Element) -> int:
    """Where the start tag of `element` ends in `text`, the content of its file."""
    found = _TAG_END.match(text, element.start)
    if found is None:
        return element.end
    return found.end()


def with_words(text: bytes, element: Element, words: str) -> Edit:
    """`element` with other words in it."""
    start = (
        text[element.start : tag_end(text, element)].removesuffix(b">").removesuffix(b"/").rstrip()
    )
    return element.start, element.end, start + f">{words}</{element.tag}>".encode()


def with_child(text: bytes, holder: Element, new: str) -> Edit:
    """`holder` with new elements as its first ones."""
    end = tag_end(text, holder)
    if end == holder.end:
        return with_words(text, holder, new)
    return (end, end, new.encode())


def edited(text: bytes, edits: Sequence[Edit]) -> bytes:
    """`text` with some bytes replaced."""
    parts = []
    at = 0
    for start, end, new in sorted(edits):
        parts += [text[at:start], new]
        at = end
    return b"".join([*parts, text[at:]])


def place(element: Element) -> str:
    """File, line and XPath of `element`, such as
    /sdf/world/model[@name='box']/link[@name='link']/pose.
    """
    steps = []
    node: Element | None = element
    while node is not None:
        name = node.get("name")
        steps.append(
            node.tag if name is None or node.tag == "world" else f"{node.tag}[@name='{name[:80]}']"
        )
        node = node.parent
    return f"{element.source}:{element.line}: /{'/'.join(reversed(steps))}"


def complain(element: Element, message: str) -> UserError:
    """A UserError with file, line and XPath of `element`."""
    return UserError(f"{place(element)}: {message}")


def text_of(element: Element | None) -> str:
    """The text of `element` without surrounding white space; empty for None."""
    if element is None:
        return ""
    return (element.text or "").strip()


def name_of(element: Element) -> str:
    """The name attribute. Raises UserError if it is missing."""
    name = element.get("name")
    if not name or not name.strip():
        raise complain(element, "has no name attribute; add one")
    return name


def floats(element: Element) -> tuple[float, ...]:
    """All numbers in the text of `element`, infinite ones and NaN included; empty if any word is
    not a number.
    """
    text = element.text or ""
    # Python would also accept 1_000 and the digits of other scripts.
    if "_" in text or not text.isascii():
        return ()
    try:
        return tuple([float(word) for word in text.split()])
    except ValueError:
        return ()


def numbers(element: Element, count: int) -> tuple[float, ...]:
    """The text of `element` as `count` finite numbers. Raises UserError."""
    values = floats(element)
    if len(values) != count or not all(map(math.isfinite, values)):
        shown = " ".join(text_of(element).split())[:60]
        wanted = "one finite number" if count == 1 else f"{count} finite numbers"
        raise complain(element, f"expected {wanted}, found '{shown}'")
    return values


def number(parent: Element, tag: str, default: float) -> float:
    """The number in child `tag` of `parent`, or `default` if there is no such child. Raises
    UserError.
    """
    child = parent.find(tag)
    if child is None:
        return default
    return numbers(child, 1)[0]


def number_or_nan(parent: Element, path: str, default: float = math.nan) -> float:
    """The number in the child `path` of `parent`, NaN if it is not one number; `default` if there
    is no such child.
    """
    child = parent.find(path)
    values = (default,) if child is None else floats(child)
    if len(values) == 1:
        return values[0]
    return math.nan


def truth(parent: Element, tag: str, default: bool) -> bool:
    """The boolean (true, false, 1, 0) in child `tag` of `parent`, or `default`. Raises
    UserError.
    """
    child = parent.find(tag)
    if child is None:
        return default
    word = text_of(child).lower()
    if word not in ("1", "true", "0", "false"):
        raise complain(child, f"expected true or false, found '{word[:60]}'")
    return word in ("1", "true")
