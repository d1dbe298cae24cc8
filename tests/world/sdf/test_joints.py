"""Joints, and the inertia of what they hold."""

import math

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Box as DrakeBox
from pydrake.geometry import Capsule as DrakeCapsule
from pydrake.geometry import Cylinder as DrakeCylinder
from pydrake.geometry import Ellipsoid as DrakeEllipsoid
from pydrake.geometry import Sphere as DrakeSphere
from pydrake.multibody.tree import CalcSpatialInertia

from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Mesh, Sphere
from ddenv.world.sdf.inertia import solid

MASS = "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>"
LINKS = (
    f"<link name='a'>{MASS}</link><link name='b'><pose>0 0 1 0 0 0</pose>{MASS}</link><link "
    f"name='c'>{MASS}</link>"
)


def joint(kind, inside="<axis><xyz>0 0 2</xyz></axis>", parent="a", child="b", name="j"):
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f"<joint name='{name}' type='{kind}'>{ends}{inside}</joint>"


def joints_of(read, *joints, more=""):
    return read(f"<model name='m'>{LINKS}{''.join(joints)}{more}</model>").models[0].joints


@pytest.mark.parametrize("kind", ["fixed", "revolute", "continuous", "prismatic", "ball"])
def test_kinds(read, kind):
    (one,) = joints_of(read, joint(kind))
    assert (one.kind, one.parent, one.child, one.axis) == (kind, "a", "b", (0, 0, 1))
    assert one.pose.position == (0, 0, 1)


def test_a_joint_without_an_axis_turns_about_its_own_z(read):
    (one,) = joints_of(read, joint("revolute", ""))
    assert one.axis == (0, 0, 1)


@pytest.mark.parametrize(("offset", "kind", "mu"), [(0.0, "fixed", 0.0), (0.01, "ball", 1.0)])
def test_a_caster_ball_slides_in_place_of_rolling(read, offset, kind, mu):
    ball = (
        f"<collision name='s'><pose>{offset} 0 0 0 0 "
        "0</pose><geometry><sphere><radius>0.1</radius></sphere></geometry>"
    )
    links = LINKS.replace("<link name='b'>", f"<link name='b'>{ball}</collision>")
    world = read(f"<model name='m'>{links}{joint('ball')}</model>")
    (model,) = world.models
    assert (model.joints[0].kind, model.collisions[0].mu) == (kind, mu)
    assert any("caster ball" in note.why for note in world.notes) == (kind == "fixed")


def test_a_universal_joint_has_two_axes_at_right_angles(read):
    (one,) = joints_of(
        read, joint("universal", "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 3 0</xyz></axis2>")
    )
    assert (one.axis, one.axis2) == ((1, 0, 0), (0, 1, 0))


def test_ends_may_be_frames_and_links_of_nested_models(read):
    frame = "<frame name='f' attached_to='a'/>"
    inner = f"<model name='in'><link name='x'>{MASS}</link></model>"
    first, second = joints_of(
        read,
        joint("fixed", parent="f"),
        joint("fixed", parent="b", child="in", name="k"),
        more=frame + inner,
    )
    assert (first.parent, first.child) == ("a", "b")
    assert (second.parent, second.child) == ("b", "in::x")


@pytest.mark.parametrize("unlimited", ["1e16", "inf"])
def test_limits_and_damping(read, unlimited):
    limit = f"<lower>-1</lower><upper>{unlimited}</upper><effort>-1</effort><velocity>2</velocity>"
    inside = f"<axis><limit>{limit}</limit><dynamics><damping>0.5</damping></dynamics></axis>"
    (one,) = joints_of(read, joint("revolute", inside))
    assert (one.lower, one.upper, one.effort, one.velocity, one.damping) == (
        -1,
        math.inf,
        math.inf,
        2,
        0.5,
    )


def test_unknown_joints_are_left_out_where_the_user_says_so(read):
    world = read(f"<model name='m'>{LINKS}{joint('gearbox')}</model>", ignore=("joint",))
    assert world.models[0].joints == ()
    assert "'gearbox'" in world.notes[0].why


SOLIDS = {
    Box((1, 2, 3)): DrakeBox(1, 2, 3),
    Cylinder(1, 2): DrakeCylinder(1, 2),
    Capsule(1, 2): DrakeCapsule(1, 2),
    Sphere(1.5): DrakeSphere(1.5),
    Ellipsoid((1, 2, 3)): DrakeEllipsoid(1, 2, 3),
}


@pytest.mark.parametrize(("shape", "drake"), SOLIDS.items(), ids=lambda each: type(each).__name__)
def test_solids_have_the_inertia_that_drake_gives_them(shape, drake):
    volume, center, unit = solid(shape)
    theirs = CalcSpatialInertia(drake, 1.0)
    assert volume == pytest.approx(theirs.get_mass())
    assert unit == pytest.approx(theirs.get_unit_inertia().CopyToFullMatrix3())
    assert center == pytest.approx(np.zeros(3))


