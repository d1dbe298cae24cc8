"""Worlds that are broken in a thousand ways: each reads as something sound, or is refused in one line that points."""

import copy
import dataclasses
import math
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ddenv.errors import UserError
from ddenv.robot.drake.articulation import spatial_inertia
from ddenv.world.model import Joint, Link, Mesh, Model, Plane, Shape, World
from ddenv.world.read import parse_world
from ddenv.world.scenario import Reading
from ddenv.world.write import without
from tests.conftest import DATA, ROOT
from tests.tiers import examples, slow

READING = Reading(model_path=(DATA / "models",))
WORLDS = {path.name: path.read_bytes() for path in (DATA / "gazebo.world", DATA / "frames.world")}
SHARED = ROOT.parent / "shared" / "worlds" / "frictionpatch6.world"

# What people and programs have written where a number, a name or a place was wanted.
VALUES = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "1e400", "0", "-1", "-0", "1e16", "0.5", "true", "false", "2"),
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
        "1e-320 1 1",
    ),
    *("9" * 400, "x" * 3000, "1 " * 500, "Бочка", "木", "\u202e", "a\tb", "'", '"', "]", "&<>", "٣", "1_000", "0x10"),
    *("link", "world", "__model__", "a::b", "::", "rack", "rack::boards", "shelf", "foot", "mast", "hinge", "bed"),
    *("barrel (old)", "barrel (old) #2", "grey wall", "crate 1", "corner", "handle", "post", "load::sack", "gone"),
    *("../../../../etc/passwd", "%2e%2e/%2e%2e/%2e%2e/etc/passwd", "file:///etc/passwd", "file:///dev/zero"),
    *("gazebo.world", "frames.world", "model://crate", "models/trolley", "model://crate/crate.obj", "model://..", "/"),
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
        "mesh",
        "polyline",
    ),
    *(
        "plane",
        "capsule",
        "heightmap",
        "empty",
        "inertial",
        "mass",
        "inertia",
        "ixx",
        "scale",
        "state",
        "include",
        "uri",
    ),
    *("name", "static", "axis", "axis2", "limit", "lower", "parent", "child", "density", "population", "sdf", "world"),
)
ATTRIBUTES = ("name", "type", "relative_to", "attached_to", "frame", "placement_frame", "canonical_link", "version", "auto",
              "degrees", "rotation_format", "expressed_in", "merge")  # fmt: skip


class Step(NamedTuple):
    """One change: how, and the numbers and words that say where and to what."""

    change: Callable[[Element, "Step"], None]
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


TREES = {name: tree_of(text) for name, text in WORLDS.items()}


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
    st.sampled_from(
        (
            b"\r",
            b"\r\n",
            b"\n\n",
            b"\t",
            b"<",
            b">",
            b"&",
            b'"',
            b"'",
            b"\0",
            b"\xff",
            b"]]>",
            b"<!--",
            b"<a>",
            b"-",
            b"9",
        )
    ),
)


# What is said of a file as a whole: there is no element to point at.
OF_THE_FILE = (
    r":\d+: not well-formed XML: ",
    r":\d+: DOCTYPE is not allowed",
    r":\d+: elements are nested more than ",
    r": the file is empty",
    r": is UTF-16, ",
    r": cannot be decoded: ",
    r": expected one <world> inside <sdf>, found ",
    r": models or frames are nested too deeply",
)
_NAME = r"(?:\[@name='(?:[^']|'(?!\]))*'\])?"
OF_AN_ELEMENT = re.compile(rf":(\d+): (?:/[^/\s\[\]:]+{_NAME})*?/([^/\s\[\]:]+){_NAME}: \S")


def read_or_refused(text: bytes, path: Path) -> None:
    """The promise of the reader."""
    with warnings.catch_warnings():
        # A warning would be a line of its own on the terminal.
        warnings.simplefilter("error")
        try:
            world = parse_world(text, path, READING)
        except UserError as error:
            check_complaint(str(error), text, path)
        else:
            check_world(world)
            check_smaller_worlds(world)


def check_complaint(line: str, text: bytes, path: Path) -> None:
    assert line.isprintable(), line
    assert len(line) < 6000, line
    file = next((one for one in (path, *DATA.rglob("*")) if re.match(re.escape(str(one)) + ":", line)), None)
    assert file is not None, line
    said = line.removeprefix(str(file))
    if any(re.match(pattern, said) for pattern in OF_THE_FILE):
        return
    found = OF_AN_ELEMENT.match(said)
    assert found, line
    lines = (text if file == path else file.read_bytes()).splitlines()
    assert f"<{found[2]}".encode() in lines[int(found[1]) - 1], line


def check_world(world: World) -> None:
    assert_finite(world.gravity)
    assert unique(model.name for model in world.models)
    assert world.anchors <= {model.name for model in world.models}
    spans = sorted(span for model in world.models for span in model.spans)
    ends = [0, *(place for span in spans for place in span), len(world.text)]
    assert ends == sorted(ends), spans
    for model in world.models:
        check_spans(model, world.text)
        check_model(model)


