"""The three scenarios: they fail for few models' sake, and nothing depends on how a world was made
smaller.
"""

from __future__ import annotations

import runpy
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, cached_property
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from ddenv.robot.oracle import Failure, judge
from ddenv.robot.result import RunResult
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.runfile.failures import alike
from ddenv.runs.experiment import load_parts
from ddenv.world.load import SCENARIOS, SDF, load_scenario
from ddenv.world.model import Box, Model, World
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.read import parse_world

# What is left of each, with other models for a part of the world that is more than that.
MINIMAL = {
    "ditch": {"asphalt_near", "asphalt_far"},
    "rubble": {"cinder_block_1", "ramp_1a"},
    "friction": {"green_patch_01", "barrel_01", "barrel_02"},
}
MORE = {
    "ditch": {"rough_tile_11", "rough_tile_20", "cinder_block"},
    "rubble": {"ramp_1b", "board_01", "crib_left_01", "crib_left_02"},
    "friction": {"red_patch_01", "barrel_09", "green_patch_03"},
}
# Where the robot is when its time is up, m.
ENDS = {
    "ditch": (-0.29, 0.04, 2.08),
    "rubble": (-0.18, 0.03, 0.18),
    "friction": (2.15, -0.59, 0.12),
}
# `benchmarks/failure_rates.py` has thirty seeds of each.
SEEDS = {"ditch": 10, "rubble": 4, "friction": 10}
REPAIRED_SEEDS = 3


def of_each(*quick: str) -> pytest.MarkDecorator:
    """All three, of which the `quick` ones are in the quick tier. One process builds a world once
    for all tests of it.
    """

    def marks(name: str) -> list[pytest.MarkDecorator]:
        return [pytest.mark.xdist_group(name)] + [pytest.mark.rates] * (name not in quick)

    return pytest.mark.parametrize(
        "name", [pytest.param(name, marks=marks(name)) for name in MINIMAL]
    )


@dataclass(frozen=True)
class Part:
    """A scenario with its world."""

    scenario: Scenario
    world: World
    robot: Model

    @cached_property
    def template(self) -> Plant:
        """The world in the simulator."""
        return Plant(self.world, self.robot, self.scenario)

    @property
    def everything(self) -> frozenset[str]:
        return frozenset(self.world.elements())


@cache
def part(name: str) -> Part:
    scenario = load_scenario(SCENARIOS / f"{name}.yaml")
    return Part(scenario, *load_parts(scenario))


@pytest.fixture
def script(monkeypatch) -> Callable[[str], dict]:
    """What the script that makes a world defines."""
    monkeypatch.syspath_prepend(str(SDF / "worlds"))
    return lambda name: runpy.run_path(str(SDF / "worlds" / f"make_{name}.py"))


@cache
def whole(name: str, seed: int) -> RunResult:
    return part(name).template.run(part(name).everything, seed)


@of_each("rubble", "friction")
def test_the_file_is_what_its_script_writes(name, script):
    assert script(name)[name]().encode() == part(name).world.text


def test_they_have_the_papers_sizes():
    assert {name: len(part(name).everything) for name in MINIMAL} == {
        "ditch": 43,
        "rubble": 36,
        "friction": 25,
    }
    assert all(model.static for model in part("ditch").world.models)
    boards = [model for model in part("rubble").world.models if not model.static]
    assert len(boards) == 34
    assert all(isinstance(model.collisions[0].shape, Box) for model in boards)


def test_the_friction_of_patches_differs_a_thousandfold():
    mus = {model.name: model.collisions[0].mu for model in part("friction").world.models}
    red, green = (
        {mu for name, mu in mus.items() if name.startswith(color)} for color in ("red", "green")
    )
    assert max(red) / min(green) == pytest.approx(1000)
    assert max(green) < mus["ground_plane"] < min(red)


@of_each()
def test_the_robot_fails_in_the_same_place_at_a_stable_rate(name):
    results = [whole(name, seed) for seed in range(SEEDS[name])]
    failed = [result for result in results if result.outcome == "failed"]
    ends = [result.end_pose[:3] for result in failed]
    similar = alike(ends, part(name).scenario.failure.epsilon)[0]
    assert 0.6 <= len(similar) / len(results) <= 1.0
    assert ends[similar[0]] == pytest.approx(ENDS[name], abs=0.15)
    assert {failed[number].failure for number in similar} == {"stuck"}


@of_each("friction")
def test_it_reaches_its_goal_where_the_cause_is_taken_away(name, script):
    scenario = part(name).scenario
    world = parse_world(script(name)[name](repaired=True).encode(), Path("repaired"))
    template = Plant(world, part(name).robot, scenario)
    results = [template.run(frozenset(world.elements()), seed) for seed in range(REPAIRED_SEEDS)]
    assert {result.outcome for result in results} == {"pass"}
    assert max(result.simulated_seconds for result in results) < 45.0


@cache
def failure(name: str) -> Failure:
    """f, as a run of the whole world has it that ends where most do."""
    runs = (whole(name, seed) for seed in range(SEEDS[name]))
    first = next(
        run for run in runs if np.linalg.norm(np.subtract(run.end_pose[:3], ENDS[name])) < 0.15
    )
    return Failure(first.end_pose[:3], first.trajectory, part(name).scenario.failure.epsilon)


def shows_f(name: str, keep: set[str], seeds: range) -> list[bool]:
    return [
        judge(part(name).template.run(frozenset(keep), seed), failure(name)).outcome == "similar"
        for seed in seeds
    ]


@of_each()
def test_few_models_show_the_same_failure_and_none_of_them_can_be_removed(name):
    assert sum(shows_f(name, MINIMAL[name], range(4))) >= 2
    for left_out in MINIMAL[name]:
        assert not any(shows_f(name, MINIMAL[name] - {left_out}, range(3))), left_out


def few(name: str) -> frozenset[str]:
    return frozenset(MINIMAL[name] | MORE[name])


@cache
def bits_of_few(name: str) -> bytes:
    return bits(part(name).template.run(few(name), seed=5))


@of_each()
def test_a_used_context_gives_the_same_bits_as_a_fresh_one(name):
    first, template = bits_of_few(name), part(name).template
    template.run(frozenset(MINIMAL[name]), seed=6)
    assert bits(template.run(few(name), seed=5)) == first
    fresh = Plant(part(name).world, part(name).robot, part(name).scenario)
    assert bits(fresh.run(few(name), seed=5)) == first


@of_each("friction")
def test_switching_models_off_gives_the_same_bits_as_building_without_them(name):
    world = part(name).world
    smaller = replace(
        world, models=tuple(one for one in world.models if one.name in few(name) | {"ground_plane"})
    )
    template = Plant(smaller, part(name).robot, part(name).scenario)
    assert bits(template.run(few(name), seed=5)) == bits_of_few(name)


@of_each()
def test_another_process_gives_the_same_bits(name):
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        elsewhere = pool.submit(bits_of_few, name).result()
    assert elsewhere == bits_of_few(name)


def bits(result: RunResult) -> bytes:
    motions = b"".join(
        name.encode() + rows.tobytes() for name, rows in sorted(result.motions.items())
    )
    return (
        result.trajectory.tobytes()
        + motions
        + repr((result.first_sensed, result.first_touched)).encode()
    )
