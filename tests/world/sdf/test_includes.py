"""Included models, nested models, and names."""

import pytest

from ddenv.errors import UserError
from ddenv.world.files.resources import Resources
from ddenv.world.model import Cylinder
from ddenv.world.sdf.read import parse_world
from tests.world.sdf.conftest import BOX, world_text

TOP = f"<pose>0 0 5 0 0 0</pose><static>1</static><link name='top'>{BOX}</link>"
TABLE = f"<sdf version='1.7'><model name='table'>{TOP}</model></sdf>"


@pytest.fixture
def table(tmp_path):
    """A folder of models, as Gazebo has them."""
    folder = tmp_path / "models" / "table"
    folder.mkdir(parents=True)
    (folder / "model.sdf").write_text(TABLE)
    (folder / "model.config").write_text("<model><sdf version='1.7'>model.sdf</sdf></model>")
    return tmp_path / "models"


def included(inside="", uri="model://table"):
    return f"<include><uri>{uri}</uri>{inside}</include>"


def test_a_model_is_found_in_the_model_path(read, table):
    world = read(
        included() + included("<name>desk</name><pose>1 2 3 0 0 0</pose><static>0</static>"),
        model_path=(table,),
    )
    first, second = world.models
    assert (first.name, first.pose.position, first.static) == ("table", (0, 0, 5), True)
    assert (second.name, second.pose.position, second.static) == ("desk", (1, 2, 3), False)
    assert second.links[0].inertia is not None


def test_of_a_broken_model_config_nothing_but_a_note_is_left(read, table):
    config = table / "table" / "model.config"
    config.write_text("<model><author>Us & co</author><sdf version='1.7'>other.sdf</sdf></model>")
    (table / "table" / "other.sdf").write_text(TABLE.replace("'table'", "'other'"))
    assert read(included(), model_path=(table,)).models[0].name == "other"
    config.write_text("<model><sdf version='1.7'>other.sdf</model>")
    world = read(included() + included("<name>desk</name>"), model_path=(table,))
    assert [model.name for model in world.models] == ["table", "desk"]
    (note,) = (note for note in world.notes if "model.config" in note.why)
    assert (
        "line 1, column 36: not well-formed XML: </model> closes <sdf> of line 1; model.sdf is "
        "taken"
    ) in note.why
    # What a run file stores says it, too.
    again = parse_world(world.text, world.path, resources=Resources(world.resources))
    assert again.notes == world.notes
    assert read(included(uri="model://table/model.sdf"), model_path=(table,)).notes == ()


def test_a_mesh_that_was_found_is_called_unreadable_and_no_folder_is_asked_for(read, tmp_path):
    (tmp_path / "broken.dae").write_text("<COLLADA/>")
    meshes = "".join(
        f"<collision name='{uri}'><geometry><mesh><uri>{uri}</uri></mesh></geometry></collision>"
        for uri in ("broken.dae", "gone.dae")
    )
    with pytest.raises(UserError) as refused:
        read(f"<model name='m'><link name='l'>{meshes}</link></model>")
    said = str(refused.value)
    assert (
        "'broken.dae' is unreadable: is not a valid DAE file: has no scene; give a shape in m"
        in said
    )
    assert "--model-path" not in said
    assert said.endswith("; also missing: 'gone.dae'")
    world = read(
        f"<model name='m'><static>1</static><link name='l'>{meshes}</link></model>",
        ignore=("mesh",),
    )
    assert any("'broken.dae' is unreadable (" in note.why for note in world.notes)
    assert any("'gone.dae' is not available (" in note.why for note in world.notes)


@pytest.mark.parametrize(
    ("of_model", "of_include"), [(" placement_frame='foot'", ""), ("", "foot")]
)
def test_the_place_of_an_include_can_be_that_of_a_frame_inside(read, table, of_model, of_include):
    frame = "<frame name='foot'><pose>0 0 -1 0 0 0</pose></frame>"
    text = TABLE.replace("<model name='table'>", f"<model name='table'{of_model}>{frame}")
    (table / "table" / "model.sdf").write_text(text)
    placed = f"<placement_frame>{of_include}</placement_frame>" if of_include else ""
    world = read(included(f"{placed}<pose>1 0 0 0 0 0</pose>"), model_path=(table,))
    assert world.models[0].pose.position == (1, 0, 1)
    with pytest.raises(UserError, match="a <placement_frame> needs a <pose>"):
        read(included("<placement_frame>foot</placement_frame>"), model_path=(table,))


