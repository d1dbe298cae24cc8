"""Who took part in a run: without the others, and with no tie broken, every bit of it stays the
same.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.piles.pile_simulator import PileCache
from ddenv.robot.result import RunResult
from ddenv.robot.sensing.lidar import Lidar
from ddenv.robot.simulation import taking_part
from ddenv.robot.simulation.plant_cache import Plant, PlantCache
from ddenv.world.model import Box, Model, Sphere
from ddenv.world.pose import Pose
from tests.robot.conftest import bits, cube, door, link_of, model_of, wedge
from tests.tiers import examples

SECTIONS = {"failure": {"timeout": 3.0}, "goal": {"x": 9, "y": 0}}
SEES = {"sensors": {"lidar": {"range": 6.0}}, "controller": {"use": "costmap"}}


def still(
    name: str, x: float, y: float, size: tuple[float, float, float], z: float | None = None
) -> Model:
    return model_of(
        name, link_of("link", Box(size), Pose((x, y, size[2] / 2 if z is None else z)), mass=None)
    )


@pytest.fixture(scope="session")
def flat(world_of, add, husky, scenario_of) -> Callable[..., PlantCache]:
    """A simulator of a flat world with these models."""

    def make(*models: Model, **sections: dict) -> PlantCache:
        return PlantCache(add(world_of(), *models), husky, scenario_of(**SECTIONS | sections))

    return make


def names(*models: Model) -> frozenset[str]:
    return frozenset(model.name for model in models)


def with_ties(world: PlantCache, models: frozenset[str], there: frozenset[str]) -> frozenset[str]:
    """`models` with all of `there` that they are tied to."""
    ties = world.ties(there)
    while new := frozenset(other for name, other in ties if name in models) - models:
        models |= new
    return models


def sensed(result: RunResult, names: frozenset[str]) -> dict[str, float]:
    return {name: at for name, at in result.first_sensed.items() if name in names}


def is_implied(
    world: PlantCache, there: frozenset[str], more: frozenset[str] = frozenset(), seed: int = 1
) -> bool:
    """Whether a run of `there` has the same bits with only what took part, `more` of it, and what
    these are tied to; and senses what took part at the same times.
    """
    whole = world.run(there, seed)
    keep = with_ties(world, (whole.took_part & there) | (more & there), there)
    part = world.run(keep, seed)
    took_part = whole.took_part & there
    return bits(part, *part.motions.keys() - keep) == bits(
        whole, *whole.motions.keys() - keep
    ) and sensed(part, took_part) == sensed(whole, took_part)


def test_every_bump_under_the_wheels_takes_part(flat):
    bumps = [
        still(f"bump_{number}", 0.6 + 0.17 * number, 0.3, (0.04, 0.3, 0.001)) for number in range(8)
    ]
    far = still("far", 2.0, 4.0, (0.5, 0.5, 0.5))
    world = flat(*bumps, far)
    assert world.run(names(*bumps, far), 1).took_part & names(*bumps, far) == names(*bumps)


def test_a_model_takes_part_if_a_beam_ends_on_it_that_somebody_reads(flat):
    # The first one is too near to be measured.
    walls = still("close", 0.55, 0.36, (0.05, 0.05, 2.0)), still("wall", 2.0, 3.0, (0.5, 0.5, 2.0))
    behind = still("behind", 2.6, 3.9, (0.3, 0.3, 2.0))
    everything = names(*walls, behind)
    lidar = {"range": 6.0, "nearest": 0.5}
    sees = flat(*walls, behind, sensors={"lidar": lidar}, controller={"use": "costmap"})
    assert names(*walls) <= sees.run(everything, 1).took_part
    blind = flat(*walls, behind, sensors={"lidar": lidar}, goal={"x": -9, "y": 0})
    assert not blind.run(everything, 1).took_part & {"wall", "behind"}


def test_what_took_part_is_sensed_at_the_same_time_whatever_else_hides_it(flat):
    """The robot runs into a wall, which a screen aside hides at first from a lidar that looks
    across. Nobody reads its scans.
    """
    wall, screen = (
        still("wall", 3.0, 0.0, (0.2, 0.4, 1.5)),
        still("screen", 1.2, 1.4, (0.1, 0.5, 1.5)),
    )
    world = flat(wall, screen, sensors={"lidar": {"y": 2.0}})
    result = world.run(names(wall, screen), 1)
    assert result.took_part & names(wall, screen) == names(wall)
    assert "screen" in result.first_sensed
    assert is_implied(world, names(wall, screen))


def test_what_the_map_cannot_hold_takes_no_part_although_beams_end_on_it(flat):
    near, far = still("near", 5.0, 2.0, (0.5, 0.5, 2.0)), still("far", 9.0, 6.0, (0.5, 0.5, 2.0))
    beyond = still("beyond", 12.0, 8.0, (3.0, 3.0, 4.0))
    world = flat(
        near, far, beyond, sensors={"lidar": {"range": 20.0}}, controller={"use": "costmap"}
    )
    result = world.run(names(near, far, beyond), 1)
    assert {"far", "beyond"} <= set(result.first_sensed)
    assert result.took_part & names(near, far, beyond) == {"near"}
    assert is_implied(world, names(near, far, beyond))


def test_what_stands_on_a_shelf_is_tied_to_it(flat):
    shelf, ball = still("shelf", 2.0, 3.0, (0.4, 0.4, 0.5)), cube("ball", 2.0, 3.0, 0.65)
    world = flat(shelf, ball)
    assert world.ties(frozenset({"shelf", "ball"})) == [("ball", "shelf")]
    assert not world.run(frozenset({"shelf", "ball"}), 1).took_part & {"shelf", "ball"}
    # Without its shelf it moves otherwise than in the whole world.
    assert "ball" in world.run(frozenset({"ball"}), 1).took_part


def test_what_an_always_kept_model_is_tied_to_takes_part(world_of, add, husky, scenario_of):
    shelf, ball = still("shelf", 2.0, 3.0, (0.4, 0.4, 0.5)), cube("ball", 2.0, 3.0, 0.65)
    scenario = scenario_of(**SECTIONS, protected=["ball"])
    assert (
        "shelf"
        in PlantCache(add(world_of(), shelf, ball), husky, scenario).run(names(shelf), 1).took_part
    )


def test_what_lies_beside_what_is_pushed_sleeps_on(flat):
    # A row across the robot's path, in which each cube nearly touches the next.
    row = [cube(f"cube_{number}", 1.5, 0.31 * number, 0.15) for number in range(7)]
    result = flat(*row).run(names(*row), 1)
    assert "cube_0" in result.motions
    assert "cube_6" not in result.took_part


def test_what_wakes_another_model_takes_part_although_it_sleeps_on(flat):
    # A ball rolls slowly past a cube, 9.5 cm away: near enough to be simulated from there on.
    hill = model_of(
        "hill", link_of("link", wedge(1.0, 1.0, 0.03), Pose((2.0, 3.0, 0.015)), mass=None)
    )
    ball = model_of("ball", link_of("link", Sphere(0.2), Pose((2.4, 3.4, 0.23))))
    passed = cube("passed", 1.9, 3.845, 0.15)
    result = flat(hill, ball, passed).run(names(hill, ball, passed), 1)
    # Only what moves has a motion.
    assert result.motions.keys() == {"ball"}
    assert {"ball", "passed"} <= result.took_part


def test_nothing_is_claimed_where_it_is_unknown(flat):
    assert (
        flat(cube("own", 2, 3, 0.15, self_collide=True)).run(frozenset({"own"}), 1).took_part
        is None
    )
    assert flat(cube("own", 2, 3, 0.15, self_collide=True)).ties(frozenset({"own"})) is None
    own = {"controller": {"use": "ddenv.robot.navigation.navigate:Straight"}}
    assert flat(cube("other", 2, 3, 0.15), **own).run(frozenset({"other"}), 1).took_part is None


# Near the robot's path or not.
PLACES = st.tuples(st.floats(0.9, 3.0), st.floats(-4.0, 4.0))
KINDS = {
    "tile": lambda name, x, y: [still(name, x, y, (0.5, 0.4, 0.02))],
    "wall": lambda name, x, y: [still(name, x, y, (0.2, 0.6, 1.0))],
    "door": lambda name, x, y: [door(name, x, y, damping=0.5)],
    "pile": lambda name, x, y: [
        cube(f"{name}_low", x, y, 0.15),
        cube(f"{name}_high", x + 0.1, y, 0.46),
    ],
    "shelf": lambda name, x, y: [
        still(name, x, y, (0.4, 0.4, 0.4)),
        cube(f"{name}_cube", x, y, 0.55),
    ],
    "ball": lambda name, x, y: [
        model_of(f"{name}_ball", link_of("link", Sphere(0.2), Pose((x, y, 0.8)), 1.0))
    ],
}
WORLDS = st.lists(st.tuples(st.sampled_from(sorted(KINDS)), PLACES), min_size=3, max_size=8)


@examples(0.2)
@given(placed=WORLDS, sees=st.booleans(), data=st.data())
def test_any_part_with_all_that_took_part_gives_the_same_bits(flat, placed, sees, data):
    models = [
        one
        for number, (kind, place) in enumerate(placed)
        for one in KINDS[kind](f"{kind}_{number}", *place)
    ]
    everything = sorted(names(*models))
    world = flat(*models, **(SEES if sees else {}), failure={"timeout": 2.0})
    some = st.lists(st.sampled_from(everything)).map(frozenset)
    assert is_implied(world, names(*models), data.draw(some, "more"))
    # Also where a removal has changed how piles move.
    there = names(*models) - data.draw(some, "removed")
    assert is_implied(world, there, data.draw(some, "more"))


@pytest.mark.rates
def test_the_audit_finds_each_kind_of_participant_that_is_forgotten(flat, monkeypatch):
    bump, wall = (
        still("bump", 0.8, 0.3, (0.04, 0.3, 0.01)),
        still("wall", 1.8, 0.5, (0.3, 0.6, 1.0)),
    )
    crate, stop = cube("crate", 1.2, 0.0, 0.15), still("stop", 2.2, 0.0, (0.1, 0.3, 0.05))
    shelf, ball = (
        still("shelf", 1.5, -0.25, (0.3, 0.3, 0.02), z=0.9),
        cube("ball", 1.5, -0.25, 1.07),
    )
    table = still("table", 1.5, 3.0, (0.6, 0.6, 0.3))
    high = still("high", 1.5, 3.0, (0.3, 0.3, 0.02), z=0.9), cube("lamp", 1.5, 3.0, 1.07), table
    worlds = {
        "robot": flat(bump),
        "models": flat(crate, stop),
        "asleep": flat(crate, cube("next", 1.65, 0.0, 0.15)),
        "lidar": flat(wall, **SEES),
        "ties": flat(shelf, ball),
        "carriers": flat(shelf, ball, protected=["ball"]),
        "unusual": flat(*high),
    }
    everything = {
        "robot": names(bump),
        "models": names(crate, stop),
        "asleep": frozenset({"crate", "next"}),
        "lidar": names(wall),
        "ties": names(shelf, ball),
        "carriers": names(shelf),
        # Without its shelf the lamp falls onto the table.
        "unusual": frozenset({"lamp", "table"}),
    }
    more = {"ties": frozenset({"ball"}), "unusual": frozenset({"lamp"})}
    for kind, world in worlds.items():
        assert is_implied(world, everything[kind], more.get(kind, frozenset())), kind
    monkeypatch.setattr(Plant, "_carriers", lambda *_: frozenset())
    assert not is_implied(worlds["carriers"], everything["carriers"])
    monkeypatch.setattr(PileCache, "unusual", lambda *_: frozenset())
    assert not is_implied(worlds["unusual"], everything["unusual"], more["unusual"])
    monkeypatch.setattr(taking_part.Reached, "_look_around_robot", lambda *_: None)
    assert not is_implied(worlds["robot"], everything["robot"])
    monkeypatch.setattr(taking_part.Reached, "_look_around_models", lambda *_: None)
    assert not is_implied(worlds["models"], everything["models"])
    monkeypatch.setattr(Lidar, "took_part", {})
    assert not is_implied(worlds["lidar"], everything["lidar"])
    monkeypatch.setattr("ddenv.robot.piles.sleep.Sleep.took_part", frozenset())
    assert not is_implied(worlds["asleep"], everything["asleep"])
    monkeypatch.setattr(PlantCache, "ties", lambda *_: [])
    assert not is_implied(worlds["ties"], everything["ties"], more["ties"])
