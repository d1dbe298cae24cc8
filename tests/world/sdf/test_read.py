"""Reading SDF: what is understood, and the one line for what is not."""

import math
from pathlib import Path

import pytest

from ddenv.errors import UserError
from ddenv.world.load import SDF
from ddenv.world.model import Box, Cylinder, Plane, Sphere
from ddenv.world.pose import Pose
from ddenv.world.sdf.read import parse_model, parse_world, read_model, read_world
from tests.conftest import DATA

HERE = Path("here.sdf")
BOX = "<collision name='c'><geometry><box><size>1 2 3</size></box></geometry></collision>"


def world(inside):
    return parse_world(f"<sdf version='1.9'><world name='w'>{inside}</world></sdf>".encode(), HERE)


def test_the_bundled_ditch_has_43_models_beside_the_ground():
    ditch = read_world(SDF / "worlds" / "ditch.sdf")
    assert len(ditch.elements()) == 43
    assert {model.name for model in ditch.models} - set(ditch.elements()) == {"ground_plane"}
    assert sum(len(model.collisions) for model in ditch.models) > 1000


def test_the_bundled_robot_has_four_driven_wheels():
    husky = read_model(SDF / "robots" / "husky.sdf")
    assert len(husky.joints) == 4
    assert all(joint.effort < math.inf for joint in husky.joints)
    assert sum(link.inertia.mass for link in husky.links) == pytest.approx(56.5, abs=2)


def test_poses_are_absolute():
    read = world(
        "<model name='m'><pose>1 0 0 0 0 1.5707963267948966</pose><static>1</static>"
        f"<link name='l'><pose>1 0 0 0 0 0</pose>{BOX.replace('<geometry>', '<pose>0 0 5 0 0 0</pose><geometry>')}</link></model>"
    )
    collision = read.models[0].collisions[0]
    assert collision.pose.position == pytest.approx((1, 1, 5))
    assert collision.pose.yaw() == pytest.approx(math.pi / 2)
    assert collision.shape == Box((1, 2, 3))
    assert read.models[0].static


def test_shapes_and_friction():
    read = read_world(DATA / "wall.sdf")
    shapes = {model.name: model.collisions[0].shape for model in read.models}
    assert shapes["post"] == Cylinder(0.2, 1.0)
    assert shapes["ball"] == Sphere(0.3)
    assert isinstance(shapes["ground_plane"], Plane)
    assert read.model("wall").collisions[0].mu == 1.0
    friction = "<surface><friction><ode><mu>0.3</mu></ode></friction></surface></collision>"
    slippery = world(f"<model name='m'><link name='l'>{BOX.replace('</collision>', friction)}</link></model>")
    assert slippery.models[0].collisions[0].mu == 0.3


def test_names_may_hold_anything_xml_allows():
    read = world(f"<model name='Häuser [bold]/ 2 &amp; 3'><link name='l'>{BOX}</link></model>")
    assert read.elements() == ("Häuser [bold]/ 2 & 3",)


def test_protected_models_and_the_ground_are_no_elements():
    read = read_world(DATA / "wall.sdf")
    assert read.elements(frozenset(["wall"])) == ("deck", "far_box", "post", "ball", "beam")


WRONG = {
    "empty": (b"  ", "the file is empty"),
    "not xml": (b"<sdf>\n<world", "here.sdf:2: not well-formed XML"),
    "not sdf": (b"<html/>", "here.sdf:1: /html: expected <sdf>"),
    "no world": (b"<sdf version='1.9'><model name='m'/></sdf>", "expected one <world>"),
    "entity bomb": (b'<!DOCTYPE l [<!ENTITY a "x"><!ENTITY b "&a;&a;">]>\n<sdf>&b;</sdf>', "DOCTYPE is not allowed"),
    "unknown encoding": (b"<?xml version='1.0' encoding='foo'?><sdf/>", "here.sdf"),
    "other encoding": (b"<?xml version='1.0' encoding='shift_jis'?><sdf/>", "here.sdf"),
    "no version": (b"<sdf><world name='w'/></sdf>", "has no version attribute; use SDF 1.4 to 1.12"),
    "unknown version": (b"<sdf version='2.0'><world name='w'/></sdf>", "version '2.0' is not supported"),
    "utf-16": ("<sdf/>".encode("utf-16"), "save it as UTF-8"),
    "external entity": (b'<!DOCTYPE l [<!ENTITY a SYSTEM "file:///etc/passwd">]><sdf>&a;</sdf>', "is not allowed"),
}


