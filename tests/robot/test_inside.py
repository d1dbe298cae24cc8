"""Runs among the parts of a model have the bits of runs among whole models."""

import random

import pytest

from ddenv.robot.simulation.plant_cache import PlantCache
from ddenv.runs.experiment import load_parts, scenario_for_world, with_options
from ddenv.world.scenario import Reading

GROUND = (
    "<model name='ground'><static>true</static><link name='l'><collision "
    "name='c'><geometry><plane><normal>0 0 1</normal>"
    "<size>50 50</size></plane></geometry></collision></link></model>"
)


def box(name, x, y):
    return (
        f"<collision name='{name}'><pose>{x} {y} 0.4 0 0 0</pose><geometry><box><size>0.4 0.3 "
        "0.8</size></box></geometry>"
        "</collision>"
    )


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """A yard of one model, opened: posts in the robot's way, and a row of others behind it."""
    posts = box("left", 1.5, 0.45) + box("right", 1.5, -0.45)
    row = "".join(box(f"far_{number}", -6 - number, 4) for number in range(6))
    yard = (
        f"<model name='yard'><static>true</static><link name='posts'>{posts}</link><link "
        f"name='row'>{row}</link></model>"
    )
    path = tmp_path_factory.mktemp("yard") / "yard.sdf"
    path.write_text(f"<sdf version='1.9'><world name='w'>{GROUND}{yard}</world></sdf>")
    scenario = with_options(scenario_for_world(path, (0, 0, 0.15, 0), (6, 0)), timeout=5.0)
    return with_options(scenario, reading=Reading(inside=True))


@pytest.fixture(scope="module")
def simulators(opened):
    """Of the whole yard, and of its parts."""
    whole = with_options(opened, reading=Reading())
    return PlantCache(*load_parts(whole), whole), PlantCache(*load_parts(opened), opened)


PARTS = frozenset(
    {"yard/posts/left", "yard/posts/right", *(f"yard/row/far_{number}" for number in range(6))}
)


def bits(result):
    return result.outcome, result.failure, result.trajectory.tobytes()


def test_all_parts_are_the_whole_model(simulators):
    whole, parts = simulators
    assert bits(whole.run(frozenset({"yard"}), 1)) == bits(parts.run(PARTS, 1))


def test_parts_that_cannot_have_affected_a_run_change_no_bit_of_it(simulators):
    _, parts = simulators
    made = parts.run(PARTS, 2)
    others = sorted(PARTS - made.took_part)
    assert others
    chance = random.Random(0)
    for _ in range(3):
        gone = frozenset(chance.sample(others, chance.randint(1, len(others))))
        assert bits(parts.run(PARTS - gone, 2)) == bits(made)


def test_a_protected_model_stays_with_all_its_parts(simulators, opened):
    _, parts = simulators
    protected = opened.model_copy(update={"protected": ("yard",)})
    assert bits(PlantCache(*load_parts(opened), protected).run(frozenset(), 1)) == bits(
        parts.run(PARTS, 1)
    )
