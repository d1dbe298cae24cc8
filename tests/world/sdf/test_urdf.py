"""Robots written as URDF."""

from __future__ import annotations

from pathlib import Path

import pytest

from ddenv.errors import UserError
from ddenv.world.model import Box, Capsule, Cylinder, Mesh, Model, Sphere
from ddenv.world.scenario import Reading
from ddenv.world.sdf.read import parse_model, read_model

HERE = Path("robot.urdf")
BODY = (
    '<inertial><origin xyz="0 0 0.1"/><mass value="5"/><inertia ixx="1" iyy="2" izz="2" '
    'ixy="0.1" ixz="0" iyz="0"/></inertial>'
)
WHEEL = (
    '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
    'iyz="0"/></inertial>'
)


def urdf(*parts: str) -> bytes:
    return f'<?xml version="1.0"?>\n<robot name="cart" version="1.0">\n{"".join(parts)}</robot>'.encode()


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>\n'


def joint(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child '
        f'link="{child}"/>{inside}</joint>\n'
    )


def shape(text: str) -> str:
    return f"<collision><geometry>{text}</geometry></collision>"


def read(*parts: str, reading: Reading | None = None) -> Model:
    return parse_model(urdf(*parts), HERE, *([reading] if reading else []))


def test_links_stand_where_the_joints_say_and_the_root_comes_first():
    model = read(
        link("wheel", WHEEL),
        link("base", BODY),
        link("arm", WHEEL),
        joint(
            "turn",
            "continuous",
            "base",
            "arm",
            '<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>',
        ),
        joint("roll", "continuous", "arm", "wheel", '<origin xyz="1 0 0.5"/><axis xyz="0 2 0"/>'),
    )
    assert [each.name for each in model.links] == ["base", "wheel", "arm"]
    assert model.links[1].pose.position == pytest.approx((1.0, 1.0, 0.5))
    turn, roll = model.joints
    # URDF's axis is x where none is given.
    assert turn.axis == pytest.approx((0.0, 1.0, 0.0))
    assert roll.axis == pytest.approx((-1.0, 0.0, 0.0))
    assert roll.pose.position == pytest.approx((1.0, 1.0, 0.5))
    assert (roll.kind, roll.parent, roll.child) == ("continuous", "arm", "wheel")


def test_mass_and_inertia():
    model = read(link("base", BODY))
    inertia = model.links[0].inertia
    assert (inertia.mass, inertia.moments, inertia.products) == (
        5.0,
        (1.0, 2.0, 2.0),
        (0.1, 0.0, 0.0),
    )
    assert inertia.pose.position == (0.0, 0.0, 0.1)
    assert not model.static


def test_links_without_mass_have_none():
    fixed = joint("up", "fixed", "footprint", "base") + joint("on", "fixed", "base", "camera")
    camera = link(
        "camera", '<inertial><mass value="0"/></inertial>' + shape('<sphere radius="0.1"/>')
    )
    model = read(link("footprint"), link("base", BODY), camera, fixed)
    assert [each.inertia is None for each in model.links] == [True, False, True]
    assert [each.kind for each in model.joints] == ["fixed", "fixed"]


def test_shapes_with_the_friction_of_gazebo_elements():
    shapes = (
        '<box size="1 2 3"/>',
        '<cylinder radius="0.5" length="2"/>',
        '<sphere radius="0.5"/>',
        '<capsule radius="0.5" length="2"/>',
    )
    collision = (
        '<collision name="round"><origin xyz="0 0 1"/><geometry><sphere '
        'radius="1"/></geometry></collision>'
    )
    model = read(
        link("base", BODY + "".join(map(shape, shapes)) + collision),
        link("wheel", WHEEL + shape(shapes[1])),
        joint("roll", "continuous", "base", "wheel"),
        (
            '<gazebo reference="wheel"><mu1>0.7</mu1><mu2 '
            'value="0.9"/><material>Gazebo/Blue</material></gazebo>'
        ),
        '<gazebo><plugin name="drive" filename="libdrive.so"/></gazebo><transmission name="t"/>',
    )
    found = model.links[0].collisions
    expected = (Box((1, 2, 3)), Cylinder(0.5, 2), Sphere(0.5), Capsule(0.5, 2), Sphere(1))
    assert tuple(each.shape for each in found) == expected
    assert found[-1].name == "round"
    assert found[-1].pose.position == (0.0, 0.0, 1.0)
    assert {each.mu for each in found} == {1.0}
    assert model.links[1].collisions[0].mu == 0.7


def test_the_friction_of_drake_is_that_of_its_collision():
    own = '<drake:proximity_properties><drake:mu_dynamic value="0.05"/><drake:rigid_hydroelastic/>'
    collision = shape('<sphere radius="0.1"/>').replace(
        "</collision>", f"{own}</drake:proximity_properties></collision>"
    )
    assert read(link("base", BODY + collision)).collisions[0].mu == 0.05


def test_limits_effort_and_damping():
    limit = (
        '<limit lower="-1" upper="2" effort="3" velocity="4"/><dynamics damping="0.5" '
        'friction="1"/>'
    )
    model = read(
        *(link(name, WHEEL) for name in "abcd"),
        joint("slide", "prismatic", "a", "b", limit),
        joint("swing", "revolute", "a", "c", '<limit effort="3"/>'),
        joint("roll", "continuous", "a", "d", limit + '<mimic joint="slide"/>'),
    )
    slide, swing, roll = model.joints
    assert (slide.lower, slide.upper, slide.effort, slide.velocity, slide.damping) == (
        -1,
        2,
        3,
        4,
        0.5,
    )
    assert (swing.lower, swing.upper) == (0.0, 0.0)
    assert (roll.lower, roll.upper, roll.effort) == (-float("inf"), float("inf"), 3.0)


