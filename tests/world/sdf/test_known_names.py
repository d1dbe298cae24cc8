"""Models that most Gazebo worlds name are there on every machine, and what is missing can be
guessed.
"""

import pytest

from ddenv.errors import UserError
from ddenv.world.extent import model_bounds
from ddenv.world.files.resources import Resources
from ddenv.world.model import Box, Cylinder, Plane
from ddenv.world.sdf.read import parse_world
from ddenv.world.sdf.standin import KNOWN_SIZES, MESH_SCALES
from tests.world.sdf.conftest import world_text

pytestmark = pytest.mark.usefixtures("no_gazebo")

FUEL = "https://fuel.gazebosim.org/1.0/OpenRobotics/models"
USUAL = [("model://sun", "model://ground_plane"), (f"{FUEL}/Sun", f"{FUEL}/Ground Plane/2")]


def included(uri, inside=""):
    return f"<include><uri>{uri}</uri>{inside}</include>"


@pytest.mark.parametrize(("sun", "ground"), USUAL)
def test_sun_and_ground_plane_are_built_in(read, tmp_path, sun, ground):
    text = included(sun) + included(ground, "<pose>0 0 0.5 0 0 0</pose>")
    world = read(text)
    (plane,) = world.models
    assert (plane.name, plane.static, world.elements()) == ("ground_plane", True, ())
    (collision,) = plane.collisions
    assert isinstance(collision.shape, Plane)
    assert (collision.mu, collision.pose.position) == (50, (0, 0, 0.5))
    assert {note.what: note.kind for note in world.notes if note.what == "<include>"} == {
        "<include>": "replaced"
    }
    assert any("nothing can touch it" in note.why for note in world.notes)
    assert any("the one built into ddenv" in note.why for note in world.notes)
    assert (
        parse_world(
            world_text(text), tmp_path / "here.sdf", resources=Resources(world.resources)
        ).models
        == world.models
    )


def test_a_model_on_the_search_path_is_used_in_place_of_the_built_in_one(read, tmp_path):
    folder = tmp_path / "home" / ".gazebo" / "models" / "ground_plane"
    folder.mkdir(parents=True)
    box = "<collision name='c'><geometry><box><size>9 9 1</size></box></geometry></collision>"
    (folder / "model.sdf").write_text(
        f"<sdf version='1.5'><model name='ground_plane'><link name='l'>{box}</link></model></sdf>"
    )
    assert read(included("model://ground_plane")).models[0].collisions[0].shape == Box((9, 9, 1))


def lost(uri, *, inside="", scale="", pose="", static=1):
    mesh = f"<geometry><mesh><uri>{uri}</uri>{scale}</mesh></geometry>"
    link = f"<link name='l'>{inside}<collision name='c'>{pose}{mesh}</collision></link>"
    return f"<model name='m'><static>{static}</static>{link}</model>"


def guessed(world):
    (collision,) = world.models[0].collisions
    (note,) = (note.why for note in world.notes if note.kind == "replaced" and "by" in note.why)
    return collision, note


@pytest.mark.parametrize("name", KNOWN_SIZES)
def test_every_known_model_and_its_mesh_have_its_size(read, name):
    text = KNOWN_SIZES[name]
    factors = MESH_SCALES.get(name, (1.0, 1.0, 1.0))
    scale = f"<scale>{' '.join(map(str, factors))}</scale>"
    whole = read(included(f"model://{name}"), stand_ins={"*": "auto"}).models[0]
    mesh, note = guessed(
        read(
            lost(f"model://{name}/meshes/x.dae", scale=scale), stand_ins={f"model://{name}": "auto"}
        )
    )
    assert mesh.shape == whole.collisions[0].shape
    assert mesh.pose == whole.collisions[0].pose
    assert f"by a guess, {text}: the size of Gazebo's model" in note
    low, high = model_bounds(whole)
    assert all(0.03 < high[axis] - low[axis] <= 20 for axis in range(3))


def test_a_mesh_that_is_scaled_has_its_known_size_scaled(read):
    scale = "<scale>2 2 3</scale>"
    collision, _ = guessed(
        read(lost("model://construction_barrel/x.dae", scale=scale), stand_ins={"*": "auto"})
    )
    assert collision.shape == Cylinder(pytest.approx(0.592), pytest.approx(3.945))


