import numpy as np
import pytest

from ddenv.world.access import Unusable
from ddenv.world.files.meshes import read_parts
from tests.world.files.mesh_files import bounds, dae, mesh_of, solid


@pytest.mark.parametrize("axis", ["X_UP", "Y_UP", "Z_UP"])
def test_dae_unit_scales_and_up_axis_does_nothing(tmp_path, axis):
    mesh = mesh_of(
        tmp_path / "a.dae", dae(f"<unit name='inch' meter='0.0254'/><up_axis>{axis}</up_axis>")
    )
    assert np.allclose(bounds(mesh), [[0, 0, 0], [0.0254, 0.0508, 0.0762]])
    assert solid(mesh).volume == pytest.approx(0.0254**3)


@pytest.mark.parametrize(
    "unit",
    [
        "<unit meter='0'/>",
        "<unit meter='-1'/>",
        "<unit meter='nan'/>",
        "<unit/>",
        "<unit meter=''/>",
    ],
)
def test_dae_unit_without_sense_is_one_metre(tmp_path, unit):
    assert bounds(mesh_of(tmp_path / "a.dae", dae(unit))) == [[0, 0, 0], [1, 2, 3]]


def test_dae_instances_with_transforms(tmp_path):
    nodes = """<node name="moved"><translate>10 0 0</translate><rotate>0 0 3 90</rotate><rotate>0 0 0 70</rotate>
        <scale>1 2 1</scale>
        <instance_geometry url="#g"><bind_material/></instance_geometry>
        <node id="child"><matrix>1 0 0 0  0 1 0 0  0 0 1 100  0 0 0 1</matrix><instance_controller url="#c"/></node></node>
      <node name="again"><instance_node url="#lib"/><instance_geometry url="#gone"/><instance_node url="other.dae#x"/></node>
      <node name="mirrored"><scale>-1 1 1</scale><instance_geometry url="#g"/></node>"""
    text = dae(nodes=nodes)
    assert len(mesh_of(tmp_path / "a.dae", text).faces) == 16
    parts = read_parts(tmp_path / "a.dae")
    assert [part.names[0] for part in parts] == ["moved", "moved", "again", "mirrored"]
    assert np.allclose(bounds(parts[0]), [[6, 0, 0], [10, 1, 3]], atol=1e-6)
    assert np.allclose(bounds(parts[1]), [[6, 0, 100], [10, 1, 103]], atol=1e-6)
    assert np.allclose(
        bounds(mesh_of(tmp_path / "a.dae", text, submesh="again")), [[0, 0, 10], [1, 2, 13]]
    )
    assert len(mesh_of(tmp_path / "a.dae", text, submesh="shape").faces) == 16
    assert len(mesh_of(tmp_path / "a.dae", text, submesh="child").faces) == 4
    mirrored = mesh_of(tmp_path / "a.dae", text, submesh="mirrored")
    assert bounds(mirrored) == [[-1, 0, 0], [0, 2, 3]]
    assert solid(mirrored).volume == pytest.approx(1)


@pytest.mark.parametrize(
    ("shapes", "faces"),
    [
        ("<triangles count='2'>{}<p>0 1 2</p><p>0 1 3</p></triangles>", 2),
        (
            (
                "<triangles count='1'>{}<input semantic='UV' source='#n' offset='1'/><p>0 9 1 9 2 "
                "9</p></triangles>"
            ),
            1,
        ),
        ("<polylist count='2'>{}<vcount>3 4 2</vcount><p>0 1 2 0 1 2 3 0 1</p></polylist>", 3),
        ("<polygons count='2'>{}<p>0 1 2</p><ph><p>0 1 2 3</p><h>0 1 2</h></ph></polygons>", 3),
        ("<tristrips count='1'>{}<p>0 1 2 3</p></tristrips>", 2),
        ("<trifans count='1'>{}<p>0 1 2 3</p></trifans>", 2),
        (
            (
                "<triangles>{}<p/></triangles><lines>{}<p>0 1</p></lines><triangles>{}<p>0 1 "
                "2</p></triangles>"
            ),
            1,
        ),
    ],
)
def test_dae_primitives(tmp_path, shapes, faces):
    shapes = shapes.replace("{}", "<input semantic='VERTEX' source='#v' offset='0'/>")
    assert len(mesh_of(tmp_path / "a.dae", dae(shapes=shapes)).faces) == faces


def test_strip_keeps_its_side(tmp_path):
    strip = (
        "<tristrips count='1'><input semantic='VERTEX' source='#v' offset='0'/><p>0 1 2 "
        "3</p></tristrips>"
    )
    mesh = mesh_of(tmp_path / "a.dae", dae(shapes=strip, positions="0 0 0 1 0 0 0 1 0 1 1 0"))
    assert (solid(mesh).face_normals[:, 2] == 1).all()


