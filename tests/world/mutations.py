"""Changes of a world's structure and of its bytes, as hypothesis makes them up."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from hypothesis import strategies as st

# What people and programs have written where a number, a name or a place was wanted.
VALUES = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "1e400", "0", "-1", "-0", "1e16", "0.5", "true", "false", "2"),
    *("", " ", "words", "0 0 0", "1 2 3", "nan nan nan", "0 0 0 0 0 0", "1 1 1 1 1 1", "1e6 1e6 1e6 1 1 1"),
    "1e-320 1 1",
    *("9" * 400, "x" * 3000, "1 " * 500, "Бочка", "木", "\u202e", "a\tb", "'", '"', "]", "&<>", "٣", "1_000", "0x10"),
    *("link", "world", "__model__", "a::b", "::", "rack", "rack::boards", "shelf", "foot", "mast", "hinge", "bed"),
    *("barrel (old)", "barrel (old) #2", "grey wall", "crate 1", "corner", "handle", "post", "load::sack", "gone"),
    *("../../../../etc/passwd", "%2e%2e/%2e%2e/%2e%2e/etc/passwd", "file:///etc/passwd", "file:///dev/zero"),
    *("gazebo.world", "frames.world", "model://crate", "models/trolley", "model://crate/crate.obj", "model://..", "/"),
    *("revolute", "fixed", "ball", "universal", "screw", "quat_xyzw", "1.4", "1.6", "1.12", "9.9"),
)
TAGS = (
    *("model", "link", "joint", "frame", "collision", "visual", "pose", "geometry", "box", "sphere"),
    *("mesh", "polyline", "plane", "capsule", "heightmap", "empty", "inertial", "mass", "inertia", "ixx"),
    *("scale", "state", "include", "uri", "name", "static", "axis", "axis2", "limit", "lower", "parent"),
    *("child", "density", "population", "sdf", "world"),
)
ATTRIBUTES = (
    *("name", "type", "relative_to", "attached_to", "frame", "placement_frame", "canonical_link"),
    *("version", "auto", "degrees", "rotation_format", "expressed_in", "merge"),
)


class Step(NamedTuple):
    """One change: how, and the numbers and words that say where and to what."""

    change: Callable[[Element, Step], None]
    first: int
    second: int
    value: str
    tag: str
    attribute: str


def elements(root: Element) -> list[Element]:
    return [element for element in root.iter() if isinstance(element.tag, str)]


def holders(root: Element) -> list[tuple[Element, Element]]:
    """All elements but the root, each after the one it is in."""
    return [(parent, child) for parent in elements(root) for child in parent if isinstance(child.tag, str)]


def chosen(options: list, number: int):
    return options[number % len(options)]


def delete(root: Element, step: Step) -> None:
    if pairs := holders(root):
        parent, child = chosen(pairs, step.first)
        parent.remove(child)


def duplicate(root: Element, step: Step) -> None:
    if pairs := holders(root):
        parent, child = chosen(pairs, step.first)
        parent.insert(step.second % (len(parent) + 1), copy.deepcopy(child))


def move(root: Element, step: Step) -> None:
    if pairs := holders(root):
        parent, child = chosen(pairs, step.first)
        parent.remove(child)
        chosen(elements(root), step.second).append(child)


def swap(root: Element, step: Step) -> None:
    """Two elements take each other's text and attributes."""
    one, other = chosen(elements(root), step.first), chosen(elements(root), step.second)
    one.text, other.text = other.text, one.text
    one.attrib, other.attrib = other.attrib, one.attrib


def rename(root: Element, step: Step) -> None:
    chosen(elements(root), step.first).tag = step.tag


def write_attribute(root: Element, step: Step) -> None:
    element = chosen(elements(root), step.first)
    named = [name for name in element.attrib if step.second % 2]
    element.set(chosen(named, step.second) if named else step.attribute, step.value)


def drop_attribute(root: Element, step: Step) -> None:
    if named := [element for element in elements(root) if element.attrib]:
        element = chosen(named, step.first)
        del element.attrib[chosen(list(element.attrib), step.second)]


def write_text(root: Element, step: Step) -> None:
    leaves = [element for element in elements(root) if not len(element) and (element.text or "").strip()]
    if leaves:
        chosen(leaves, step.first).text = step.value


