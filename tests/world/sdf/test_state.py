"""What Gazebo Classic saved in `<state>` wins over the poses and sizes of the models."""

import math

import pytest

from ddenv.world.model import Box
from tests.world.sdf.conftest import BOX

MODEL = (
    "<model name='m'><static>1</static><pose>9 9 9 0 0 0</pose><link name='l'><pose>1 0 0 0 0 "
    f"0</pose>{BOX}</link></model>"
)
INERTIAL = (
    "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"
)


def state(inside):
    return f"<state world_name='w'>{inside}</state>"


def test_absolute_link_poses_win(read):
    saved = (
        "<model name='m'><pose>1 2 3 0 0 0</pose><link name='l'><pose>4 5 6 0 0 "
        "1.5707963267948966</pose></link></model>"
    )
    world = read(MODEL + state(saved), "1.6")
    model = world.models[0]
    assert model.pose.position == (1, 2, 3)
    assert model.links[0].pose.position == (4, 5, 6)
    assert model.collisions[0].pose.position == (4, 5, 6)
    assert model.collisions[0].pose.yaw() == pytest.approx(math.pi / 2)
    (note,) = world.notes
    assert (note.kind, note.model, note.detail) == (
        "replaced",
        "m",
        f"{math.dist((10, 9, 9), (4, 5, 6)):.2f} m away",
    )


def test_links_that_are_not_named_move_with_their_model(read):
    saved = "<model name='m'><pose>1 2 3 0 0 1.5707963267948966</pose></model>"
    assert read(MODEL + state(saved), "1.6").models[0].links[0].pose.position == pytest.approx(
        (1, 3, 3)
    )


def test_scales_multiply_sizes_but_not_places(read):
    world = read(MODEL + state("<model name='m'><scale>1 2 10</scale></model>"), "1.6")
    assert world.models[0].collisions[0].shape == Box((1, 4, 30))
    assert world.models[0].links[0].pose.position == (10, 9, 9)
    assert "scale" in world.notes[0].why


def test_nested_models_are_saved_inside_theirs(read):
    nested = (
        "<model name='m'><link name='a'/><model name='in'><link "
        f"name='b'>{BOX}</link></model></model>"
    )
    inner = "<model name='in'><link name='b'><pose>7 7 7 0 0 0</pose></link></model>"
    saved = f"<model name='m'><pose>1 0 0 0 0 0</pose>{inner}</model>"
    links = {
        link.name: link.pose.position for link in read(nested + state(saved), "1.6").models[0].links
    }
    assert links == {"a": (1, 0, 0), "in::b": (7, 7, 7)}


def test_models_of_one_name_take_their_entries_in_order(read):
    twice = MODEL * 2 + state(
        "<model name='m'><pose>1 0 0 0 0 0</pose></model><model name='m'><pose>2 0 0 0 0 "
        "0</pose></model>"
    )
    world = read(twice, "1.6")
    assert [(model.name, model.pose.position[0]) for model in world.models] == [
        ("m", 1),
        ("m #2", 2),
    ]


def test_entries_for_what_is_not_there_are_noted(read):
    saved = (
        "<model name='m'><link name='lnik'><pose>1 1 1 0 0 0</pose></link><model "
        "name='no'/></model><model name='ghost'/>"
    )
    told = [note.why for note in read(MODEL + state(saved + "<light name='sun'/>"), "1.6").notes]
    assert told == [
        "the model has no 'lnik'",
        "the model has no 'no'",
        "the world has no model 'ghost'",
    ]


@pytest.mark.parametrize(
    ("kind", "turned", "lower", "upper"),
    [("revolute", "0 0 0 0 0 0.5", -0.5, 1.0), ("prismatic", "0 0 0.2 0 0 0", -0.2, 1.3)],
)
def test_joint_limits_count_from_where_the_state_has_the_links(read, kind, turned, lower, upper):
    limit = "<limit><lower>0</lower><upper>1.5</upper></limit>"
    door = (
        f"<model name='m'><link name='a'>{INERTIAL}</link><link name='b'>{INERTIAL}</link><joint "
        f"name='j' type='{kind}'>"
        f"<parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz>{limit}</axis></joint></model>"
    )
    saved = (
        "<model name='m'><link name='a'><pose>0 0 0 0 0 0</pose></link><link "
        f"name='b'><pose>{turned}</pose></link></model>"
    )
    (joint,) = read(door + state(saved), "1.6").models[0].joints
    assert (joint.lower, joint.upper) == pytest.approx((lower, upper))


def test_what_moved_when_it_was_saved_begins_at_rest(read):
    saved = (
        "<model name='m'><link name='l'><pose>0 0 0 0 0 0</pose><velocity>1 0 0 0 0 "
        "0</velocity></link></model>"
    )
    assert "every run starts at rest" in [
        note.why for note in read(MODEL + state(saved), "1.6").notes
    ]


def test_a_model_that_was_only_turned_is_noted(read):
    saved = (
        "<model name='m'><pose>9 9 9 0 0 0</pose><link name='l'><pose>10 9 9 0 0 "
        "1</pose></link></model>"
    )
    assert [note.detail for note in read(MODEL + state(saved), "1.6").notes] == ["turned"]
