"""Which wheels a robot has, how they turn it, and what the simplest controller makes of that."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ddenv.errors import UserError
from ddenv.robot.navigation.navigate import Straight
from ddenv.robot.protocol import STOP, Estimate, Reading, Setup, Twist, WheelSpeeds
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.world.drive import find_drive, footprint, rolled
from ddenv.world.model import Box, Capsule, Ellipsoid, Mesh, Model, Shape, Sphere
from ddenv.world.pose import Pose
from ddenv.world.scenario import Controller, Wheels
from tests.robot.conftest import joint_of, link_of

ALL = Wheels(
    left=("front_left_wheel", "rear_left_wheel"), right=("front_right_wheel", "rear_right_wheel")
)
FRONT = Wheels(left=("front_left_wheel",), right=("front_right_wheel",))


def test_the_husky_has_four_wheels(husky):
    drive = find_drive(husky)
    assert drive.joints == (
        "front_left_wheel",
        "front_right_wheel",
        "rear_left_wheel",
        "rear_right_wheel",
    )
    assert drive.left == (True, False, True, False)
    assert drive.radius == pytest.approx(0.1651)
    assert drive.track == pytest.approx(0.5708)
    assert drive == find_drive(husky, ALL)


def test_a_robot_that_is_static_is_refused(husky):
    with pytest.raises(UserError, match="is static and cannot move"):
        find_drive(replace(husky, static=True))


def test_wheel_speeds_of_a_skid_steered_turn(husky):
    drive = find_drive(husky)
    assert drive.wheel_speeds(Twist(1.0, 0.0), 0.5) == pytest.approx(np.full(4, 1.0 / 0.1651))
    left, right, *_ = drive.wheel_speeds(Twist(0.0, 1.0), 0.5) * 0.1651
    # To turn at 1 rad/s where half of it is lost, the rims must differ by 2 rad/s times the track.
    assert right - left == pytest.approx(2 * 0.5708)
    assert right > 0 > left


def way_of(*poses: tuple[float, float, float, float, float]) -> np.ndarray:
    """Rows of a robot at x, y, z (m), yaw and pitch (rad), one a second."""
    places = [Pose.from_rpy(x, y, z, 0.0, pitch, yaw) for x, y, z, yaw, pitch in poses]
    return np.array(
        [(float(time), *each.position, *each.quaternion) for time, each in enumerate(places)]
    )


def test_wheels_roll_as_far_as_the_way_makes_them(husky):
    drive = find_drive(husky)
    rise = math.radians(30)
    # Along y and up a slope, then back down.
    low, high = (
        (0.0, 0.0, 0.0, math.pi / 2, -rise),
        (0.0, math.cos(rise), math.sin(rise), math.pi / 2, -rise),
    )
    up = way_of(low, high, low)
    assert rolled(husky, drive, 0.5, up) == pytest.approx(
        np.array([[0, 0], [1, 1], [0, 0]]) / drive.radius
    )
    # A turn on the spot to the left, through south, of which half is lost: the wheels do what they
    # were commanded.
    around = way_of((1, 2, 0, 3.0, 0), (1, 2, 0, 3.0 + 1.0, 0))
    speeds = drive.wheel_speeds(Twist(0.0, 1.0), 0.5)
    assert rolled(husky, drive, 0.5, around)[-1] == pytest.approx(speeds[:2])
    assert rolled(husky, drive, 0.5, around[:1]).tolist() == [[0.0, 0.0]]


def test_what_turns_about_the_opposite_axis_turns_the_other_way(husky, world_of, scenario_of):
    joints = tuple(
        replace(joint, axis=(0.0, -1.0, 0.0)) if "right" in joint.name else joint
        for joint in husky.joints
    )
    mixed = replace(husky, joints=joints)
    drive = find_drive(mixed)
    assert drive.signs == (1.0, -1.0, 1.0, -1.0)
    assert np.sign(drive.wheel_speeds(Twist(1.0, 0.0), 0.5)).tolist() == list(drive.signs)
    named = WheelSpeeds({"rear_left_wheel": 2.0, "front_right_wheel": 3.0})
    assert drive.wheel_speeds(named, 0.5).tolist() == [0.0, -3.0, 2.0, 0.0]
    assert Plant(world_of(), mixed, scenario_of()).run(frozenset(), seed=1).outcome == "pass"


def turned(robot: Model, pose: Pose) -> Model:
    """`robot` as a whole somewhere else."""

    def link(each):
        collisions = tuple(replace(one, pose=pose @ one.pose) for one in each.collisions)
        return replace(each, pose=pose @ each.pose, collisions=collisions)

    joints = tuple(
        replace(each, pose=pose @ each.pose, axis=pose.rotate(each.axis)) for each in robot.joints
    )
    return replace(
        robot, pose=pose @ robot.pose, links=tuple(map(link, robot.links)), joints=joints
    )


def test_sides_and_footprint_are_seen_from_the_model(husky):
    there = turned(husky, Pose.from_rpy(3.0, -5.0, 1.0, 0.0, 0.0, math.pi))
    assert find_drive(there).left == find_drive(husky).left
    assert find_drive(there).signs == find_drive(husky).signs
    assert footprint(there) == pytest.approx(footprint(husky))
    # Its bumpers are 0.9874 m apart, its tyres stand out by half of their width.
    assert footprint(husky) == pytest.approx(
        (0.4937, 0.4937, 0.2854 + 0.1143 / 2, 0.2854 + 0.1143 / 2), abs=1e-6
    )


REFUSED = {
    "mistyped": (
        Wheels(left=("front_left_weel",), right=FRONT.right),
        r"robot.wheels.left: there is no joint 'front_left_weel' \(did you mean "
        r"front_left_wheel\?\); joints of 'husky' that turn "
        "are front_left_wheel, .*, turret$",
    ),
    "fixed": (
        Wheels(left=FRONT.left, right=("mast",)),
        "robot.wheels.right: 'mast' is a fixed joint that does not turn",
    ),
    "both": (
        Wheels(left=FRONT.left, right=FRONT.left),
        "robot.wheels: joint 'front_left_wheel' is listed on both sides$",
    ),
    "twice": (
        Wheels(left=FRONT.left * 2, right=FRONT.right),
        "robot.wheels: joint 'front_left_wheel' is listed twice$",
    ),
    "swapped": (
        Wheels(left=FRONT.right, right=FRONT.left),
        "left wheels of 'husky' must lie to the left of the right ones",
    ),
    "upright": (
        Wheels(left=("turret",), right=FRONT.right),
        "'husky': joint 'turret' is not a wheel: its axis does not run across",
    ),
}


@pytest.mark.parametrize(("wheels", "complaint"), REFUSED.values(), ids=REFUSED.keys())
def test_wheels_that_cannot_be_are_refused(husky, wheels, complaint):
    extra = [
        replace(joint_of(kind, "base_link", "load", (0.0, 0.2, 0.5)), name=name)
        for name, kind in (("mast", "fixed"), ("turret", "continuous"))
    ]
    with pytest.raises(UserError, match=complaint):
        find_drive(replace(husky, joints=(*husky.joints, *extra)), wheels)


def test_a_robot_without_wheels_is_refused(husky):
    with pytest.raises(UserError, match=r"husky.*wheels on both sides.*robot\.wheels"):
        find_drive(replace(husky, joints=()))
    with pytest.raises(UserError, match="left and right"):
        find_drive(replace(husky, joints=husky.joints[::2]))
    with pytest.raises(
        UserError, match=r"robot.wheels.left: there is no joint.*none of its joints turns"
    ):
        find_drive(replace(husky, joints=()), FRONT)


def on_wheels_of(husky: Model, shape: Shape) -> Model:
    def with_shape(link):
        return replace(link, collisions=tuple(replace(one, shape=shape) for one in link.collisions))

    return replace(
        husky,
        links=tuple(with_shape(link) if "wheel" in link.name else link for link in husky.links),
    )


def tyre(radius: float) -> Mesh:
    """A wheel of 24 corners along its frame's z axis."""
    angles = np.linspace(0.0, math.tau, 24, endpoint=False)
    rims = [
        np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(24, z)])
        for z in (-0.3, 0.3)
    ]
    return Mesh("tyre", np.vstack(rims), np.zeros((0, 3), int))


