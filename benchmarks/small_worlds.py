"""Small flat worlds with things in the robot's way and beside it, for the audit of slices
(`slices.py`).
"""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

from ddenv.world.load import validate
from ddenv.world.model import World
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.read import parse_world

# How many things a world has, and how long its robot drives, s.
THINGS = 7
SECONDS = 2.0
Thing = Callable[[int, float, float], str]


def small_scenario(number: int) -> Scenario:
    """The robot sees by lidar in every second world."""
    sees = (
        {"sensors": {"lidar": {"range": 6.0}}, "controller": {"use": "costmap"}}
        if number % 2
        else {}
    )
    data = {
        "name": f"small {number}",
        "world": "small.sdf",
        "robot": {"model": "husky.sdf", "spawn": {"x": 0, "y": 0, "z": 0.14}},
        "goal": {"x": 6, "y": 0},
        "failure": {"timeout": SECONDS},
    }
    return validate(data | sees, "slices")


def small_world(kind: str, number: int) -> World:
    """A flat world of some of `KINDS`."""
    chance = random.Random(f"{kind} {number}")
    places = ((chance.uniform(0.9, 2.6), chance.uniform(-2.5, 2.5)) for _ in range(THINGS))
    things = "".join(chance.choice(KINDS[kind])(one, x, y) for one, (x, y) in enumerate(places))
    ground = model("ground", 0, 0, 0, "<plane><normal>0 0 1</normal></plane>")
    text = f'<sdf version="1.9"><world name="w">{ground}{things}</world></sdf>'
    return parse_world(text.encode(), Path("small.sdf"))


def tile(number: int, x: float, y: float) -> str:
    return model(f"tile_{number}", x, y, 0.01, box(0.5, 0.4, 0.02))


def wall(number: int, x: float, y: float) -> str:
    return model(f"wall_{number}", x, y, 0.5, box(0.2, 0.6, 1.0))


def door(number: int, x: float, y: float) -> str:
    return model(
        f"door_{number}",
        x,
        y,
        0.6,
        box(0.05, 1.0, 0.8),
        3.0,
        hinge("world", "link", (0, 0.5, 0), "0 0 1"),
    )


def pile(number: int, x: float, y: float) -> str:
    """One cube lies askew on another, or falls onto it."""
    low, high = f"pile_{number}_low", f"pile_{number}_high"
    return model(low, x, y, 0.15, CUBE, 1.0) + model(
        high, x + 0.1, y, 0.46 + 0.1 * (number % 2), CUBE, 1.0
    )


def boards(number: int, x: float, y: float) -> str:
    """Two boards with a third across them."""
    along, across = box(0.9, 0.09, 0.04), box(0.09, 0.9, 0.04)
    low = "".join(
        model(f"board_{number}_{side}", x, y + 0.2 * side, 0.02, along, 2.0) for side in (-1, 1)
    )
    return low + model(f"board_{number}_across", x, y, 0.07, across, 2.0)


def shelf(number: int, x: float, y: float) -> str:
    return model(f"shelf_{number}", x, y, 0.2, box(0.4, 0.4, 0.4)) + model(
        f"on_shelf_{number}", x, y, 0.55, CUBE, 1.0
    )


def ball(number: int, x: float, y: float) -> str:
    return model(f"ball_{number}", x, y, 0.8, "<sphere><radius>0.2</radius></sphere>", 1.0)


def chain(number: int, x: float, y: float) -> str:
    """Two cubes on one hinge, which may collide with each other."""
    own = "<self_collide>true</self_collide>" + hinge("link", "other", (0, 0, 0.3), "1 0 0")
    return model(
        f"chain_{number}", x, y, 0.2, CUBE, 1.0, link("other", CUBE, 1.0, "0.05 0 0.4 0 0 0") + own
    )


def loose_pair(number: int, x: float, y: float) -> str:
    """A model of two cubes without a joint, one above the other."""
    more = link("other", CUBE, 1.0, "0.05 0 0.35 0 0 0") + "<self_collide>true</self_collide>"
    return model(f"pair_{number}", x, y, 0.15, CUBE, 1.0, more)


def hinge(parent: str, child: str, at: tuple[float, float, float], axis: str) -> str:
    """`at` (m) is a place in the frame of the child."""
    place = " ".join(map(str, at))
    return (
        '<joint name="hinge" '
        f'type="revolute"><parent>{parent}</parent><child>{child}</child><pose>{place} 0 0 '
        "0</pose>"
        f"<axis><xyz>{axis}</xyz><dynamics><damping>0.5</damping></dynamics></axis></joint>"
    )


def box(x: float, y: float, z: float) -> str:
    return f"<box><size>{x} {y} {z}</size></box>"


CUBE = box(0.3, 0.3, 0.3)


def link(name: str, shape: str, mass: float, pose: str = "0 0 0 0 0 0") -> str:
    moments = "".join(f"<{axis}>{0.03 * mass}</{axis}>" for axis in ("ixx", "iyy", "izz"))
    inertial = (
        f"<inertial><mass>{mass}</mass><inertia>{moments}</inertia></inertial>" if mass else ""
    )
    collision = f'<collision name="c"><geometry>{shape}</geometry></collision>'
    return f'<link name="{name}"><pose>{pose}</pose>{inertial}{collision}</link>'


def model(
    name: str, x: float, y: float, z: float, shape: str, mass: float = 0.0, more: str = ""
) -> str:
    """A model of one shape, static without a mass (kg)."""
    static = "" if mass else "<static>true</static>"
    return (
        f'<model name="{name}">{static}<pose>{x} {y} {z} 0 0 '
        f"0</pose>{link('link', shape, mass)}{more}</model>"
    )


KINDS: dict[str, tuple[Thing, ...]] = {
    "piles": (pile, boards, tile),
    "shelves": (shelf, ball, tile),
    "doors": (door, wall, ball),
    "self-colliding models": (chain, loose_pair, tile, shelf),
    "walls": (wall, wall, ball, tile),
    "all of these": (tile, wall, door, pile, boards, shelf, ball),
}
