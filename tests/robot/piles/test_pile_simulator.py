"""Rehearsals: scripts of piles, how a world comes to rest before the robot moves, and which models
rest on which.
"""

from __future__ import annotations

import pytest

from ddenv.robot.piles import pile_simulator
from ddenv.robot.piles.pile_simulator import PileSimulator
from ddenv.robot.settled import Settled, moved, notes_on
from ddenv.robot.simulation.plant_cache import Plant, PlantCache
from ddenv.world.model import Box, Model, Sphere, World
from ddenv.world.pose import Pose
from tests.robot.conftest import bits, box_model, cube, link_of, model_of, run, wedge
from tests.robot.piles.test_sleep import SECTIONS
from tests.tiers import slow


@pytest.mark.rates
@pytest.mark.parametrize("memory", slow(pytest.mark.examples, [0.0, 3e5], but=[3e5]))
def test_a_small_memory_changes_no_bit(world_of, add, husky, scenario_of, monkeypatch, memory):
    world = add(
        world_of(),
        cube("a", 1.2, 0.0, 0.15),
        cube("b", 1, 3, 0.5),
        cube("c", 1.1, 3.1, 0.9),
        cube("d", 5, -9, 0.3),
    )
    parts = ["abcd", "bc", "abd", "cd", "abcd"]
    large = Plant(world, husky, scenario_of(**SECTIONS))
    expected = [bits(run(large, *part)) for part in parts]
    rehearsed = []
    simulate = PileSimulator._rows
    monkeypatch.setattr(
        PileSimulator, "_rows", lambda self, *pile: rehearsed.append(pile) or simulate(self, *pile)
    )
    monkeypatch.setattr(pile_simulator, "MEMORY", memory)
    small = Plant(world, husky, scenario_of(**SECTIONS))
    assert [bits(run(small, *part)) for part in parts] == expected
    # Of the piles b c, d, b, c one at least was made twice.
    assert len(rehearsed) > 4


TABLE = box_model("table", "6 3 0.2 0 0 0", "1 1 0.4")


def test_what_falls_and_what_rests_is_told_apart(world_of, add, simulator):
    world = add(
        world_of(TABLE),
        cube("rests", 6, 3, 0.55),
        cube("falls", 3, 3, 1.15),
        cube("lost", 300, 0, 0.15),
    )
    settled = simulator(world).settled()
    ways = moved(world, settled)
    assert ways["rests"] < 0.005
    assert ways["falls"] == pytest.approx(1.0, abs=0.01)
    assert settled.places["falls"][0].position == pytest.approx((3, 3, 0.15), abs=0.02)
    assert (settled.restless, settled.broken) == ((), ())
    words = dict(notes_on(world, settled))
    assert words["unrest"].startswith(
        "the world is not at rest at the start: 1 model moves before the robot arrives, falls by "
        "1.0"
    )


def test_it_is_the_same_whatever_ran_before_and_changes_no_run(world_of, add, simulator):
    world = add(world_of(TABLE), cube("falls", 3, 3, 1.15), cube("near", 2, 0, 0.5))
    fresh, used = simulator(world), simulator(world)
    everything = frozenset(world.elements())
    before = used.run(everything, 0)
    assert used.settled() == fresh.settled()
    assert used.supports(everything) == fresh.supports(everything)
    again = used.run(everything, 0)
    assert (again.trajectory == before.trajectory).all()


def test_a_pile_that_breaks_is_named_and_the_robot_still_runs(
    world_of, add, simulator, monkeypatch
):
    def breaks(*_):
        raise ValueError("not finite")

    monkeypatch.setattr(PileSimulator, "_rows", breaks)
    world = add(world_of(), cube("breaks", 4, 3, 0.15), cube("apart", 6, 3, 0.15))
    one = simulator(world)
    settled = one.settled()
    assert settled.broken == ("breaks", "apart")
    words = dict(notes_on(world, settled))["broken"]
    assert words == "2 models cannot be simulated: their motion diverges (breaks, apart)"
    assert one.run(frozenset(world.elements()), 0).outcome in ("pass", "failed")


def test_a_pile_that_never_rests_is_named(world_of, add, simulator):
    wheel = model_of("wheel", link_of("link", Box((0.3, 0.3, 0.3)), Pose((4, 3, 3.0))))
    ways = Settled(
        seconds=2.0, places={"wheel": (Pose((4, 3, 2.0)),)}, restless=("wheel",), fallen=("lost",)
    )
    assert (
        dict(notes_on(add(world_of(), wheel), ways))["restless"]
        == "1 model does not come to rest within 2.0 s (wheel)"
    )
    # Falls for longer than a pile is simulated.
    world: World = add(world_of(), cube("high", 4, 3, 3000.0))
    assert simulator(world).settled().restless == ("high",)


