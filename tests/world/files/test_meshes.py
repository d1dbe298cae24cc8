import os
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from ddenv.world.access import Unusable
from ddenv.world.files.meshes import SUFFIXES, read_parts
from tests.world.files.mesh_files import BOX, bounds, dae, gltf, mesh_of, solid


@pytest.mark.parametrize("suffix", ["obj", "stl", "stl_ascii", "glb"])
@pytest.mark.parametrize("convex", [False, True])
def test_box_of_each_format(tmp_path, suffix, convex):
    mesh = mesh_of(tmp_path / f"box.{suffix[:3]}", BOX.export(file_type=suffix), convex=convex)
    assert bounds(mesh) == [[0, 0, 0], [1, 2, 3]]
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 12)
    assert solid(mesh).is_watertight
    assert solid(mesh).volume == pytest.approx(6)
    assert mesh.vertices.dtype == np.float64
    assert not mesh.vertices.flags.writeable and not mesh.faces.flags.writeable


def test_suffix_in_capitals_and_unknown(tmp_path):
    assert len(mesh_of(tmp_path / "a.STL", BOX.export(file_type="stl")).faces) == 12
    with pytest.raises(Unusable, match=r"'\.fbx' are not supported; use one of \.obj"):
        mesh_of(tmp_path / "a.fbx", b"x")


OBJ = """mtllib ../../etc/passwd
o first
v 0 0 0
v 1 0 0
v 0 1 0
g left side
  f\t-3/1/1 -2//2  -1 # counted back
o second
g right
v 0 0 5 0.1 0.2 0.3
v 1 0 5
v 1 1 5
v 0.5 2 5
v 0 1 \\
  5
f -5 -4 -3 -2 -1
l 1 2
p 1
"""


def test_obj_counts_back_from_the_face_and_fans(tmp_path):
    first = mesh_of(tmp_path / "a.obj", OBJ, submesh="first")
    assert first.vertices.tolist() == [[0, 0, 0], [0, 1, 0], [1, 0, 0]]
    second = mesh_of(tmp_path / "a.obj", OBJ, submesh="second")
    assert len(second.faces) == 3
    assert (solid(second).face_normals[:, 2] == 1).all()
    assert bounds(second) == [[0, 0, 5], [1, 2, 5]]
    assert (
        mesh_of(tmp_path / "a.obj", OBJ, submesh="left side").vertices.tolist()
        == first.vertices.tolist()
    )
    assert bounds(mesh_of(tmp_path / "a.obj", OBJ, submesh="right", center=True)) == [
        [-0.5, -1, 0],
        [0.5, 1, 0],
    ]
    assert len(mesh_of(tmp_path / "a.obj", OBJ).faces) == 4


def test_obj_names_are_kept_apart(tmp_path):
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\no a_b\nf 1 2 3\no a\ng b\nf 1 2 3\no a_b\nf 1 2 3"
    )
    assert [(part.names, len(part.faces)) for part in read_parts(tmp_path / "a.obj")] == [
        (("a_b", ""), 2),
        (("a", "b"), 1),
    ]


def test_unknown_submesh_names_those_that_exist(tmp_path):
    with pytest.raises(Unusable, match=r"has no submesh 'third'; it has 'first', 'second'$"):
        mesh_of(tmp_path / "a.obj", OBJ, submesh="third")
    many = "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "".join(f"o part{i}\nf 1 2 3\n" for i in range(7))
    with pytest.raises(Unusable, match=r"'part4', \.\.\.$"):
        mesh_of(tmp_path / "a.obj", many, submesh="x")
    with pytest.raises(Unusable, match="it has none with a name"):
        mesh_of(tmp_path / "a.stl", BOX.export(file_type="stl"), submesh="x")


def test_binary_stl_that_begins_like_text_or_has_a_tail(tmp_path):
    data = b"solid" + BOX.export(file_type="stl")[5:]
    assert len(mesh_of(tmp_path / "a.stl", data).faces) == 12
    assert len(mesh_of(tmp_path / "a.stl", BOX.export(file_type="stl") + b"tail").faces) == 12


