"""Models that move: what is hit, and what joints let move, about or along which axis, and how
far.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ddenv.robot.simulation.plant_cache import Plant
from ddenv.world.drive import find_drive
from ddenv.world.model import Box, Model, Sphere
from ddenv.world.pose import Pose
from tests.robot.conftest import joint_of, link_of, model_of

CUBE = Box((0.2, 0.2, 0.2))
HINGE = (0.0, 3.0, 2.0)
NOWHERE = {"failure": {"timeout": 2.0}, "goal": {"x": 9, "y": 0}}


def hung(kind: str, offset=(0.5, 0.0, 0.0), **changes: object) -> Model:
    """A cube that hangs on the world, `offset` away from its joint."""
    place = tuple(float(a + b) for a, b in zip(HINGE, offset, strict=True))
    return model_of(
        "thing",
        link_of("a", CUBE, Pose(place)),
        joints=(joint_of(kind, "world", "a", HINGE, **changes),),
    )


@pytest.fixture
def motion(world_of, add, husky, scenario_of):
    """Where a model is (N, 3) from its joint, and its rows (N, 8), in 2 s beside the robot's way.

    Another model in its place, which has the same names inside, is removed.
    """

    def run(model: Model) -> tuple[np.ndarray, np.ndarray]:
        template = Plant(
            add(world_of(), model, replace(model, name="twin")), husky, scenario_of(**NOWHERE)
        )
        rows = template.run(frozenset({model.name}), seed=1).motions[model.name]
        return rows[:, 1:4] - HINGE, rows

    return run


def test_a_revolute_joint_turns_about_its_axis_up_to_its_limit(motion):
    way, _ = motion(hung("revolute", axis=(0.0, 1.0, 0.0), lower=-0.5, upper=0.5, damping=0.5))
    assert np.linalg.norm(way[:, [0, 2]], axis=1) == pytest.approx(np.full(len(way), 0.5), abs=1e-6)
    assert way[:, 1] == pytest.approx(np.zeros(len(way)), abs=1e-6)
    assert np.arctan2(-way[-1, 2], way[-1, 0]) == pytest.approx(0.5, abs=0.02)


def test_a_prismatic_joint_slides_along_its_axis_up_to_its_limit(motion):
    slope = (0.6, 0.0, -0.8)
    way, rows = motion(hung("prismatic", axis=slope, lower=-0.1, upper=0.4))
    along = (way - way[0]) @ slope
    assert way - way[0] == pytest.approx(along[:, None] * slope, abs=1e-9)
    assert along[3] == pytest.approx(9.81 * 0.8 * 0.3**2 / 2, rel=0.05)
    assert along[-1] == pytest.approx(0.4, abs=0.02)
    assert rows[:, 4:] == pytest.approx(np.tile(rows[0, 4:], (len(rows), 1)))


def test_damping_slows_a_slider_down(motion):
    # At its final speed the damper carries the weight of 1 kg.
    way, _ = motion(hung("prismatic", axis=(0.0, 0.0, -1.0), damping=30.0))
    assert np.diff(way[-5:, 2]) / 0.1 == pytest.approx(np.full(4, -9.81 / 30.0), rel=0.01)


@pytest.mark.parametrize(
    "offset", [(0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (0.3, 0.0, 0.4), (0.3, 0.3, 0.2)]
)
def test_a_ball_joint_swings_in_any_direction(motion, offset):
    way, _ = motion(hung("ball", offset))
    assert np.linalg.norm(way, axis=1) == pytest.approx(
        np.full(len(way), np.linalg.norm(offset)), abs=1e-6
    )
    # It swings through below its joint, to the other side.
    assert way[:, 2].min() < -0.9 * np.linalg.norm(offset)
    assert (way[:, :2] @ offset[:2]).min() < -0.1 * np.linalg.norm(offset)


def test_a_universal_joint_turns_about_both_its_axes_only(motion):
    # Its axes need not be those of the world. Gravity turns nothing about a vertical one.
    way, _ = motion(
        hung("universal", (0.6, 0.8, 0.0), axis=(0.0, 0.0, 1.0), axis2=(-0.8, 0.6, 0.0))
    )
    assert way @ (-0.8, 0.6, 0.0) == pytest.approx(np.zeros(len(way)), abs=1e-6)
    assert way[:, 2].min() < -0.9
    axes = {"axis": (1.0, 0.0, 0.0), "axis2": (0.0, 1.0, 0.0)}
    for offset, still in (((0.0, 0.5, 0.0), 0), ((0.5, 0.0, 0.0), 1)):
        way, _ = motion(hung("universal", offset, **axes))
        assert np.linalg.norm(way, axis=1) == pytest.approx(np.full(len(way), 0.5), abs=1e-6)
        assert way[:, still] == pytest.approx(np.zeros(len(way)), abs=1e-6)
        assert way[:, 2].min() < -0.45


def test_a_joint_without_play_is_fixed(world_of, add, husky, scenario_of):
    held = hung("revolute", axis=(0.0, 1.0, 0.0), lower=0.0, upper=0.0)
    result = Plant(add(world_of(), held), husky, scenario_of(**NOWHERE)).run(
        frozenset({"thing"}), seed=1
    )
    assert result.motions == {}


def test_what_is_fixed_in_the_world_stops_the_robot_and_can_be_removed(
    world_of, add, husky, scenario_of
):
    post = model_of(
        "post",
        link_of("foot", Box((0.3, 3.0, 1.0)), Pose((2.0, 0.0, 0.5))),
        link_of("arm", CUBE, Pose((2.0, 0.0, 1.5))),
        joints=(
            joint_of("fixed", "world", "foot", (2.0, 0.0, 0.5)),
            joint_of("revolute", "foot", "arm", (2.0, 0.0, 1.4), axis=(0.0, 0.0, 1.0)),
        ),
    )
    template = Plant(add(world_of(), post), husky, scenario_of(failure={"timeout": 5.0}))
    blocked = template.run(frozenset({"post"}), seed=1)
    assert blocked.outcome == "failed"
    assert blocked.trajectory[:, 1].max() < 1.6
    assert template.run(frozenset(), seed=1).outcome == "pass"
    assert (
        template.run(frozenset({"post"}), seed=1).trajectory.tobytes()
        == blocked.trajectory.tobytes()
    )


def test_only_joints_that_turn_about_one_axis_are_wheels(world_of, husky, scenario_of):
    at = (0.0, 0.0, 0.9)
    load = link_of("load", Sphere(0.1), Pose(at))
    for kind in ("ball", "prismatic", "universal", "fixed"):
        joint = joint_of(kind, "base_link", "load", at, axis2=(1.0, 0.0, 0.0), lower=0.0, upper=0.1)
        robot = replace(husky, links=(*husky.links, load), joints=(*husky.joints, joint))
        assert find_drive(robot) == find_drive(husky)
        assert Plant(world_of(), robot, scenario_of()).run(frozenset(), seed=1).outcome == "pass"


def test_a_board_that_is_hit_moves_and_its_motion_is_recorded(world_of, husky, scenario_of, box):
    board, crate = (
        box("board", "1.2 0 0.02 0 0 1.57", "0.9 0.09 0.04", mass=2.0),
        box("crate", "1.6 -3 0.25 0 0 0", "0.5 0.5 0.5", mass=10.0),
    )
    template = Plant(
        world_of(board, crate), husky, scenario_of(failure={"timeout": 4.0}, goal={"x": 9, "y": 0})
    )
    result = template.run(frozenset({"board", "crate"}), seed=1)
    rows = result.motions["board"]
    assert rows[:, 0] == pytest.approx(result.trajectory[:, 0])
    assert rows[0, 1:4] == pytest.approx([1.2, 0, 0.02])
    assert np.linalg.norm(rows[-1, 1:4] - rows[0, 1:4]) > 0.001
    assert "crate" not in result.motions
    # One that is removed is passed through.
    removed = template.run(frozenset({"crate"}), seed=1)
    assert removed.motions == {} and abs(removed.trajectory[1:, 3] - 0.1323).max() < 0.01


def test_a_model_of_several_links_moves_as_one(world_of, husky, scenario_of, box):
    inertia = "<inertial><mass>1</mass><inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>"
    side = (
        "<collision name='c'><geometry><box><size>0.2 0.2 0.2</size></box></geometry></collision>"
    )
    pair = (
        f"<model name='pair'><pose>0 3 1 0 0 0</pose><link name='a'>{inertia}{side}</link>"
        f"<link name='b'><pose>0 0 0.2 0 0 0</pose>{inertia}{side}</link>"
        "<joint name='j' type='fixed'><parent>a</parent><child>b</child></joint></model>"
    )
    template = Plant(world_of(pair), husky, scenario_of(failure={"timeout": 2.0}))
    rows = template.run(frozenset({"pair"}), seed=1).motions["pair"]
    assert rows[0, 1:4] == pytest.approx([0, 3, 1])
    assert rows[-1, 3] == pytest.approx(0.1, abs=0.005)
    assert "pair" not in template.run(frozenset(), seed=1).motions
