"""Smaller plants for what is left of a world: the same bits as in the plant of all of it, and no plant twice."""

from __future__ import annotations

import pytest

from ddenv.robot.piles.rehearsal import Rehearsals
from ddenv.robot.simulation import template as variants
from ddenv.robot.simulation.template import Template, Variants
from ddenv.runs.subject import load_parts
from ddenv.world.load import SCENARIOS, load_scenario
from ddenv.world.model import Box, Model, World
from ddenv.world.pose import Pose
from ddenv.world.scenario import Scenario
from tests.robot.conftest import all_bits, cube, joint_of, link_of, model_of
from tests.tiers import slow

ALL = frozenset({"a", "b", "c", "d"})


@pytest.fixture
def built(monkeypatch) -> list[frozenset[str]]:
    """The moving models that are left out of each smaller plant which is built. Building is so cheap that it always pays."""
    monkeypatch.setattr(variants, "BUILD", 0.0)
    monkeypatch.setattr(variants, "PAIR", 0.0)
    reported: list[frozenset[str]] = []
    without = Template.without

    def tell(self: Template, names: frozenset[str]) -> Template:
        smaller = without(self, names)
        reported.append(ALL - smaller.names)
        return smaller

    monkeypatch.setattr(Template, "without", tell)
    return reported


@pytest.fixture
def cubes(world_of, add) -> World:
    """A cube in the robot's way, a pile of two that falls beside it, a cube far away."""
    return add(world_of(), cube("a", 1.2, 0), cube("b", 1, 3), cube("c", 1, 3.1, 0.5), cube("d", 5, -9))


@pytest.fixture
def scenario(scenario_of) -> Scenario:
    return scenario_of(failure={"timeout": 4.0}, goal={"x": 9, "y": 0})


def rubble() -> tuple[World, Model, Scenario]:
    scenario = load_scenario(SCENARIOS / "rubble.yaml")
    short = scenario.model_copy(update={"failure": scenario.failure.model_copy(update={"timeout": 6.0})})
    return *load_parts(scenario), short


@pytest.mark.rates
def test_parts_of_the_rubble_give_the_same_bits_as_in_the_plant_of_all_of_it_in_any_order():
    world, robot, scenario = rubble()
    names = world.elements()
    parts = [frozenset(part) for part in (names[:11], names[:6] + names[16:21], names[::6])]
    whole = Template(world, robot, scenario)
    expected = [all_bits(whole.run(part, seed=2)) for part in parts]
    touched = {name for *_, (_, first_touched) in expected for name in first_touched}
    # That plant does not know what takes part, so it has times of scans that nobody read, too.
    times = [sensed for *_, (sensed, _) in expected]
    assert touched & whole.removable
    smaller = Variants(world, robot, scenario)
    for number in (2, 0, 1, 2, 0):
        *run, (sensed, first_touched) = all_bits(smaller.run(parts[number], seed=2))
        assert sensed.items() <= times[number].items()
        assert (*run, (times[number], first_touched)) == expected[number]


@pytest.mark.rates
def test_what_a_pile_does_is_worked_out_once_for_all_plants(cubes, husky, scenario, built, monkeypatch):
    rehearsed = []
    simulate = Rehearsals._rows

    def tell(self: Rehearsals, pile: tuple, sleep: object) -> object:
        rehearsed.append([body.name for body in pile])
        return simulate(self, pile, sleep)

    monkeypatch.setattr(Rehearsals, "_rows", tell)
    smaller = Variants(cubes, husky, scenario)
    results = [smaller.run(keep, 1) for keep in (ALL - {"d"}, ALL - {"a"}, ALL, ALL - {"c"})]
    assert len(built) == 3
    assert sorted(rehearsed) == [["a"], ["b"], ["b", "c"], ["d"]]
    whole = Template(cubes, husky, scenario)
    assert all_bits(results[1]) == all_bits(whole.run(ALL - {"a"}, 1))


@pytest.mark.rates
def test_a_script_is_not_played_where_something_static_is_gone_of_a_model_that_was_left_out(
    world_of, add, husky, scenario
):
    """The frame of a door holds a cube up: with the door the cube falls less far."""
    frame = link_of("frame", Box((1.0, 1.0, 0.5)), Pose((1.0, 4.0, 0.25)), mass=5.0)
    leaf = link_of("leaf", Box((0.1, 0.1, 0.1)), Pose((1.0, 6.0, 1.0)))
    joints = (
        joint_of("fixed", "world", "frame", (1.0, 4.0, 0.0)),
        joint_of("revolute", "world", "leaf", (1.0, 6.0, 1.0)),
    )
    world = add(world_of(), model_of("a", frame, leaf, joints=joints), cube("b", 1.0, 4.0, 0.8))
    smaller = Variants(world, husky, scenario)
    for keep, height in (({"b"}, 0.15), ({"a", "b"}, 0.65), ({"b"}, 0.15)):
        rows = smaller.run(frozenset(keep), 1).motions["b"]
        assert rows[-1, 3] == pytest.approx(height, abs=0.005)


@pytest.mark.rates
def test_a_plant_is_built_once_while_it_is_asked_for(cubes, husky, scenario, built, monkeypatch):
    smaller = Variants(cubes, husky, scenario)
    for seed in range(3):
        smaller.run(ALL, seed)
        smaller.run(ALL - {"a"}, seed)
    assert built == [{"a"}]
    # Those that were used last are held.
    monkeypatch.setattr(variants, "MOST", 2)
    for left_out in ("b", "a", "c", "a", "b"):
        smaller.run(ALL - {left_out}, 1)
    assert built == [{"a"}, {"b"}, {"c"}, {"b"}]


TOO_DEAR = {"BUILD": 1.0, "PAIR": 1.0, "LARGEST": 3, "HELD": 0.0}


@pytest.mark.parametrize("limit", slow(pytest.mark.rates, TOO_DEAR, but=["LARGEST"]))
def test_no_plant_is_built_that_costs_more_than_it_saves(cubes, husky, scenario, built, monkeypatch, limit):
    monkeypatch.setattr(variants, limit, TOO_DEAR[limit])
    result = Variants(cubes, husky, scenario).run(ALL - {"d"}, 1)
    assert not built
    assert all_bits(result) == all_bits(Template(cubes, husky, scenario).run(ALL - {"d"}, 1))


def test_what_is_protected_stays(cubes, husky, scenario, built):
    protected = scenario.model_copy(update={"protected": ("a",)})
    result = Variants(cubes, husky, protected).run(frozenset({"b"}), 1)
    assert built == [{"c", "d"}]
    assert "a" in result.motions


def test_the_floor_is_that_of_the_whole_world(world_of, husky, scenario_of, box):
    """What is removed must not change when the robot has fallen out of the world."""
    cellar = box("a", "0 9 -20 0 0 0", "1 1 1", mass=1.0)
    world = world_of(box("table", "0 0 -0.5 0 0 0", "3 3 1"), cellar, ground=False)
    scenario = scenario_of(goal={"x": 50, "y": 0})
    table = frozenset({"table"})
    assert all_bits(Variants(world, husky, scenario).run(table, 1)) == all_bits(
        Template(world, husky, scenario).run(table, 1)
    )
