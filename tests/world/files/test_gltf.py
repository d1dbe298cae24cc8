import struct

import numpy as np
import pytest
import trimesh

from ddenv.world.access import Unusable
from tests.world.files.mesh_files import BOX, bounds, gltf, mesh_of, solid


def test_gltf_keeps_its_axes_and_places_instances(tmp_path):
    nodes = [
        {"name": "root", "children": [1, 2], "translation": [0, 0, 10]},
        {
            "name": "turned",
            "mesh": 0,
            "rotation": [0, 0, 2**-0.5, 2**-0.5],
            "scale": [1, 2, 1],
            "translation": [1, 0, 0],
        },
        {
            "name": "mirrored",
            "mesh": 0,
            "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1],
        },
        {"name": "unused", "mesh": 0},
    ]
    text, _ = gltf(nodes=nodes)
    assert len(mesh_of(tmp_path / "a.gltf", text).faces) == 8
    assert np.allclose(
        bounds(mesh_of(tmp_path / "a.gltf", text, submesh="turned")), [[-3, 0, 10], [1, 1, 13]]
    )
    mirrored = mesh_of(tmp_path / "a.gltf", text, submesh="mirrored")
    assert np.allclose(bounds(mirrored), [[4, 0, 10], [5, 2, 13]])
    assert solid(mirrored).volume == pytest.approx(1)
    assert len(mesh_of(tmp_path / "a.gltf", text, submesh="shape").faces) == 8
    oracle = trimesh.load_scene(tmp_path / "a.gltf", skip_materials=True).to_mesh()
    assert np.allclose(oracle.bounds, bounds(mesh_of(tmp_path / "a.gltf", text)))


def test_gltf_nodes_with_a_camera_or_lines_keep_what_is_below(tmp_path):
    shapes = [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}]
    lines = {"primitives": [{"attributes": {"POSITION": 0}, "mode": 1}]}
    for above in ({"camera": 0}, {"mesh": 1}, {"name": "world"}):
        nodes = [{"children": [1], "translation": [5, 0, 0], **above}, {"mesh": 0}]
        text, _ = gltf(nodes=nodes, meshes=[*shapes, lines], cameras=[{"type": "perspective"}])
        assert bounds(mesh_of(tmp_path / "a.gltf", text)) == [[5, 0, 0], [6, 2, 3]]


def test_gltf_buffer_beside_it_and_glb(tmp_path):
    text, data = gltf("more%20data/a.bin")
    (tmp_path / "more data").mkdir()
    (tmp_path / "more data" / "a.bin").write_bytes(data)
    assert bounds(mesh_of(tmp_path / "a.gltf", text)) == [[0, 0, 0], [1, 2, 3]]
    scene = trimesh.Scene()
    for place in (0, 10):
        scene.add_geometry(
            BOX,
            node_name=f"box{place}",
            transform=trimesh.transformations.translation_matrix([place, 0, 0]),
        )
    mesh = mesh_of(tmp_path / "a.glb", scene.export(file_type="glb"))
    assert bounds(mesh) == [[0, 0, 0], [11, 2, 3]]
    assert bounds(mesh_of(tmp_path / "a.glb", scene.export(file_type="glb"), submesh="box10"))[
        0
    ] == [10, 0, 0]


@pytest.mark.parametrize(("mode", "corners"), [(4, 3), (5, 4)])
def test_gltf_modes_without_indices(tmp_path, mode, corners):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype="<f4").tobytes()
    (tmp_path / "a.bin").write_bytes(points)
    primitives = [{"attributes": {"POSITION": 0}, "mode": each} for each in (mode, 1)]
    text, _ = gltf(
        "a.bin",
        meshes=[{"primitives": primitives}],
        accessors=accessor(count=corners)[:1],
        bufferViews=views()[:1],
    )
    mesh = mesh_of(tmp_path / "a.gltf", text)
    assert (solid(mesh).face_normals[:, 2] == 1).all() and len(mesh.faces) == corners - 2


def accessor(**changes):
    first = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", **changes}
    return [first, {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}]