def test_without_ground_it_is_told_what_falls_out_of_the_world(world_of, add, simulator):
    world = add(
        world_of(box_model("floor", "0 0 -0.5 0 0 0", "20 20 1"), ground=False),
        cube("lost", 30, 0, 0.15),
    )
    settled = simulator(world).settled()
    assert settled.fallen == ("lost",)
    assert dict(notes_on(world, settled)) == {"fallen": "1 model falls out of the world (lost)"}


SHELF = box_model("shelf", "1 3 0.4 0 0 0", "1 1 0.8")


def ball(name: str, x: float, y: float, z: float) -> Model:
    return model_of(name, link_of("link", Sphere(0.2), Pose((x, y, z))))


def plank(name: str, x: float, y: float, z: float, length: float) -> Model:
    return model_of(name, link_of("link", Box((0.2, length, 0.05)), Pose((x, y, z)), mass=2.0))


@pytest.fixture
def simulator(husky, scenario_of):
    def make(world: World, **sections: object) -> PlantCache:
        return PlantCache(world, husky, scenario_of(**SECTIONS | sections))

    return make


def pairs(simulator: PlantCache, world: World, *protected: str) -> list[tuple[str, str]]:
    return simulator(world, protected=protected).supports(
        frozenset(world.elements(frozenset(protected)))
    )


def test_each_model_rests_on_what_carries_it_after_it_has_fallen(simulator, world_of, add):
    world = add(
        world_of(SHELF),
        # It falls onto the shelf, and a second one onto the first; the third lands on the ground
        # beside them.
        cube("cup", 1.0, 3.0, 1.2),
        cube("lid", 1.0, 3.05, 1.7),
        cube("dropped", 1.0, 4.2, 1.0),
        # In the robot's start: how it stands without a robot.
        cube("under", 0.3, 0.0, 0.15),
        cube("over", 0.3, 0.0, 0.45),
        # A plank across two blocks.
        cube("left", 4.0, 3.0, 0.15),
        cube("right", 4.0, 4.0, 0.15),
        plank("plank", 4.0, 3.5, 0.33, 1.3),
    )
    expected = [
        ("cup", "shelf"),
        ("lid", "cup"),
        ("over", "under"),
        ("plank", "left"),
        ("plank", "right"),
    ]
    assert pairs(simulator, world) == expected
    # What always stays is skipped: what lies on it rests on what carries it.
    assert pairs(simulator, world, "cup")[0] == ("lid", "shelf")


def test_what_stands_beside_something_does_not_rest_on_it(simulator, world_of, add):
    world = add(
        world_of(box_model("wall", "1 3.35 0.5 0 0 0", "1 0.4 1")), ball("ball", 1.0, 2.95, 0.2)
    )
    assert pairs(simulator, world) == []


@pytest.mark.rates
def test_what_rolls_onto_another_pile_rests_on_it(simulator, world_of, add):
    ramp = model_of(
        "ramp", link_of("link", wedge(1.0, 1.0, 0.3), Pose((2.0, 6.0, 0.45)), mass=None)
    )
    tray = [cube(f"tray_{side}", 0.6, 6.0 + side, 0.15) for side in (-1, 1)]
    bottom = model_of(
        "bottom", link_of("link", Box((1.2, 2.5, 0.05)), Pose((0.75, 6.0, 0.33)), mass=20.0)
    )
    stop = model_of("stop", link_of("link", Box((0.1, 2.5, 1.0)), Pose((0.2, 6.0, 0.9)), mass=None))
    world = add(world_of(), ball("ball", 2.3, 6.0, 0.85), ramp, *tray, bottom, stop)
    assert ("ball", "bottom") in pairs(simulator, world)


def test_a_pile_that_cannot_be_simulated_is_taken_as_it_starts(
    simulator, world_of, add, monkeypatch
):
    def broken(*_: object) -> None:
        raise RuntimeError("it broke")

    monkeypatch.setattr(pile_simulator.Simulator, "AdvanceTo", broken)
    assert pairs(simulator, add(world_of(SHELF), cube("cup", 1.0, 3.0, 0.9499))) == [
        ("cup", "shelf")
    ]
