"""The example of MuJoCo: what it makes of a world, and whether the robot fails there, too, where
MuJoCo is installed.
"""

import math
import random
import sys
from importlib.util import find_spec
from xml.etree import ElementTree

import numpy as np
import pytest

from ddenv.robot.external.python_simulator import PythonSimulator
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.runs.experiment import load_parts
from ddenv.world.drive import find_drive
from ddenv.world.load import SDF, load_scenario, load_simulator
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Inertia,
    Joint,
    Link,
    Mesh,
    Model,
    Plane,
    Sphere,
    World,
)
from ddenv.world.pose import Pose
from ddenv.world.scenario import Oracle
from ddenv.world.sdf.read import read_model
from tests.conftest import ROOT
from tests.robot.drake.conftest import EDGE, ROAD, piece
from tests.robot.drake.test_floors import platform

FOLDER = ROOT / "docs/examples/mujoco"
needs_mujoco = pytest.mark.skipif(
    find_spec("mujoco") is None, reason="mujoco is not installed: pip install mujoco"
)
ROBOT = read_model(SDF / "robots" / "husky.sdf")
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
SHAPES = [
    Box((1, 2, 3)),
    Cylinder(0.3, 1),
    Sphere(0.2),
    Capsule(0.1, 1),
    Ellipsoid((1, 2, 3)),
    Plane((1, 1)),
    Mesh("m", CUBE, CUBE),
]


