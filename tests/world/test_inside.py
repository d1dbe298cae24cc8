"""Models that start inside others, and robots that start in the air, are noted before anything moves."""

import pytest

from ddenv.world.placement import DROP, INSIDE, Inside, drop, inside, note_inside, notes_on_start
from ddenv.world.scenario import Spawn
from ddenv.world.sdf.read import parse_world
from tests.conftest import DATA
from tests.robot.conftest import GROUND, box_model
from tests.world.test_placement import HUSKY, WALL


def world(*models):
    text = f'<sdf version="1.9"><world name="w">{GROUND}{"".join(models)}</world></sdf>'
    return parse_world(text.encode(), DATA)


def box(name, x, z=0.5, mass=1.0):
    return box_model(name, f"{x} 0 {z} 0 0 0", "1 1 1", mass)


def test_each_pair_is_found_once_with_its_depth():
    pairs = inside(
        world(box("first", 0), box("second", 0.8), box("apart", 3), box("sunk", 6, z=0.3), box("post", 0.8, mass=None))
    )
    assert {(pair.name, pair.other) for pair in pairs} == {
        ("first", "second"),
        ("first", "post"),
        ("second", "post"),
        ("sunk", "ground"),
    }
    depths = {(pair.name, pair.other): pair.depth for pair in pairs}
    assert depths["first", "second"] == pytest.approx(0.2)
    assert depths["second", "post"] == pytest.approx(1.0)
    assert depths["sunk", "ground"] == pytest.approx(0.2)


@pytest.mark.parametrize("x", [1.0, 1.0 - 0.9 * INSIDE])
def test_what_touches_is_not_inside(x):
    assert inside(world(box("first", 0), box("second", x))) == []


def test_what_never_moves_may_overlap():
    assert inside(world(box("first", 0, mass=None), box("second", 0.5, mass=None))) == []


def test_one_line_says_it_all():
    ((_, words),) = note_inside(world(box("first", 0), box("second", 0.8), box("third", 0.9)))
    assert words == "second starts 0.90 m inside third, and 2 more pairs: they push each other apart"
    assert list(note_inside(WALL)) == []
    assert Inside("a", "b", 0.1) == Inside("a", "b", 0.1)


@pytest.mark.parametrize(
    ("spawn", "height"),
    [
        # On the deck, which is 0.3 m high; above it; beside it; above the wall.
        (Spawn(x=0, y=0, z=0.45), 0.0),
        (Spawn(x=0, y=0, z=1.45), 1.0),
        (Spawn(x=-4, y=4, z=1.15), 1.0),
    ],
)
def test_the_way_down_is_measured_to_what_is_below(spawn, height):
    assert drop(WALL, HUSKY, spawn) == pytest.approx(height, abs=0.05)
    told = [about for about, _ in notes_on_start(WALL, HUSKY, spawn)]
    assert told == (["drop"] if height > DROP else [])
