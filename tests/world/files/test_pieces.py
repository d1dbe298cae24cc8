"""A mesh is cut into convex pieces that fill what it fills, and leave open what it leaves open."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import assume, given
from hypothesis import strategies as st
from manifold3d import Manifold

from ddenv.world.files.boxes import box_of, volume
from ddenv.world.files.kept_pieces import KNOWN, keep
from ddenv.world.files.meshes import pack_pieces
from ddenv.world.files.pieces import MOST_PLATES, PLATE, convex_pieces
from ddenv.world.files.resources import MeshPart, Resources
from ddenv.world.files.roots import search_roots
from ddenv.world.model import Mesh
from tests.tiers import examples


def meshes(pieces):
    return [Mesh(str(number), *piece) for number, piece in enumerate(pieces)]


def cut(vertices, faces, most=64):
    return meshes(convex_pieces(np.asarray(vertices, dtype=float), np.asarray(faces), most))


def surface(solid):
    mesh = solid.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(int)


def house(width, depth, door):
    """Four walls of 0.2 m around a room, with a doorway of `door` m in the middle of the front; no
    roof.
    """
    inner = Manifold.cube((width - 0.4, depth - 0.4, 3.0)).translate((0.2, 0.2, -0.1))
    way = Manifold.cube((door, 0.4, 2.0)).translate(((width - door) / 2, -0.1, -0.1))
    return Manifold.cube((width, depth, 2.5)) - inner - way


SIZE = st.floats(1.5, 12.0)


@examples(0.3)
@given(
    width=SIZE,
    depth=SIZE,
    door=st.floats(0.4, 1.0),
    turn=st.floats(-180, 180),
    order=st.randoms(use_true_random=False),
)
def test_a_house_is_cut_exactly_and_its_door_stays_open(width, depth, door, turn, order):
    whole = house(width, depth, door)
    vertices, faces = surface(whole.rotate((0.0, 0.0, turn)))
    rows = list(range(len(faces)))
    order.shuffle(rows)
    # Neither the order of its triangles nor which way they are wound changes what a mesh fills.
    faces = faces[rows]
    faces[::3] = faces[::3, ::-1]
    pieces = cut(vertices, faces)
    assert sum(map(volume, pieces)) == pytest.approx(whole.volume(), rel=1e-4)
    assert all(box_of(piece) is not None for piece in pieces)
    in_the_door = trimesh.transformations.rotation_matrix(np.radians(turn), (0, 0, 1))
    for x in np.linspace(-door / 2, door / 2, 7)[1:-1]:
        place = (in_the_door @ (width / 2 + x, 0.1, 1.0, 1.0))[:3]
        assert not any(encloses(piece, place) for piece in pieces)


def encloses(piece, place):
    corners = piece.vertices[piece.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return (np.einsum("ij,ij->i", normals, place - corners[:, 0]) < 0).all()


@examples(0.3)
@given(
    boxes=st.lists(
        st.tuples(*[st.integers(0, 4)] * 3, *[st.integers(1, 3)] * 3), min_size=1, max_size=6
    )
)
def test_pieces_fill_what_a_solid_fills(boxes):
    """Also with holes, steps, and parts that touch in an edge or a corner."""
    whole = sum_of(boxes)
    pieces = cut(*surface(whole))
    filled = sum_of_meshes(pieces)
    assert abs(filled.volume() - whole.volume()) < 0.003 * whole.volume()
    assert (whole - filled).volume() < 1e-4


def sum_of(boxes):
    whole = Manifold()
    for x, y, z, *size in boxes:
        whole = whole + Manifold.cube(tuple(map(float, size))).translate(
            (float(x), float(y), float(z))
        )
    return whole


def sum_of_meshes(pieces):
    whole = Manifold()
    for piece in pieces:
        whole = whole + Manifold.hull_points(piece.vertices)
    return whole


def test_a_table_can_be_driven_under():
    top = Manifold.cube((1.2, 0.8, 0.05)).translate((0.0, 0.0, 0.7))
    legs = [
        Manifold.cube((0.05, 0.05, 0.72)).translate((x, y, 0.0))
        for x in (0.0, 1.15)
        for y in (0.0, 0.75)
    ]
    table = top
    for leg in legs:
        table = table + leg
    pieces = cut(*surface(table))
    assert sum(map(volume, pieces)) == pytest.approx(table.volume(), rel=1e-4)
    assert not any(encloses(piece, (0.6, 0.4, 0.3)) for piece in pieces)


def test_a_flat_sheet_is_one_thin_box():
    corners = [(x, y, 0.0) for x in range(11) for y in range(11)]
    squares = [
        (11 * x + y, 11 * x + 11 + y, 11 * x + 12 + y, 11 * x + y + 1)
        for x in range(10)
        for y in range(10)
    ]
    faces = [face for a, b, c, d in squares for face in ((a, b, c), (a, c, d))]
    [piece] = cut(corners, faces)
    box, pose = box_of(piece)
    assert sorted(box.size)[1:] == pytest.approx([10.0, 10.0])
    assert sorted(box.size)[0] < 2e-3
    assert pose.position == pytest.approx((5.0, 5.0, 0.0), abs=1e-6)


def test_sheets_are_thin_plates_below_them():
    """A floor and a wall without thickness, which meet in an edge."""
    floor = [(0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0)]
    wall = [(0, 3, 2), (4, 3, 2)]
    faces = [(0, 1, 2), (0, 2, 3), (3, 2, 5), (3, 5, 4)]
    boxes = [box_of(piece) for piece in cut(floor + wall, faces)]
    assert [sorted(box.size) for box, _ in boxes] == [
        pytest.approx([PLATE, 3.0, 4.0], rel=1e-4),
        pytest.approx([PLATE, 2.0, 4.0], rel=1e-4),
    ]
    assert boxes[0][1].position == pytest.approx((2.0, 1.5, -PLATE / 2), abs=1e-4)


def test_a_curved_sheet_of_many_triangles_is_patches_that_follow_it():
    x, y = np.meshgrid(np.linspace(0, 10, 40), np.linspace(0, 10, 40), indexing="ij")
    corners = np.column_stack([x.ravel(), y.ravel(), np.sin(x.ravel()) * np.cos(y.ravel())])
    cells = np.arange(1600).reshape(40, 40)
    a, b, c, d = (
        part.ravel() for part in (cells[:-1, :-1], cells[1:, :-1], cells[1:, 1:], cells[:-1, 1:])
    )
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    assert len(faces) > MOST_PLATES
    pieces = cut(corners, faces, 512)
    assert 64 < len(pieces) <= 512
    assert sum(map(volume, pieces)) < 25


@pytest.mark.parametrize(
    "vertices, faces",
    [
        ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]),
        ([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]),
        ([(0, 0, 0)] * 3, [(0, 1, 2)]),
        ([(0, 0, 0), (1e-9, 0, 0), (0, 1e-9, 0)], [(0, 1, 2), (0, 2, 1)]),
        ([(1e6, 0, 0), (1e6, 1, 0), (1e6, 0, 1)], [(0, 1, 2), (2, 1, 0), (1, 2, 0)]),
    ],
    ids=["triangle", "line", "point", "tiny", "far"],
)
def test_what_is_hardly_a_mesh_is_its_hull(vertices, faces):
    assert len(cut(vertices, faces)) == 1


@examples(1.0)
@given(
    st.lists(st.tuples(*[st.floats(-5, 5)] * 3), min_size=3, max_size=12),
    st.lists(st.tuples(*[st.integers(0, 11)] * 3), min_size=1, max_size=30),
)
def test_any_triangles_at_all_become_pieces_within_their_hull(vertices, faces):
    faces = np.array(faces) % len(vertices)
    points = np.array(vertices)
    assume(np.ptp(points[faces.ravel()], axis=0).max() > 0)
    pieces = cut(points, faces)
    assert 1 <= len(pieces) <= 64
    low, high = points[faces.ravel()].min(axis=0), points[faces.ravel()].max(axis=0)
    slack = max(PLATE, 1e-3 * float(np.max(high - low)))
    for piece in pieces:
        assert (piece.vertices >= low - slack).all() and (piece.vertices <= high + slack).all()


def test_pieces_are_cut_once_and_what_is_damaged_is_cut_again(tmp_path, home, monkeypatch):
    cuts = []

    def cut_here(meshes):
        cuts.extend(meshes)
        for file, mesh in meshes.items():
            keep(file, pack_pieces(convex_pieces(*mesh)))

    monkeypatch.setattr("ddenv.world.files.cutting.cut", cut_here)
    vertices, faces = surface(house(4.0, 3.0, 0.9))
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "house.obj")
    part = MeshPart("house.obj", tmp_path)

    def build(most=64, scale=(1.0, 1.0, 1.0)):
        # As another program does.
        KNOWN.clear()
        disk = Resources({}, search_roots((), tmp_path))
        disk.pieces(part, scale, most)
        disk.cut()
        return [
            (piece.vertices.tolist(), piece.faces.tolist())
            for piece in disk.pieces(part, scale, most)
        ]

    first = build()
    assert build() == first and len(cuts) == 1
    assert build(scale=(2.0, 1.0, 1.0)) != first and len(cuts) == 2
    assert build(most=1) != first and len(cuts) == 3
    for file in (tmp_path / "cache" / "pieces").iterdir():
        file.write_bytes(file.read_bytes()[:-1])
    assert build() == first and len(cuts) == 4
    monkeypatch.setenv("DDENV_HOME", "/proc/nowhere")
    assert build() == first and len(cuts) == 5


def test_of_many_loose_parts_the_large_ones_stay_exact():
    rng = np.random.default_rng(0)
    whole = house(12.0, 9.0, 0.9)
    for x, y in rng.uniform((1.0, 1.0), (11.0, 3.5), size=(300, 2)):
        whole = Manifold.compose([whole, Manifold.cube((0.02, 0.02, 0.02)).translate((x, y, 1.0))])
    pieces = cut(*surface(whole), 64)
    assert len(pieces) <= 64
    assert not any(encloses(piece, (6.0, 0.1, 1.0)) for piece in pieces)
    assert not any(encloses(piece, (6.0, 6.0, 1.0)) for piece in pieces)


def test_a_very_fine_mesh_takes_no_longer_than_it_may(monkeypatch):
    """What is not cut by then is its hull."""
    monkeypatch.setattr("ddenv.world.files.pieces.MOST_WORK", 100_000)
    bowl = (
        Manifold.sphere(1.0, 100)
        - Manifold.sphere(0.9, 100)
        - Manifold.cube((3.0, 3.0, 3.0)).translate((-1.5, -1.5, 0.0))
    )
    pieces = cut(*surface(bowl), 512)
    assert 1 < len(pieces) <= 512
    assert sum(map(volume, pieces)) < 1.5 * bowl.hull().volume()
