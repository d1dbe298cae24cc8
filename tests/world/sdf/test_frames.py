"""Where things are: frames, nested models and includes, as Drake's own parser has them."""

import math

import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from ddenv.world.pose import Pose
from tests.world.sdf.conftest import BOX, world_text

INERTIAL = (
    "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"
)

FRAMES = {
    "link after link": (
        "<model name='m'><pose>1 2 3 0.1 0.2 0.3</pose><link name='a'><pose>1 0 0 0 0 "
        "1.5</pose></link>"
        "<link name='b'><pose relative_to='a'>1 0 0 0.4 0 0</pose></link></model>"
    ),
    "frame on frame": (
        "<model name='m'><frame name='f'><pose>0 1 0 0 0 1</pose></frame><frame name='g' "
        "attached_to='f'><pose>0 0 1 1 0 0</pose>"
        "</frame><link name='a'><pose relative_to='g'>1 0 0 0 0 0</pose></link></model>"
    ),
    "relative to a joint": (
        "<model name='m'><link name='a'/><link name='b'><pose>0 0 2 0 1 0</pose></link><joint "
        "name='j' type='fixed'>"
        "<pose>0.1 0.2 0.3 0 0 1</pose><parent>a</parent><child>b</child></joint>"
        "<frame name='f'><pose relative_to='j'>1 1 1 0 0 0</pose></frame>"
        "<link name='c'><pose relative_to='f'/></link></model>"
    ),
    "placement frame": (
        "<model name='m' placement_frame='tip'><pose>5 0 0 0 0 0.5</pose><link name='a'><pose>0 "
        "0 1 0 0 0</pose></link>"
        "<frame name='tip' attached_to='a'><pose>1 0 0 0.3 0 0</pose></frame></model>"
    ),
    "frames of the world": (
        "<frame name='hall'><pose>10 0 0 0 0 1</pose></frame>"
        "<model name='m'><pose relative_to='hall'>1 0 0 0 0 0</pose><link name='a'/></model>"
        "<model name='n'><pose relative_to='m'>0 1 0 0 0 0</pose><link name='a'/></model>"
        "<model name='o'><pose relative_to='n::a'>0 0 1 0 0 0</pose><link name='a'/></model>"
    ),
    "nested models": (
        "<model name='m'><pose>1 0 0 0 0 1</pose><link name='a'/><model name='inner'><pose "
        "relative_to='a'>0 2 0 0.5 0 0</pose>"
        "<link name='a'><pose>0 0 1 0 0 0</pose></link></model>"
        "<link name='z'><pose relative_to='inner::a'>1 0 0 0 0 0</pose></link></model>"
    ),
    "a quaternion, and degrees": (
        "<model name='m'><pose degrees='true'>1 2 3 10 20 30</pose>"
        "<link name='a'><pose rotation_format='quat_xyzw'>0 0 1 0 0 0.70710678118654752 "
        "0.70710678118654752</pose></link></model>"
    ),
}


@pytest.mark.parametrize("inside", FRAMES.values(), ids=FRAMES.keys())
def test_links_are_where_drake_has_them(read, inside):
    plant = MultibodyPlant(0.001)
    Parser(plant).AddModelsFromString(world_text(inside).decode(), "sdf")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    count = 0
    for model in read(inside).models:
        for link in model.links:
            *scope, own = link.name.split("::")
            body = plant.GetBodyByName(
                own, plant.GetModelInstanceByName("::".join((model.name, *scope)))
            )
            there = plant.EvalBodyPoseInWorld(context, body)
            assert link.pose.position == pytest.approx(there.translation().tolist(), abs=1e-9)
            assert link.pose.rotation() == pytest.approx(there.rotation().matrix(), abs=1e-9)
            count += 1
    assert count == inside.count("<link ")


def test_frame_attributes_mean_the_same_in_old_files_and_nothing_in_new_ones(read):
    inside = (
        "<model name='m'><static>1</static><link name='a'><pose frame=''>1 0 0 0 0 "
        f"0</pose>{BOX}</link>"
    )
    inside += "<link name='b'><pose frame='a'>1 0 0 0 0 0</pose></link></model>"
    assert read(inside, "1.5").models[0].links[1].pose.position == (2, 0, 0)
    new = read(inside, "1.8")
    assert new.models[0].links[1].pose.position == (1, 0, 0)
    assert "has no effect since SDF 1.7" in new.notes[0].why


def test_collisions_follow_frames_of_their_model(read):
    collision = BOX.replace("<geometry>", "<pose relative_to='b'>0 0 1 0 0 0</pose><geometry>")
    two = (
        f"<link name='a'><pose>1 0 0 0 0 1</pose>{collision}</link><link name='b'><pose>5 5 5 0 "
        "0 0</pose></link>"
    )
    model = read(f"<model name='m'><pose>0 0 0 0 0 1</pose>{two}</model>").models[0]
    there = model.links[1].pose @ Pose((0, 0, 1))
    assert model.collisions[0].pose.position == pytest.approx(there.position)


def test_models_that_others_stand_on_are_never_removed(read):
    world = read(
        "<frame name='f' attached_to='base'/><model name='base'><link name='a'/></model>"
        "<model name='shelf'><link name='a'/></model><model name='cup'><pose "
        "relative_to='shelf::a'/><link name='a'/></model>"
    )
    assert world.anchors == {"base", "shelf"}
    assert world.elements() == ("cup",)


def test_old_joint_axes_are_in_the_frame_of_the_model(read):
    inside = (
        f"<model name='m'><link name='a'>{INERTIAL}</link><link name='b'><pose>0 0 0 0 0 "
        f"{math.pi / 2}</pose>{INERTIAL}</link>"
        "<joint name='j' type='revolute'><parent>a</parent><child>b</child><axis><xyz>1 0 "
        "0</xyz>{}</axis></joint></model>"
    )
    across = "<use_parent_model_frame>1</use_parent_model_frame>"
    assert read(inside.format(""), "1.4").models[0].joints[0].axis == pytest.approx((1, 0, 0))
    assert read(inside.format(""), "1.6").models[0].joints[0].axis == pytest.approx((0, 1, 0))
    assert read(inside.format(across), "1.6").models[0].joints[0].axis == pytest.approx((1, 0, 0))
    named = inside.replace("<xyz>", "<xyz expressed_in='a'>")
    assert read(named.format(""), "1.9").models[0].joints[0].axis == pytest.approx((1, 0, 0))


def test_rows_of_frames_may_be_long(read):
    frames = "".join(
        f"<frame name='f{n}'><pose relative_to='f{n - 1}'>1 0 0 0 0 0</pose></frame>"
        for n in range(1, 3000)
    )
    world = read(
        f"<model name='m'><frame name='f0'/>{frames}<link name='a'><pose "
        "relative_to='f2999'/></link></model>"
    )
    assert world.models[0].links[0].pose.position == (2999, 0, 0)
