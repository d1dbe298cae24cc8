"""Inside models: their collisions as models that can be removed, and the text without some of
them.
"""

import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from ddenv.world.files.resources import Resources
from ddenv.world.load import SDF
from ddenv.world.scenario import Reading
from ddenv.world.sdf import inside
from ddenv.world.sdf.read import disk_of, parse_world, read_world
from ddenv.world.write import convert, without

BOX = "<geometry><box><size>1 1 1</size></box></geometry>"


def shape(tag, name, x=0.0):
    return f"<{tag} name='{name}'><pose>{x} 0 0 0 0 0</pose>{BOX}</{tag}>"


def house(inside, more=""):
    return f"<model name='house'><static>true</static>{inside}{more}</model>"


ROOMS = (
    f"<link name='walls'>{shape('collision', 'a', 1)}{shape('visual', 'a_shown', 1.1)}"
    f"{shape('collision', 'b', 5)}{shape('visual', 'b_shown', 5.1)}</link>"
    f"<model name='shed'><link name='roof'>{shape('collision', 'c', 9)}</link></model>"
)
DITCH = read_world(SDF / "worlds" / "ditch.sdf", Reading(inside=True))


def test_parts_are_named_by_model_link_and_collision_and_have_the_nearest_visuals(read):
    world = read(house(ROOMS), inside=True)
    assert world.elements() == ("house/walls/a", "house/walls/b", "house/shed/roof")
    assert [[one.name for one in model.links[0].visuals] for model in world.models] == [
        ["a_shown"],
        ["b_shown"],
        [],
    ]
    assert world.elements(frozenset({"house"})) == ()


@pytest.mark.parametrize(
    ("removed", "left"),
    [
        ({"house/walls/a"}, ["collision b", "visual b_shown", "collision c"]),
        ({"house/walls/a", "house/walls/b"}, ["collision c"]),
        ({"house/shed/roof"}, ["collision a", "visual a_shown", "collision b", "visual b_shown"]),
    ],
)
def test_links_and_nested_models_go_with_their_last_part(read, removed, left):
    world = read(house(ROOMS), inside=True)
    text = without(world, frozenset(removed)).decode()
    for kind, name in (
        words.split() for words in ("collision a", "visual a_shown", "collision b", "collision c")
    ):
        assert (f"<{kind} name='{name}'>" in text) == (f"{kind} {name}" in left)
    assert ("'walls'" in text) == any(name in ("collision a", "collision b") for name in left)
    assert ("'shed'" in text) == ("collision c" in left)


def test_a_model_goes_with_its_last_part(read):
    world = read(
        f"{house(ROOMS)}<model name='box'><link name='l'>{shape('collision', 'd')}</link></model>",
        inside=True,
    )
    assert (
        "house"
        not in without(
            world, frozenset(name for name in world.elements() if name != "box")
        ).decode()
    )


@pytest.mark.parametrize(
    "more",
    [
        "<frame name='door' attached_to='walls'/>",
        "<joint name='j' type='fixed'><parent>walls</parent><child>shed::roof</child></joint>",
    ],
)
def test_links_that_others_name_stay(read, more):
    world = read(house(ROOMS, more), inside=True)
    text = without(world, frozenset({"house/walls/a", "house/walls/b"}))
    assert b"<link name='walls'></link>" in text
    assert parse_world(text, world.path).elements() == ("house",)


@pytest.mark.parametrize(
    ("walls", "more"),
    [
        (ROOMS.replace("'b'", "'a'"), ""),
        (ROOMS, "<model name='house/walls/a'><static>1</static><link name='l'/></model>"),
    ],
    ids=["two parts", "a part and a model"],
)
def test_a_model_whose_parts_would_have_one_name_stays_whole_and_is_noted(read, walls, more):
    world = read(house(walls) + more, inside=True)
    assert "house" in {model.name for model in world.models}
    assert any("have one name" in note.why for note in world.notes)


def test_what_moves_and_what_others_are_placed_relative_to_stays_whole_and_is_noted(read):
    cart = (
        "<model name='cart'><link "
        f"name='l'>{shape('collision', 'a')}{shape('collision', 'b')}</link></model>"
    )
    base = house(ROOMS).replace("house", "base")
    lamp = (
        "<model name='lamp'><pose relative_to='base'/><static>1</static><link "
        f"name='l'>{shape('collision', 'd')}</link></model>"
    )
    world = read(f"{cart}{base}{lamp}{house(ROOMS)}", inside=True)
    assert world.elements()[:2] == ("cart", "lamp")
    whole = {note.model: note.why for note in world.notes if note.what == "--inside"}
    assert "it can move" in whole["cart"]
    assert "other models depend on it" in whole["base"]


