"""Reading SDF: what is understood, and the one line for what is not."""

import math
from pathlib import Path

import pytest

from ddenv.errors import UserError
from ddenv.world.load import SDF
from ddenv.world.pose import Pose
from ddenv.world.sdf.read import parse_model, read_model, read_world
from tests.conftest import DATA

HERE = Path("here.sdf")


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


def test_names_may_hold_anything_xml_allows(read):
    world = read("<model name='Häuser [bold]/ 2 &amp; 3'><link name='l'/></model>")
    assert world.elements() == ("Häuser [bold]/ 2 & 3",)


def test_protected_models_and_the_ground_are_no_elements():
    read = read_world(DATA / "wall.sdf")
    assert read.elements(frozenset(["wall"])) == ("deck", "far_box", "post", "ball", "beam")


def test_a_model_file_holds_one_model():
    with pytest.raises(UserError, match="expected one <model>"):
        parse_model(b"<sdf version='1.9'/>", HERE)


def test_pose_inverse_undoes_the_pose():
    pose = Pose.from_rpy(1, 2, 3, 0.4, -0.5, 2.0)
    back = pose @ pose.inverse()
    assert back.position == pytest.approx((0, 0, 0), abs=1e-12)
    assert back.quaternion == pytest.approx((1, 0, 0, 0), abs=1e-12)
    assert pose.rotate((1, 2, 3)) == pytest.approx(tuple(pose.rotation() @ (1, 2, 3)))
