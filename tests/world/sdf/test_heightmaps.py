"""Heightmaps and meshes that are solid ground: where its heights are, what is in the run file, and
which images are refused.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from ddenv.errors import UserError
from ddenv.map.footprints import footprints
from ddenv.workbench.setup.missing_files import MISSING, read_with_remedies
from ddenv.world.access import MissingFiles
from ddenv.world.files.resources import Resources
from ddenv.world.model import Box, World, is_ground
from ddenv.world.scenario import Reading
from ddenv.world.sdf.read import parse_world
from ddenv.world.terrain import height_at
from ddenv.world.write import convert

HEIGHTS = np.array([[0, 40, 80], [0, 100, 200]], dtype=np.uint8)


def heightmap(size: str = "4 2 10") -> str:
    geometry = (
        f"<geometry><heightmap><uri>hill.png</uri><size>{size}</size><pos>1 2 "
        "3</pos></heightmap></geometry>"
    )
    link = f"<collision name='c'>{geometry}</collision><visual name='v'>{geometry}</visual>"
    return f"<model name='hill'><static>true</static><link name='l'>{link}</link></model>"


def png(pixels: np.ndarray, kind: str = "PNG") -> bytes:
    file = BytesIO()
    Image.fromarray(pixels).save(file, kind)
    return file.getvalue()


def heights(world: World, x: list[float], y: list[float]) -> list[float]:
    (collision,) = world.models[0].collisions
    assert collision.pose.position == (1, 2, 3)
    return height_at(collision.shape, np.array(x), np.array(y)).tolist()


@pytest.mark.parametrize(
    "pixels",
    [HEIGHTS, HEIGHTS.astype(np.uint16) * 256, np.dstack([HEIGHTS, *[HEIGHTS // 2] * 3])],
    ids=["8 bits", "16 bits", "colours"],
)
def test_the_brightest_pixel_is_as_high_as_the_heightmap_and_the_first_row_is_at_the_greatest_y(
    read, tmp_path, pixels
):
    (tmp_path / "hill.png").write_bytes(png(pixels))
    world = read(heightmap())
    assert heights(world, [-2, 0, 2, 2, 1], [1, 1, 1, -1, 0]) == pytest.approx([0, 2, 4, 10, 5.25])
    assert np.isnan(heights(world, [2.01, 0], [0, -1.01])).all()
    assert is_ground(world.models[0]) and not world.elements()


def test_several_models_of_ground_are_tiles_that_can_be_removed(read, tmp_path):
    (tmp_path / "hill.png").write_bytes(png(HEIGHTS))
    plane = "<geometry><plane/></geometry>"
    floor = (
        "<model name='floor'><static>true</static><link name='l'><collision "
        f"name='c'>{plane}</collision></link></model>"
    )
    world = read(floor + heightmap() + heightmap().replace("'hill'", "'other'"))
    assert world.elements() == ("hill", "other") and world.ground == {"floor"}
    assert [(each.name, each.low, each.high) for each in footprints(world)] == [
        (name, (-1.0, 1.0), (3.0, 3.0)) for name in world.elements()
    ]
    assert read(floor + heightmap()).elements() == ()


def test_what_was_read_is_read_again_without_the_image(read, tmp_path):
    (tmp_path / "hill.png").write_bytes(png(HEIGHTS))
    world = read(heightmap())
    (tmp_path / "hill.png").unlink()
    again = parse_world(world.text, world.path, resources=Resources(world.resources))
    assert again.models == world.models
    assert np.array_equal(
        again.models[0].collisions[0].shape.heights, world.models[0].collisions[0].shape.heights
    )


def test_clean_sdf_has_its_triangles(read, tmp_path):
    (tmp_path / "hill.png").write_bytes(png(HEIGHTS))
    _, meshes = convert(read(heightmap()), "meshes")
    (mesh,) = meshes.values()
    assert sorted(mesh.vertices[:, 2]) == pytest.approx([0, 0, 2, 4, 5, 10])
    corners = mesh.vertices[mesh.faces]
    assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0).all()


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (
            png(np.zeros((1, 1), np.uint8)),
            "has 1 x 1 pixels; a heightmap has 2 to 4097 along each side",
        ),
        (png(np.zeros((2, 20_000), np.uint8)), "has 20000 x 2 pixels"),
        (b"no image", "is no image that can be read; use a PNG of 8 or 16 bits"),
        (b"", "is no image that can be read"),
        (png(np.arange(2_500, dtype=np.uint16).reshape(50, 50))[:150], "is no valid image: "),
        (png(np.zeros((3, 3), np.float32), "TIFF"), "holds elevations in m"),
    ],
    ids=["a pixel", "20,000 pixels", "text", "empty", "cut", "elevations"],
)
def test_what_is_no_heightmap_is_refused_in_one_line(read, tmp_path: Path, content, why):
    (tmp_path / "hill.png").write_bytes(content)
    with pytest.raises(UserError) as caught:
        read(heightmap())
    said = str(caught.value)
    assert f"/heightmap: heightmap 'hill.png' is unreadable: {why}" in said
    assert said.endswith("leave it out with --ignore heightmap") and "\n" not in said


def test_a_missing_image_has_the_remedies_of_any_missing_file(read, tmp_path):
    with pytest.raises(
        MissingFiles,
        match=r"heightmap 'hill.png' is not available: .* give its folder .* --ignore heightmap",
    ) as caught:
        read(heightmap())
    assert caught.value.uris == {"hill.png": ""}
    guessed = read(heightmap(), stand_ins={"*": "auto"})
    assert heights(guessed, [-2, 0, 2], [1, 0, -1]) == [0, 0, 0]
    assert "'hill.png' by a guess, level ground: looked" in guessed.notes[0].why
    boxed = read(heightmap(), stand_ins={"hill.png": "box:4,2,1"}).models[0]
    assert boxed.collisions[0].shape == Box((4, 2, 1))
    assert not read(heightmap(), stand_ins={"hill.png": "none"}).models[0].collisions
    # As the workbench lists it.
    world = tmp_path / "world.sdf"
    world.write_text(f"<sdf version='1.9'><world name='w'>{heightmap()}</world></sdf>")
    _, _, (row,) = read_with_remedies(world, Reading(), {})
    assert (row.uri, row.kind) == ("hill.png", MISSING) and row.words.startswith(
        "guess level ground"
    )


def test_an_image_of_400_million_pixels_is_refused_before_it_is_decoded(read, tmp_path):
    # A header that claims more than the file holds: decoding would take 400 MB.
    header = bytearray(png(np.zeros((2, 2), np.uint8)))
    header[16:24] = (20_000).to_bytes(4, "big") * 2
    header[29:33] = zlib.crc32(bytes(header[12:29])).to_bytes(4, "big")
    (tmp_path / "hill.png").write_bytes(bytes(header))
    with pytest.raises(UserError, match="is wider or higher than 4097 pixels"):
        read(heightmap())


def surface(
    height: Callable[[np.ndarray, np.ndarray], np.ndarray], count: int = 61
) -> trimesh.Trimesh:
    """A mesh of 20 x 12 m that each vertical line meets once, its vertices at random places."""
    random = np.random.default_rng(1)
    along, across = np.linspace(0, 20, count), np.linspace(0, 12, count)
    x, y = np.meshgrid(along, across)
    x[:, 1:-1] += random.uniform(-0.05, 0.05, x[:, 1:-1].shape)
    y[1:-1] += random.uniform(-0.05, 0.05, y[1:-1].shape)
    number = np.arange(count * count).reshape(count, count)
    first, beside, above, across = (
        number[:-1, :-1],
        number[:-1, 1:],
        number[1:, :-1],
        number[1:, 1:],
    )
    faces = np.stack([first, beside, across, first, across, above], axis=-1).reshape(-1, 3)
    return trimesh.Trimesh(
        np.column_stack([x.ravel(), y.ravel(), height(x, y).ravel()]), faces, process=False
    )


def hill(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 5 + 0.5 * np.sin(x / 2) * np.cos(y / 3)


MESH = "<geometry><mesh><uri>ground.obj</uri>{}</mesh></geometry>"
GROUND = (
    "<model name='m'><static>true</static><link name='l'><collision "
    "name='c'>{}</collision></link></model>"
)


def test_a_mesh_that_is_a_surface_is_solid_ground_below_it(read, tmp_path):
    mesh = surface(hill)
    mesh.export(tmp_path / "ground.obj")
    world = read(GROUND.format(MESH.format("<scale>1 2 1</scale>")))
    (one,) = world.models[0].collisions
    assert is_ground(world.models[0])
    places, _ = trimesh.sample.sample_surface(mesh, 2000, seed=1)
    local = places * (1, 2, 1) - one.pose.position
    found = height_at(one.shape, local[:, 0], local[:, 1])
    assert found == pytest.approx(local[:, 2], abs=0.011)
    again = parse_world(world.text, world.path, resources=Resources(world.resources))
    assert again.models == world.models


@pytest.mark.parametrize(
    "mesh",
    [
        trimesh.util.concatenate([surface(hill), surface(lambda x, y: hill(x, y) + 2)]),
        surface(lambda x, y: hill(x, y) + 0.5 * np.random.default_rng(2).random(x.shape)),
        surface(hill, 9),
        surface(lambda x, y: 0 * x),
        trimesh.Trimesh(surface(hill).vertices, surface(hill).faces[:-900], process=False),
        trimesh.creation.icosphere(4, 9.0),
    ],
    ids=["two layers", "rocks", "a roof", "a floor", "with a gap", "a ball"],
)
def test_other_meshes_are_no_ground(read, tmp_path, mesh):
    mesh.export(tmp_path / "ground.obj")
    world = read(GROUND.format(MESH.format("")))
    assert not is_ground(world.models[0])
    again = parse_world(world.text, world.path, resources=Resources(world.resources))
    assert again.models == world.models and again.absent == ()