def test_models_in_models_become_one(read, table):
    inner = f"<model name='in'><pose>0 0 1 0 0 0</pose><link name='l'>{BOX}</link></model>"
    world = read(
        (
            "<model name='m'><static>1</static><pose>1 0 0 0 0 "
            f"0</pose>{inner}{included('<name>t</name>')}</model>"
        ),
        model_path=(table,),
    )
    links = {link.name: link.pose.position for link in world.models[0].links}
    assert links == {"in::l": (1, 0, 1), "t::top": (1, 0, 5)}


def test_a_static_model_in_one_that_moves_hangs_on_the_world(read):
    inner = f"<model name='in'><static>1</static><link name='l'>{BOX}</link></model>"
    (joint,) = read(f"<model name='m'><link name='a'/>{inner}</model>").models[0].joints
    assert (joint.kind, joint.parent, joint.child) == ("fixed", "world", "in::l")


@pytest.mark.parametrize(
    "inside",
    [
        f"<model name='in'><static>1</static><link name='l'>{BOX}</link></model>",
        (
            "<model name='in'><static>1</static><model name='inner'><link "
            f"name='l'>{BOX}</link></model></model>"
        ),
        (
            f"<link name='l'>{BOX}</link><joint name='j' "
            "type='fixed'><parent>world</parent><child>l</child></joint>"
        ),
    ],
)
def test_a_model_that_is_fixed_to_the_world_is_static(read, inside):
    world = read(f"<model name='m'><pose>0 0 -4 0 0 0</pose>{inside}</model>")
    (model,) = world.models
    assert (model.static, model.joints, model.links[0].inertia) == (True, (), None)
    assert not [note for note in world.notes if "inertial" in note.why and "joint" not in inside]


def test_the_parts_of_a_static_model_in_another_one_can_be_removed(read):
    boxes = "".join(BOX.replace("'c'", f"'{name}'") for name in "ab")
    walls = f"<model name='walls'><static>1</static><link name='l'>{boxes}</link></model>"
    assert read(f"<model name='house'>{walls}</model>", inside=True).elements() == (
        "house/a",
        "house/b",
    )


def test_the_links_of_a_merged_model_are_those_of_the_model_around_it(read, table):
    inner = (
        f"<frame name='tip'><pose>0 0 2 0 0 0</pose></frame><link name='a'>{BOX}</link><link "
        f"name='b'>{BOX}</link>"
    )
    (table / "table" / "model.sdf").write_text(
        f"<sdf version='1.9'><model name='table'><static>1</static>{inner}</model></sdf>"
    )
    merged = "<include merge='true'><uri>model://table</uri><pose>0 1 0 0 0 0</pose></include>"
    own = f"<link name='c'><pose relative_to='tip'>1 0 0 0 0 0</pose>{BOX}</link>"
    joint = "<joint name='k' type='fixed'><parent>b</parent><child>c</child></joint>"
    world = read(
        f"<model name='m'><pose>5 0 0 0 0 0</pose>{merged}{own}{joint}</model>", model_path=(table,)
    )
    (model,) = world.models
    assert {link.name: link.pose.position for link in model.links} == {
        "a": (5, 1, 0),
        "b": (5, 1, 0),
        "c": (6, 1, 2),
    }
    assert [(one.parent, one.child) for one in model.joints] == [("b", "c")]
    assert not model.static


@pytest.mark.parametrize(
    "fallen",
    [
        f"<model name='fallen'><pose>9 -10 -7.6e8 0 0 0</pose><link name='l'>{BOX}</link></model>",
        f"<model name='fallen'><link name='l'><pose>0 0 -1e308 0 0 0</pose>{BOX}</link></model>",
        f"<model name='fallen'><link name='l'>{BOX}</link></model>"
        "<state world_name='w'><model name='fallen'><pose>0 0 -9e6 0 0 0</pose></model></state>",
    ],
)
def test_a_model_that_has_fallen_far_is_not_simulated(read, fallen):
    world = read(f"<model name='m'><static>1</static><link name='l'>{BOX}</link></model>{fallen}")
    assert [model.name for model in world.models] == ["m"]
    assert ("<model>", "it is not simulated: it is more than 1e+06 m away") in [
        (note.what, note.why) for note in world.notes
    ]