def test_colours_of_visuals_by_name_or_their_own():
    visual = '<visual><geometry><box size="1 1 1"/></geometry>{}</visual>'
    own = visual.format('<material name="x"><color rgba="1 0 0 1"/></material>')
    named, bare = visual.format('<material name="green"/>'), visual.format("")
    model = read(
        link("base", BODY + own + named + bare),
        '<material name="green"><color rgba="0 1 0 0.5"/></material>',
    )
    assert [each.color for each in model.links[0].visuals] == [(1, 0, 0, 1), (0, 1, 0, 0.5), None]


TRIANGLES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@pytest.mark.parametrize(
    "name", ["wheel.obj", "package://cart/meshes/wheel.obj", "package://other/wheel.obj"]
)
def test_meshes_beside_the_file_in_its_package_and_in_the_model_path(tmp_path, name):
    places = [
        tmp_path / "cart" / "urdf",
        tmp_path / "cart" / "meshes",
        tmp_path / "models" / "other",
    ]
    for place in places:
        place.mkdir(parents=True)
    kept = {"wheel.obj": places[0], "package://other/wheel.obj": places[2]}.get(name, places[1])
    (kept / "wheel.obj").write_text(TRIANGLES)
    file = places[0] / "cart.urdf"
    file.write_bytes(urdf(link("base", BODY + shape(f'<mesh filename="{name}" scale="2 2 2"/>'))))
    model = read_model(file, Reading(model_path=(tmp_path / "models",)))
    mesh = model.collisions[0].shape
    assert isinstance(mesh, Mesh)
    assert mesh.vertices.max() == 2.0


def test_a_mesh_that_is_nowhere_may_be_stood_in_for():
    base = link("base", BODY + shape('<mesh filename="package://cart/wheel.dae"/>'))
    with pytest.raises(
        UserError,
        match=(
            r"robot.urdf:3: /robot\[@name='cart'\]/link.*'package://cart/wheel.dae' is not "
            r"available"
        ),
    ):
        read(base)
    model = read(base, reading=Reading(stand_ins={"package://cart": "cylinder:0.3,1.0"}))
    assert model.collisions[0].shape == Cylinder(0.3, 1.0)


A, B, J = link("a", BODY), link("b", WHEEL), joint("j", "fixed", "a", "b")


def moving(kind: str, inside: str = "", child: str = "b") -> tuple[str, str, str]:
    return A, B, joint("j", kind, "a", child, inside)


REFUSED = {
    "no link": ((), r":2: /robot\[@name='cart'\]: has no <link>"),
    "two roots": ((A, B), "expected one link that is not the child of a joint, found a, b"),
    "loop": (
        (A, B, J, joint("k", "fixed", "b", "a")),
        "expected one link that is not the child of a joint, but joints close a loop",
    ),
    "two parents": (
        (link("c", WHEEL), A, B, J, joint("k", "fixed", "c", "b"), joint("l", "fixed", "a", "c")),
        "link 'b' is the child of two joints",
    ),
    "planar": (
        moving("planar"),
        r":5: .*/joint\[@name='j'\]: joint type 'planar' is not supported",
    ),
    "floating": (moving("floating"), "joint type 'floating' is not supported"),
    "unknown link": (
        moving("fixed", child="bb"),
        r"/child: there is no link 'bb' \(did you mean b\?\)",
    ),
    "no end": ((A, B, '<joint name="j" type="fixed"><parent link="a"/></joint>'), "has no <child>"),
    "no limit": (moving("revolute"), "a revolute joint needs a <limit>"),
    "axis": (moving("continuous", '<axis xyz="0 1"/>'), "xyz must be three numbers, found '0 1'"),
    "origin": (
        moving("fixed", '<origin xyz="0 1 up"/>'),
        "expected 6 finite numbers, found '0 1 up",
    ),
    "mass": (
        (link("a", '<inertial><mass value="5 kg"/></inertial>'),),
        "expected one finite number, found '5 kg'",
    ),
    "size": (
        (link("a", BODY + shape('<box size="1 2"/>')),),
        "/box/size: expected 3 finite numbers, found '1 2'",
    ),
    "negative": ((link("a", BODY + shape('<sphere radius="-1"/>')),), "sizes must be from 1e-06"),
    "no radius": ((link("a", BODY + shape('<sphere size="1"/>')),), "has no attribute 'radius'"),
    "shape": (
        (link("a", BODY + shape('<cone radius="1"/>')),),
        "<cone> is not a URDF shape; use one of box, cylinder",
    ),
    "no shape": ((link("a", BODY + shape("")),), "has no <geometry> with a shape in it"),
    "xacro": (
        (link("a", BODY + shape('<sphere radius="${r}"/>')),),
        r"is xacro, not URDF; run 'xacro FILE > robot.urdf'",
    ),
    "macro": (
        ('<x:macro xmlns:x="http://www.ros.org/wiki/xacro" name="m"/>', A),
        ":3: .*is xacro, not URDF",
    ),
    "twice": ((A, A), "name is used twice"),
}


@pytest.mark.parametrize(("parts", "complaint"), REFUSED.values(), ids=REFUSED.keys())
def test_what_is_no_robot_is_refused_with_its_place(parts, complaint):
    with pytest.raises(UserError, match=complaint) as refused:
        read(*parts)
    assert str(refused.value).startswith("robot.urdf:")


def test_sdf_that_mentions_a_robot_is_sdf():
    text = b"<!-- <robot> --><sdf version='1.9'><model name='m'><link name='l'/></model></sdf>"
    assert parse_model(text, HERE).name == "m"