@pytest.mark.parametrize(
    "shape",
    [Sphere(0.2), Capsule(0.2, 0.1), Ellipsoid((0.2, 0.2, 0.3)), tyre(0.2)],
    ids=lambda one: type(one).__name__,
)
def test_the_radius_of_wheels_of_any_round_shape(husky, shape):
    assert find_drive(on_wheels_of(husky, shape)).radius == pytest.approx(0.2)


def test_square_wheels_are_refused(husky):
    with pytest.raises(
        UserError, match="'front_left_wheel_link' has no round collision: a cylinder"
    ):
        find_drive(on_wheels_of(husky, Box((0.3, 0.3, 0.1))))


def test_joints_that_are_not_named_turn_freely(husky, world_of, scenario_of):
    """Two driven wheels, and behind them two that only roll."""
    scenario = scenario_of(
        robot={
            "model": "husky.sdf",
            "spawn": {"x": 0, "y": 0, "z": 0.14},
            "wheels": FRONT.model_dump(),
        }
    )
    template = Plant(world_of(), husky, scenario)
    assert template.context.built.plant.num_actuators() == 2
    assert template.run(frozenset(), seed=1).outcome == "pass"


def test_links_without_mass_are_frames_of_what_they_are_fixed_to(husky, world_of, scenario_of):
    at = (0.4, 0.0, 0.4)
    rod = link_of("rod", Sphere(0.1), Pose(at), mass=None)
    tip = link_of("tip", None, Pose(at), mass=None)
    fixed = joint_of("fixed", "base_link", "rod", at), joint_of("fixed", "rod", "tip", at)
    framed = replace(husky, links=(*husky.links, rod, tip), joints=(*husky.joints, *fixed))
    assert Plant(world_of(), framed, scenario_of()).run(frozenset(), seed=1).outcome == "pass"
    loose = replace(framed, joints=(*husky.joints, replace(fixed[0], kind="continuous"), fixed[1]))
    wheels = {
        "model": "husky.sdf",
        "spawn": {"x": 0, "y": 0, "z": 0.14},
        "wheels": ALL.model_dump(),
    }
    with pytest.raises(
        UserError, match=r"link 'rod' of the moving model 'husky' has no <inertial>"
    ):
        Plant(world_of(), loose, scenario_of(robot=wheels))


