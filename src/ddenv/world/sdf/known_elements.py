"""The elements that the official SDF checker knows, and what it demands of their text (libsdformat
12: `Param.cc`).
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ddenv.world.sdf.xml import Element, text_of

TABLE = Path(__file__).with_name("known_elements.txt")
_ENTRY = re.compile(r"([^@:!]+)((?:@[^@:!]+)*)(?::(\w+))?(!?)")
_DECIMAL = r"[+-]?+(?:\d++\.?+\d*+|\.\d++)(?:e[+-]?\d++)?+"
# As `strtod` and `strtol`, these accept anything behind the number.
_NUMBER = re.compile(rf"\s*+(?:[+-]?(?:0x[\da-f]|inf|nan)|({_DECIMAL}))", re.IGNORECASE)
_WHOLE = re.compile(r"\s*+[+-]?\d++")


@dataclass(frozen=True)
class Known:
    """What is known of a child: the attributes that it must have, the `kind` of its text, and
    whether that must not be empty.
    """

    attributes: tuple[str, ...]
    kind: str
    required: bool


@cache
def known_children() -> dict[str, dict[str, Known]]:
    """By the tag of the parent and of the child."""
    known: dict[str, dict[str, Known]] = {}
    for line in TABLE.read_text(encoding="utf-8").splitlines():
        parent, colon, children = line.partition(": ")
        if not colon or line.startswith("#"):
            continue
        known[parent] = {}
        for entry in filter(None, map(_ENTRY.fullmatch, children.split())):
            tag, attributes, kind, required = entry.groups()
            names = tuple(attributes.split("@")[1:])
            known[parent][tag] = Known(attributes=names, kind=kind or "", required=bool(required))
    return known


def fault(element: Element, known: Known) -> str:
    """What the checker refuses in the attributes and the text of `element`; empty if nothing."""
    for attribute in known.attributes:
        if not element.get(attribute, "").strip():
            return f"a <{element.tag}> without its {attribute}"
    text = text_of(element)
    if not text:
        if known.required:
            return f"an empty <{element.tag}>"
        return ""
    if known.kind == "pose":
        count = 7 if element.get("rotation_format") == "quat_xyzw" else 6
        if _is_pose(text, count):
            return ""
        return f"a <{element.tag}> that is not {count} numbers"
    check = CHECKS.get(known.kind)
    if check is None or check[0](text):
        return ""
    return f"a <{element.tag}> that is not {check[1]}"


def _is_number(word: str) -> bool:
    found = _NUMBER.match(word)
    if found is None:
        return False
    if found[1] is None:
        return True
    value = abs(float(found[1]))
    has_digits = re.search("[1-9]", found[1].lower().partition("e")[0]) is not None
    return value < math.inf and (value >= sys.float_info.min or not has_digits)


def _is_whole(text: str, bits: int) -> bool:
    found = _WHOLE.match(text)
    # Python refuses to read thousands of digits.
    return found is not None and len(found[0]) < 40 and abs(int(found[0])) <= 2**bits


def _is_color(text: str) -> bool:
    words = text.split()
    return len(words) in (3, 4) and all(_is_number(word) and _in_unit_range(word) for word in words)


def _in_unit_range(word: str) -> bool:
    found = _NUMBER.match(word)
    return found is None or found[1] is None or 0 <= float(found[1]) <= 1


def _is_pose(text: str, count: int) -> bool:
    words = text.split()
    infinite = re.compile(r"[+-]?(inf|nan)", re.IGNORECASE)
    return len(words) == count and all(
        _is_number(word) and not infinite.match(word) for word in words
    )


def _are_numbers(text: str, count: int) -> bool:
    """Whether `text` begins with so many finite numbers."""
    found = re.match(rf"(?:\s*+{_DECIMAL}){{{count}}}", text, re.IGNORECASE)
    return found is not None and all(map(_is_number, found[0].split()))


# By kind: whether a text is such a value, and what the value is.
CHECKS: dict[str, tuple[Callable[[str], bool], str]] = {
    "bool": (lambda text: text.lower() in ("true", "false", "1", "0"), "true or false"),
    "double": (_is_number, "a number"),
    "float": (_is_number, "a number"),
    "int": (lambda text: _is_whole(text, bits=31), "a whole number"),
    "unsigned": (lambda text: _is_whole(text, bits=64), "a whole number"),
    "time": (
        lambda text: re.match(r"\s*+[+-]?\d++\s++[+-]?\d", text) is not None,
        "seconds and nanoseconds",
    ),
    "vector2": (lambda text: _are_numbers(text, 2), "2 numbers"),
    "vector3": (lambda text: _are_numbers(text, 3), "3 numbers"),
    "color": (_is_color, "3 or 4 numbers from 0 to 1"),
}
