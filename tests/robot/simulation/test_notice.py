"""Noticing: when the robot first had each model in view, and first touched it; and that this
changes nothing else.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from ddenv.robot.result import RunResult
from ddenv.robot.simulation.notice import Notice, in_view
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.robot.simulation.taking_part import ENDLESS, Hull
from ddenv.world.model import Box, Sphere
from ddenv.world.pose import Pose
from tests.robot.conftest import bits, box_model, joint_of, link_of, model_of, run
from tests.tiers import slow

WALL = box_model("wall", "1.5 0 0.5 0 0 0", "0.2 4 1")
FRONT = 0.4937  # m, from the robot's frame to the foremost point of its box


def x_at(result: RunResult, seconds: float) -> float:
    return float(np.interp(seconds, result.trajectory[:, 0], result.trajectory[:, 1]))


def without_noticing(monkeypatch, make) -> RunResult:
    with monkeypatch.context() as patch:
        patch.setattr(Notice, "feel", lambda *_: None)
        patch.setattr(Notice, "look", lambda *_: None)
        return make()


def test_a_wall_is_touched_when_the_robot_is_there(world_of, husky, scenario_of):
    result = run(Plant(world_of(WALL), husky, scenario_of()), "wall")
    assert set(result.first_touched) == {"ground", "wall"}
    # The bumper meets the wall, whose near side is at 1.4 m, within the 0.05 s between two looks at
    # up to 1 m/s.
    assert x_at(result, result.first_touched["wall"]) + FRONT == pytest.approx(1.4, abs=0.06)
    # It starts a little above the ground.
    assert result.first_touched["ground"] < 0.3


def test_what_is_touched_at_the_start_and_at_the_end_counts(world_of, husky, scenario_of):
    low = {
        "robot": {"model": "husky.sdf", "spawn": {"x": 0, "y": 0, "z": 0.13}},
        "failure": {"timeout": 4.0},
    }
    template = Plant(world_of(WALL), husky, scenario_of(**low))
    whole = run(template, "wall")
    assert whole.first_touched["ground"] == 0.0
    # The run that ends just then ends before the next command.
    end = whole.first_touched["wall"]
    short = Plant(world_of(WALL), husky, scenario_of(**low | {"failure": {"timeout": end}}))
    assert run(short, "wall").first_touched == whole.first_touched
    assert run(short, "wall").simulated_seconds == end


def test_what_is_within_range_is_sensed_before_it_is_touched(world_of, husky, scenario_of):
    scenario = scenario_of(sensors={"view_range": 1.0})
    high = box_model("lamp", "1.0 0 1.5 0 0 0", "0.2 0.2 0.2")
    aside = box_model("aside", "0.5 2 0.5 0 0 0", "0.2 0.2 1")
    result = run(Plant(world_of(WALL, high, aside), husky, scenario), "wall", "lamp", "aside")
    assert result.first_sensed["wall"] < result.first_touched["wall"]
    assert x_at(result, result.first_sensed["wall"]) == pytest.approx(0.4, abs=0.12)
    # The lamp hangs 1.3 m above: nowhere is it within range, and neither is the post that the robot
    # passes by 1.9 m.
    assert set(result.first_sensed) == {"ground", "wall"}
    assert all(
        result.first_sensed[name] <= seconds for name, seconds in result.first_touched.items()
    )


def test_what_is_behind_is_not_sensed_until_the_robot_turns(world_of, husky, scenario_of):
    models = (
        box_model("ahead", "3 0.5 0.5 0 0 0", "0.2 0.2 1"),
        box_model("behind", "-3 2 0.5 0 0 0", "0.2 0.2 1"),
    )
    narrow = {"sensors": {"view_range": 5.0, "view_angle": math.radians(90)}}
    straight = Plant(world_of(*models), husky, scenario_of(**narrow))
    result = run(straight, "ahead", "behind")
    assert result.first_sensed["ahead"] == 0.0
    assert "behind" not in result.first_sensed
    turning = run(
        Plant(world_of(*models), husky, scenario_of(**narrow, goal={"x": -3, "y": 0})),
        "ahead",
        "behind",
    )
    assert turning.first_sensed["behind"] > 0.5
    all_round = {"sensors": {"view_range": 5.0}}
    assert (
        run(Plant(world_of(*models), husky, scenario_of(**all_round)), "behind").first_sensed[
            "behind"
        ]
        == 0.0
    )


def test_removed_models_are_never_noticed(world_of, add, husky, scenario_of):
    crate = model_of("crate", link_of("link", Box((0.3, 0.3, 0.3)), Pose((1.0, 0.0, 0.15))))
    scenario = scenario_of(sensors={"view_range": 20.0}, failure={"timeout": 3.0})
    template = Plant(add(world_of(WALL), crate), husky, scenario)
    assert set(run(template, "crate", "wall").first_sensed) == {"ground", "crate", "wall"}
    assert set(run(template, "wall").first_sensed) == {"ground", "wall"}
    assert set(run(template, "crate").first_touched) == {"ground", "crate"}
    assert set(run(template).first_sensed) == {"ground"}


def test_a_moving_model_is_sensed_where_it_is_by_now(world_of, add, husky, scenario_of):
    # It falls past the edge of the view, 6 m beside the robot, which never comes near.
    ball = model_of("ball", link_of("link", Sphere(0.2), Pose((0.0, 6.0, 5.2))))
    scenario = scenario_of(
        sensors={"view_range": 6.0}, goal={"x": 0.0, "y": -20.0}, failure={"timeout": 2.0}
    )
    scenario = scenario.model_copy(
        update={"controller": scenario.controller.model_copy(update={"speed": 1e-6})}
    )
    far = model_of("far", link_of("link", Sphere(0.2), Pose((0.0, 30.0, 0.2))))
    result = run(Plant(add(world_of(), far, ball), husky, scenario), "ball", "far")
    assert "far" not in result.first_sensed
    rows = result.motions["ball"]
    seen = np.hypot(rows[:, 2] - 0.2, rows[:, 3] - 0.2 - result.trajectory[:, 3]) <= 6.0
    assert result.first_sensed["ball"] == pytest.approx(rows[seen.argmax(), 0], abs=0.1)
    assert 0.5 < result.first_sensed["ball"] < 1.0


def test_a_moving_model_that_slept_is_touched_where_the_robot_finds_it(
    world_of, add, husky, scenario_of
):
    crates = [
        model_of(name, link_of("link", Box((0.3, 0.3, 0.3)), Pose((x, 0.0, z))))
        for name, x, z in (("near", 1.5, 0.15), ("pushed", 1.9, 0.15))
    ]
    leaf = link_of("leaf", Box((0.05, 0.5, 0.5)), Pose((-2.0, 3.0, 0.6)))
    door = model_of(
        "door", leaf, joints=(joint_of("revolute", "world", "leaf", (-2.0, 3.25, 0.6)),)
    )
    template = Plant(add(world_of(), *crates, door), husky, scenario_of(failure={"timeout": 3.0}))
    result = run(template, "near", "pushed", "door")
    assert set(result.first_touched) == {"ground", "near"}
    # Contacts are looked at every 0.1 s, and the crate may jump ahead for a moment.
    assert x_at(result, result.first_touched["near"]) + FRONT == pytest.approx(1.35, abs=0.3)
    # The crate in front moves the other one, which the robot itself never touches.
    assert result.motions["pushed"][-1, 1] > 2.0
    template._sleeping = False
    assert set(run(template, "near", "pushed", "door").first_touched) == {"ground", "near"}


def test_what_lies_on_each_other_beside_the_robot_is_not_touched(world_of, add, husky, scenario_of):
    shelf = box_model("shelf", "1 0.6 0.1 0 0 0", "0.4 0.4 0.2")
    cup = model_of("cup", link_of("link", Box((0.3, 0.3, 0.3)), Pose((1.0, 0.58, 0.35))))
    template = Plant(add(world_of(shelf), cup), husky, scenario_of(goal={"x": 3, "y": -0.1}))
    result = run(template, "shelf", "cup")
    assert result.outcome == "pass"
    assert set(result.first_touched) == {"ground"}


def test_what_is_touched_out_of_view_was_sensed_then_although_it_is_seen_later(
    world_of, husky, scenario_of
):
    post = box_model("post", "-0.6 0 0.3 0 0 0", "0.22 0.1 0.6")
    sensors = {"view_range": 5.0, "view_angle": math.radians(300)}
    template = Plant(world_of(post), husky, scenario_of(goal={"x": 0, "y": 3}, sensors=sensors))
    result = run(template, "post")
    assert result.first_touched["post"] < 0.2
    assert result.first_sensed["post"] == result.first_touched["post"]


def test_links_that_are_fixed_in_the_world_are_part_of_their_model(
    world_of, add, husky, scenario_of
):
    frame = link_of("frame", Box((0.2, 4.0, 1.0)), Pose((1.5, 0.0, 0.5)))
    flap = link_of("flap", Box((0.1, 0.1, 0.3)), Pose((1.5, 3.0, 1.0)))
    joints = (
        joint_of("fixed", "world", "frame", (1.5, 0.0, 0.5)),
        joint_of("revolute", "frame", "flap", (1.5, 3.0, 1.2)),
    )
    gate = model_of("gate", frame, flap, joints=joints)
    result = run(Plant(add(world_of(), gate), husky, scenario_of(failure={"timeout": 3.0})), "gate")
    assert x_at(result, result.first_touched["gate"]) + FRONT == pytest.approx(1.4, abs=0.06)


@pytest.mark.parametrize("sleeping", slow(pytest.mark.rates, [True, False], but=[True]))
def test_noticing_changes_no_bit_of_a_run_with_moving_models(
    world_of, add, husky, scenario_of, monkeypatch, sleeping
):
    tower = [
        model_of(
            f"storey_{number}",
            link_of("link", Box((0.3, 0.3, 0.3)), Pose((1.5, 0.1, 0.15 + 0.3 * number))),
        )
        for number in range(3)
    ]
    # At some of these instants a row is recorded, but no command is due.
    scenario = scenario_of(
        sensors={"view_range": 1.0}, controller={"period": 0.03}, failure={"timeout": 4.0}
    )
    template = Plant(add(world_of(WALL), *tower), husky, scenario)
    template._sleeping = sleeping
    names = [model.name for model in tower]
    result = run(template, *names)
    assert "storey_0" in result.first_touched
    bare = without_noticing(monkeypatch, lambda: run(template, *names))
    assert bare.first_sensed == bare.first_touched == {}
    assert bits(bare) == bits(result)


def test_in_view_agrees_with_looking_at_many_points_of_each_box():
    random = np.random.default_rng(3)
    low = random.uniform(-4, 4, (300, 3)) * (1, 1, 0.3)
    high = low + random.uniform(0.2, 4, (300, 3))
    view_range = 2.5
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 41)] * 2, [0.0, 0.5, 1.0]), axis=-1).reshape(
        -1, 3
    )

    def some(heading: float, view_range: float, view_angle: float) -> np.ndarray:
        points = low[:, None] + grid * (high - low)[:, None]
        points[:, :, 2] = np.clip(0.0, low[:, None, 2], high[:, None, 2])
        offset = np.arctan2(points[..., 1], points[..., 0]) - heading
        ahead = np.abs(np.remainder(offset + math.pi, math.tau) - math.pi) <= view_angle / 2
        return (ahead & (np.linalg.norm(points, axis=2) <= view_range)).any(axis=1)

    for heading, view_angle in ((2.5, 1.7), (math.pi, 1.6), (-2.5, 5.0), (0.0, math.tau)):
        seen = in_view(low, high, np.zeros(3), np.array([heading]), view_range, view_angle)
        # All that some point is in view of, and nothing that is out of a slightly wider view.
        assert 30 < seen.sum() < 290
        assert (seen | ~some(heading, view_range, view_angle)).all()
        assert (~seen | some(heading, view_range + 0.15, view_angle + 0.1)).all()


def reach_of(robot):
    return Hull.of(robot).reach


def test_reach_is_that_of_the_farthest_part_however_the_joints_stand(husky):
    assert reach_of(husky) < 1.0
    base = link_of("base", Box((0.6, 0.8, 0.0001)), Pose((5.0, 0.0, 1.0)))
    # Folded back over the base, with its hinge 1 m ahead.
    arm = link_of("arm", Sphere(0.2), Pose((5.0, 0.0, 1.0)))
    hinge = joint_of("revolute", "base", "arm", (6.0, 0.0, 1.0))
    corner = 0.2 * math.sqrt(3)
    # A box around all places of the arm, which turns about its hinge.
    far = 1 + corner
    assert reach_of(model_of("robot", base)) == pytest.approx(0.5)
    assert reach_of(model_of("robot", base, arm, joints=(hinge,))) == pytest.approx(
        math.hypot(1 + far, far, far)
    )
    assert reach_of(model_of("robot", base, arm)) >= ENDLESS
    slide = joint_of("prismatic", "base", "arm", (5.0, 0.0, 1.0), lower=-3.0, upper=1.0)
    assert reach_of(model_of("robot", base, arm, joints=(slide,))) == pytest.approx(
        math.sqrt(3) * (3 + corner)
    )
    endless = joint_of("prismatic", "base", "arm", (5.0, 0.0, 1.0))
    assert reach_of(model_of("robot", base, arm, joints=(endless,))) >= ENDLESS
    # What hangs on the arm may be named before it.
    hand = link_of("hand", Sphere(0.2), Pose((5.0, 0.0, 1.0)))
    grip = joint_of("fixed", "arm", "hand", (5.0, 0.0, 1.0))
    assert reach_of(model_of("robot", base, hand, arm, joints=(grip, hinge))) >= 2 + corner
