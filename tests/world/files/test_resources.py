import json
import shutil

import numpy as np
import pytest

from ddenv.world.access import Missing, Unusable
from ddenv.world.files.meshes import pack
from ddenv.world.files.resources import MeshPart, Resources
from ddenv.world.files.roots import search_roots

CUBE = "\n".join(
    [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 2)]
    + ["o cube", "f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f 2 6 8 4"]
)


@pytest.fixture
def world(tmp_path, no_gazebo):
    folder = tmp_path / "world"
    (folder / "box").mkdir(parents=True)
    (folder / "cube.obj").write_text(CUBE)
    (folder / "bad.obj").write_text("f 1 2 3")
    (folder / "box" / "box.sdf").write_text("<sdf version='1.6'/>")
    (folder / "box" / "model.config").write_text("<model><sdf version='1.6'>box.sdf</sdf></model>")
    return folder


def test_stored_gives_the_same_without_the_files(world):
    disk = Resources({}, search_roots((), world))
    ways = [
        {"convex": convex, "center": center, "submesh": name}
        for convex in (False, True)
        for center in (False, True)
        for name in ("", "cube")
    ]
    parts = [MeshPart("cube.obj", world, way["submesh"], way["center"]) for way in ways]
    given = [disk.mesh(part, convex=way["convex"]) for part, way in zip(parts, ways, strict=True)]
    disk.pieces(parts[0], (1.0, 1.0, 1.0), 8)
    disk.cut()
    pieces = disk.pieces(parts[0], (1.0, 1.0, 1.0), 8)
    assert len(pieces) == 1
    text = disk.sdf("model://box", world)
    assert text == (world / "box" / "box.sdf", b"<sdf version='1.6'/>")
    assert disk.sdf("box/box.sdf", world)[1] == text[1]
    shutil.rmtree(world)
    stored = Resources(dict(disk.taken))
    assert stored.sdf("model://box", world) == text
    assert stored.pieces(parts[0], (1.0, 1.0, 1.0), 8) == pieces
    for part, way, mesh in zip(parts, ways, given, strict=True):
        again = stored.mesh(part, convex=way["convex"])
        assert again == mesh
        assert again.vertices.tobytes() == mesh.vertices.tobytes()
        assert again.faces.tobytes() == mesh.faces.tobytes()
        assert (again.vertices.dtype, again.faces.dtype) == (np.float64, np.uint32)
        assert not again.vertices.flags.writeable and not again.faces.flags.writeable
    assert len({mesh.origin for mesh in given}) == len(ways)
    for ask in (
        lambda: stored.sdf("model://none", world),
        lambda: stored.mesh(MeshPart("bad.obj", world), convex=False),
    ):
        with pytest.raises(Missing):
            ask()


def damaged(packed: bytes):
    triangle = pack(np.eye(3), np.array([[0, 1, 2]]))
    yield b""
    yield packed[:10]
    yield packed[:-1]
    yield packed + b"\0"
    yield b"x" + packed[1:]
    yield packed[:8] + b"\x10" + packed[9:]
    yield packed[:8] + b"\0" * 4 + packed[12:]
    yield packed[:12] + b"\xff" * 8 + packed[20:]
    yield pack(np.full((3, 3), np.nan), np.array([[0, 1, 2]]))
    yield pack(np.eye(3) * 1e9, np.array([[0, 1, 2]]))
    yield pack(np.eye(3), np.zeros((0, 3)))
    yield triangle[:-4] + b"\x03\0\0\0"


def test_damaged_bytes(world):
    disk = Resources({}, search_roots((), world))
    disk.mesh(MeshPart("cube.obj", world), convex=True)
    disk.sdf("model://box", world)
    keys = {json.loads(key)[0]: key for key in disk.taken}
    for bad in damaged(disk.taken[keys["mesh"]]):
        with pytest.raises(Unusable, match="damaged"):
            Resources({keys["mesh"]: bad}).mesh(MeshPart("cube.obj", world), convex=True)
    for bad in (b"", b"no end", b"\0<sdf/>"):
        with pytest.raises(Unusable, match="damaged"):
            Resources({keys["sdf"]: bad}).sdf("model://box", world)


@pytest.mark.parametrize(
    "bad", [b"", b"\1", b"\2\0\0\0\1\0\0\0x", b"\xff\xff\xff\xff", b"\1\0\0\0\5\0\0\0abc"]
)
def test_damaged_pieces(world, bad):
    disk = Resources({}, search_roots((), world))
    cube = MeshPart("cube.obj", world)
    disk.pieces(cube, (1.0, 1.0, 1.0), 8)
    disk.cut()
    disk.pieces(cube, (1.0, 1.0, 1.0), 8)
    stored = Resources(dict.fromkeys(disk.taken, bad))
    with pytest.raises(Unusable, match="damaged"):
        stored.pieces(cube, (1.0, 1.0, 1.0), 8)


def test_files_of_one_name_are_told_apart_by_content(world):
    disk = Resources({}, search_roots((), world))
    first = disk.mesh(MeshPart("cube.obj", world), convex=True)
    (world / "box" / "cube.obj").write_text(CUBE.replace("2", "3"))
    other = disk.mesh(MeshPart("cube.obj", world / "box"), convex=True)
    assert first != other
