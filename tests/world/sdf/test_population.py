"""The copies that a `<population>` makes of its model. The places were worked out by hand from
gazebo-classic's Population.cc.
"""

import math

import pytest

from ddenv.world.scenario import Reading
from ddenv.world.sdf.moved import with_places
from ddenv.world.sdf.read import parse_world
from ddenv.world.write import convert, without
from tests.world.sdf.conftest import BOX

GRID = "<type>grid</type><rows>1</rows><cols>3</cols><step>2 5 0</step>"
ROW = "<pose>0 0 0 0 0 0</pose><box><size>2 4 6</size></box><model_count>2</model_count>"
QUARTER = math.pi / 2


def population(distribution: str, more: str, static: bool = True) -> str:
    model = (
        f"<model name='can'><pose>7 7 7 0 0 0</pose><static>{static}</static><link "
        f"name='l'>{BOX}</link></model>"
    )
    return (
        "<population "
        f"name='p'>{model}{more}<distribution>{distribution}</distribution></population>"
    )


@pytest.mark.parametrize(
    ("distribution", "more", "places"),
    [
        (GRID, f"<pose>10 20 1 0 0 {QUARTER}</pose>", [(8, 20, 1), (8, 22, 1), (8, 24, 1)]),
        ("<type>linear-x</type>", ROW, [(-1, 0, 0), (0, 0, 0)]),
        ("<type>linear-y</type>", ROW, [(0, -2, 0), (0, 0, 0)]),
        ("<type>linear-z</type>", ROW, [(0, 0, -3), (0, 0, 0)]),
    ],
)
def test_copies_stand_where_gazebo_classic_puts_them(read, distribution, more, places):
    world = read(population(distribution, more))
    assert world.names == tuple(f"can_clone_{number}" for number in range(len(places)))
    for model, place in zip(world.models, places, strict=True):
        assert model.collisions[0].pose.position == pytest.approx(place)
        assert model.collisions[0].pose.quaternion == (1, 0, 0, 0)


def test_copies_stay_together_until_they_are_written_out(read):
    # Two of one name: no copy may be removed with the text of the others.
    twice = population("<type>linear-x</type>", ROW) * 2
    other = f"<model name='shelf'><static>1</static><link name='l'>{BOX}</link></model>"
    for options in ({}, {"inside": True}):
        world = read(other + twice, **options)
        assert len(world.models) == 5 and world.elements() == ("shelf",)
        assert without(world, frozenset(["shelf"])) == world.text.replace(other.encode(), b"")
    written, _ = convert(world, "meshes")
    assert len(parse_world(written, world.path).elements()) == 5


def test_a_copy_that_came_to_rest_elsewhere_is_not_moved(read):
    world = read(population("<type>linear-x</type>", ROW, static=False))
    places = {model.name: [model.pose @ model.pose] for model in world.models}
    assert with_places(world, places, Reading()) == (world.text, ["can_clone_0"])


def test_random_places_can_be_left_out(read):
    world = read(population("<type>random</type>", ROW), ignore=("population",))
    assert world.models == () and [note.what for note in world.notes] == ["<population>"]
