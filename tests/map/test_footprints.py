"""Outlines of shapes seen from above; in which order and colour models are drawn."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.map.drawing import Frame, path_of
from ddenv.map.footprints import DYNAMIC, ROUND, STATIC, footprint, footprints, plan
from ddenv.world.extent import polygon_area, shape_bounds
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Link,
    Mesh,
    Model,
    Plane,
    Shape,
    Sphere,
)
from ddenv.world.pose import Pose
from tests.map.worlds import GROUND, box, world_of

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
SHAPES = (
    Box((1, 2, 3)),
    Cylinder(0.5, 2),
    Capsule(0.5, 2),
    Sphere(0.7),
    Ellipsoid((1, 0.5, 0.2)),
    Mesh("m", CORNERS * (1, 2, 3), np.array([[0, 1, 2]])),
)
angle = st.floats(-3, 3)


def print_of(shape: Shape, pose: Pose = Pose(), corners: int = ROUND):  # noqa: B008
    collisions = (Collision(name="c", shape=shape, pose=pose, mu=1.0),)
    return footprint(
        Model(
            name="m",
            pose=Pose((4, 5, 6)),
            static=True,
            links=(Link(name="l", pose=Pose(), inertia=None, collisions=collisions, visuals=()),),
            joints=(),
            spans=(),
            line=1,
        ),
        corners,
    )


@given(st.sampled_from(SHAPES), st.builds(Pose.from_rpy, angle, angle, angle, angle, angle, angle))
def test_an_outline_is_as_large_as_its_shape(shape, pose):
    low, high = shape_bounds(shape, pose)
    seen = print_of(shape, pose, corners=90)
    assert seen.low == pytest.approx(low[:2], abs=0.01)
    assert seen.high == pytest.approx(high[:2], abs=0.01)
    assert all(polygon_area(polygon) > 0 for polygon in seen.polygons)


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        (Sphere(2), np.pi * 4),
        (Ellipsoid((3, 1, 9)), np.pi * 3),
        (Capsule(1, 5), np.pi),
        (Mesh("m", CORNERS, np.array([[0, 1, 2]])), 1),
    ],
    ids=repr,
)
def test_areas_from_above(shape, area):
    (polygon,) = print_of(shape, corners=200).polygons
    assert polygon_area(polygon) == pytest.approx(area, rel=1e-3)


def test_a_model_without_shapes_is_a_point():
    seen = print_of(Plane((1, 1)))
    assert seen.polygons == ()
    assert seen.center == (4, 5)
    assert seen.area == 0


def test_a_model_that_moved_and_tipped_over_covers_what_it_lies_on():
    upright = Pose((1.0, 0.0, 1.0))
    link = Link(
        name="link",
        pose=upright,
        inertia=None,
        collisions=(Collision(name="post", shape=Box((0.2, 0.2, 2.0)), pose=upright, mu=1.0),),
        visuals=(),
    )
    model = Model(
        name="post", pose=upright, static=False, links=(link,), joints=(), spans=(), line=1
    )
    there = Pose.from_rpy(4.0, 0.0, 0.1, 0.0, math.pi / 2, 0.0)
    moved = footprint(model, moved=there @ model.links[0].pose.inverse())
    assert (*moved.low, *moved.high) == pytest.approx((3.0, -0.1, 5.0, 0.1), abs=1e-6)


def drawn(*models: str):
    return plan(world_of(GROUND, *models))


def test_what_lies_on_top_is_drawn_later():
    names = [
        each.model.name
        for each in drawn(box("lid", 0, 0, z=2), box("crate", 0, 0), box("shelf", 0, 0, z=1))
    ]
    assert names == ["crate", "shelf", "lid"]


def test_of_models_of_one_height_the_larger_is_drawn_first():
    small, large = box("small", 0, 0), box("large", 0, 0, size=(2, 2, 0.3))
    assert [each.model.name for each in drawn(small, large)] == ["large", "small"]


def test_a_huge_model_hides_nothing_wherever_it_is():
    crates = [box(f"crate {number}", number, 0) for number in range(5)]
    first, *others = drawn(*crates, box("stage", 0, 0, size=(20, 20, 0.1), z=0.8))
    assert first.model.name == "stage"
    assert first.floor
    assert not any(each.floor for each in others)


def house(*walls: str) -> str:
    """A model of boxes, each given as "x y z size"."""
    boxes = (
        f"<collision name='{number}'><pose>{' '.join(wall.split()[:3])} 0 0 0</pose>"
        f"<geometry><box><size>{' '.join(wall.split()[3:])}</size></box></geometry></collision>"
        for number, wall in enumerate(walls)
    )
    return f"<model name='house'><static>1</static><link name='l'>{''.join(boxes)}</link></model>"


HOUSE = house(
    "-3 0 1 0.2 6 2",
    "3 0 1 0.2 6 2",
    "0 3 1 6 0.2 2",
    "-2 -3 1 2 0.2 2",
    "2 -3 1 2 0.2 2",
    "0 -3 1.8 2 0.2 0.4",
)


def test_a_building_is_its_walls_with_its_doors_open_and_what_hangs_is_a_point():
    floor, lamp = box("floor", 0, 0, size=(6, 6, 0.1)), box("lamp", 0, 0, z=1.5)
    crates = [box(f"crate {number}", number / 4, 0, size=(0.3, 0.3, 0.3)) for number in range(5)]
    models = {each.model.name: each for each in drawn(HOUSE, floor, lamp, *crates)}
    walls = models["house"]
    assert not walls.floor and models["floor"].floor
    assert walls.outline.distance((0.0, 0.0)) == pytest.approx(2.9)
    # Below the lintel.
    assert walls.outline.distance((0.0, -3.0)) == pytest.approx(1.0)
    assert models["lamp"].outline.polygons == ()
    assert models["lamp"].size == pytest.approx((1.2, 0.8, 0.3))
    # Above a trench the ground is what is beside it.
    raised = {
        each.model.name: each
        for each in drawn(box("quay", 0, 0, size=(6, 6, 2)), box("tile", 0, 0, z=2))
    }
    assert raised["tile"].outline.polygons
    # One outline around it would close it.
    frame = Frame.around(
        list(models.values()), [], 0.1, 2.0, (800.0, 600.0), (0.0, 0.0), (0.0, 0.0)
    )
    assert path_of(walls, frame, coarse=True) == path_of(walls, frame)
    assert [each.name for each in footprints(world_of(GROUND, HOUSE, floor))] == ["floor", "house"]


def test_of_few_models_none_is_a_floor():
    assert not any(
        each.floor for each in drawn(box("hall", 0, 0, size=(50, 50, 1)), box("crate", 0, 0))
    )


def test_colours_are_those_of_the_file_or_else_of_the_kind():
    glass = box("glass", 2, 0, color="0 0 1 1").replace(
        "<material>", "<transparency>1</transparency><material>"
    )
    models = [box("red", 0, 0, color="1 0 0 1"), glass, box("moves", 4, 0, static=False)]
    assert {each.model.name: each.color for each in drawn(*models)} == {
        "red": (255, 0, 0),
        "glass": STATIC,
        "moves": DYNAMIC,
    }


def test_nothing_is_drawn_of_an_empty_world():
    assert drawn() == ()
