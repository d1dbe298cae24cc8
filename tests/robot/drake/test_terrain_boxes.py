"""The boxes in place of terrain lie at its surface, do not depend on a region, and are driven on as
one box is.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.drake import terrain_boxes
from ddenv.robot.drake.region import Region
from ddenv.robot.drake.terrain_boxes import MOST, TOLERANCES, boxes, note_terrain
from ddenv.robot.result import RunResult
from ddenv.robot.simulation.plant_cache import Plant, PlantCache
from ddenv.world.model import Box, Shape, Terrain, World
from ddenv.world.pose import HERE, Pose
from ddenv.world.terrain import height_at
from tests.robot.conftest import bits, link_of, model_of
from tests.tiers import examples

SIDE = 20.0  # m


def terrain_of(
    height: Callable[[np.ndarray, np.ndarray], np.ndarray], count: int = 81, side: float = SIDE
) -> Terrain:
    along = np.linspace(-side / 2, side / 2, count)
    return Terrain((side, side), height(*np.meshgrid(along, along)), "terrain")


def hills(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.4 * np.sin(x / 2) * np.cos(y / 2)


def top(placed: list[tuple[Box, Pose]], places: np.ndarray) -> np.ndarray:
    """The height (N,) of the highest box at each of `places` (N, 2), m."""
    highest = np.full(len(places), -np.inf)
    for box, pose in placed:
        axes = pose.rotation()
        middle = np.array(pose.position) + axes[:, 2] * box.size[2] / 2
        away = places - middle[:2]
        z = middle[2] - away @ axes[:2, 2] / axes[2, 2]
        local = np.column_stack([away, z - middle[2]]) @ axes[:, :2]
        over = (np.abs(local) <= np.array(box.size[:2]) / 2 + 1e-9).all(axis=1)
        highest[over] = np.maximum(highest[over], z[over])
    return highest


@examples(0.5)
@given(
    seed=st.integers(0, 10**6),
    rows=st.integers(2, 9),
    columns=st.integers(2, 9),
    cell=st.floats(0.1, 4.0),
    steepness=st.floats(0.0, 1.0),
    tolerance=st.sampled_from(TOLERANCES[:3]),
)
def test_no_point_of_the_surface_is_off_by_more_than_2_cm(
    seed, rows, columns, cell, steepness, tolerance
):
    random = np.random.default_rng(seed)
    heights = random.uniform(0.0, steepness * cell, (rows, columns))
    size = ((columns - 1) * cell, (rows - 1) * cell * 1.3)
    terrain = Terrain(size, heights, "terrain")
    places = (random.random((500, 2)) - 0.5) * size
    found = top(list(boxes(terrain, HERE, None, tolerance)), places)
    assert (
        np.abs(found - height_at(terrain, places[:, 0], places[:, 1])).max()
        <= max(0.02, tolerance) + 1e-9
    )


def test_level_and_tilted_ground_is_one_box_and_a_region_takes_some_of_the_same_boxes():
    for slope in (0.0, 0.2):
        ((box, _),) = boxes(terrain_of(lambda x, _, slope=slope: slope * x), HERE, None, 0.01)
        assert box.size[:2] == pytest.approx((SIDE * math.hypot(1.0, slope), SIDE))
    everything = list(boxes(terrain_of(hills), HERE, None, 0.01))
    region = Region(np.array([[-3.0, 0.0]]), np.array([[3.0, 0.0]]), np.array([1.0]))
    some = list(boxes(terrain_of(hills), HERE, region, 0.01))
    assert 0 < len(some) < len(everything) / 2
    assert [one for one in everything if one in some] == some


def test_terrain_that_is_too_fine_for_its_boxes_is_noted(world_of, scenario_of):
    def noted(height: Callable[[np.ndarray, np.ndarray], np.ndarray], *kept: str) -> list:
        shapes = {"hill": terrain_of(height), "slope": terrain_of(lambda x, _: 2.0 * x)}
        links = {name: link_of("link", shape, HERE, None) for name, shape in shapes.items()}
        models = tuple(model_of(name, link) for name, link in links.items())
        world = replace(world_of(ground=False), models=models)
        return list(note_terrain(world, scenario_of(), kept))

    random = np.random.default_rng(4)
    words = r"boxes in place of hill, up to 0\.\d\d m off its surface"
    ((about, said),) = noted(lambda x, _: random.uniform(0.0, 0.5, x.shape), "hill", "slope")
    assert about == "terrain" and re.fullmatch(words, said)
    # Each is a tile, which may be gone; and smooth hills, or a steep slope, are met exactly.
    assert noted(lambda x, _: random.uniform(0.0, 0.5, x.shape), "slope") == []
    assert noted(hills, "hill", "slope") == []


@pytest.fixture(scope="session")
def drive(world_of, husky, scenario_of) -> Callable[..., RunResult]:
    """A run of the Husky along x, on ground of one shape that is `height` m high at its start."""

    def run(shape: Shape, pose: Pose = HERE, height: float = 0.0, kind: type = Plant) -> RunResult:
        scenario = scenario_of(
            robot={"model": "husky.sdf", "spawn": {"x": -4.0, "y": 0.0, "z": height + 0.14}},
            goal={"x": 4.0, "y": 0.0, "tolerance": 0.3},
            controller={"speed": 0.8, "motor_gain": 300.0},
            failure={"timeout": 25.0},
        )
        ground = model_of("ground", replace(link_of("link", shape, pose, None), pose=HERE))
        world: World = replace(world_of(ground=False), models=(ground,))
        return kind(world, husky, scenario).run(frozenset({"ground"}), seed=1)

    return run


def test_flat_terrain_and_a_plane_that_leans_are_driven_as_one_box_is(drive):
    for angle in (0.0, math.radians(10)):
        slope = math.tan(angle)
        box = Pose.from_rpy(0.0, 0.0, 0.0, 0.0, -angle, 0.0) @ Pose((0.0, 0.0, -0.1))
        start = -4.0 * slope + 0.06 * (angle > 0)
        one = drive(Box((SIDE / math.cos(angle), SIDE, 0.2)), box, start)
        other = drive(terrain_of(lambda x, _, slope=slope: slope * x), HERE, start)
        assert one.outcome == other.outcome == "pass"
        assert other.end_pose[:3] == pytest.approx(one.end_pose[:3], abs=0.02)


def test_a_flat_floor_is_the_same_in_400_boxes(drive, monkeypatch):
    one = drive(terrain_of(lambda x, _: 0 * x))
    whole = terrain_boxes._box

    def small(terrain, low, high, *others):
        return None if (high - low).max() > 4 else whole(terrain, low, high, *others)

    monkeypatch.setattr(terrain_boxes, "_box", small)
    cut = drive(terrain_of(lambda x, _: 0 * x))
    assert cut.outcome == one.outcome == "pass"
    assert cut.end_pose[:3] == pytest.approx(one.end_pose[:3], abs=0.02)


def test_a_robot_drives_over_hills_in_a_small_region_as_in_a_large_one_and_stops_at_a_trench(
    drive, monkeypatch
):
    over = drive(terrain_of(hills), height=float(hills(np.array(-4.0), np.array(0.0))) + 0.3)
    assert over.outcome == "pass"
    monkeypatch.setattr("ddenv.robot.drake.region.WIDTH", 3.0)
    again = drive(
        terrain_of(hills), height=float(hills(np.array(-4.0), np.array(0.0))) + 0.3, kind=PlantCache
    )
    assert bits(again) == bits(over)
    trench = drive(terrain_of(lambda x, _: -0.6 * (np.abs(x) < 0.6)))
    assert trench.outcome == "failed"


def test_rough_terrain_is_as_fine_as_memory_allows(world_of, husky, scenario_of):
    rough = np.random.default_rng(1).uniform(0.0, 0.3, (41, 41))
    ground = model_of("ground", link_of("link", Terrain((20.0, 20.0), rough, "rough"), HERE, None))
    template = Plant(replace(world_of(ground=False), models=(ground,)), husky, scenario_of())
    assert 300 < len(template.context.built.static["ground"]) <= MOST
