"""Changes of a world's structure and of its bytes, as hypothesis makes them up."""

from __future__ import annotations

import copy
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from hypothesis import strategies as st

# What people and programs have written where a number, a name or a place was wanted.
VALUES = (
    *(
        "nan",
        "inf",
        "-inf",
        "1e308",
        "-1e308",
        "1e-320",
        "1e400",
        "0",
        "-1",
        "-0",
        "1e16",
        "0.5",
        "true",
        "false",
        "2",
    ),
    *(
        "",
        " ",
        "words",
        "0 0 0",
        "1 2 3",
        "nan nan nan",
        "0 0 0 0 0 0",
        "1 1 1 1 1 1",
        "1e6 1e6 1e6 1 1 1",
    ),
    "1e-320 1 1",
    *(
        "9" * 400,
        "x" * 3000,
        "1 " * 500,
        "Бочка",
        "木",
        "\u202e",
        "a\tb",
        "'",
        '"',
        "]",
        "&<>",
        "٣",
        "1_000",
        "0x10",
    ),
    *(
        "link",
        "world",
        "__model__",
        "a::b",
        "::",
        "rack",
        "rack::boards",
        "shelf",
        "foot",
        "mast",
        "hinge",
        "bed",
    ),
    *(
        "barrel (old)",
        "barrel (old) #2",
        "grey wall",
        "crate 1",
        "corner",
        "handle",
        "post",
        "load::sack",
        "gone",
    ),
    *(
        "../../../../etc/passwd",
        "%2e%2e/%2e%2e/%2e%2e/etc/passwd",
        "file:///etc/passwd",
        "file:///dev/zero",
    ),
    *(
        "gazebo.world",
        "frames.world",
        "model://crate",
        "models/trolley",
        "model://crate/crate.obj",
        "model://..",
        "/",
    ),
    *("revolute", "fixed", "ball", "universal", "screw", "quat_xyzw", "1.4", "1.6", "1.12", "9.9"),
)
TAGS = (
    *(
        "model",
        "link",
        "joint",
        "frame",
        "collision",
        "visual",
        "pose",
        "geometry",
        "box",
        "sphere",
    ),
    *(
        "mesh",
        "polyline",
        "plane",
        "capsule",
        "heightmap",
        "empty",
        "inertial",
        "mass",
        "inertia",
        "ixx",
    ),
    *(
        "scale",
        "state",
        "include",
        "uri",
        "name",
        "static",
        "axis",
        "axis2",
        "limit",
        "lower",
        "parent",
    ),
    *("child", "density", "population", "sdf", "world"),
)
ATTRIBUTES = (
    *("name", "type", "relative_to", "attached_to", "frame", "placement_frame", "canonical_link"),
    *("version", "auto", "degrees", "rotation_format", "expressed_in", "merge"),
)


class Step(NamedTuple):
    """One change: its kind, and the numbers and words that say where and to what."""

    kind: str
    first: int
    second: int
    value: str
    tag: str
    attribute: str


def elements(root: Element) -> list[Element]:
    return [element for element in root.iter() if isinstance(element.tag, str)]


def chosen(options: list, number: int):
    return options[number % len(options)]


def having(root: Element, tag: str) -> Element:
    """The child `tag` of an element, new if there is none."""
    child = root.find(tag)
    return ElementTree.SubElement(root, tag) if child is None else child


def change_element(root: Element, step: Step) -> None:
    """Changes in one element, wherever it is."""
    everything = elements(root)
    one, other = chosen(everything, step.first), chosen(everything, step.second)
    match step.kind:
        case "swap":
            one.text, other.text = other.text, one.text
            one.attrib, other.attrib = other.attrib, one.attrib
        case "rename":
            one.tag = step.tag
        case "write an attribute":
            named = [name for name in one.attrib if step.second % 2]
            one.set(chosen(named, step.second) if named else step.attribute, step.value)
        case "add a child":
            child = ElementTree.SubElement(one, step.tag)
            child.text = step.value
            if step.second % 2:
                child.set("name", step.value)
        case "copy into":
            # What stands in one place also stands in another of the same kind.
            same = [element for element in everything if element.tag == one.tag]
            chosen(same, step.second).extend(copy.deepcopy(list(one)))