def test_a_hull_has_the_inertia_of_what_it_holds():
    box = trimesh.creation.box((1, 2, 3))
    volume, center, unit = solid(
        Mesh("box", box.vertices + np.array([5, 6, 7]), np.array(box.faces))
    )
    assert volume == pytest.approx(6)
    assert center == pytest.approx((5, 6, 7))
    assert unit == pytest.approx(solid(Box((1, 2, 3)))[2])


def moving(inertial, tag="model"):
    shape = (
        "<collision name='c'><pose>0 0 1 0 0 0</pose><geometry><box><size>1 2 "
        "3</size></box></geometry></collision>"
    )
    return (
        f"<{tag} name='m'><link name='l'><pose>4 0 0 0 0 0</pose>{inertial}{shape}</link></{tag}>"
    )


REPLACED = {
    "absent": ("", 1.0, "no <inertial>: 1 kg"),
    "nan": (
        "<inertial><mass>2</mass><inertia><ixx>nan</ixx></inertia></inertial>",
        2.0,
        "moments nan 1 1 kg m",
    ),
    "impossible": (
        "<inertial><mass>3</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>9</izz></inertia></inertial>",
        3.0,
        "moments 1 1 9 kg m",
    ),
    "no mass": ("<inertial><mass>0</mass></inertial>", 6000.0, "mass 0 kg is impossible: 6e"),
    "negative mass": ("<inertial><mass>-1</mass></inertial>", 6000.0, "mass -1 kg is impossible"),
    "no inertia": ("<inertial><mass>5</mass></inertial>", 5.0, "no <inertia>"),
}


@pytest.mark.parametrize(("inertial", "mass", "why"), REPLACED.values(), ids=REPLACED.keys())
def test_an_inertia_that_cannot_be_is_worked_out_from_the_shapes_with_a_note(
    read, inertial, mass, why
):
    world = read(moving(inertial))
    inertia = world.models[0].links[0].inertia
    assert inertia.mass == pytest.approx(mass)
    assert inertia.pose.position == pytest.approx((4, 0, 1))
    assert inertia.moments == pytest.approx(tuple(mass / 12 * part for part in (13, 10, 5)))
    assert [why in note.why for note in world.notes] == [True]


@pytest.mark.parametrize(("given", "mass"), [("<density>10</density>", 60), ("<mass>7</mass>", 7)])
def test_automatic_inertia_uses_the_density_or_spreads_a_mass(read, given, mass):
    world = read(moving(f"<inertial auto='true'>{given}</inertial>"), "1.11")
    assert world.models[0].links[0].inertia.mass == pytest.approx(mass)


def test_two_shapes_share_one_inertia(read):
    half = (
        "<collision name='{0}'><pose>{1} 0 0 0 0 0</pose><geometry><box><size>1 1 "
        "1</size></box></geometry></collision>"
    )
    link = f"<link name='l'>{half.format('a', -0.5)}{half.format('b', 0.5)}</link>"
    inertia = read(f"<model name='m'>{link}</model>").models[0].links[0].inertia
    assert inertia.moments == pytest.approx((1 / 6, 5 / 12, 5 / 12))


@pytest.mark.parametrize(
    ("limits", "angle", "left"),
    [
        ((0, 3.5), 3.4, (-3.4, 0.1)),
        ((0, 6.28), 6, (-6, 0.28)),
        ((-4, 0), -3.3, (-0.7, 3.3)),
        ((-1, 1), 0.5, (-1.5, 0.5)),
    ],
)
def test_a_joint_that_was_saved_beyond_half_a_turn_is_within_its_limits(read, limits, angle, left):
    limit = (
        "<axis><xyz>0 0 "
        f"1</xyz><limit><lower>{limits[0]}</lower><upper>{limits[1]}</upper></limit></axis>"
    )
    state = (
        "<state><model name='m'><link name='b'><pose>0 0 1 0 0 "
        f"{angle}</pose></link></model></state>"
    )
    (one,) = (
        read(f"<model name='m'>{LINKS}{joint('revolute', limit)}</model>{state}", "1.6")
        .models[0]
        .joints
    )
    assert (one.lower, one.upper) == pytest.approx(left)


def test_a_thin_plate_in_round_figures_is_kept(read):
    plate = "<inertia><ixx>0.083333</ixx><iyy>0.083333</iyy><izz>0.166667</izz></inertia>"
    world = read(moving(f"<inertial><mass>1</mass>{plate}</inertial>"))
    assert world.notes == ()
    assert world.models[0].links[0].inertia.moments == pytest.approx(
        (0.083333, 0.083333, 0.166667), rel=1e-4
    )