@pytest.fixture
def models(tmp_path):
    """A folder of models: a hut with a mesh, which includes a porch, and a shed that is a URDF
    file.
    """
    for name in ("hut", "porch", "shed"):
        (tmp_path / "models" / name / "meshes").mkdir(parents=True)
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "models" / "hut" / "meshes" / "a&b.obj")
    mesh = (
        "<collision "
        "name='m'><geometry><mesh><uri>meshes/a&amp;b.obj</uri></mesh></geometry></collision>"
    )
    porch = "<include><uri>model://porch</uri><pose relative_to='door'>0 0 1 0 0 0</pose></include>"
    door = "<frame name='door'><pose>3 0 0 0 0 0</pose></frame>"
    hut = (
        "<sdf version='1.7'>\n<model name='hut' canonical_link='walls'><pose>7 7 7 0 0 "
        f"0</pose>{door}{ROOMS}"
    )
    hut += f"<link name='chimney'>{mesh}</link>{porch}</model>\n</sdf>"
    (tmp_path / "models" / "hut" / "model.sdf").write_text(hut)
    post = "<link name='post'>" + shape("collision", "p") + shape("collision", "q") + "</link>"
    (tmp_path / "models" / "porch" / "model.sdf").write_text(
        f"<sdf version='1.9'><model name='porch'><static>1</static>{post}</model></sdf>"
    )
    urdf_box = "<collision><geometry><box size='1 1 1'/></geometry></collision>"
    link = f"<link name='l'>{2 * urdf_box}</link>"
    (tmp_path / "models" / "shed" / "shed.urdf").write_text(f"<robot name='shed'>{link}</robot>")
    return (tmp_path / "models",)


def include(uri, more=""):
    return f"<include><uri>{uri}</uri><static>1</static>{more}</include>"


HUTS = (
    include("model://hut", "<name>a&amp;b</name><pose>1 2 0 0 0 1</pose>")
    + f"<model name='yard'><static>1</static>{include('models/hut/model.sdf')}</model>"
)


def test_included_models_are_copied_and_opened(read, models):
    whole, world = read(HUTS, model_path=models), read(HUTS, model_path=models, inside=True)
    assert not [note for note in world.notes if note.what == "--inside"]
    named = {
        name: [part for part in world.models if part.inside == name] for name in ("a&b", "yard")
    }
    assert [part.name for part in named["a&b"]] == [
        *(
            "a&b/walls/a",
            "a&b/walls/b",
            "a&b/chimney",
            "a&b/shed/roof",
            "a&b/porch/post/p",
            "a&b/porch/post/q",
        ),
    ]
    for model in whole.models:
        parts = [one for part in named[model.name] for one in part.collisions]
        assert [(one.pose, one.mu) for one in parts] == [
            (one.pose, one.mu) for one in model.collisions
        ]


@pytest.mark.parametrize(
    "removed", [(), ("a&b/chimney",), ("a&b/walls/a", "a&b/porch/post/p", "yard/hut/chimney")]
)
def test_what_is_left_of_an_included_model_reads_alike_with_and_without_the_files(
    read, models, removed
):
    world = read(HUTS, model_path=models, inside=True)
    text = without(world, frozenset(removed))
    left = [one for model in world.models if model.name not in removed for one in model.collisions]
    for resources in (Resources(world.resources), disk_of(world.path, Reading(model_path=models))):
        again = parse_world(text, world.path, Reading(model_path=models), resources)
        assert [one for model in again.models for one in model.collisions] == left


def test_what_cannot_be_copied_stays_whole_and_is_noted(read, models):
    world = read(
        include("model://shed/shed.urdf") + include("model://hut"), model_path=models, inside=True
    )
    (note,) = [note for note in world.notes if note.what == "--inside"]
    assert note.model == "shed"
    assert "ddenv world convert" in note.why
    assert "shed" in world.elements() and "hut/chimney" in world.elements()


def test_a_large_file_is_not_copied_again_and_again(read, models, monkeypatch):
    monkeypatch.setattr(inside, "MOST_COPIED", 2000)
    world = read(
        "".join(include("model://hut", f"<name>{name}</name>") for name in "abc"),
        model_path=models,
        inside=True,
    )
    assert world.elements() == ("a", "b", "c")
    assert len(world.text) < 1000


@given(removed=st.sets(st.sampled_from(DITCH.elements())))
def test_what_is_left_of_a_real_world_reads_as_before(removed):
    again = parse_world(without(DITCH, frozenset(removed)), DITCH.path)
    left = [one for model in DITCH.models if model.name not in removed for one in model.collisions]
    assert [one for model in again.models for one in model.collisions] == left


L = "0 0", "2 0", "2 1", "1 1", "1 2", "0 2"
CORNER = (
    f"<polyline><height>1</height>{''.join(f'<point>{point}</point>' for point in L)}</polyline>"
)


def test_the_pieces_of_one_collision_are_one_part(read):
    wall = f"<collision name='wall'><geometry>{CORNER}</geometry></collision>"
    world = read(house(f"<link name='l'>{shape('collision', 'box')}{wall}</link>"), inside=True)
    assert [(model.name, len(model.collisions)) for model in world.models] == [
        ("house/box", 1),
        ("house/wall", 2),
    ]
    whole = read(house(f"<link name='l'>{wall}</link>"), inside=True)
    assert [model.name for model in whole.models] == ["house"]
    assert any("'ddenv world convert' writes its pieces" in note.why for note in whole.notes)
    text, _ = convert(whole, "meshes")
    parts = parse_world(text, whole.path, Reading(inside=True))
    assert parts.elements() == ("house/wall", "house/wall_2")
