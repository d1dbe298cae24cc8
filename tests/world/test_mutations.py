"""Worlds that are broken in a thousand ways: each reads as something sound, or is refused in one
line that points.
"""

from __future__ import annotations

import copy
from xml.etree import ElementTree

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ddenv.errors import UserError
from ddenv.world.model import World
from ddenv.world.sdf.read import parse_world
from ddenv.world.write import without
from tests.conftest import DATA, ROOT
from tests.tiers import examples, slow
from tests.world.mutations import BYTES, STEPS, changed, changed_bytes, elements, tree_of
from tests.world.soundness import (
    OF_AN_ELEMENT,
    READING,
    check_smaller_worlds,
    check_world,
    read_or_refused,
)

WORLDS = {path.name: path.read_bytes() for path in (DATA / "gazebo.world", DATA / "frames.world")}
SHARED = ROOT.parent / "shared" / "worlds" / "frictionpatch6.world"
TREES = {name: tree_of(text) for name, text in WORLDS.items()}


def bounded(weight: float) -> settings:
    """The same cases everywhere, whatever the machine."""
    health = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example]
    return examples(weight, derandomize=True, database=None, suppress_health_check=health)


@pytest.mark.parametrize("name", WORLDS)
def test_the_worlds_themselves_are_sound(name):
    world = parse_world(WORLDS[name], DATA / name, READING)
    check_world(world)
    check_smaller_worlds(world)


BOX = (
    "<link name='l'><collision name='c'><geometry><box><size>1 2 "
    "3</size></box></geometry></collision></link>"
)
OUTLINE = (
    "<model name='{}'><static>1</static><link name='l'><collision "
    "name='c'><geometry><polyline><height>{}</height>"
    "<point>0 0</point><point>1 0</point><point>0 "
    "1</point></polyline></geometry></collision></link></model>"
)


def small_world(inside: str) -> World:
    text = f"<sdf version='1.9'><world name='w'>{inside}</world></sdf>".encode()
    return parse_world(text, DATA / "small.world", READING)


def test_a_model_of_which_nothing_can_be_touched_is_static():
    world = small_world(
        "<model name='outer'><model name='plugin'><static>1</static></model></model>"
    )
    check_world(world)
    assert world.models[0].static


@pytest.mark.parametrize(
    "empty",
    ["<model name='a'/>", "<model name='a' />", "<model name='a'></model>", "<model name='a'\n/>"],
)
@pytest.mark.parametrize("after", ["", "\n", "<model name='b'><pose>7 0 0 0 0 0</pose></model>"])
def test_what_is_said_of_a_model_in_an_empty_element_goes_alone(empty, after):
    state = f"<state world_name='w'>{empty}{after}</state>"
    world = small_world(f"<model name='a'>{BOX}</model><model name='b'>{BOX}</model>{state}")
    check_world(world)
    check_smaller_worlds(world)
    assert without(world, frozenset("a")).endswith(
        f"<state world_name='w'>{after}</state></world></sdf>".encode()
    )


@pytest.mark.parametrize("name", ["a", "a::b", "a::", "::a", "a #2", " a", "rack::boards"])
def test_a_model_that_others_stand_on_stays_whatever_its_name(name):
    on = f"<model name='on'><pose relative_to='{name}'>0 0 1 0 0 0</pose>{BOX}</model>"
    try:
        world = small_world(
            f"<model name='{name}'>{BOX}</model><model name='off'>{BOX}</model>{on}"
        )
    except UserError:
        return
    check_smaller_worlds(world)
    assert name not in world.elements()


@pytest.mark.parametrize("names", [("j", "j"), ("a", "j"), ("b", "j"), ("j", "f")])
def test_joints_whose_names_are_taken_keep_their_places_or_are_refused(names):
    """Also those called as a link or a frame of their model: before SDF 1.7 that was allowed."""
    joints = "".join(
        (
            f"<joint name='{name}' type='fixed'><pose>{5 * at} 0 0 0 0 "
            f"0</pose><parent>{parent}</parent><child>{child}</child></joint>"
        )
        for at, (name, parent, child) in enumerate(zip(names, "ab", "bc", strict=True), start=1)
    )
    inside = (
        "<link name='a'/><link name='b'><pose>1 0 0 0 0 0</pose></link><link name='c'/><frame "
        "name='f'/>"
    )
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


@pytest.mark.skipif(
    not SHARED.is_file(), reason="the folder shared/worlds is not beside this checkout"
)
@bounded(0.5)
@given(steps=st.lists(STEPS, min_size=1, max_size=3))
def test_a_real_world_that_was_changed_is_read_soundly_or_refused(steps):
    read_or_refused(changed(tree_of(SHARED.read_bytes()), steps), SHARED)
