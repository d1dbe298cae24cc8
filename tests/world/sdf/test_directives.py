"""Drake's model directives as worlds: where Drake puts each model, what goes with what, and what is
refused.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from ddenv.errors import UserError
from ddenv.world.model import World
from ddenv.world.scenario import Reading
from ddenv.world.sdf.read import parse_world, read_world
from ddenv.world.write import without

MASS = "<inertial><mass>1</mass></inertial>"
BOX = "<collision name='{0}'><geometry><box><size>.2 .2 .2</size></box></geometry></collision>"
CRATE = f"""<sdf version='1.7'><model name='crate'><pose>0.1 0.2 0.3 0 0 0.4</pose>
<link name='base'><pose>0 0 0.1 0.3 0 0</pose>{MASS}{BOX.format("box")}</link>
<frame name='lid' attached_to='base'><pose relative_to='base'>0 0 1 0.1 0.2 0</pose></frame></model></sdf>"""
ARM = f"""<sdf version='1.9'><model name='arm'><link name='foot'>{MASS}{BOX.format("a")}</link>
<link name='lower'><pose>0 0 1 0 0.2 0</pose>{MASS}{BOX.format("b")}</link>
<model name='hand'><pose>0 0 2 0 0 0</pose><link name='palm'>{MASS}{BOX.format("c")}</link></model>
<joint name='shoulder' type='revolute'><pose>0 0 -0.5 0 0 0.3</pose><parent>foot</parent><child>lower</child>
<axis><xyz>0 1 0</xyz><limit><lower>-2</lower><upper>2</upper></limit></axis></joint>
<joint name='wrist' type='prismatic'><parent>lower</parent><child>hand::palm</child><axis><xyz>1 0 1</xyz></axis></joint>
</model></sdf>"""
PAIR = f"""<sdf version='1.9'><model name='pair'><link name='p'><pose>1 2 3 0 0 0</pose>{MASS}{BOX.format("p")}</link>
<link name='q'>{MASS}{BOX.format("q")}</link></model></sdf>"""
SHELF = """<robot name='shelf'><link name='board'><inertial><mass value='2'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0'
iyz='0'/></inertial></link><link name='rail'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>
</inertial></link><joint name='slide' type='prismatic'><parent link='board'/><child link='rail'/><origin xyz='1 0 0.5'
rpy='0.1 0.2 0.3'/><axis xyz='0 1 0'/><limit lower='-1' upper='1' effort='1' velocity='1'/></joint></robot>"""
ROOM = """directives:
- add_model: {name: crate, file: package://things/crate.sdf}
- add_model: {name: arm, file: package://things/arm.sdf, default_joint_positions: {shoulder: [0.3]}}
- add_frame:
    name: crate::corner
    X_PF: {base_frame: arm::lower, translation: [0.1, 0.2, 0.3]}
- add_weld: {parent: world, child: arm::foot, X_PC: {translation: [1, 1, 0]}}
- add_weld: {parent: crate::corner, child: crate::lid}
- add_collision_filter_group: {name: own, members: [crate::base, arm::foot], ignored_collision_filter_groups: [own]}
"""
FLOOR = """directives:
- add_directives: {file: package://things/room.dmd.yaml, model_namespace: room}
- add_frame: {name: "room::arm::spot", X_PF: {base_frame: "room::arm::foot", rotation: !Rpy {deg: [0, 90, 0]}}}
"""
CRATES = "".join(
    f"- add_model: {{name: {name}, file: package://things/crate.sdf}}\n" for name in "abc"
)

# Each is a file of its own.
WORLDS = {
    "plain": CRATES,
    "welds": CRATES
    + """
- add_weld: {parent: world, child: a::lid}
- add_weld: {parent: a::lid, child: b::base, X_PC: {translation: [1, 2, 3], rotation: !Rpy {deg: [10, 20, 30]}}}
- add_weld: {parent: b::base, child: c::lid, X_PC: {rotation: !AngleAxis {angle_deg: 50, axis: [1, -2, 2]}}}
""",
    "frames": CRATES
    + """
- add_frame: {name: door, X_PF: {base_frame: world, translation: [5, 0, 0], rotation: !Rpy {deg: [0, 0, 90]}}}
- add_frame: {name: inside, X_PF: {base_frame: door, rotation: !AngleAxis {angle_deg: -20, axis: [0, 1, 0]}}}
- add_weld: {parent: inside, child: a::base}
- add_frame: {name: hook, X_PF: {base_frame: a::lid, translation: [0, 0, 0.5]}}
- add_weld: {parent: a::hook, child: b::base}
""",
    "free": """
- add_model:
    name: a
    file: package://things/crate.sdf
    default_free_body_pose:
      base:
        translation: [1, 2, 3]
        rotation: !Rpy
          deg: [30, 40, 50]
- add_model:
    name: b
    file: package://things/crate.sdf
    default_free_body_pose: {lid: {base_frame: a::lid, translation: [0, 0, 1]}}
- add_model: {name: c, file: package://things/crate.sdf, default_free_body_pose: {__model__: {translation: [-4, 0, 0]}}}
""",
    "joints": """
- add_model: {name: arm, file: package://things/arm.sdf, default_joint_positions: {shoulder: [0.7]}}
- add_weld: {parent: world, child: arm::foot, X_PC: {translation: [0, 0, 1], rotation: !Rpy {deg: [0, 0, 30]}}}
""",
    "gripper": """
- add_model: {name: arm, file: package://things/arm.sdf, default_joint_positions: {shoulder: [0.1]}}
- add_model: {name: tool, file: package://things/crate.sdf}
- add_model: {name: tip, file: package://things/crate.sdf}
- add_weld: {parent: world, child: arm::foot}
- add_weld: {parent: arm::hand::palm, child: tool::base, X_PC: {translation: [0, 0, 0.2]}}
- add_weld: {parent: tool::lid, child: tip::base, X_PC: {rotation: !Rpy {deg: [0, 90, 0]}}}
""",
    "parts": """
- add_model: {name: one, file: package://things/pair.sdf}
- add_model: {name: two, file: package://things/pair.sdf, default_free_body_pose: {q: {translation: [7, 0, 0]}}}
- add_weld: {parent: one::p, child: one::q, X_PC: {translation: [0, 0, 1]}}
- add_weld: {parent: world, child: two::p}
""",
    "urdf": """
- add_model: {name: low, file: package://things/shelf.urdf, default_joint_positions: {slide: [0.25]}}
- add_model: {name: high, file: package://things/shelf.urdf, default_free_body_pose: {board: {translation: [0, 0, 2]}}}
- add_weld: {parent: world, child: low::rail, X_PC: {translation: [3, 0, 0], rotation: !Rpy {deg: [5, 6, 7]}}}
""",
    "room": "- add_directives: {file: package://things/room.dmd.yaml}\n",
    "scopes": """
- add_model_instance: {name: left}
- add_model_instance: {name: right}
- add_directives: {file: package://things/room.dmd.yaml, model_namespace: left}
- add_directives:
    file: package://things/room.dmd.yaml
    model_namespace: right
- add_model: {name: ball, file: package://things/crate.sdf}
- add_weld: {parent: left::crate::corner, child: ball::base}
""",
    "nested": """
- add_model_instance: {name: house}
- add_model_instance: {name: house::room}
- add_directives: {file: package://things/floor.dmd.yaml, model_namespace: house}
- add_model: {name: cup, file: package://things/crate.sdf, default_free_body_pose: {base: {base_frame: house::room::arm::spot}}}
""",
}
FILES = {
    "package.xml": "<package format='2'><name>things</name></package>",
    "crate.sdf": CRATE,
    "arm.sdf": ARM,
    "shelf.urdf": SHELF,
    "pair.sdf": PAIR,
    "room.dmd.yaml": ROOM,
    "floor.dmd.yaml": FLOOR,
}


@pytest.fixture
def things(tmp_path: Path) -> Path:
    """A package whose folder has another name."""
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(text)
    return folder


def written(folder: Path, text: str) -> Path:
    file = folder / "world.dmd.yaml"
    file.write_text(f"directives:\n{text}")
    return file


def in_drake(text: bytes, things: Path) -> dict[str, np.ndarray]:
    """The poses of all bodies where Drake puts them, by scoped name."""
    from pydrake.multibody.parsing import (
        LoadModelDirectivesFromString,
        Parser,
        ProcessModelDirectives,
    )
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.multibody.tree import BodyIndex
    from pydrake.systems.framework import DiagramBuilder

    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.001)
    parser = Parser(plant)
    parser.package_map().Add("things", str(things))
    ProcessModelDirectives(LoadModelDirectivesFromString(text.decode()), plant, parser)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    bodies = [plant.get_body(BodyIndex(number)) for number in range(1, plant.num_bodies())]
    return {
        body.scoped_name().get_full(): body.EvalPoseInWorld(context).GetAsMatrix4()
        for body in bodies
    }


def as_read(world: World) -> dict[str, np.ndarray]:
    names = {
        f"{model.name}::{link.name}": link.pose for model in world.models for link in model.links
    }
    poses = {}
    for name, pose in names.items():
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = pose.rotation(), pose.position
        poses[name] = matrix
    return poses


def assert_same(ours: Mapping[str, np.ndarray], drakes: Mapping[str, np.ndarray]) -> None:
    # A model that is carried by another is a part of that.
    named = {
        next(name for name in ours if name == full or name.endswith(f"::{full}")): full
        for full in drakes
    }
    assert len(named) == len(ours) == len(drakes)
    for name, full in named.items():
        np.testing.assert_allclose(ours[name], drakes[full], atol=1e-9, rtol=0, err_msg=name)


@pytest.mark.parametrize("name", WORLDS)
def test_models_stand_where_drake_puts_them(name, things, tmp_path):
    world = read_world(written(tmp_path, WORLDS[name]), Reading(model_path=(things,)))
    assert_same(as_read(world), in_drake((tmp_path / "world.dmd.yaml").read_bytes(), things))
    # The world's own text stands alone.
    assert b"add_directives" not in world.text
    assert_same(as_read(world), in_drake(world.text, things))


def read(folder: Path, text: str) -> World:
    return read_world(written(folder, text), Reading(model_path=(folder / "elsewhere",)))


@pytest.mark.parametrize("name", WORLDS)
def test_what_is_left_is_the_files_own_text_that_drake_reads(name, things, tmp_path):
    world = read(tmp_path, WORLDS[name])
    poses = as_read(world)
    for gone in world.elements():
        removed = {gone}
        while more := {one for one, other in world.ties if other in removed} - removed:
            removed |= more
        text = without(world, frozenset(removed))
        lines = world.text.decode().splitlines()
        assert [
            line for line in text.decode().splitlines() if line.strip(" []") and line not in lines
        ] == []
        again = as_read(parse_world(text, world.path, Reading(model_path=(things,))))
        left = {
            name: pose
            for name, pose in poses.items()
            if not name.startswith(tuple(f"{one}::" for one in removed))
        }
        assert again.keys() == left.keys()
        assert all(np.array_equal(again[name], left[name]) for name in left)
        assert_same(again, in_drake(text, things))


def test_what_is_welded_to_a_model_is_tied_to_it_and_what_stands_relative_to_one_keeps_it(
    things, tmp_path
):
    welds, frames, free = (read(tmp_path, WORLDS[name]) for name in ("welds", "frames", "free"))
    assert welds.ties == (("b", "a"), ("c", "b"))
    assert all(model.static for model in welds.models)
    assert frames.ties == (("b", "a"),)
    assert (free.anchors, free.elements()) == ({"a"}, ("b", "c"))
    assert not any(model.static for model in free.models)
    # What carries a protected model stays, too.
    assert welds.elements(frozenset(["b"])) == ("c",)


def test_what_is_welded_to_a_model_that_moves_is_a_part_of_it(things, tmp_path):
    (arm,) = read(tmp_path, WORLDS["gripper"]).models
    assert [link.name for link in arm.links] == [
        "foot",
        "lower",
        "hand::palm",
        "tool::base",
        "tip::base",
    ]
    ends = {joint.child: joint.parent for joint in arm.joints}
    assert ends["tip::base"] == "tool::base"
    assert ends["tool::base"] == "hand::palm"
    assert not arm.static


FILTERS = """
- add_collision_filter_group: {name: g, members: [a::base, b::base], ignored_collision_filter_groups: [g, h]}
- add_collision_filter_group:
    name: h
    members:
    - c::base  # the last one
    ignored_collision_filter_groups:
    - h
    - g
"""


def test_collision_filter_groups_lose_the_models_that_went(things, tmp_path):
    world = read(tmp_path, CRATES + FILTERS)
    for removed in (["a"], ["c"], ["a", "b"], ["b", "c"]):
        text = without(world, frozenset(removed))
        in_drake(text, things)
        assert [
            model.name for model in read(tmp_path, text.decode().partition("\n")[2]).models
        ] == sorted({*"abc"} - {*removed})
    kept = without(world, frozenset("a")).decode()
    assert "members: [ b::base]" in kept
    assert "name: g" not in without(world, frozenset("ab")).decode()


LOOP = "- add_weld: {parent: a::lid, child: b::lid}\n- add_weld: {parent: b::lid, child: a::lid}"
PAIRS = CRATES.replace("crate", "pair")
REFUSED = {
    "- add_modle: {name: a}": "2: unknown directive 'add_modle' (did you mean add_model?)",
    "- add_model: {name: a, file: package://nowhere/crate.sdf}": "2: /add_model[@name='a']: 'package://nowhere",
    "- add_model: {name: a, flie: x}": "2: add_model: unknown key 'flie' (did you mean file?)",
    "- add_model: {name: a}": "2: add_model: file is missing",
    CRATES
    + "- add_model: {name: b, file: package://things/crate.sdf}": "5: the model 'b' is added twice",
    CRATES
    + "- add_weld: {parent: world, child: a::lidd}": "5: there is no frame 'a::lidd' here (did you mean a::lid?)",
    CRATES
    + "- add_weld: {parent: world, child: lid}": "5: 'lid' may be a::lid or b::lid or c::lid",
    CRATES
    + "- add_weld: {parent: world, child: a::lid}\n- add_weld: {parent: b::lid, child: a::lid}": "6: 'a' is placed twice",
    CRATES + LOOP: "6: the place of 'a' depends on itself",
    CRATES + "- add_frame: {name: f, X_PF: {translation: [0, 0, 1]}}": "5: base_frame is missing",
    CRATES
    + "- add_weld: {parent: world, child: a::lid, X_PC: {translation: [0, .nan, 0]}}": "5: expected a finite number, found '.nan'",
    CRATES
    + "- add_weld: {parent: world, child: a::lid, X_PC: {rotation: !Uniform {}}}": "5: !Uniform is random",
    PAIRS
    + "- add_weld: {parent: b::p, child: a::p}\n- add_weld: {parent: c::p, child: a::q}": "6: 'a' is welded to two models",
    PAIRS
    + "- add_weld: {parent: b::p, child: a::p}\n- add_weld: {parent: a::q, child: b::q}": "[@name='a']: its welds form a loop",
    "- add_directives: {file: package://things/loop.dmd.yaml}": "loop.dmd.yaml:2: add_directives form a cycle: loop.dmd.yaml",
    "- add_directives: {file: package://things/none.dmd.yaml}": "2: 'package://things/none.dmd.yaml' was not found",
    "- add_directives: {file: package://things/room.dmd.yaml, model_namespace: x}": "2: there is no model instance 'x'",
    "- add_model: &a {name: a, file: x}\n- add_model: *a": "3: not valid YAML: aliases (*name) are not read",
    "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]": "not valid YAML",
    '- add_weld: {parent: world, child: "a\\nb\\e[2J"}': "2: there is no frame 'a",
    "- add_model: {name: [a": "not valid YAML",
    "- " * 2000 + "x": "nested too deeply",
    "- add_model: {name: a, name: b, file: x}": "2: the key 'name' appears twice",
    "- add_model: {name: a, file: package://things/room.dmd.yaml}": "not well-formed XML",
}


@pytest.mark.parametrize("text", REFUSED, ids=range(len(REFUSED)))
def test_what_cannot_be_read_is_refused_in_one_line(text, things, tmp_path):
    (things / "loop.dmd.yaml").write_text(
        "directives:\n- add_directives: {file: package://things/loop.dmd.yaml}\n"
    )
    with pytest.raises(UserError) as error:
        read(tmp_path, text)
    assert REFUSED[text] in str(error.value)
    assert str(error.value).isprintable()


JSON = '{"directives": [%s, %s]}'
IN_JSON = '{"add_model": {"name": "%s", "file": "package://things/crate.sdf"}}'
WRITTEN = {
    "json": JSON % (IN_JSON % "a", IN_JSON % "b"),
    "crlf": f"directives:\n{CRATES}".replace("\n", "\r\n"),
    "bom": f"\ufeffdirectives:\n{CRATES}",
    "indented": f"directives: # all\n\n{CRATES}".replace("- add", "   # one - each\n   - add"),
    "words": f"directives:\n{CRATES}".replace(
        "things/crate.sdf}", "things/crate.sdf} # größer"
    ).replace("{name: c", "{name: Häuser"),
    "far apart": f"directives:\n{CRATES}".replace("- add", "-\n    # of its own\n  add"),
}


@pytest.mark.parametrize("how", WRITTEN)
def test_however_it_is_written_the_right_text_goes(how, things, tmp_path):
    file = tmp_path / "world.dmd.yaml"
    file.write_bytes(WRITTEN[how].encode())
    world = read_world(file, Reading(model_path=(things,)))
    names = [model.name for model in world.models]
    for gone in names:
        text = without(world, frozenset([gone]))
        again = parse_world(text, file, Reading(model_path=(things,)))
        assert [model.name for model in again.models] == [name for name in names if name != gone]
        assert_same(as_read(again), in_drake(text, things))
    in_drake(without(world, frozenset(names)), things)