def test_a_model_that_is_nowhere_is_refused_with_the_remedies(read):
    with pytest.raises(UserError, match="/world/include: 'model://table' was not found") as caught:
        read(included())
    assert all(
        word in str(caught.value)
        for word in ("--model-path", "--stand-in 'model://table=box", "--ignore include")
    )


def test_a_stand_in_for_a_whole_model(read):
    text = included("<name>desk</name><pose>1 0 0 0 0 0</pose>")
    world = read(text, stand_ins={"model://table": "cylinder:0.5,2"})
    (desk,) = world.models
    assert (desk.name, desk.static) == ("desk", True)
    assert desk.collisions[0].shape == Cylinder(0.5, 2)
    assert desk.collisions[0].pose.position == (1, 0, 1)
    assert "stand-in cylinder:0.5,2" in world.notes[0].why
    assert read(included(), ignore=("include",)).models == ()
    assert (
        read("<include merge='true'><uri>model://table</uri></include>", ignore=("include",)).models
        == ()
    )


def test_what_is_wrong_in_an_included_file_is_told_of_that_file(read, table):
    (table / "table" / "model.sdf").write_text(TABLE.replace("0 0 5", "0 0 nan"))
    with pytest.raises(
        UserError, match=r"table/model\.sdf:1: /sdf/model\[@name='table'\]/pose: expected 6 finite"
    ):
        read(included(), model_path=(table,))


def test_a_world_in_a_world_is_refused(read, table):
    (table / "world.sdf").write_bytes(world_text(""))
    with pytest.raises(UserError, match=r"here\.sdf:1: /sdf/world/include.* holds no <model>"):
        read(included(uri="models/world.sdf"), model_path=(table,))


def test_lights_and_actors_are_passed_over(read, table):
    (table / "sun.sdf").write_text(
        "<sdf version='1.7'><light name='sun' type='directional'/></sdf>"
    )
    world = read(included(uri="models/sun.sdf") + "<light name='l'/><actor name='walker'/>")
    assert world.models == ()
    assert sorted(note.what for note in world.notes) == ["<actor>", "<include>"]


def test_models_of_one_name_are_told_apart_by_their_place(read):
    one = "<model name='box'><link name='l'/></model>"
    world = read(one + "<model name='box #2'><link name='l'/></model>" + one + one)
    assert [model.name for model in world.models] == ["box", "box #2", "box #3", "box #4"]
    assert all("used 3 times" in note.why for note in world.notes if "name" in note.why)


def test_a_ground_that_could_move_does_not(read):
    plane = "<collision name='c'><geometry><plane/></geometry></collision>"
    world = read(f"<model name='g'><link name='l'>{plane}</link></model>")
    assert world.models[0].static
    assert world.elements() == ()


def test_gravity_of_old_and_new_files(read):
    assert read("").gravity == (0, 0, -9.8)
    assert read("<gravity>0 0 -1.6</gravity>").gravity == (0, 0, -1.6)
    assert read("<physics type='ode'><gravity>0 0 -3.7</gravity></physics>", "1.4").gravity == (
        0,
        0,
        -3.7,
    )
    light = read("<model name='m'><link name='l'><gravity>0</gravity></link></model>").models[0]
    assert not light.gravity


def test_all_files_that_are_nowhere_are_told_at_once(read):
    mesh = (
        "<collision "
        "name='c'><geometry><mesh><uri>model://lamp/lamp.dae</uri></mesh></geometry></collision>"
    )
    with pytest.raises(
        UserError,
        match=r"'model://table' was not found: .*; also missing: 'model://lamp/lamp.dae'$",
    ):
        read(
            included()
            + included()
            + f"<model name='lamp'><static>1</static><link name='l'>{mesh}</link></model>"
        )


def test_a_stand_in_is_called_as_what_it_replaces(read):
    uris = ("model://table", "https://fuel.gazebosim.org/1.0/Open/models/Construction%20Barrel")
    world = read(
        "".join(included(uri=uri) for uri in uris), stand_ins=dict.fromkeys(uris, "sphere:1")
    )
    assert [model.name for model in world.models] == ["table", "Construction Barrel"]
    assert [note.model for note in world.notes] == ["table", "Construction Barrel"]


def test_a_static_model_may_have_no_link(read):
    world = read("<model name='m'><static>1</static><plugin name='p' filename='f'/></model>")
    assert world.models[0].collisions == ()
    assert any("no <link>" in note.why for note in world.notes)


