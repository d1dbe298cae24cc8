"""How a world comes to rest before the robot moves, and what the notes say of it."""

from __future__ import annotations

import pytest

from ddenv.robot.piles.rehearsal import Rehearsals
from ddenv.robot.settled import Settled, moved, notes_on
from ddenv.robot.simulation.template import Variants
from ddenv.world.model import Box, World
from ddenv.world.pose import Pose
from tests.robot.conftest import box_model, cube, link_of, model_of
from tests.robot.piles.test_sleep import SECTIONS

TABLE = box_model("table", "6 3 0.2 0 0 0", "1 1 0.4")


@pytest.fixture
def simulator(husky, scenario_of):
    return lambda world: Variants(world, husky, scenario_of(**SECTIONS))


def test_what_falls_and_what_rests_is_told_apart(world_of, add, simulator):
    world = add(world_of(TABLE), cube("rests", 6, 3, 0.55), cube("falls", 3, 3, 1.15), cube("lost", 300, 0, 0.15))
    settled = simulator(world).settled()
    ways = moved(world, settled)
    assert ways["rests"] < 0.005
    assert ways["falls"] == pytest.approx(1.0, abs=0.01)
    assert settled.places["falls"][0].position == pytest.approx((3, 3, 0.15), abs=0.02)
    assert (settled.restless, settled.broken) == ((), ())
    words = dict(notes_on(world, settled))
    assert words["unrest"].startswith(
        "the world is not at rest at the start: 1 model moves before the robot arrives, falls by 1.0"
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


def test_a_pile_that_breaks_is_named_and_the_robot_still_runs(world_of, add, simulator, monkeypatch):
    def breaks(*_):
        raise ValueError("not finite")

    monkeypatch.setattr(Rehearsals, "_rows", breaks)
    world = add(world_of(), cube("breaks", 4, 3, 0.15), cube("apart", 6, 3, 0.15))
    one = simulator(world)
    settled = one.settled()
    assert settled.broken == ("breaks", "apart")
    words = dict(notes_on(world, settled))["broken"]
    assert words == "2 models cannot be simulated: their motion diverges (breaks, apart)"
    assert one.run(frozenset(world.elements()), 0).outcome in ("pass", "failed")


def test_a_pile_that_never_rests_is_named(world_of, add, simulator):
    wheel = model_of("wheel", link_of("link", Box((0.3, 0.3, 0.3)), Pose((4, 3, 3.0))))
    ways = Settled(2.0, {"wheel": (Pose((4, 3, 2.0)),)}, restless=("wheel",), fallen=("lost",))
    assert (
        dict(notes_on(add(world_of(), wheel), ways))["restless"] == "1 model does not come to rest within 2.0 s (wheel)"
    )
    # Falls for longer than a pile is simulated.
    world: World = add(world_of(), cube("high", 4, 3, 3000.0))
    assert simulator(world).settled().restless == ("high",)


def test_without_ground_it_is_told_what_falls_out_of_the_world(world_of, add, simulator):
    world = add(world_of(box_model("floor", "0 0 -0.5 0 0 0", "20 20 1"), ground=False), cube("lost", 30, 0, 0.15))
    settled = simulator(world).settled()
    assert settled.fallen == ("lost",)
    assert dict(notes_on(world, settled)) == {"fallen": "1 model falls out of the world (lost)"}