def views(**changes):
    first = {"buffer": 0, "byteLength": 48, **changes}
    return [first, {"buffer": 0, "byteOffset": 48, "byteLength": 24}]


HOSTILE_GLTF = {
    "climbing": (gltf("../../x.bin"), "is outside the file's folder"),
    "encoded": (gltf("%2e%2e/x.bin"), "is outside the file's folder"),
    "absolute": (gltf("/etc/passwd"), "is outside the file's folder"),
    "remote": (gltf("http://example.org/x.bin"), "is outside the file's folder"),
    "file": (gltf("file:///etc/passwd"), "is outside the file's folder"),
    "nul": (gltf("a%00b"), "is outside the file's folder"),
    "gone": (gltf("gone.bin"), "buffer 'gone.bin': no such file"),
    "folder": (gltf("."), "buffer '.': is a folder"),
    "base64": (gltf("data:x;base64,!!!"), "not a valid GLTF"),
    "circle": (gltf(nodes=[{"children": [0], "mesh": 0}]), "form a tree"),
    "bomb": (gltf(nodes=[{"children": [1] * 9}, {"mesh": 0}]), "form a tree"),
    "negative node": (gltf(scenes=[{"nodes": [-1]}]), "form a tree"),
    "huge": (gltf(accessors=accessor(count=10**12)), "the maximum is 2 million: simplify it"),
    "negative": (gltf(accessors=accessor(byteOffset=-8)), "negative numbers"),
    "stride": (gltf(bufferViews=views(byteStride=0)), "not a valid GLTF"),
    "sparse": (gltf(accessors=accessor(sparse={})), "not supported"),
    "fan": (
        gltf(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}]}]),
        "fans are not supported",
    ),
    "views": (gltf(bufferViews=[{"buffer": 0, "byteLength": 10**9}]), "larger than its buffers"),
    "beyond": (gltf(accessors=accessor(count=5)), "not a valid GLTF"),
    "indices": (
        gltf(bufferViews=[{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteLength": 24}]),
        "does not exist",
    ),
    "kind": (gltf(accessors=accessor(componentType=5120)), "not supported"),
    "mesh": (gltf(nodes=[{"children": [1], "mesh": -1}, {"mesh": 0}]), "negative numbers"),
    "infinite": (
        gltf(nodes=[{"mesh": 0, "rotation": [0, 0, 0, float("inf")]}]),
        "not a valid GLTF",
    ),
    "draco": (
        gltf(extensionsRequired=["KHR_draco_mesh_compression"]),
        "KHR_draco_mesh_compression is not supported",
    ),
    "version": (gltf(asset={"version": "1.0"}), "only GLTF 2 is supported"),
    "no asset": (gltf(asset={}), "it has no .version."),
    "no mesh": (gltf(meshes=[]), "not a valid GLTF"),
    "wrong": (gltf(meshes={"primitives": 1}), "not a valid GLTF"),
    "not json": (("{", b""), "not a valid GLTF file: Expecting"),
    "deep": (("[" * 100_000, b""), "not a valid GLTF"),
}


@pytest.mark.parametrize("case", HOSTILE_GLTF)
def test_hostile_gltf(tmp_path, case, capfd):
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    (tmp_path / "x.bin").write_bytes(gltf()[1])
    (text, _), reason = HOSTILE_GLTF[case]
    with pytest.raises(Unusable, match=reason) as caught:
        mesh_of(folder / "a.gltf", text)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_triangles_shared_by_many_primitives_are_counted(tmp_path, monkeypatch):
    monkeypatch.setattr("ddenv.world.files.triangles.MOST_FACES", 1000)
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    with pytest.raises(Unusable, match=r"the maximum is 0\.001 million: simplify it"):
        mesh_of(tmp_path / "a.gltf", gltf(meshes=[{"primitives": [primitive] * 500}])[0])


def test_glb_that_lies_about_its_size(tmp_path):
    data = BOX.scene().export(file_type="glb")
    with pytest.raises(Unusable, match="not a valid GLB"):
        mesh_of(tmp_path / "a.glb", data[:12] + struct.pack("<I", 2**32 - 1) + data[16:])
