"""Shapes, friction and colours."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from ddenv.errors import UserError
from ddenv.world.extent import around, shape_bounds, vertices_of
from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Plane, Sphere
from ddenv.world.sdf.geometry import DEFAULT_SIZES


def model(geometry, more="", tag="collision"):
    inside = f"<{tag} name='c'><geometry>{geometry}</geometry>{more}</{tag}>"
    return f"<model name='m'><static>1</static><link name='l'>{inside}</link></model>"


def shape_of(world):
    return world.models[0].collisions[0].shape


SHAPES = {
    "<box><size>1 2 3</size></box>": Box((1, 2, 3)),
    "<cylinder><radius>1</radius><length>2</length></cylinder>": Cylinder(1, 2),
    "<capsule><radius>1</radius><length>2</length></capsule>": Capsule(1, 2),
    "<sphere><radius>1</radius></sphere>": Sphere(1),
    "<ellipsoid><radii>1 2 3</radii></ellipsoid>": Ellipsoid((1, 2, 3)),
    "<plane><size>5 6</size></plane>": Plane((5, 6)),
}


@pytest.mark.parametrize(("geometry", "shape"), SHAPES.items())
def test_primitives(read, geometry, shape):
    assert shape_of(read(model(geometry))) == shape


SDFORMAT = Path("/usr/share/sdformat12/1.9")


@pytest.mark.skipif(
    not SDFORMAT.is_dir(), reason="libsdformat's descriptions are not on this machine"
)
@pytest.mark.parametrize(
    ("shape", "child"),
    [(shape, child) for shape, children in DEFAULT_SIZES.items() for child in children],
)
def test_sizes_that_a_file_leaves_out_are_those_of_libsdformat(shape, child):
    file = SDFORMAT / f"{shape}_shape.sdf"
    if not file.exists():
        pytest.skip(f"this libsdformat has no {shape}")
    described = ElementTree.parse(file).find(f"element[@name='{child}']")
    assert DEFAULT_SIZES[shape][child] == tuple(map(float, described.get("default").split()))


def test_a_shape_without_sizes_has_the_usual_ones(read):
    assert shape_of(read(model("<capsule><length>3</length></capsule>"))) == Capsule(0.5, 3)
    world = read(model(""))
    assert world.models[0].collisions == ()
    assert world.notes[0].why == "it has no shape in its <geometry>"


@pytest.mark.parametrize("normal", ["0 0 2", "0 1 0", "1 -2 0.5", "0 0 -1"])
def test_planes_are_turned_as_their_normal_says(read, normal):
    plane = read(model(f"<plane><normal>{normal}</normal></plane>")).models[0].collisions[0]
    wanted = np.array([float(word) for word in normal.split()])
    assert plane.pose.rotate((0, 0, 1)) == pytest.approx(wanted / np.linalg.norm(wanted))


def outline(*corners):
    return f"<polyline><height>3</height>{''.join(f'<point>{x} {y}</point>' for x, y in corners)}</polyline>"


@pytest.mark.parametrize(
    ("outlines", "volume"),
    [
        (outline((0, 0), (2, 0), (2, 1), (0, 1)), 6),
        (outline((0, 0), (2, 0), (2, 1), (1, 0.2), (0, 1)), 3.6),
        # A frame: the inner outline is a hole.
        (
            outline((0, 0), (2, 0), (2, 1), (0, 1))
            + outline((0.5, 0.2), (1.5, 0.2), (1.5, 0.8), (0.5, 0.8)),
            4.2,
        ),
    ],
)
def test_polylines_stand_on_their_frame_with_their_notches_and_holes(read, outlines, volume):
    solids = read(model(outlines)).models[0].collisions
    low, high = around(shape_bounds(one.shape, one.pose) for one in solids)
    assert [*low, *high] == pytest.approx([0, 0, 0, 2, 1, 3], abs=1e-5)
    filled = sum(trimesh.convex.convex_hull(vertices_of(one.shape, 0)[0]).volume for one in solids)
    assert filled == pytest.approx(volume, rel=1e-5)


@pytest.fixture
def angle(tmp_path):
    """An L of 1 m width and height, as a mesh that is mirrored and stretched downwards: collision
    and visual of a link.
    """
    outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]])
    _extruded(outline, 1.0).export(tmp_path / "angle.obj")

    def link(inside="", attributes=""):
        mesh = f"<mesh {attributes}><uri>angle.obj</uri><scale>1 1 -2</scale>{inside}</mesh>"
        shown = "".join(
            f"<{tag} name='{tag}'><geometry>{mesh}</geometry></{tag}>"
            for tag in ("collision", "visual")
        )
        return f"<link name='l'>{shown}</link>"

    return link


def test_meshes_are_convex_pieces_where_they_collide_and_themselves_where_they_are_seen(
    read, angle
):
    world = read(f"<model name='m'><static>1</static>{angle()}</model>")
    found = world.models[0].links[0]
    sizes = sorted(
        tuple(round(side, 5) for side in sorted(one.shape.size)) for one in found.collisions
    )
    assert sizes == [(1, 1, 2), (1, 2, 2)]
    assert {one.name for one in found.collisions} == {"collision"}
    low, high = around(shape_bounds(one.shape, one.pose) for one in found.collisions)
    assert [*low, *high] == pytest.approx([0, 0, -2, 2, 2, 0])
    seen = found.visuals[0].shape
    assert trimesh.Trimesh(seen.vertices, seen.faces).volume == pytest.approx(6)
    assert "by its convex pieces" in world.notes[0].why


@pytest.mark.parametrize(
    "made",
    [
        lambda angle: (angle(attributes="optimization='convex_hull'"), {}),
        lambda angle: (angle(), {"mesh": "hull"}),
        lambda angle: (
            angle(
                "<convex_decomposition><max_convex_hulls>1</max_convex_hulls></convex_decomposition>",
                "optimization='convex_decomposition'",
            ),
            {},
        ),
        # What a joint turns rolls on its hull.
        lambda angle: (
            f"{angle()}<link name='k'/><joint name='j' "
            "type='continuous'><parent>k</parent><child>l</child>"
            "<axis><xyz>0 0 1</xyz></axis></joint>",
            {},
        ),
    ],
    ids=["convex_hull", "reading", "one piece", "wheel"],
)
def test_a_mesh_is_its_hull_where_the_file_or_the_user_asks_for_that_or_where_it_is_a_wheel(
    read, angle, made
):
    inside, options = made(angle)
    world = read(f"<model name='m'>{inside}</model>", **options)
    [collision] = next(link for link in world.models[0].links if link.name == "l").collisions
    hull = collision.shape
    assert trimesh.Trimesh(hull.vertices, hull.faces).volume == pytest.approx(7)
    assert hull.vertices[:, 2].min() == pytest.approx(-2)


def _extruded(outline, height):
    """A prism over an L."""
    count = len(outline)
    low = np.column_stack([outline, np.zeros(count)])
    walls = [[i, (i + 1) % count, (i + 1) % count + count] for i in range(count)]
    walls += [[i, (i + 1) % count + count, i + count] for i in range(count)]
    fan = [[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]]
    faces = [
        *walls,
        *([a, c, b] for a, b, c in fan),
        *([a + count, b + count, c + count] for a, b, c in fan),
    ]
    return trimesh.Trimesh(np.vstack([low, low + np.array([0, 0, height])]), faces, process=False)


def test_a_collision_mesh_that_is_nowhere_is_refused_with_all_remedies(read):
    with pytest.raises(UserError) as caught:
        read(model("<mesh><uri>model://barrel/meshes/a.dae</uri></mesh>"))
    said = str(caught.value)
    assert "/geometry/mesh: mesh 'model://barrel/meshes/a.dae'" in said
    assert (
        "--model-path" in said
        and "--stand-in 'model://barrel=cylinder:0.3,1.0'" in said
        and "--ignore mesh" in said
    )


def test_a_stand_in_stands_on_the_frame_of_what_it_replaces(read):
    barrel = model(
        "<mesh><uri>model://barrel/meshes/a.dae</uri></mesh>", "<pose>0 0 2 0 0 0</pose>"
    )
    world = read(barrel, stand_ins={"model://barrel": "cylinder:0.3,1.0"})
    (collision,) = world.models[0].collisions
    assert collision.shape == Cylinder(0.3, 1.0)
    assert collision.pose.position == (0, 0, 2.5)
    placed = (
        read(barrel, stand_ins={"model://barrel/meshes": "box:1,2,3@1,0,0"}).models[0].collisions[0]
    )
    assert placed.pose.position == (1, 0, 2)


@pytest.mark.parametrize("kind", ["visual", "collision"])
def test_the_box_around_the_other_shapes_of_a_link_can_stand_in(read, kind):
    pose = "<pose>0 0 1 0 0 0</pose>"
    other = (
        f"<{kind} "
        f"name='o'>{pose}<geometry><cylinder><radius>0.5</radius><length>2</length></cylinder></geometry></{kind}>"
    )
    lost = (
        f"<collision name='c'>{pose}<geometry><mesh><uri>a.dae</uri></mesh></geometry></collision>"
    )
    text = f"<model name='m'><static>1</static><link name='l'>{lost}{other}</link></model>"
    with pytest.raises(
        UserError, match=f"'a.dae={kind}' for the box around its link's {kind} shapes"
    ):
        read(text)
    found = read(text, stand_ins={"a.dae": kind}).models[0].collisions[0]
    assert found.shape == Box((1, 1, 2))
    assert found.pose.position == (0, 0, 1)


def touched(inside):
    return model(CUBE, f"<surface><contact>{inside}</contact></surface>")


CUBE = "<box><size>1 1 1</size></box>"
NOTED = {
    "a mesh that is nowhere is not drawn": (
        model("<mesh><uri>model://no/a.dae</uri></mesh>", tag="visual"),
        "'model://no/a.dae' is not drawn",
    ),
    "a visual that is too fine is drawn as its hull": (
        model("<mesh><uri>a.obj</uri></mesh>", tag="visual"),
        "'a.obj' by its convex hull, since it is too fine to be drawn",
    ),
    "a heightmap is ignored": (
        model("<heightmap><uri>file://hills.png</uri></heightmap>"),
        "left out by --ignore",
    ),
    "an image is ignored": (
        model("<image><uri>file://hills.png</uri></image>"),
        "left out by --ignore",
    ),
    "a bitmask of nothing": (
        touched("<collide_bitmask>0x00</collide_bitmask>"),
        "lets nothing touch it",
    ),
    "no contact": (
        touched("<collide_without_contact>1</collide_without_contact>"),
        "it collides without contact",
    ),
}


@pytest.mark.parametrize(("text", "why"), NOTED.values(), ids=NOTED)
def test_what_is_left_out_or_replaced_is_noted(read, tmp_path, monkeypatch, text, why):
    monkeypatch.setattr("ddenv.world.files.meshes.MOST_DRAWN", 3)
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n"
    )
    world = read(text, ignore=("heightmap", "image"), stand_ins={"model://bariel": "sphere:1"})
    assert world.models[0].collisions == ()
    assert why in world.notes[0].why
    assert "stand-in for 'model://bariel' is not used" in world.notes[-1].why


def test_the_smaller_friction_counts(read):
    surface = "<surface><friction><ode><mu>0.3</mu><mu2>0.2</mu2></ode></friction></surface>"
    world = read(model(CUBE, surface))
    assert world.models[0].collisions[0].mu == 0.2
    assert "0.3 and 0.2" in world.notes[0].why
    # One alone does not hide the other.
    alone = "<surface><friction><ode><mu>50</mu></ode></friction></surface>"
    assert read(model(CUBE, alone)).models[0].collisions[0].mu == 1
    bullet = "<surface><friction><bullet><friction>0.4</friction></bullet></friction></surface>"
    assert read(model(CUBE, bullet)).models[0].collisions[0].mu == 0.4


@pytest.mark.parametrize(
    ("properties", "mu"),
    [
        ("<drake:mu_static>0.2</drake:mu_static><drake:mu_dynamic>0.05</drake:mu_dynamic>", 0.05),
        ("<drake:mu_static>0.2</drake:mu_static>", 0.2),
        ("", 0.3),
    ],
)
def test_the_friction_of_drake_counts_before_that_of_gazebo(read, properties, mu):
    surface = "<surface><friction><ode><mu>0.3</mu><mu2>0.3</mu2></ode></friction></surface>"
    own = f"<drake:proximity_properties>{properties}</drake:proximity_properties>"
    world = read(model(CUBE, surface + own))
    assert world.models[0].collisions[0].mu == mu
    assert not any("drake" in note.what for note in world.notes)


COLORS = {
    "<material><diffuse>1 0 0 1</diffuse><ambient>0 1 0 1</ambient></material>": (1, 0, 0, 1),
    "<material><ambient>0 1 0 0</ambient></material>": (0, 1, 0, 1),
    "<material><diffuse>0 0 1</diffuse></material><transparency>0.75</transparency>": (
        0,
        0,
        1,
        0.25,
    ),
    "<material><script><name>Gazebo/Red</name></script></material>": (0.8, 0.1, 0.1, 1),
    "<material><script><name>My/Own</name></script></material>": None,
}


@pytest.mark.parametrize(("material", "color"), COLORS.items())
def test_visuals_keep_their_colours(read, material, color):
    world = read(model(CUBE, material, "visual"))
    assert world.models[0].links[0].visuals[0].color == color


def test_a_cone_stands_on_its_base(read):
    shape = shape_of(
        read(model("<cone><radius>1</radius><length>3</length></cone>", "", "collision"))
    )
    solid = trimesh.Trimesh(shape.vertices, shape.faces)
    assert solid.is_watertight and solid.volume == pytest.approx(np.pi, rel=0.01)
    assert shape.vertices[:, 2].max() == 1.5