def check_spans(model: Model, text: bytes) -> None:
    for (start, end), tags in zip(model.spans, ((b"<model", b"<include"), (b"<model",)), strict=False):
        assert text[start:end].startswith(tags), text[start:end]
        assert text[start:end].endswith(b">"), text[start:end]


def check_model(model: Model) -> None:
    assert model.links
    assert_finite(model.pose)
    assert unique(link.name for link in model.links)
    assert unique(joint.name for joint in model.joints)
    assert not (model.static and model.joints)
    for link in model.links:
        check_link(link, model.static)
    for joint in model.joints:
        check_joint(joint, {link.name for link in model.links})
    check_tree(model)


def check_link(link: Link, static: bool) -> None:
    assert_finite(link)
    for one in (*link.collisions, *link.visuals):
        check_shape(one.shape)
    for collision in link.collisions:
        assert collision.mu >= 0
        if isinstance(collision.shape, Mesh):
            check_convex(collision.shape)
    assert (link.inertia is None) == static
    if link.inertia is not None:
        assert link.inertia.mass > 0
        # Drake's own judgement: it raises for what no body can have.
        assert spatial_inertia(link.inertia, link.pose).IsPhysicallyValid()


def check_shape(shape: Shape) -> None:
    if isinstance(shape, Mesh):
        assert len(shape.vertices) >= 3
        assert np.isfinite(shape.vertices).all()
        assert len(shape.faces) > 0
        assert 0 <= shape.faces.min() <= shape.faces.max() < len(shape.vertices)
    elif not isinstance(shape, Plane):
        assert all(size > 0 for size in numbers_in(shape)), shape


def check_convex(mesh: Mesh) -> None:
    """Drake refuses hulls of no volume."""
    corners = mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0)
    assert len(mesh.vertices) >= 4
    assert np.linalg.det(corners).sum() > 0


def check_joint(joint: Joint, links: set[str]) -> None:
    assert joint.child in links
    assert joint.parent in links | {"world"}
    assert joint.parent != joint.child
    assert "world" not in links, "a parent 'world' would mean either of two things"
    assert_finite((joint.pose, joint.axis, joint.axis2 or (), joint.damping))
    assert math.isclose(math.hypot(*joint.axis), 1, abs_tol=1e-6)
    assert -math.inf <= joint.lower <= joint.upper <= math.inf
    assert joint.lower < math.inf and joint.upper > -math.inf
    assert joint.effort >= 0 and joint.velocity >= 0 and joint.damping >= 0


def check_tree(model: Model) -> None:
    parents = {joint.child: joint.parent for joint in model.joints}
    assert len(parents) == len(model.joints)
    for link in parents:
        for _ in model.links:
            link = parents.get(link, "world")
        assert link == "world", "joints close a loop"


def unique(names) -> bool:
    names = list(names)
    return len(set(names)) == len(names)


def assert_finite(value: object) -> None:
    assert all(map(math.isfinite, numbers_in(value))), value


def numbers_in(value: object) -> list[float]:
    """All numbers in plain data."""
    if isinstance(value, float | int):
        return [value]
    if isinstance(value, np.ndarray):
        return value.ravel().tolist()
    if isinstance(value, tuple | list):
        return [number for each in value for number in numbers_in(each)]
    if dataclasses.is_dataclass(value):
        return [number for field in dataclasses.fields(value) for number in numbers_in(getattr(value, field.name))]
    return []


def check_smaller_worlds(world: World) -> None:
    """Without any of its elements the world reads again, and all others are as they were."""
    names = world.elements()
    for name in names if len(names) < 4 else (names[0], names[len(world.text) % len(names)], names[-1]):
        again = parse_world(without(world, frozenset([name])), world.path, READING)
        assert [model.links for model in again.models] == [model.links for model in world.models if model.name != name]


def bounded(weight: float) -> settings:
    """The same cases everywhere, whatever the machine."""
    health = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example]
    return examples(weight, derandomize=True, database=None, suppress_health_check=health)


@pytest.mark.parametrize("name", WORLDS)
def test_the_worlds_themselves_are_sound(name):
    world = parse_world(WORLDS[name], DATA / name, READING)
    check_world(world)
    for model in world.elements():
        again = parse_world(without(world, frozenset([model])), world.path, READING)
        assert [one.links for one in again.models] == [one.links for one in world.models if one.name != model]


BOX = "<link name='l'><collision name='c'><geometry><box><size>1 2 3</size></box></geometry></collision></link>"
OUTLINE = (
    "<model name='{}'><static>1</static><link name='l'><collision name='c'><geometry><polyline><height>{}</height>"
    "<point>0 0</point><point>1 0</point><point>0 1</point></polyline></geometry></collision></link></model>"
)