@pytest.mark.parametrize(("text", "words"), WRONG.values(), ids=WRONG.keys())
def test_broken_files_get_one_line(text, words):
    with pytest.raises(UserError, match=words.replace("(", r"\(")) as caught:
        parse_world(text, HERE)
    assert "\n" not in str(caught.value)


WRONG_MODELS = {
    "no link": ("<model name='m'/>", "has no <link>"),
    "no name": ("<model><link name='l'/></model>", "has no name"),
    "links twice": ("<model name='m'><link name='l'/><link name='l'/></model>", "is used twice"),
    "pose": (
        "<model name='m'><pose>1 2 3</pose><link name='l'/></model>",
        r"model\[@name='m'\]/pose: expected 6 finite",
    ),
    "nan": (
        "<model name='m'><pose>nan 0 0 0 0 0</pose><link name='l'/></model>",
        "expected 6 finite numbers, found 'nan",
    ),
    "infinite": (
        f"<model name='m'><link name='l'>{BOX.replace('1 2 3', '1 inf 3')}</link></model>",
        "3 finite numbers",
    ),
    "zero size": (
        f"<model name='m'><link name='l'>{BOX.replace('1 2 3', '1 0 3')}</link></model>",
        "sizes must be from",
    ),
    "static": (
        "<model name='m'><static>maybe</static><link name='l'/></model>",
        "expected true or false, found 'maybe'",
    ),
    "frame": ("<model name='m'><pose relative_to='x'>0 0 0 0 0 0</pose><link name='l'/></model>", "no frame 'x' here"),
    "population": ("<population name='p'/>", "<population> is not supported"),
    "joint between models": ("<joint name='j' type='fixed'/>", "joints between models are not supported"),
    "joint end": (
        "<model name='m'><link name='l'/><joint name='j' type='fixed'><parent>l</parent></joint></model>",
        "<child> is not a link",
    ),
    "joint type": (
        "<model name='m'><link name='l'/><joint name='j' type='screw'/></model>",
        "'screw' is not supported .*--ignore joint",
    ),
}


@pytest.mark.parametrize(("text", "words"), WRONG_MODELS.values(), ids=WRONG_MODELS.keys())
def test_what_is_not_understood_is_refused_with_its_place(text, words):
    with pytest.raises(UserError, match=words) as caught:
        world(text)
    assert str(caught.value).startswith("here.sdf:1: /sdf/world/")


def test_missing_files_folders_and_unreadable_ones(tmp_path):
    for path, words in ((tmp_path / "no.sdf", "no such file"), (tmp_path, "is a folder")):
        with pytest.raises(UserError, match=words):
            read_world(path)


def test_a_model_file_holds_one_model():
    with pytest.raises(UserError, match="expected one <model>"):
        parse_model(b"<sdf version='1.9'/>", HERE)


def test_pose_inverse_undoes_the_pose():
    pose = Pose.from_rpy(1, 2, 3, 0.4, -0.5, 2.0)
    back = pose @ pose.inverse()
    assert back.position == pytest.approx((0, 0, 0), abs=1e-12)
    assert back.quaternion == pytest.approx((1, 0, 0, 0), abs=1e-12)
    assert pose.rotate((1, 2, 3)) == pytest.approx(tuple(pose.rotation() @ (1, 2, 3)))