def write_one_number(root: Element, step: Step) -> None:
    leaves = [element for element in elements(root) if len((element.text or "").split()) > 1 and not len(element)]
    if leaves:
        element = chosen(leaves, step.first)
        words = element.text.split()
        words[step.second % len(words)] = step.value
        element.text = " ".join(words)


def add_child(root: Element, step: Step) -> None:
    child = ElementTree.SubElement(chosen(elements(root), step.first), step.tag)
    child.text = step.value
    if step.second % 2:
        child.set("name", step.value)


def copy_into(root: Element, step: Step) -> None:
    """What stands in one place also stands in another of the same kind."""
    one = chosen(elements(root), step.first)
    same = [element for element in elements(root) if element.tag == one.tag]
    chosen(same, step.second).extend(copy.deepcopy(list(one)))


def wrap(root: Element, step: Step) -> None:
    """A model in models, up to 12 or up to some hundred deep."""
    models = [(parent, child) for parent, child in holders(root) if child.tag == "model"]
    if not models:
        return
    parent, child = chosen(models, step.first)
    place = list(parent).index(child)
    parent.remove(child)
    for depth in range(1 + step.second % (12 if step.second % 5 else 300)):
        outer = Element("model", name=f"outer {depth}")
        outer.append(child)
        child = outer
    parent.insert(place, child)


def name_alike(root: Element, step: Step) -> None:
    """Two things of one kind get one name."""
    named = [element for element in elements(root) if element.get("name")]
    if named:
        one = chosen(named, step.first)
        other = chosen([element for element in named if element.tag == one.tag], step.second)
        other.set("name", one.get("name"))


def go_in_a_circle(root: Element, step: Step) -> None:
    """A few frames or links of one model, each given relative to the next."""
    scopes = [element for element in elements(root) if element.tag in ("model", "world")]
    if not scopes:
        return
    scope = chosen(scopes, step.first)
    things = [child for child in scope if child.tag in ("frame", "link", "model", "joint")]
    count = min(len(things), 1 + step.second % 4)
    for number in range(count):
        following = things[(number + 1) % count].get("name") or step.value
        pose = things[number].find("pose")
        pose = ElementTree.SubElement(things[number], "pose") if pose is None else pose
        pose.set("relative_to", following)


def join_anything(root: Element, step: Step) -> None:
    """A joint gets ends that are any names of the file."""
    joints = [element for element in elements(root) if element.tag == "joint"]
    names = [element.get("name") for element in elements(root) if element.get("name")] or [step.value]
    if joints:
        joint = chosen(joints, step.first)
        for tag, number in (("parent", step.first // 7), ("child", step.second)):
            child = joint.find(tag)
            child = ElementTree.SubElement(joint, tag) if child is None else child
            child.text = chosen([*names, step.value], number)


CHANGES = (
    *(delete, duplicate, move, swap, rename, write_attribute, drop_attribute, write_text, write_text, write_one_number),
    *(write_one_number, add_child, copy_into, wrap, name_alike, go_in_a_circle, join_anything, join_anything),
)
NUMBERS = st.integers(0, 2**16)
STEPS = st.builds(
    Step,
    *(st.sampled_from(CHANGES), NUMBERS, NUMBERS, st.sampled_from(VALUES)),
    *(st.sampled_from(TAGS), st.sampled_from(ATTRIBUTES)),
)


def tree_of(text: bytes) -> Element:
    builder = ElementTree.TreeBuilder(insert_comments=True, insert_pis=True)
    return ElementTree.fromstring(text, ElementTree.XMLParser(target=builder))


def changed(root: Element, steps: list[Step]) -> bytes:
    root = copy.deepcopy(root)
    for step in steps:
        step.change(root, step)
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
            return (
                text[:start]
                + bytes([byte ^ (1 << change.second % 8) for byte in text[start : start + 1]])
                + text[start + 1 :]
            )
    return text.replace(b"\n", change.with_)


BYTES = st.builds(
    Bytes,
    st.sampled_from(("cut", "drop", "insert", "repeat", "flip", "flip", "lines")),
    st.integers(0, 2**20),
    st.integers(0, 2**20),
    st.sampled_from(b"\r|\r\n|\n\n|\t|<|>|&|\"|'|\0|\xff|]]>|<!--|<a>|-|9".split(b"|")),
)