@pytest.fixture
def mjcf(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    monkeypatch.delitem(sys.modules, "mjcf", raising=False)
    import mjcf

    return mjcf


def link(name, *shapes, at=0.0, mass=None):
    collisions = tuple(
        Collision(name=f"c{number}", shape=shape, pose=Pose(), mu=mu)
        for number, (shape, mu) in enumerate(shapes)
    )
    inertia = None if mass is None else Inertia(mass, Pose(), (1.0, 1.0, 1.0))
    return Link(
        name=name, pose=Pose((at, 0.0, 0.0)), inertia=inertia, collisions=collisions, visuals=()
    )


def model(name, *links, static=False, joints=()):
    return Model(
        name=name, pose=Pose(), static=static, links=links, joints=joints, spans=(), line=1
    )


def joint(kind, parent, child, **more):
    return Joint(
        name=f"{parent}-{child}",
        kind=kind,
        parent=parent,
        child=child,
        pose=Pose((1, 0, 0)),
        axis=(0, 0, 1),
        lower=-1,
        upper=1,
        effort=9,
        velocity=9,
        damping=0.5,
        **more,
    )


def written(mjcf, *models):
    world = World(path=ROOT, name="w", text=b"", gravity=(0.0, 0.0, -9.8), models=models)
    return ElementTree.fromstring(
        mjcf.mjcf(world, ROBOT, Pose((0, 0, 1)), find_drive(ROBOT), 30.0, 0.002)
    )


def test_every_shape_has_its_like_and_the_smoother_surface_decides(mjcf):
    grips = [0.8, 0.4, 1.2, 0.001, 1.5, 0.5, 0.7]
    tree = written(mjcf, model("all", link("l", *zip(SHAPES, grips, strict=True)), static=True))
    geoms = tree.findall("worldbody/geom")
    assert [geom.get("type") for geom in geoms] == [
        "box",
        "cylinder",
        "sphere",
        "capsule",
        "ellipsoid",
        "plane",
        "mesh",
    ]
    assert geoms[0].get("size") == "0.5 1 1.5"
    assert len(tree.find("asset/mesh").get("vertex").split()) == 24
    priority = {
        float(geom.get("friction").split()[0]): int(geom.get("priority"))
        for geom in tree.iter("geom")
    }
    assert sorted(priority, key=priority.get, reverse=True) == sorted(priority)


def test_links_hang_on_their_joints_and_wheels_have_motors(mjcf):
    parts = [
        link("base", mass=1),
        link("door", at=2.0, mass=1),
        link("loose", mass=1),
        link("post"),
    ]
    joints = (joint("revolute", "base", "door"), joint("fixed", "world", "post"))
    tree = written(mjcf, model("m", *parts, joints=joints))
    door = tree.find("worldbody/body[@name='1 base']/body[@name='1 door']")
    assert (door.get("pos"), door.find("joint").get("pos"), door.find("joint").get("range")) == (
        "2 0 0",
        "-1 0 0",
        "-1 1",
    )
    assert [
        body.get("name")
        for body in tree.findall("worldbody/body")
        if body.find("freejoint") is not None
    ] == [
        "0 base_link",
        "1 base",
        "1 loose",
    ]
    assert (
        len(
            [pair for pair in tree.findall("contact/exclude") if pair.get("body1").startswith("1 ")]
        )
        == 6
    )
    motors = [motor.get("joint") for motor in tree.findall("actuator/velocity")]
    assert motors == [f"0 {name}" for name in find_drive(ROBOT).joints]


@pytest.mark.parametrize(
    "joints",
    [
        (joint("screw", "a", "b"),),
        (joint("revolute", "a", "b"), joint("ball", "b", "a")),
        (joint("ball", "a", "b"),) * 2,
    ],
)
def test_what_it_cannot_translate_is_one_line(mjcf, joints):
    with pytest.raises(mjcf.Unsupported, match=r"^[^\n]+$"):
        written(mjcf, model("m", link("a", mass=1), link("b", mass=1), joints=joints))


def test_the_file_of_the_simulator_is_read():
    assert load_simulator(FOLDER / "simulator.yaml") == Oracle(
        name="MuJoCo", use="drive:MuJoCo", folder=FOLDER
    )


@needs_mujoco
@pytest.mark.examples
def test_the_robot_of_friction_fails_in_mujoco_too_and_not_without_the_patch():
    oracle = load_simulator(FOLDER / "simulator.yaml")
    scenario = load_scenario(ROOT / "scenarios/friction.yaml").model_copy(update={"oracle": oracle})
    simulator = PythonSimulator(load_parts(scenario)[0], scenario)
    barrels = frozenset({"barrel_01", "barrel_02"})
    failed, passed = (simulator.run(names, 0) for names in (barrels | {"green_patch_01"}, barrels))
    again = simulator.run(barrels | {"green_patch_01"}, 0)
    simulator.close()
    assert (failed.outcome, passed.outcome) == ("failed", "pass")
    assert failed.end_pose[0] < 3.0 < passed.end_pose[0]
    assert again.trajectory.tobytes() == failed.trajectory.tobytes()


FLOOR = """name: floor
world: floor.sdf
robot: {{model: {robot}, spawn: {{x: {start[0]}, y: {start[1]}, z: {start[2]}, yaw: {yaw}}}}}
goal: {{x: {goal[0]}, y: {goal[1]}, tolerance: 0.3}}
controller: {{use: straight, speed: {speed}, motor_gain: 300.0}}
failure: {{timeout: 20}}
"""
# Of a platform in the robot's way, m. Between 12 and 15 cm it depends on the run-up whether the
# robot climbs it.
HEIGHTS = [0.001, 0.002, 0.003, 0.005, 0.01, 0.02, 0.05, 0.08, 0.1, 0.11, 0.17, 0.2, 0.25]


@needs_mujoco
@pytest.mark.examples
@pytest.mark.parametrize("number", range(20))
def test_on_a_floor_cut_at_random_the_robot_ends_where_it_does_in_mujoco(tmp_path, number):
    chance = random.Random(number)
    frame = Pose.from_rpy(
        3.0, -2.0, 0.0, 0.0, chance.choice([0.0, -0.05, 0.05]), chance.uniform(-3.1, 3.1)
    )
    cuts, across = ([chance.random() for _ in range(chance.randint(0, 4))] for _ in range(2))
    height = HEIGHTS[number % len(HEIGHTS)]
    floor = [
        piece("road", ROAD, frame @ Pose((EDGE - 3.0, 0.0, -0.05))),
        *platform(height, cuts, across, frame),
    ]
    boxes = "".join(
        "<model "
        f"name='{number}'><static>true</static><pose>{numbers(one.pose.position + one.pose.rpy())}</pose>"
        "<link name='link'><collision "
        f"name='c'><geometry><box><size>{numbers(one.shape.size)}</size></box></geometry>"
        "</collision></link></model>"
        for number, one in enumerate(floor)
    )
    (tmp_path / "floor.sdf").write_text(f"<sdf version='1.9'><world name='w'>{boxes}</world></sdf>")
    start, goal = ((frame @ Pose(place)).position for place in ((0.0, 0.0, 0.14), (3.0, 0.0, 0.0)))
    scenario = FLOOR.format(
        robot=SDF / "robots/husky.sdf",
        start=start,
        yaw=frame.yaw(),
        goal=goal,
        speed=chance.choice([0.3, 0.5, 0.8]),
    )
    (tmp_path / "floor.yaml").write_text(scenario)
    scenario = load_scenario(tmp_path / "floor.yaml")
    world, robot = load_parts(scenario)
    in_drake = Plant(world, robot, scenario).run(frozenset(world.elements()), 0)
    elsewhere = scenario.model_copy(update={"oracle": load_simulator(FOLDER / "simulator.yaml")})
    simulator = PythonSimulator(load_parts(elsewhere)[0], elsewhere)
    in_mujoco = simulator.run(frozenset(world.elements()), 0)
    simulator.close()
    assert (in_drake.outcome, in_drake.failure) == (in_mujoco.outcome, in_mujoco.failure)
    assert in_drake.outcome == ("pass" if height < 0.12 else "failed")
    assert math.dist(in_drake.end_pose[:3], in_mujoco.end_pose[:3]) < 0.05


def numbers(values):
    return " ".join(f"{value:.9f}" for value in values)
