"""The same floor, however it is cut: equal ends, kerbs as high as a ball climbs, bodies that do not
sink, in any order.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.drake import contact_shapes
from ddenv.robot.drake.contact_shapes import Placed
from ddenv.robot.result import RunResult
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.world.hull import convex_hull
from ddenv.world.model import Box, Collision, Cylinder, Inertia, Link, Mesh, Model, Sphere
from ddenv.world.pose import HERE, Pose
from tests.robot.conftest import bits, cube
from tests.robot.drake.conftest import EDGE, WIDTH, piece, static
from tests.tiers import examples

LENGTH = 4.0  # of the platform, m
THICK = 0.5


def box_mesh(size: tuple[float, float, float]) -> Mesh:
    """A wedge-shaped slab with the box's front, top and bottom edges, which is no box: its back
    leans out by a centimetre.
    """
    corners = (
        np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    )
    corners[(corners[:, 0] > 0) & (corners[:, 2] < 0), 0] += 0.01
    return Mesh(f"slab {size}", *convex_hull(corners))


def platform(
    height: float, cuts: list[float], across: list[float], frame: Pose = HERE, kind: str = "box"
) -> list[Collision]:
    """A platform `height` (m) above the road, cut at the shares `cuts` of its length and `across`
    of its width.
    """
    xs = [EDGE + LENGTH * share for share in (0.0, *sorted(cuts), 1.0)]
    ys = [WIDTH * (share - 0.5) for share in (0.0, *sorted(across), 1.0)]
    pieces = []
    for x, next_x in pairwise(xs):
        for y, next_y in pairwise(ys):
            size = (next_x - x, next_y - y, THICK)
            middle = Pose(((x + next_x) / 2, (y + next_y) / 2, height - THICK / 2))
            shape = Box(size) if kind == "box" else box_mesh(size)
            pieces.append(piece(f"{len(pieces)}", shape, frame @ middle))
    return pieces


cut_places = st.lists(st.floats(0.02, 0.98), max_size=4, unique_by=lambda share: round(share, 2))


@examples(0.5)
@given(
    height=st.sampled_from([0.001, 0.005, 0.05, 0.1, 0.2]),
    cuts=cut_places,
    across=cut_places,
    yaw=st.floats(-math.pi, math.pi),
    pitch=st.sampled_from([0.0, -0.05, 0.05]),
    one_model=st.booleans(),
)
def test_a_floor_is_the_same_however_it_is_cut(drive, height, cuts, across, yaw, pitch, one_model):
    frame = Pose.from_rpy(3.0, -2.0, 0.0, 0.0, pitch, yaw)
    whole = drive(static("platform", *platform(height, [], [], frame)), frame=frame)
    parts = platform(height, cuts, across, frame)
    models = [static("all", *parts)] if one_model else [static(part.name, part) for part in parts]
    cut = drive(*models, frame=frame)
    assert (cut.outcome, cut.failure) == (whole.outcome, whole.failure)
    assert cut.outcome == ("pass" if height < 0.12 else "failed")
    # The run ends at the first look within the goal: one look sooner or later is 5 cm.
    apart = np.linalg.norm(np.subtract(cut.end_pose[:3], whole.end_pose[:3]))
    late = abs(cut.simulated_seconds - whole.simulated_seconds)
    assert apart < 0.02 + 0.5 * late and late < 0.11


def highest(climbs: Callable[[float], bool]) -> float:
    """The highest kerb that is climbed, m, to 4 mm."""
    low, high = 0.0, 0.16
    while high - low > 0.004:
        middle = (low + high) / 2
        low, high = (middle, high) if climbs(middle) else (low, middle)
    return low


# On smooth ground an edge between two spheres of a wheel gives it some grip (docs/contact.md).
@pytest.mark.parametrize(
    ("mu", "effort", "share"),
    [
        (0.8, 40.0, 0.1),
        pytest.param(1.0, 10.0, 0.1, marks=pytest.mark.rates),
        pytest.param(0.4, 40.0, 0.2, marks=pytest.mark.rates),
    ],
)
def test_a_wheel_climbs_what_a_ball_of_its_size_climbs(
    drive, husky, monkeypatch, mu, effort, share
):
    # Against a box a ball is exact. It is too wide for a wheel, but nothing stands beside the robot
    # here.
    def rough(parts: list[Collision]) -> Model:
        return static("platform", *(replace(part, mu=mu) for part in parts))

    wheels = tuple(replace(joint, effort=effort) for joint in husky.joints)
    bare = tuple(
        replace(link, collisions=()) if link.name == "base_link" else link for link in husky.links
    )
    robot = replace(husky, joints=wheels, links=bare)

    def climbs(height: float) -> bool:
        return (
            drive(rough(platform(height, [], [])), robot=robot, speed=0.2, timeout=40.0).outcome
            == "pass"
        )

    as_tyre = highest(climbs)
    monkeypatch.setattr(contact_shapes, "tyre", lambda wheel: [Placed(Sphere(wheel.radius), HERE)])
    as_ball = highest(climbs)
    assert 0.03 < as_ball < 0.15
    # Each limit is found to 4 mm.
    assert as_tyre == pytest.approx(as_ball, rel=share, abs=0.008)


def test_a_mesh_that_is_no_box_is_climbed_where_the_ground_is_rough(drive):
    # On smooth ground its edges stop a slow robot: a known limit (docs/contact.md).
    meshes = [static("platform", *platform(height, [], [], kind="mesh")) for height in (0.005, 0.1)]
    assert [drive(mesh, timeout=20.0).outcome for mesh in meshes] == ["pass", "pass"]


@pytest.mark.parametrize("height", [0.001, 0.002, 0.005])
def test_a_lip_does_not_stop_a_slow_robot(drive, height):
    long = drive(static("platform", *platform(height, [], [])), speed=0.1, timeout=30.0)
    assert long.outcome == "pass"


@pytest.mark.parametrize("mass", [1.0, 100.0, 1e4, 1e5])
@pytest.mark.parametrize(
    "shape", [Box((0.6, 0.6, 0.4)), Cylinder(0.3, 0.4)], ids=["box", "cylinder"]
)
def test_nothing_sinks_by_more_than_5_mm(world_of, husky, scenario_of, mass, shape):
    # As large as water of this mass.
    grown = (mass / 100.0) ** (1 / 3)
    body = Box(tuple(side * grown for side in shape.size)) if isinstance(shape, Box) else shape
    if isinstance(shape, Cylinder):
        body = Cylinder(shape.radius * grown, shape.length * grown)
    height = 0.2 * grown
    place = Pose((0.0, 9.0, height + 0.005))
    inertia = Inertia(mass, place, (0.05 * mass * grown**2,) * 3)
    thing = Model(
        name="thing",
        pose=place,
        static=False,
        links=(
            Link(
                name="link",
                pose=place,
                inertia=inertia,
                collisions=(Collision(name="c", shape=body, pose=place, mu=1.0),),
                visuals=(),
            ),
        ),
        joints=(),
        spans=(),
        line=1,
    )
    world = world_of()
    scenario = scenario_of(failure={"timeout": 2.0}, goal={"x": 9, "y": 0})
    template = Plant(replace(world, models=(*world.models, thing)), husky, scenario)
    template._sleeping = False
    rows = template.run(frozenset({"thing"}), seed=1).motions["thing"]
    assert rows[:, 3].min() > height - 0.005
    assert rows[-1, 1:4] == pytest.approx(rows[len(rows) // 2, 1:4], abs=1e-3)


def test_a_robot_of_a_tonne_and_a_half_stands_on_the_ground(drive, husky):
    heavy = [
        replace(link, inertia=replace(link.inertia, mass=link.inertia.mass * 27))
        for link in husky.links
        if link.inertia
    ]
    end = drive(robot=replace(husky, links=tuple(heavy)), timeout=2.0)
    assert end.end_pose[2] == pytest.approx(0.1323, abs=0.005)


@examples(0.3)
@given(order=st.permutations(range(6)))
def test_the_order_of_models_changes_no_bit(add, world_of, husky, scenario_of, order):
    # A leaning pile that the robot drives into, and posts beside it.
    loose = [
        cube(f"crate_{number}", 1.6, 0.29 * number - 0.45, 0.16 + 0.1 * number)
        for number in range(4)
    ]
    posts = [cube(f"post_{number}", 2.5, 2.0 * number - 1.0, mass=None) for number in range(2)]
    models = [*loose, *posts]

    def run(models: list[Model]) -> RunResult:
        template = Plant(add(world_of(), *models), husky, scenario_of(failure={"timeout": 4.0}))
        return template.run(frozenset(model.name for model in models), seed=1)

    assert bits(run([models[number] for number in order])) == bits(run(models))