def test_text_stl_in_another_encoding_and_of_several_solids(tmp_path):
    text = "solid Kühler\n" + BOX.export(file_type="stl_ascii").partition("\n")[2]
    assert len(mesh_of(tmp_path / "a.stl", text.encode("latin-1")).faces) == 12
    assert len(mesh_of(tmp_path / "a.stl", text * 2).faces) == 24


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "no triangles"),
        ("v 0 0 0\n", "no triangles"),
        ("v 0 0\nf 1 1 1", "fewer than three numbers"),
        ("v 0 0 0\nf 1 2 3", "does not exist"),
        ("v 0 0 0\nf 1 0 1", "refers to the vertex 0"),
        ("v 0 0 0\nf 1 -2 1", "vertex -2"),
        ("v 0 0 x\n", "no triangles|could not be read to its end"),
        ("v 0 0 inf\nv 0 0 1\nv 1 0 0\nf 1 2 3", "not finite"),
        ("v 0 0 nan\nv 0 0 1\nv 1 0 0\nf 1 2 3", "not finite"),
        ("f\nf 1 2", "does not exist|no triangles|not a valid OBJ"),
    ],
)
@pytest.mark.parametrize("convex", [False, True])
def test_bad_obj(tmp_path, text, reason, convex):
    with pytest.raises(Unusable, match=reason):
        mesh_of(tmp_path / "a.obj", text, convex=convex)


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(data=st.data())
def test_any_bytes_give_a_mesh_or_a_reason(tmp_path_factory, suffix, data):
    """Random bytes, and sound files cut, with bytes changed, or with a piece doubled."""
    sound = {
        ".obj": OBJ.encode(),
        ".stl": BOX.export(file_type="stl"),
        ".dae": dae().encode(),
        ".gltf": gltf()[0].encode(),
        ".glb": BOX.scene().export(file_type="glb"),
    }[suffix]
    content = bytearray(data.draw(st.one_of(st.binary(max_size=200), st.just(sound))))
    for _ in range(data.draw(st.integers(0, 4))):
        place = data.draw(st.integers(0, len(content)))
        end = data.draw(st.integers(place, min(place + 12, len(content))))
        content[place:end] = data.draw(
            st.binary(max_size=8) | st.sampled_from([b"-1", b"1e999", b"9" * 12, b"null", b"[]"])
        )
    if data.draw(st.booleans()):
        del content[data.draw(st.integers(0, len(content))) :]
    try:
        mesh = mesh_of(
            tmp_path_factory.getbasetemp() / f"any{suffix}",
            bytes(content),
            convex=data.draw(st.booleans()),
        )
    except Unusable as error:
        assert "\n" not in str(error) and len(str(error)) < 300
    else:
        assert np.isfinite(mesh.vertices).all()
        assert mesh.faces.max() < len(mesh.vertices)


def test_hull_is_simplified_within_its_box(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=4)
    mesh = mesh_of(tmp_path / "a.stl", ball.export(file_type="stl"), convex=True)
    assert len(mesh.vertices) <= 256
    assert solid(mesh).is_watertight and solid(mesh).is_convex
    assert solid(mesh).volume == pytest.approx(ball.volume, rel=0.03)
    assert np.allclose(bounds(mesh), ball.bounds, atol=1e-3)


def test_long_rod_keeps_its_shape(tmp_path):
    rod = trimesh.creation.cylinder(radius=0.01, height=20, sections=400)
    mesh = mesh_of(tmp_path / "a.stl", rod.export(file_type="stl"), convex=True)
    assert solid(mesh).volume == pytest.approx(rod.volume, rel=0.01)


@pytest.mark.parametrize(
    ("points", "volume"),
    [
        ("v 0 0 0\nv 2 0 0\nv 0 3 0", 3e-3),
        ("v 5 0 0\nv 5 2 2\nv 5 0 4", 4e-3),
        ("v 0 0 0\nv 1 1 0\nv 1 1 1", 2**0.5 / 2 * 1e-3),
        ("v 0 0 0\nv 1 1 1\nv 2 2 2", 12**0.5 * 1e-6),
        ("v 7 7 7\nv 7 7 7\nv 7 7 7", 1e-9),
        ("v 0 0 0\nv 100 0 0\nv 0 100 0", 5000 * 1e-4 * 2**0.5 * 100),
    ],
)
def test_flat_meshes_get_a_thin_hull(tmp_path, points, volume):
    mesh = mesh_of(tmp_path / "a.obj", f"{points}\nf 1 2 3", convex=True)
    assert solid(mesh).is_watertight
    assert solid(mesh).volume == pytest.approx(volume, rel=1e-6)


@pytest.mark.parametrize("suffix", ["stl", "obj", "glb"])
def test_a_mesh_of_too_many_triangles_is_refused_in_a_line(tmp_path, monkeypatch, suffix):
    ball = trimesh.creation.icosphere(subdivisions=3)
    monkeypatch.setattr("ddenv.world.files.triangles.MOST_FACES", 1000)
    with pytest.raises(
        Unusable, match=r"has 0\.0 million triangles; the maximum is 0\.001 million: simplify it"
    ):
        mesh_of(tmp_path / f"a.{suffix}", ball.export(file_type=suffix), convex=True)


def run(text: str, seed: str = "0") -> str:
    """What a new process prints."""
    environment = {"PYTHONPATH": os.pathsep.join(sys.path), "PYTHONHASHSEED": seed}
    done = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, check=True, env=environment
    )
    return done.stdout.strip()


@pytest.mark.programs
def test_same_bytes_in_every_process(tmp_path):
    points = np.random.default_rng(1).normal(size=(600, 3))
    vertices = "\n".join(f"v {x} {y} {z}" for x, y, z in points)
    (tmp_path / "a.obj").write_text(f"{vertices}\nf {' '.join(map(str, range(1, 601)))}")
    (tmp_path / "b.dae").write_text(
        dae(nodes="<node><rotate>1 2 3 40</rotate><instance_geometry url='#g'/></node>" * 3)
    )
    triangles = {"attributes": {"POSITION": 0}, "indices": 1}
    nodes = [
        {"mesh": 0, "children": [1], "rotation": [0.1, 0.2, 0.3, 0.9]},
        {"mesh": 0, "scale": [1, 2, 3]},
    ]
    (tmp_path / "c.gltf").write_text(gltf(meshes=[{"primitives": [triangles] * 4}], nodes=nodes)[0])
    text = f"""
from pathlib import Path
from ddenv.world.files.meshes import build, read_parts, unpack
for path in sorted(Path({str(tmp_path)!r}).iterdir()):
    print([unpack("", build(read_parts(path), convex=convex)).origin for convex in (False, True)])
"""
    assert run(text, "1") == run(text, "2")