SILENT = {
    "a misspelt collision": "<colision name='c'/>",
    "a sensor": "<sensor name='s'/>",
    "a plugin": "<plugin name='p' filename='f'/>",
    "a misspelt limit": "<joint name='j' type='revolute'>{ends}<axis><xyz>0 0 1</xyz><limits/></axis></joint>",
    "a limit outside its axis": "<joint name='j' type='fixed'>{ends}<limit/></joint>",
    "two axes": "<joint name='j' type='revolute'>{ends}<axis/><axis/></joint>",
    "a spring": "<joint name='j' "
    "type='revolute'>{ends}<axis><dynamics><spring_stiffness>9</spring_stiffness></dynamics>"
    "</axis></joint>",
    "dry friction": (
        "<joint name='j' "
        "type='revolute'>{ends}<axis><dynamics><friction>9</friction></dynamics></axis></joint>"
    ),
    "limits that are not simulated": (
        "<joint name='j' "
        "type='continuous'>{ends}<axis><limit><lower>0</lower></limit></axis></joint>"
    ),
    "a joint's sensor": "<joint name='j' type='fixed'>{ends}<sensor name='s'/></joint>",
    "drag": "<velocity_decay><linear>0.1</linear></velocity_decay>",
    "a misspelt mass": "<inertial><Mass>5</Mass></inertial>",
    "misplaced friction": (
        "<collision name='c'>{box}<surface><friction><mu>0.1</mu></friction></surface></collision>"
    ),
    "bounce": "<collision "
    "name='c'>{box}<surface><bounce><restitution_coefficient>1</restitution_coefficient></bounce></surface>"
    "</collision>",
    "a bitmask": (
        "<collision "
        "name='c'>{box}<surface><contact><collide_bitmask>2</collide_bitmask></contact></surface></collision>"
    ),
}


@pytest.mark.parametrize("text", SILENT.values(), ids=SILENT.keys())
def test_what_is_not_simulated_is_noted(read, text):
    text = text.format(
        ends="<parent>a</parent><child>b</child>",
        box="<geometry><box><size>1 1 1</size></box></geometry>",
    )
    mass = "<inertial><mass>1</mass><inertia/></inertial>"
    inside = "" if text.startswith("<joint") else text
    first = f"<link name='a'>{inside if '<inertial' in inside else mass + inside}</link>"
    world = read(
        f"<model name='m'>{first}<link name='b'>{mass}</link>{'' if inside else text}</model>"
    )
    assert any(note.kind == "ignored" for note in world.notes)


def test_links_collide_with_their_own_model_as_they_say(read):
    def model(own, *links):
        texts = (f"<link name='{n}'>{text}</link>" for n, text in enumerate(links))
        return read(f"<model name='m'>{own}{''.join(texts)}</model>").models[0].self_collide

    yes, no = "<self_collide>1</self_collide>", "<self_collide>0</self_collide>"
    assert not model("", "", "")
    assert model(yes, "", "")
    assert model(no, yes, "")
    assert not model(yes, no, no)


def test_a_missing_file_is_told_before_what_follows_from_it(read):
    with pytest.raises(UserError, match="'model://table' was not found"):
        read(included() + "<model name='cup'><pose relative_to='table'/><link name='l'/></model>")


def test_a_model_of_which_all_is_left_out_is_left_out(read):
    lamp = "<model name='lamp'><static>1</static><link name='l'/></model>"
    wrapped = f"<model name='wall'>{included()}<model name='inner'>{included()}</model></model>"
    world = read(
        wrapped + f"<model name='half'>{included()}{lamp}</model>",
        stand_ins={"model://table": "none"},
    )
    assert [model.name for model in world.models] == ["half"]
    assert "all that it includes is left out" in [
        note.why for note in world.notes if note.model == "wall"
    ]
    with pytest.raises(UserError, match="has no <link>"):
        read("<model name='m'><plugin name='p' filename='f'/></model>")


def test_actors_are_not_simulated_and_nothing_else_is_said_of_them(read, table):
    (table / "table" / "model.sdf").write_text("<sdf version='1.6'><actor name='walker'/></sdf>")
    # An actor may have links, which could be touched.
    world = read(
        f"{included()}<actor name='a'><link name='l'>{BOX}</link></actor>", model_path=(table,)
    )
    assert world.models == ()
    assert [(note.what, note.why) for note in world.notes] == [
        ("<actor>", "actors are not simulated"),
        ("<include>", "actors are not simulated"),
    ]
