"""Sleeping: what nobody comes near lies still, costs nothing and leaves no trace; what is met wakes
in time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ddenv.robot.drake.plant import MANY
from ddenv.robot.piles import pile_simulator
from ddenv.robot.piles.sleep import BEARS, BORE, GRAVITY, Loads
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.world.model import Box, Model, Sphere
from ddenv.world.pose import Pose
from ddenv.world.whole import FALL
from tests.robot.conftest import (
    bits,
    box_model,
    cube,
    door,
    joint_of,
    link_of,
    model_of,
    run,
    wedge,
)
from tests.tiers import slow

BOARD = "0.9 0.09 0.04"
SECTIONS = {"failure": {"timeout": 4.0}, "goal": {"x": 9, "y": 0}}


def flap(name: str, x: float, y: float, lower: float = -0.3, damping: float = 0.3) -> Model:
    """A plate on a horizontal hinge, pulled down by its weight to its limit."""
    plate = link_of("plate", Box((0.4, 0.3, 0.02)), Pose((x + 0.25, y, 1.0)))
    hinge = joint_of(
        "revolute",
        "world",
        "plate",
        (x, y, 1.0),
        (0.0, -1.0, 0.0),
        lower=lower,
        upper=1.0,
        damping=damping,
    )
    return model_of(name, plate, joints=(hinge,))


def tile(name: str, x: float, y: float, mass: float = 20.0) -> Model:
    """A plate of many boxes side by side, 0.9 m wide and 0.2 m high."""
    link = link_of("link", Box((0.3, 0.3, 0.2)), Pose((x, y, 0.1)), mass)
    shapes = [
        replace(link.collisions[0], pose=Pose((x + 0.3 * column, y + 0.3 * row, 0.1)))
        for column in (-1, 0, 1)
        for row in (-1, 0, 1)
    ]
    assert len(shapes) > MANY
    return model_of(name, replace(link, collisions=tuple(shapes)))


def slope(name: str, x: float, y: float) -> Model:
    """A static ramp that rises along x, 0.3 m in 1 m."""
    return model_of(name, link_of("link", wedge(1.0, 1.0, 0.3), Pose((x, y, 0.15)), mass=None))


FAR = {
    "at rest": (cube("far", 2.0, 6.0, 0.15),),
    "in the air": (cube("far", 2.0, 6.0, 1.5),),
    "rolling": (
        model_of("far", link_of("link", Sphere(0.2), Pose((2.2, 6.0, 0.5)))),
        slope("hill", 2.0, 6.0),
    ),
    "swinging": (flap("far", 2.0, 6.0, lower=-np.inf, damping=0.0),),
    "at its limit": (flap("far", 2.0, 6.0),),
    "in two parts": (
        model_of(
            "far",
            link_of("a", Box((0.2, 0.2, 0.2)), Pose((2.0, 6.0, 0.8))),
            link_of("b", Sphere(0.2), Pose((2.0, 7.0, 0.5))),
        ),
    ),
    "of many shapes": (tile("far", 2.0, 6.0),),
    "out of the world": (cube("far", 2.0, 6.0, -3.0),),
    "colliding with itself": (
        model_of(
            "far",
            link_of("a", Box((0.3, 0.3, 0.3)), Pose((2.0, 6.0, 0.44))),
            link_of("b", Box((0.3, 0.3, 0.3)), Pose((2.0, 6.0, 0.149))),
            self_collide=True,
        ),
    ),
}


@pytest.fixture
def template(world_of, add, husky, scenario_of):
    """A template of a flat world with these models."""

    def make(*models: Model, **sections: dict) -> Plant:
        return Plant(add(world_of(), *models), husky, scenario_of(**SECTIONS | sections))

    return make


@pytest.mark.parametrize("far", slow(pytest.mark.rates, FAR, but=["in the air"]))
def test_a_model_that_takes_no_part_leaves_no_trace_when_it_is_removed(template, far):
    near, far = (cube("near", 1.2, 0.0, 0.15), cube("beside", 1.5, 1.5, 0.4)), FAR[far]
    names = {model.name for model in (*near, *far)}
    both = template(*near, *far)
    with_it, without = run(both, *names), run(both, *names - {"far"})
    assert "near" in with_it.motions
    assert bits(with_it, "far") == bits(without)
    # Neither does it matter whether it was ever built, nor which of them came first.
    assert bits(run(template(*far, *near), *names)) == bits(with_it)
    assert bits(run(template(*near, *far[1:]), *names - {"far"})) == bits(without)


@pytest.mark.rates
def test_what_moves_far_away_does_not_decide_whether_the_robot_wakes_what_it_passes(template):
    """What touches itself has no twin, and wakes before the robot can touch it."""
    links = (
        link_of(name, Box((0.3, 0.3, 0.3)), Pose((1.2, 0.55, z)))
        for name, z in (("a", 0.15), ("b", 0.46))
    )
    near = replace(model_of("near", *links), self_collide=True)
    both = template(near, *FAR["swinging"], failure={"timeout": 3.0})
    assert bits(run(both, "near", "far"), "far") == bits(run(both, "near"))


def test_what_fell_to_rest_does_not_creep_at_all(template):
    pile = template(
        cube("low", 1.0, 3.0, 0.2), cube("high", 1.0, 3.1, 0.6), failure={"timeout": 10.0}
    )
    motions = run(pile, "low", "high").motions
    for name, height in (("low", 0.15), ("high", 0.45)):
        rows = motions[name][20:, 1:]
        assert rows[0, 2] == pytest.approx(height, abs=0.005)
        assert (rows == rows[0]).all()


@pytest.mark.rates
def test_boards_that_lie_across_each_other_come_to_rest(template, world_of, husky, scenario_of):
    boards = [
        box_model("left", "1 3 0.02 0 0 0", BOARD, mass=2.0),
        box_model("right", "1 3.4 0.02 0 0 0", BOARD, mass=2.0),
        box_model("across", "1 3.2 0.07 0 0 1.57", BOARD, mass=2.0),
    ]
    template = Plant(world_of(*boards), husky, scenario_of(**SECTIONS))
    rows = run(template, "left", "right", "across").motions["across"][20:, 1:]
    assert rows[0, 2] == pytest.approx(0.06, abs=0.005)
    assert (rows == rows[0]).all()


def test_the_robot_pushes_what_was_asleep_as_if_it_had_been_awake(template):
    crate = template(cube("crate", 2.0, 0.0, 0.15))
    slept = run(crate, "crate")
    crate._sleeping = False
    awake = run(crate, "crate")
    assert slept.motions["crate"][-1, 1] > 3.0
    assert slept.trajectory[:, 1:4] == pytest.approx(awake.trajectory[:, 1:4], abs=0.01)
    assert slept.motions["crate"][:, 1:4] == pytest.approx(awake.motions["crate"][:, 1:4], abs=0.03)


@pytest.mark.rates
def test_models_of_many_and_of_few_shapes_rest_on_each_other_and_are_pushed(template):
    # At rest the cube lies a little within the tile. Drake must not look for contacts of one twin
    # with another.
    pile = template(
        tile("tile", 2.0, 0.0), cube("cube", 2.0, 0.0, 0.349), tile("beside", 2.0, 0.905)
    )
    slept = run(pile, "tile", "cube", "beside")
    pile._sleeping = False
    awake = run(pile, "tile", "cube", "beside")
    assert slept.motions["tile"][-1, 1] > 2.5
    for name in ("tile", "cube"):
        assert slept.motions[name][:, 1:4] == pytest.approx(awake.motions[name][:, 1:4], abs=0.05)


def test_a_pile_wakes_as_one(template):
    tower = [cube(f"storey_{number}", 2.0, 0.0, 0.15 + 0.3 * number) for number in range(4)]
    result = run(template(*tower), *(model.name for model in tower))
    assert set(result.motions) == {model.name for model in tower}
    # It pushes the lowest away, and none of the others stays up in the air.
    assert result.motions["storey_2"][-1, 3] < 0.6
    assert result.motions["storey_3"][-1, 3] < 0.3


@pytest.mark.rates
def test_what_the_robot_sets_in_motion_wakes_what_it_comes_near(template):
    row = [
        model_of(
            f"domino_{number}",
            link_of("link", Box((0.1, 0.5, 0.9)), Pose((1.5 + 0.5 * number, 0.0, 0.45)), 2.0),
        )
        for number in range(7)
    ]
    result = run(
        template(*row, controller={"speed": 0.4}, failure={"timeout": 8.0}),
        *(model.name for model in row),
    )
    last = result.motions["domino_6"]
    fallen = int((last[:, 3] < 0.4).argmax())
    # The last one falls when the robot, which reaches 0.5 m ahead of its frame, is still far away
    # from it.
    assert fallen > 0
    assert result.trajectory[fallen, 1] + 0.5 < last[0, 1] - 1.0


@pytest.mark.rates
def test_what_moves_by_itself_wakes_what_it_comes_near(template):
    ball = model_of("ball", link_of("link", Sphere(0.2), Pose((2.3, 6.0, 0.55)), 5.0))
    # The slope rises along x: the ball rolls back along it, onto a box that is long at rest.
    world = template(ball, slope("hill", 2.0, 6.0), cube("box", -0.5, 6.0, 0.15))
    result = run(world, "ball", "hill", "box")
    assert result.motions["box"][-1, 1] < -0.51
    # Without the slope nothing rolls, although the ball's way was rehearsed with it.
    assert "box" not in run(world, "ball", "box").motions
    assert bits(run(world, "ball", "hill", "box")) == bits(result)


@pytest.mark.rates
def test_what_is_asleep_or_removed_stands_on_its_joint_like_a_pencil_on_its_tip(template):
    pole = link_of("pole", Box((0.1, 0.1, 0.4)), Pose((1.0, 3.0, 1.5)))
    hinge = joint_of("revolute", "world", "pole", (1.0, 3.0, 1.2), (0.0, 1.0, 0.0))
    ball = joint_of("ball", "pole", "head", (1.0, 3.0, 1.8))
    head = link_of("head", Box((0.1, 0.1, 0.2)), Pose((1.1, 3.0, 2.0)))
    pencil = template(
        model_of("pencil", pole, head, joints=(hinge, ball)),
        failure={"timeout": 12.0},
        goal={"x": 90, "y": 0},
    )
    assert run(pencil).outcome == "failed"
    entries = pencil.context.hold.entries(pencil.context.built.moving.values())
    assert (pencil.context.hold.state() == pencil.context.hold.start)[entries].all()


def test_a_door_at_rest_opens_when_the_robot_runs_into_it(template):
    world = template(door("door", 2.0, 0.0, lower=-2.0, upper=2.0, damping=0.5))
    result = run(world, "door")
    assert result.trajectory[-1, 1] > 2.3
    assert "door" in result.motions
    # One that is locked stops it.
    locked = template(door("door", 2.0, 0.0, lower=-0.01, upper=0.01))
    assert run(locked, "door").trajectory[:, 1].max() < 1.7


def test_a_carrier_that_is_removed_lets_fall_what_slept_on_it(
    template, world_of, add, husky, scenario_of
):
    table = box_model("table", "1 3 0.4 0 0 0", "1 1 0.8")
    world = add(world_of(table), cube("cup", 1.0, 3.0, 0.95))
    template = Plant(world, husky, scenario_of(**SECTIONS))
    assert run(template, "table", "cup").motions == {}
    assert run(template, "cup").motions["cup"][-1, 3] == pytest.approx(0.15, abs=0.005)
    assert run(template, "table", "cup").motions == {}


def test_what_falls_out_of_the_world_is_left_alone(add, world_of, husky, scenario_of):
    table = box_model("table", "0 0 -0.5 0 0 0", "30 5 1")
    world = add(
        world_of(table, ground=False), cube("lost", 0.0, 4.0, 0.5), cube("pushed", 1.2, 2.45, 0.15)
    )
    template = Plant(world, husky, scenario_of(**SECTIONS))
    rows = run(template, "table", "lost", "pushed").motions["lost"]
    assert -1.0 - FALL - 5.0 < rows[-1, 3] < -1.0 - FALL
    assert (rows[-10:, 1:] == rows[-1, 1:]).all()


@pytest.mark.rates
def test_what_moves_longer_than_it_could_be_rehearsed_goes_on_moving(template, monkeypatch):
    swing = flap("flap", 1.0, -3.0, lower=-np.inf, damping=0.0)
    whole = run(template(swing), "flap").motions["flap"]
    monkeypatch.setattr(pile_simulator, "BUDGET", 0.0)
    rest = run(template(swing), "flap").motions["flap"]
    rehearsed = int(pile_simulator.LEAST / 0.1)
    assert rest[:rehearsed].tobytes() == whole[:rehearsed].tobytes()
    assert rest == pytest.approx(whole, abs=1e-4)


def test_what_cannot_be_rehearsed_is_simulated_with_the_robot(template, monkeypatch):
    class Broken:
        def __init__(self, *_: object) -> None: ...

        def AdvanceTo(self, _: float) -> None:
            raise RuntimeError("it broke")

    monkeypatch.setattr(pile_simulator, "Simulator", Broken)
    rows = run(template(cube("thing", 1.0, 3.0, 1.0)), "thing").motions["thing"]
    assert rows[-1, 3] == pytest.approx(0.15, abs=0.005)


@pytest.mark.rates
def test_links_of_a_model_meet_only_if_it_says_so(template):
    pair = model_of(
        "pair",
        link_of("a", Box((0.3, 0.3, 0.3)), Pose((1.0, 3.1, 0.5))),
        link_of("b", Box((0.3, 0.3, 0.3)), Pose((1.0, 3.0, 0.15))),
    )
    for self_collide, height in ((False, 0.15), (True, 0.45)):
        pairs = template(replace(pair, self_collide=self_collide))
        for _ in range(2):
            assert run(pairs, "pair").motions["pair"][-1, 3] == pytest.approx(height, abs=0.005)
            run(pairs)


@pytest.mark.rates
def test_links_that_are_met_one_after_the_other_stay_apart_from_their_own_model_only(template):
    """Waking and falling asleep must not let a model's own links meet."""
    pair = model_of(
        "pair",
        link_of("a", Box((0.3, 0.3, 0.3)), Pose((2.0, 0.0, 0.15))),
        link_of("b", Box((0.3, 0.3, 0.3)), Pose((2.0, 0.0, 0.15))),
    )
    rows = run(template(pair, cube("other", 2.6, 0.0, 0.15)), "pair", "other")
    # Two cubes in the same place would fly apart; so they are pushed, and push the other one.
    assert rows.motions["pair"][:, 3].max() < 0.3
    assert rows.motions["other"][-1, 1] > 3.0


