"""Infinite planes as boxes that reach as far as anything does."""

import pytest

from ddenv.world.extent import corners, with_ground_boxes
from ddenv.world.sdf.read import parse_world
from tests.conftest import ROOT


def world(*places):
    box = "<collision name='c'><geometry><box><size>1 1 1</size></box></geometry></collision>"
    models = "".join(
        f"<model name='m{n}'><static>1</static><pose>{x} {y} 0.5 0 0 0</pose><link name='l'>{box}</link></model>"
        for n, (x, y) in enumerate(places)
    )
    plane = "<collision name='c'><geometry><plane/></geometry></collision>"
    ground = f"<model name='g'><static>1</static><pose>0 0 0.25 0 0 1</pose><link name='l'>{plane}</link></model>"
    text = f"<sdf version='1.9'><world name='w'>{ground}{models}</world></sdf>"
    return parse_world(text.encode(), ROOT / "w.sdf")


def extent(world):
    """Half sizes and middle of the ground's box."""
    (collision,) = world.model("g").collisions
    return collision.shape.size, collision.pose.position


def test_its_top_is_the_plane():
    size, middle = extent(with_ground_boxes(made := world((3, 4)), corners(made)))
    assert size == (200, 200, 1)
    assert middle == pytest.approx((0, 0, -0.25))


@pytest.mark.parametrize("places", [((300.0, 0.0),), ((0.0, 0.0), (-1000.0, 5000.0)), ((90.0, 0.0),)])
def test_it_reaches_beyond_everything(places):
    made = with_ground_boxes(world(*places), corners(world(*places)), [(0.0, 150.0, 0.0)])
    (collision,) = made.model("g").collisions
    for x, y in (*places, (0.0, 150.0)):
        local = collision.pose.inverse().rotate(
            tuple(a - b for a, b in zip((x, y, 0.0), collision.pose.position, strict=True))
        )
        assert all(abs(part) + 20 < size / 2 for part, size in zip(local[:2], collision.shape.size[:2], strict=True))
    assert made.model("m0") == world(*places).model("m0")
