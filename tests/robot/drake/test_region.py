"""Worlds of many models: the plant has only what comes near, and every bit of a run is as if it had
all.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ddenv.robot.drake import region
from ddenv.robot.simulation.plant_cache import Plant, PlantCache
from ddenv.world.model import Box, World
from ddenv.world.pose import Pose
from ddenv.world.scenario import Scenario
from tests.robot.conftest import all_bits, cube, link_of, model_of

EVERYTHING = 10**9


@pytest.fixture
def world(world_of, add) -> World:
    """In the robot's way a cube that it pushes against a wall; a pile that falls far away onto a
    shelf; crates all around.
    """
    crates = [
        cube(f"crate {x} {y}", 4 * x, 4 * y, mass=None)
        for x in range(-4, 8)
        for y in range(-4, 5)
        if y
    ]
    shelf = model_of("shelf", link_of("link", Box((1.0, 1.0, 0.3)), Pose((1.0, 30.0, 0.15)), None))
    wall = model_of("wall", link_of("link", Box((0.2, 3.0, 0.3)), Pose((4.5, 0.0, 0.15)), None))
    loose = cube("pushed", 1.2, 0.1), cube("falls", 1.0, 30.0, 0.8)
    return add(world_of(), *crates[:50], loose[0], shelf, wall, loose[1], *crates[50:])


@pytest.fixture
def scenario(scenario_of) -> Scenario:
    sensors = {"lidar": {"beams": 91, "range": 9.0, "z": 0.0}, "view_range": 3.0}
    return scenario_of(
        failure={"timeout": 4.0},
        goal={"x": 9, "y": 0},
        sensors=sensors,
        simulation={"time_step": 0.01},
    )


@pytest.fixture
def variants(world, husky, scenario, monkeypatch) -> Callable[[float], PlantCache]:
    """The simulator of the world with a region of a width (m)."""

    def make(width: float) -> PlantCache:
        monkeypatch.setattr(region, "FEW", EVERYTHING if width == EVERYTHING else 0)
        monkeypatch.setattr(region, "WIDTH", width)
        monkeypatch.setattr(region, "AROUND", width)
        return PlantCache(world, husky, scenario)

    return make


def still(variants: PlantCache) -> int:
    """How many models that never move are in the plant."""
    return len(variants._whole.context.built.static)


def test_every_bit_is_the_same_in_a_small_region_in_a_large_one_and_with_everything(
    variants, world
):
    names = frozenset(world.elements())
    parts = names, names - {"shelf", "crate 0 1"}
    whole, large, small = (variants(width) for width in (EVERYTHING, 8.0, 3.5))
    expected = [all_bits(whole.run(part, seed=1)) for part in parts]
    assert expected[0][3]["falls"] != expected[1][3]["falls"]
    assert "pushed" in expected[0][3] and "pushed" in expected[0][4][1]
    for one in (large, small):
        assert still(one) < still(whole)
        assert [all_bits(one.run(part, seed=1)) for part in parts] == expected


@pytest.mark.rates
def test_a_run_that_leaves_the_region_is_made_again_from_its_start_in_a_larger_one(variants, world):
    names = frozenset(world.elements())
    expected = all_bits(variants(EVERYTHING).run(names, seed=1))
    small = variants(0.5)
    before = still(small)
    assert all_bits(small.run(names, seed=1)) == expected
    after = still(small)
    assert before < after
    # The larger plant stays: the next run need not begin twice.
    assert all_bits(small.run(names, seed=1)) == expected
    assert still(small) == after


@pytest.mark.rates
@pytest.mark.parametrize("x", [0.0, 3.0], ids=["beside the robot", "played back"])
def test_a_model_that_slides_out_of_the_region_is_stopped_by_what_lies_there(
    world_of, add, variants, husky, scenario, x
):
    ramp = model_of(
        "ramp",
        link_of("link", Box((0.6, 1.6, 0.1)), Pose.from_rpy(x, 1.2, 0.0, -0.3, 0, 0), None, mu=0.0),
    )
    slides = model_of(
        "slides", link_of("link", Box((0.3, 0.3, 0.3)), Pose((x, 0.52, 0.52)), mu=0.0)
    )
    world = add(world_of(), ramp, slides, cube("stop", x, 5.2, mass=None))
    expected, found = [], []
    for width, results in ((EVERYTHING, expected), (4.0, found)):
        variants(width)
        one = PlantCache(world, husky, scenario)
        assert ("stop" in one._whole.context.built.static) is (width == EVERYTHING)
        results += [
            all_bits(one.run(frozenset(keep), 1))
            for keep in (["ramp", "slides", "stop"], ["ramp", "slides"])
        ]
        assert "stop" in one._whole.context.built.static
    assert found == expected
    assert expected[0][3] != expected[1][3]


@pytest.mark.rates
def test_what_rests_on_what_is_found_where_a_pile_leaves_the_region(variants, world):
    names = frozenset(world.elements())
    expected = variants(EVERYTHING).supports(names)
    assert ("falls", "shelf") in expected
    assert variants(0.5).supports(names) == expected


def test_a_small_world_is_in_the_plant_as_a_whole(world, husky, scenario):
    template = Plant(world, husky, scenario)
    assert template.context.region is None
    assert len(template.context.built.static) == len(world.models)


def test_a_region_has_what_its_edge_cuts_and_all_that_has_no_end(
    variants, world, add, husky, scenario
):
    variants(2.0)
    edge = cube("edge", 5.0, 2.1, mass=None), cube("outside", 5.0, 2.3, mass=None)
    static = PlantCache(add(world, *edge), husky, scenario)._whole.context.built.static
    assert {"ground", "edge", "wall", "shelf"} <= static.keys()
    assert "outside" not in static