def test_without_gravity_a_model_floats_until_it_is_pushed(template):
    floating = (
        replace(cube("far", 1.0, 3.0, 1.0), gravity=False),
        replace(cube("near", 1.5, 0.0, 0.25), gravity=False),
    )
    result = run(template(*floating), "far", "near")
    assert set(result.motions) == {"near"}
    assert result.motions["near"][-1, 1] > 2.0


MASS = 2.0
WEIGHT = MASS * GRAVITY
YES, NO = np.array([True]), np.array([False])


class Pressed(Loads):
    """One model on which the robot presses with `force`, N."""

    force = 0.0

    def _forces(self):
        return np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, -self.force]]])

    def lie_down(self) -> None:
        self.note(NO, YES)
        self.note(YES, NO)


@pytest.fixture
def loads(world_of, add, husky, scenario_of):
    board = model_of("board", link_of("link", Box((0.9, 0.1, 0.04)), Pose((3.0, 0.0, 0.02)), MASS))
    context = Plant(add(world_of(), board), husky, scenario_of()).context
    loads = Pressed(context, list(context.built.moving.values()))
    loads.lie_down()
    return loads


def wakes(loads: Pressed, force: float) -> bool:
    loads.force = force
    return bool(loads.changed(seconds=1.0)[0])


def test_a_model_bears_a_few_times_its_weight(loads):
    assert not wakes(loads, 0.9 * BEARS * WEIGHT)
    assert wakes(loads, 1.1 * BEARS * WEIGHT)


@pytest.mark.parametrize("stayed", [True, False])
def test_a_change_that_moved_nothing_wakes_the_model_no_second_time(loads, stayed):
    change = 2 * BEARS * WEIGHT
    assert wakes(loads, change)
    loads.woke(YES, YES)
    if stayed:
        loads.bore(YES)
    loads.lie_down()
    # It lies under that load now; it changes back, and by a little more than it is known to bear.
    assert wakes(loads, 0.0) != stayed
    assert wakes(loads, (1 + 1.1 * BORE) * change)


def test_what_woke_otherwise_is_not_known_to_bear_more(loads):
    assert wakes(loads, 2 * BEARS * WEIGHT)
    loads.woke(YES, NO)
    loads.bore(YES)
    loads.lie_down()
    assert wakes(loads, 0.0)
