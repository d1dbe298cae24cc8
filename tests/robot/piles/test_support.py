"""What rests on what, by the contacts of the settled world."""

from __future__ import annotations

import pytest

from ddenv.robot.piles import rehearsal
from ddenv.robot.simulation.template import Variants
from ddenv.world.model import Box, Model, Sphere, World
from ddenv.world.pose import Pose
from tests.robot.conftest import box_model, cube, link_of, model_of, wedge
from tests.robot.piles.test_sleep import SECTIONS

SHELF = box_model("shelf", "1 3 0.4 0 0 0", "1 1 0.8")


def ball(name: str, x: float, y: float, z: float) -> Model:
    return model_of(name, link_of("link", Sphere(0.2), Pose((x, y, z))))


def plank(name: str, x: float, y: float, z: float, length: float) -> Model:
    return model_of(name, link_of("link", Box((0.2, length, 0.05)), Pose((x, y, z)), mass=2.0))


@pytest.fixture
def simulator(husky, scenario_of):
    def make(world: World, **sections: object) -> Variants:
        return Variants(world, husky, scenario_of(**SECTIONS | sections))

    return make


def pairs(simulator: Variants, world: World, *protected: str) -> list[tuple[str, str]]:
    return simulator(world, protected=protected).supports(frozenset(world.elements(frozenset(protected))))


def test_each_model_rests_on_what_carries_it_after_it_has_fallen(simulator, world_of, add):
    world = add(
        world_of(SHELF),
        # It falls onto the shelf, and a second one onto the first; the third lands on the ground beside them.
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
    expected = [("cup", "shelf"), ("lid", "cup"), ("over", "under"), ("plank", "left"), ("plank", "right")]
    assert pairs(simulator, world) == expected
    # What always stays is skipped: what lies on it rests on what carries it.
    assert pairs(simulator, world, "cup")[0] == ("lid", "shelf")


def test_what_stands_beside_something_does_not_rest_on_it(simulator, world_of, add):
    world = add(world_of(box_model("wall", "1 3.35 0.5 0 0 0", "1 0.4 1")), ball("ball", 1.0, 2.95, 0.2))
    assert pairs(simulator, world) == []


@pytest.mark.rates
def test_what_rolls_onto_another_pile_rests_on_it(simulator, world_of, add):
    ramp = model_of("ramp", link_of("link", wedge(1.0, 1.0, 0.3), Pose((2.0, 6.0, 0.45)), mass=None))
    tray = [cube(f"tray_{side}", 0.6, 6.0 + side, 0.15) for side in (-1, 1)]
    bottom = model_of("bottom", link_of("link", Box((1.2, 2.5, 0.05)), Pose((0.75, 6.0, 0.33)), mass=20.0))
    stop = model_of("stop", link_of("link", Box((0.1, 2.5, 1.0)), Pose((0.2, 6.0, 0.9)), mass=None))
    world = add(world_of(), ball("ball", 2.3, 6.0, 0.85), ramp, *tray, bottom, stop)
    assert ("ball", "bottom") in pairs(simulator, world)


def test_a_pile_that_cannot_be_simulated_is_taken_as_it_starts(simulator, world_of, add, monkeypatch):
    def broken(*_: object) -> None:
        raise RuntimeError("it broke")

    monkeypatch.setattr(rehearsal.Simulator, "AdvanceTo", broken)
    assert pairs(simulator, add(world_of(SHELF), cube("cup", 1.0, 3.0, 0.9499))) == [("cup", "shelf")]
