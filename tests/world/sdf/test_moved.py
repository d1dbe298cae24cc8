"""A world is written with other poses; every other byte stays, and what is written reads as it was
asked for.
"""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.world.pose import Pose
from ddenv.world.scenario import PLAIN
from ddenv.world.sdf.moved import is_same, with_places
from ddenv.world.sdf.read import parse_world, read_world
from tests.conftest import DATA

BOX = "<collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision>"
INERTIAL = (
    "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"
)
LINK = f"<link name='link'>{INERTIAL}{BOX}</link>"
HINGE = (
    f"<link name='arm'><pose>0 0 1 0 0 0</pose>{INERTIAL}{BOX}</link>"
    "<joint name='hinge' type='revolute'><parent>link</parent><child>arm</child><axis><xyz>1 0 "
    "0</xyz></axis></joint>"
)
WORLD = f"""<?xml version='1.0'?>
<sdf version='1.9'><world name='w'>
  <frame name='corner'><pose>5 1 0 0 0 1</pose></frame>
  <!-- kept --> <model name='plain'><pose>1 2 3 0.1 0.2 0.3</pose>{LINK}</model>
  <model name='none'>
    {LINK}</model>
  <model name='empty'><pose/>{LINK}</model>
  <model name='turned'><pose rotation_format="quat_xyzw" relative_to='corner'>1 0 0 0 0 0.6 0.8</pose>{LINK}</model>
  <model name='degrees'><pose degrees='true'>1 0 0 90 0 45</pose><link name='link'><pose>0 1 0 1 0 0</pose>{INERTIAL}</link></model>
  <model name='placed' placement_frame='link'><pose>3 0 0 0 0 2</pose>
    <link name='link'><pose>0 0 1 0 1 0</pose>{INERTIAL}</link></model>
  <model name='saved'><pose>9 9 9 0 0 0</pose>{LINK}</model>
  <model name='saved in part'><pose>7 9 9 0 0 0</pose>{LINK}</model>
  <model name='arm'>{LINK}{HINGE}</model>
  <model name='saved arm'>{LINK}{HINGE}</model>
  <model name='base'><pose>2 2 0 0 0 0</pose>{LINK}</model>
  <model name='follower'><pose relative_to='base'>0 0 1 0 0 0</pose>{LINK}</model>
  <state world_name='w'>
    <model name='saved'><pose>1 1 1 0 0 1</pose><scale>1 1 1</scale>
      <link name='link'><pose>1 1 2 0 0 1</pose><velocity>0 0 0 0 0 0</velocity></link></model>
    <model name='saved in part'><scale>1 1 1</scale></model>
    <model name='saved arm'><pose>4 4 0 0 0 0</pose>
      <link name='link'><pose>4 4 0 0 0 0</pose></link>
      <link name='arm'><pose>4 4 1 0.2 0 0</pose></link></model>
  </state>
</world></sdf>
""".encode()
READ = parse_world(WORLD, DATA / "w.sdf")
RIGID = [model.name for model in READ.models if len(model.links) == 1 and model.name != "base"]

places = st.floats(-50, 50, allow_subnormal=False)
angles = st.one_of(
    st.floats(-3.2, 3.2, allow_subnormal=False),
    st.sampled_from([1.5707963267948966, -1.5707963267948966]),
)
poses = st.builds(Pose.from_rpy, places, places, places, angles, angles, angles)
POSES = re.compile(rb"<pose[^>]*>[^<]*</pose>|<pose/>")


@given(turn=poses)
def test_roll_pitch_and_yaw_are_those_of_the_pose(turn):
    assert is_same(Pose.from_rpy(*turn.position, *turn.rpy()), turn)


@given(moved=st.dictionaries(st.sampled_from(RIGID), poses))
def test_what_is_written_reads_as_it_was_asked_for_and_the_rest_stays(moved):
    text, stay = with_places(READ, {name: [place] for name, place in moved.items()}, PLAIN)
    assert stay == []
    again = parse_world(text, READ.path)
    for model in READ.models:
        wanted = [moved[model.name]] if model.name in moved else [link.pose for link in model.links]
        assert all(map(is_same, (link.pose for link in again.model(model.name).links), wanted))
    # Without poses both texts are the same: some models had none.
    assert re.sub(rb"\s+", b"", POSES.sub(b"", text)) == re.sub(rb"\s+", b"", POSES.sub(b"", WORLD))


@pytest.mark.parametrize("world", [READ, read_world(DATA / "wall.sdf")], ids=["poses", "wall"])
def test_where_nothing_moves_no_byte_changes(world):
    there = {model.name: [link.pose for link in model.links] for model in world.models}
    assert with_places(world, there, PLAIN) == (world.text, [])


def test_what_cannot_be_moved_stays_and_is_named():
    lifted = Pose((0.0, 0.0, 0.5))
    bent = {name: [link.pose for link in READ.model(name).links] for name in ("arm", "saved arm")}
    bent = {
        name: [lifted @ first, lifted @ second @ Pose.from_rpy(0, 0, 0, 0.5, 0, 0)]
        for name, (first, second) in bent.items()
    }
    text, stay = with_places(READ, {**bent, "base": [lifted], "plain": [lifted]}, PLAIN)
    # <state> holds the links of one arm; others are placed relative to the base.
    assert stay == ["arm", "base"]
    again = parse_world(text, READ.path)
    assert again.model("arm").links == READ.model("arm").links
    assert again.model("follower").links == READ.model("follower").links
    assert all(
        map(is_same, (link.pose for link in again.model("saved arm").links), bent["saved arm"])
    )
    assert is_same(again.model("plain").links[0].pose, lifted)