def small_world(inside: str) -> World:
    text = f"<sdf version='1.9'><world name='w'>{inside}</world></sdf>".encode()
    return parse_world(text, DATA / "small.world", READING)


@pytest.mark.parametrize(
    "empty", ["<model name='a'/>", "<model name='a' />", "<model name='a'></model>", "<model name='a'\n/>"]
)
@pytest.mark.parametrize("after", ["", "\n", "<model name='b'><pose>7 0 0 0 0 0</pose></model>"])
def test_what_is_said_of_a_model_in_an_empty_element_goes_alone(empty, after):
    state = f"<state world_name='w'>{empty}{after}</state>"
    world = small_world(f"<model name='a'>{BOX}</model><model name='b'>{BOX}</model>{state}")
    check_world(world)
    check_smaller_worlds(world)
    assert without(world, frozenset("a")).endswith(f"<state world_name='w'>{after}</state></world></sdf>".encode())


@pytest.mark.parametrize("name", ["a", "a::b", "a::", "::a", "a #2", " a", "rack::boards"])
def test_a_model_that_others_stand_on_stays_whatever_its_name(name):
    on = f"<model name='on'><pose relative_to='{name}'>0 0 1 0 0 0</pose>{BOX}</model>"
    try:
        world = small_world(f"<model name='{name}'>{BOX}</model><model name='off'>{BOX}</model>{on}")
    except UserError:
        return
    check_smaller_worlds(world)
    assert name not in world.elements()


@pytest.mark.parametrize("names", [("j", "j"), ("a", "j"), ("b", "j"), ("j", "f")])
def test_joints_whose_names_are_taken_keep_their_places_or_are_refused(names):
    """Also those called as a link or a frame of their model: before SDF 1.7 that was allowed."""
    joints = "".join(
        f"<joint name='{name}' type='fixed'><pose>{5 * at} 0 0 0 0 0</pose><parent>{parent}</parent><child>{child}</child></joint>"
        for at, (name, parent, child) in enumerate(zip(names, "ab", "bc", strict=True), start=1)
    )
    inside = "<link name='a'/><link name='b'><pose>1 0 0 0 0 0</pose></link><link name='c'/><frame name='f'/>"
    try:
        world = small_world(f"<model name='m'>{inside}{joints}</model>")
    except UserError as error:
        assert OF_AN_ELEMENT.search(str(error))
        return
    check_world(world)
    assert [joint.pose.position[0] for joint in world.models[0].joints] == [6, 10]


@pytest.mark.parametrize("between", ["", "\n"])
def test_outlines_that_differ_are_different_shapes_wherever_they_stand(between):
    world = small_world(OUTLINE.format("a", 1) + between + OUTLINE.format("b", 2))
    one, other = (model.collisions[0].shape for model in world.models)
    assert one != other


def test_an_outline_stays_the_same_when_a_model_before_it_goes():
    world = small_world(f"<model name='before'>\n{BOX}</model>\n" + OUTLINE.format("a", 1))
    check_smaller_worlds(world)


@pytest.mark.parametrize("name", WORLDS)
@bounded(4.5)
@given(steps=st.lists(STEPS, min_size=1, max_size=3))
def test_any_change_of_structure_is_read_soundly_or_refused(name, steps):
    read_or_refused(changed(TREES[name], steps), DATA / name)


@pytest.mark.parametrize("name", WORLDS)
@bounded(1.5)
@given(changes=st.lists(BYTES, min_size=1, max_size=3))
def test_any_change_of_bytes_is_read_soundly_or_refused(name, changes):
    text = WORLDS[name]
    for change in changes:
        text = changed_bytes(text, change)
    read_or_refused(text, DATA / name)


@pytest.mark.parametrize(
    "value", slow(pytest.mark.fuzz, ["nan", "-inf", "0", "-1", "1e-320", "1e308", ""], but=["nan"])
)
@pytest.mark.parametrize("name", slow(pytest.mark.fuzz, WORLDS, but=["frames.world"]))
def test_no_number_at_all_can_break_the_reader(name, value):
    """Each text of a world, one after the other, is none or nearly none."""
    for number, element in enumerate(elements(TREES[name])):
        if not len(element) and (element.text or "").strip():
            root = copy.deepcopy(TREES[name])
            elements(root)[number].text = value
            try:
                read_or_refused(ElementTree.tostring(root), DATA / name)
            except Exception as error:
                error.add_note(f"element {number}: <{element.tag}>{element.text}</{element.tag}>")
                raise


@pytest.mark.skipif(not SHARED.is_file(), reason="the folder shared/worlds is not beside this checkout")
@bounded(0.5)
@given(steps=st.lists(STEPS, min_size=1, max_size=3))
def test_a_real_world_that_was_changed_is_read_soundly_or_refused(steps):
    read_or_refused(changed(tree_of(SHARED.read_bytes()), steps), SHARED)