def straight(x: float, y: float = 0.0, tolerance: float = 0.5, **settings: float) -> Straight:
    controller = Controller(**settings)
    setup = Setup(
        goal=(x, y),
        tolerance=tolerance,
        start=(0, 0, 0),
        joints=(),
        left=(),
        radius=0.1,
        track=0.5,
        footprint=(0, 0, 0, 0),
        period=controller.period,
        speed=controller.speed,
        acceleration=controller.acceleration,
        turn_rate=controller.turn_rate,
        settings=controller,
    )
    return Straight(setup)


def reading(x: float) -> Reading:
    return Reading(0.0, Estimate(x, 0.0, 0.0))


def test_starts_gently_and_keeps_to_its_speed():
    controller = straight(10, speed=0.5, acceleration=1.0, period=0.1)
    speeds = [controller.step(reading(0.0)).speed for _ in range(8)]
    assert speeds == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.5, 0.5, 0.5])


def test_turns_on_the_spot_to_a_goal_behind():
    command = straight(-10, 1, turn_rate=0.7).step(reading(0.0))
    assert command.speed == 0.0
    assert command.turn_rate == pytest.approx(0.7)


def test_stays_once_it_believes_to_be_there():
    controller = straight(10, tolerance=1.0)
    assert controller.step(reading(9.7)) != STOP
    assert controller.step(reading(9.9)) == STOP
    assert controller.step(reading(5.0)) == STOP
    assert controller.arrived