def change_place(root: Element, step: Step) -> None:
    """Changes of where an element is."""
    pairs = [
        (parent, child)
        for parent in elements(root)
        for child in parent
        if isinstance(child.tag, str)
    ]
    pairs = [pair for pair in pairs if step.kind != "wrap" or pair[1].tag == "model"]
    if not pairs:
        return
    parent, child = chosen(pairs, step.first)
    if step.kind == "duplicate":
        parent.insert(step.second % (len(parent) + 1), copy.deepcopy(child))
        return
    place = list(parent).index(child)
    parent.remove(child)
    if step.kind == "move":
        chosen(elements(root), step.second).append(child)
    elif step.kind == "wrap":
        # A model in models, up to 12 or up to some hundred deep.
        for depth in range(1 + step.second % (12 if step.second % 5 else 300)):
            outer = Element("model", name=f"outer {depth}")
            outer.append(child)
            child = outer
        parent.insert(place, child)


def change_chosen(root: Element, step: Step) -> None:
    """Changes in one of the elements that have something to change."""
    fit = {
        "drop an attribute": lambda one: one.attrib,
        "write text": lambda one: not len(one) and (one.text or "").strip(),
        "write one number": lambda one: not len(one) and len((one.text or "").split()) > 1,
        "name alike": lambda one: one.get("name"),
        "go in a circle": lambda one: one.tag in ("model", "world"),
        "join anything": lambda one: one.tag == "joint",
    }[step.kind]
    fitting = [element for element in elements(root) if fit(element)]
    if not fitting:
        return
    one = chosen(fitting, step.first)
    match step.kind:
        case "drop an attribute":
            del one.attrib[chosen(list(one.attrib), step.second)]
        case "write text":
            one.text = step.value
        case "write one number":
            words = one.text.split()
            words[step.second % len(words)] = step.value
            one.text = " ".join(words)
        case "name alike":
            chosen([each for each in fitting if each.tag == one.tag], step.second).set(
                "name", one.get("name")
            )
        case "go in a circle":
            # A few frames or links of one model, each given relative to the next.
            things = [child for child in one if child.tag in ("frame", "link", "model", "joint")]
            count = min(len(things), 1 + step.second % 4)
            for number in range(count):
                following = things[(number + 1) % count].get("name") or step.value
                having(things[number], "pose").set("relative_to", following)
        case "join anything":
            # A joint gets ends that are any names of the file.
            names = [element.get("name") for element in elements(root) if element.get("name")]
            for tag, number in (("parent", step.first // 7), ("child", step.second)):
                having(one, tag).text = chosen([*names, step.value], number)


CHANGES = {
    **dict.fromkeys(
        ("swap", "rename", "write an attribute", "add a child", "copy into"), change_element
    ),
    **dict.fromkeys(("delete", "duplicate", "move", "wrap"), change_place),
    **dict.fromkeys(("drop an attribute", "write text", "write one number"), change_chosen),
    **dict.fromkeys(("name alike", "go in a circle", "join anything"), change_chosen),
}
KINDS = [*CHANGES, "write text", "write one number", "join anything"]
NUMBERS = st.integers(0, 2**16)
STEPS = st.builds(
    Step,
    *(st.sampled_from(KINDS), NUMBERS, NUMBERS, st.sampled_from(VALUES)),
    *(st.sampled_from(TAGS), st.sampled_from(ATTRIBUTES)),
)


def tree_of(text: bytes) -> Element:
    builder = ElementTree.TreeBuilder(insert_comments=True, insert_pis=True)
    return ElementTree.fromstring(text, ElementTree.XMLParser(target=builder))


def changed(root: Element, steps: list[Step]) -> bytes:
    root = copy.deepcopy(root)
    for step in steps:
        CHANGES[step.kind](root, step)
    return ElementTree.tostring(root, encoding="utf-8")


class Bytes(NamedTuple):
    """One change of the bytes of a file, which knows nothing of XML."""

    kind: str
    first: int
    second: int
    with_: bytes


def changed_bytes(text: bytes, change: Bytes) -> bytes:
    start, other = change.first % (len(text) + 1), change.second % (len(text) + 1)
    start, end = min(start, other), max(start, other)
    match change.kind:
        case "cut":
            return text[:start]
        case "drop":
            return text[:start] + text[min(end, start + 200) :]
        case "insert":
            return text[:start] + change.with_ + text[start:]
        case "repeat":
            return text[:end] + text[start:end] + text[end:]
        case "flip":
            flipped = bytes([byte ^ (1 << change.second % 8) for byte in text[start : start + 1]])
            return text[:start] + flipped + text[start + 1 :]
    return text.replace(b"\n", change.with_)


BYTES = st.builds(
    Bytes,
    st.sampled_from(("cut", "drop", "insert", "repeat", "flip", "flip", "lines")),
    st.integers(0, 2**20),
    st.integers(0, 2**20),
    st.sampled_from(b"\r|\r\n|\n\n|\t|<|>|&|\"|'|\0|\xff|]]>|<!--|<a>|-|9".split(b"|")),
)