@pytest.mark.parametrize(
    "ids", ["s = k", "g = k", "v = g", "s = k = g = v = p", "k = <STL_BINARY>"]
)
def test_elements_of_different_kinds_may_share_an_id(tmp_path, ids):
    *others, last = ids.split(" = ")
    text = dae(nodes="<node id='k' name='tip'><instance_geometry url='#g'/></node>")
    for other in others:
        for mark in ("id={}", "url={}", "source={}"):
            for quote in "'\"":
                name, new = (
                    mark.format(f"{quote}{sign}{{}}{quote}")
                    for sign in ("" if "id" in mark else "#",) * 2
                )
                text = text.replace(name.format(other), new.format(last))
    mesh = mesh_of(tmp_path / "a.dae", text)
    assert bounds(mesh) == [[0, 0, 0], [1, 2, 3]]
    assert solid(mesh).volume == pytest.approx(1)


def test_of_two_elements_of_one_kind_and_id_the_first_counts(tmp_path):
    first = dae()
    start, end = first.index("<geometry"), first.index("</library_geometries>")
    again = first[start:end].replace("1 0 0 0 2 0", "9 0 0 0 9 0")
    assert bounds(mesh_of(tmp_path / "a.dae", first[:end] + again + first[end:])) == [
        [0, 0, 0],
        [1, 2, 3],
    ]


def test_primitives_share_positions_but_keep_only_their_own(tmp_path):
    one = "<triangles><input semantic='VERTEX' source='#v' offset='0'/><p>{}</p></triangles>"
    mesh_of(
        tmp_path / "a.dae", dae(shapes=one.format("0 1 2") + one.format("3 2 1") + one.format(""))
    )
    parts = read_parts(tmp_path / "a.dae")
    assert [part.vertices.tolist() for part in parts] == [
        [[0, 0, 0], [1, 0, 0], [0, 2, 0]],
        [[1, 0, 0], [0, 2, 0], [0, 0, 3]],
    ]
    assert [part.faces.tolist() for part in parts] == [[[0, 1, 2]], [[2, 1, 0]]]


BOMB = "<!DOCTYPE x [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;'>]>"
OUTSIDE = "<!DOCTYPE x [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>"
CHAIN = "".join(
    f"<node id='n{i}'>" + f"<instance_node url='#n{i + 1}'/>" * 10 + "</node>" for i in range(20)
)


def triangles(inside, offset=0, tag="triangles"):
    return dae(
        shapes=f"<{tag}><input semantic='VERTEX' source='#v' offset='{offset}'/>{inside}</{tag}>"
    )


HOSTILE_DAE = {
    "bomb": (dae(head=BOMB, asset="&b;"), "DOCTYPE is not allowed"),
    "outside": (dae(head=OUTSIDE, asset="&a;"), "DOCTYPE is not allowed"),
    "circle": (dae(nodes="<node><instance_node url='#circle'/></node>"), "nested too deeply"),
    "multiplied": (dae(nodes=CHAIN), "places its geometries too often"),
    "deep": (
        "<COLLADA>" + "<a>" * 100_000 + "</a>" * 100_000 + "</COLLADA>",
        "has no scene|nested",
    ),
    "vcount": (
        triangles("<vcount>2000000000</vcount><p>0 1 2</p>", tag="polylist"),
        "<vcount> does not match",
    ),
    "offset": (triangles("<p>0</p>", 2_000_000_000), "not a valid DAE"),
    "indices": (triangles("<p>0 1 9</p>"), "a face refers to a vertex that does not exist"),
    "negative": (triangles("<p>0 1 -1</p>"), "a face refers to a vertex that does not exist"),
    "gaps": (dae().replace('count="4" stride="3"', 'count="4" stride="4"'), "stored with gaps"),
    "nan": (dae(positions="nan 0 0 1 0 0 0 2 0 0 0 3"), "not finite"),
    "far": (dae(positions="2e6 0 0 1 0 0 0 2 0 0 0 3"), "farther than 1000000 m"),
    "word": (dae(positions="0 0 0 1 0 0 x 2 0 0 0 3"), "could not convert string to float: 'x'"),
    "root": ("<html/>", "its root is <html>, not <COLLADA>"),
    "cut": (dae()[:900], "line .*: not well-formed XML"),
    "empty": ("", "not a valid DAE file"),
    "nothing": ("<COLLADA/>", "has no scene"),
}


@pytest.mark.parametrize("case", HOSTILE_DAE)
def test_hostile_dae(tmp_path, case, capfd):
    text, reason = HOSTILE_DAE[case]
    with pytest.raises(Unusable, match=reason) as caught:
        mesh_of(tmp_path / "a.dae", text)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")