def test_auto_prefers_the_box_around_the_visuals(read):
    visual = (
        "<visual name='v'><pose>0 0 1 0 0 0</pose><geometry><box><size>1 2 "
        "3</size></box></geometry></visual>"
    )
    world = read(lost("model://table/x.dae", inside=visual), stand_ins={"*": "auto"})
    collision, note = guessed(world)
    assert (collision.shape, collision.pose.position) == (Box((1, 2, 3)), (0, 0, 1))
    assert "by the box around its link's visual shapes" in note


def test_auto_takes_the_box_that_has_the_inertia(read):
    moments = "<ixx>0.0011</ixx><iyy>0.1771</iyy><izz>0.1763</izz>"
    inertial = (
        "<inertial><pose>0 0 0.2 0 0 "
        f"0</pose><mass>1.4111</mass><inertia>{moments}</inertia></inertial>"
    )
    text = lost("model://plank/x.dae", inside=inertial, pose="<pose>5 0 0 0 0 0</pose>", static=0)
    collision, note = guessed(read(text, stand_ins={"*": "auto"}))
    assert collision.shape.size == pytest.approx((1.2192, 0.038, 0.0888), rel=0.1)
    assert collision.pose.position == pytest.approx((0, 0, 0.2))
    assert "the box that has the link's inertia" in note


IMPOSSIBLE = (
    "",
    "<mass>1</mass>",
    "<mass>-1</mass><inertia/>",
    "<mass>1</mass><inertia><ixx>9</ixx></inertia>",
    "<mass>x</mass>",
)
DEFAULT = "<mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia>"


@pytest.mark.parametrize("inside", [*IMPOSSIBLE, DEFAULT])
def test_auto_says_that_it_knows_nothing(read, inside):
    text = lost(
        "model://odd/x.dae",
        inside=f"<inertial>{inside}</inertial>",
        pose="<pose>0 0 1 0 0 0</pose>",
    )
    collision, note = guessed(read(text, stand_ins={"*": "auto"}))
    assert (collision.shape, collision.pose.position) == (Box((1, 1, 1)), (0, 0, 1.5))
    assert "by a guess, box:1,1,1: nothing says how large it is" in note


@pytest.mark.parametrize("name", ["FloorB_01", "my_ground_plane", "Terrain%20map"])
def test_auto_puts_no_box_where_a_floor_would_be(read, name):
    for text in (
        included(f"model://{name}"),
        lost(f"model://{name}/x.dae"),
        lost(f"model://hall/{name}.dae"),
    ):
        world = read(text, stand_ins={"*": "auto"})
        assert not any(model.collisions for model in world.models)
        assert any(
            "is left out: a floor of unknown size is not guessed" in note.why
            for note in world.notes
        )
    seen = "<visual name='v'><geometry><box><size>8 8 0.1</size></box></geometry></visual>"
    collision, _ = guessed(
        read(lost(f"model://{name}/x.dae", inside=seen), stand_ins={"*": "auto"})
    )
    assert collision.shape == Box((8, 8, 0.1))
    assert read(lost("model://playground/x.dae"), stand_ins={"*": "auto"}).models[0].collisions


def test_auto_leaves_what_is_there(read, tmp_path):
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n"
    )
    world = read(lost("a.obj"), stand_ins={"*": "auto", "a.obj": "auto"})
    assert tuple(model_bounds(world.models[0])[1]) == (2, 2, 2)
    assert [note.why for note in world.notes] == [
        "'a.obj' by its convex hull; contact at the edges of those that are no boxes is rough"
    ]


def test_one_uri_can_be_guessed_and_another_left_out(read):
    text = included("model://table") + included("model://odd") + lost("model://gone/x.dae")
    with pytest.raises(
        UserError,
        match=(
            r"'model://table'.*--stand-in auto.*; also missing: 'model://odd', "
            r"'model://gone/x.dae'"
        ),
    ):
        read(text)
    world = read(text, stand_ins={"*": "auto", "model://odd": "none", "model://gone": "none"})
    assert [model.name for model in world.models] == ["table", "m"]
    assert world.models[1].collisions == ()
    left = [note.why for note in world.notes if "left out as asked" in note.why]
    assert left == [
        "'model://odd' is left out as asked",
        "'model://gone/x.dae' is left out as asked: nothing collides with it",
    ]


def test_only_auto_stands_for_all_that_is_missing(read):
    with pytest.raises(
        UserError, match=r"stand-in for '\*': only auto can stand for all that is missing"
    ):
        read("", stand_ins={"*": "box:1,1,1"})
