"""A robot that fails at a trench: a reduction finds the model that has it, or what stands in it, on
real Drake.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ddenv.world.files.pieces import extruded
from tests.command import ddenv

PLANE = "<geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry>"
CRATE = "<geometry><box><size>0.5 0.5 0.5</size></box></geometry>"


def still(name: str, x: float, y: float, z: float, geometry: str) -> str:
    return (
        f"<model name='{name}'><static>true</static><pose>{x} {y} {z} 0 0 0</pose><link name='l'>"
        f"<collision name='c'>{geometry}</collision><visual "
        f"name='v'>{geometry}</visual></link></model>"
    )


def write_mesh(path: Path, vertices: np.ndarray, faces: np.ndarray) -> str:
    """Writes a mesh, and returns its <geometry>."""
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices]
    lines += ["f {} {} {}".format(*face) for face in faces + 1]
    path.write_text("\n".join(lines))
    return f"<geometry><mesh><uri>{path.name}</uri></mesh></geometry>"


def solid(path: Path, *profile: tuple[float, float]) -> str:
    """A closed mesh that is 4 m wide along y, with the outline `profile` (x, z) m."""
    vertices, faces = extruded([np.array(profile)], 4.0)
    x, z, along = vertices.T
    return write_mesh(path, np.column_stack([x, 2.0 - along, z]), faces)


def open_surface(path: Path, heights: np.ndarray, length: float) -> str:
    """An open mesh, `length` m long and 10 m wide, that is as high along x as `heights` say."""
    count = len(heights)
    x, y = np.meshgrid(np.linspace(-length / 2, length / 2, count), np.linspace(-5.0, 5.0, 9))
    vertices = np.stack([x, y, np.broadcast_to(heights, x.shape)], axis=-1).reshape(-1, 3)
    number = np.arange(x.size).reshape(x.shape)
    first, beside, across, above = (
        number[:-1, :-1],
        number[:-1, 1:],
        number[1:, 1:],
        number[1:, :-1],
    )
    faces = np.stack([first, beside, across, first, across, above], axis=-1).reshape(-1, 3)
    return write_mesh(path, vertices, faces)


def banks(folder: Path) -> list[str]:
    """Low banks on a plane: the robot crosses `plain`, and is stuck in the trench across `cut`."""
    plain = solid(folder / "plain.obj", (-2, 0), (2, 0), (1, 0.3), (-1, 0.3))
    trench = ((0.22, 0.3), (0.2, 0.02), (-0.2, 0.02), (-0.22, 0.3))
    cut = solid(folder / "cut.obj", (-2, 0), (2, 0), (1, 0.3), *trench, (-1, 0.3))
    shapes = {
        "plain": (4, 0, plain),
        "cut": (8.5, 0, cut),
        "plain_2": (4, 6, plain),
        "cut_2": (8.5, 6, cut),
    }
    tiles = [still(name, x, y, 0, geometry) for name, (x, y, geometry) in shapes.items()]
    return [still("ground", 0, 0, 0, PLANE), *tiles]


def land(folder: Path) -> list[str]:
    """Tiles of land: each of its own is ground that carries all else, but together each is a
    model.
    """
    x = np.linspace(-5.0, 5.0, 129)
    plain = np.clip((5.0 - np.abs(x)) * 0.3, 0.0, 0.3)
    cut = np.where(np.abs(x) < 0.22, 0.02, plain)
    shapes = {"plain": (6, 11, plain), "cut": (6, 0, cut), "plain_2": (6, -11, plain)}
    tiles = [
        still(name, x, y, 0, open_surface(folder / f"{name}.obj", heights, 10.0))
        for name, (x, y, heights) in shapes.items()
    ]
    return [still("ground", 0, 0, 0, PLANE), *tiles]


def ground(folder: Path) -> list[str]:
    """Ground with a wide trench that the robot can cross, but for a crate in it."""
    x = np.linspace(-15.0, 15.0, 241)
    depth = 0.5 * np.clip(2.0 - np.abs(x - 4.0), 0.0, 1.0)
    return [
        still("ground", 0, 0, 0, open_surface(folder / "ground.obj", -depth, 30.0)),
        *(
            still(name, 4, y, -0.25, CRATE)
            for name, y in (("in_the_way", 0.1), ("left", 3.0), ("right", -3.0))
        ),
    ]


@pytest.mark.rates
@pytest.mark.parametrize(("make", "found"), [(banks, "cut"), (land, "cut"), (ground, "in_the_way")])
def test_the_model_of_a_trench_is_found(tmp_path, make, found):
    crates = [
        still(f"crate_{number}", 2 * number, (-1) ** number * 3.5, 0.25, CRATE)
        for number in range(4)
    ]
    world = tmp_path / "world.sdf"
    world.write_text(
        f"<sdf version='1.9'><world name='w'>{''.join([*make(tmp_path), *crates])}</world></sdf>"
    )
    # Enough for the search, not for a certificate.
    few = ("--baseline-runs", 3, "--budget", 10, "--timeout", 17, "--json")
    done = ddenv(
        "run",
        world,
        "--spawn",
        "0,0,0.2,0",
        "--goal",
        "12,0",
        "--output",
        tmp_path / "run.ddenv",
        *few,
    )
    summary = json.loads(done.stdout)
    assert summary["kept"] == [found], done.stderr
    assert summary["models_before"] == len(crates) + {banks: 4, land: 3, ground: 3}[make]
    assert summary["outcomes"]["pass"] >= 1
