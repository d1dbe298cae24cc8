"""Whether a run really repeats where what took no part in it is removed: simulates tests that a finished run implies.

    python benchmarks/slices.py [--tests N] [--worlds N] [WORLD --spawn X,Y,Z,YAW --goal X,Y]
    python benchmarks/slices.py --forget KIND

Without a world file: the three scenarios, and random worlds of tiles, walls, doors, piles, shelves and balls. Of each world, random
parts run, and then random parts of these that keep what took part and break no tie. Every bit must be the same. With `--forget`
one kind of participant is left out on purpose, which the comparison must find. Prints a row for each world, and what recording who
took part adds to the time of its runs; exits with 1 if tests differ.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from ddenv.robot.drake.template import Template, Variants
from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.reached import Reached
from ddenv.robot.result import RunResult
from ddenv.robot.sensing.lidar import Lidar
from ddenv.runs.scenarios import load_parts, scenario_for_world
from ddenv.slices import Ties
from ddenv.world.load import SCENARIOS, SDF, load_scenario, validate
from ddenv.world.model import Model, World
from ddenv.world.read import parse_world, read_model
from ddenv.world.scenario import Scenario

FORGOTTEN = {
    "robot": lambda: setattr(Reached, "_look_around_robot", lambda *_: None),
    "models": lambda: setattr(Reached, "_look_around_models", lambda *_: None),
    "awake": lambda: setattr(Sleep, "took_part", frozenset()),
    "lidar": lambda: setattr(Lidar, "took_part", frozenset()),
    "ties": lambda: setattr(Template, "ties", lambda *_: []),
}
# Implied tests of each run.
PARTS = 4


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", nargs="?", type=Path)
    parser.add_argument("--spawn", default="0,0,0.2,0", help="x, y, z m and yaw rad; with a world file")
    parser.add_argument("--goal", default="5,0", help="x, y m; with a world file")
    parser.add_argument("--tests", type=int, default=40, help="implied tests of each world")
    parser.add_argument("--worlds", type=int, default=10, help="random worlds")
    parser.add_argument("--forget", choices=FORGOTTEN, help="a kind of participant to leave out")
    options = parser.parse_args()
    if options.forget:
        FORGOTTEN[options.forget]()
    print("| world | models | took part in the whole | implied tests | that differ | recording |")
    print("|---|---|---|---|---|---|", flush=True)
    return int(sum([row(*each, options.tests) for each in worlds(options)]) > 0)


def worlds(options: argparse.Namespace) -> Iterator[tuple[World, Model, Scenario]]:
    if options.world is not None:
        x, y, z, yaw = map(float, options.spawn.split(","))
        goal_x, goal_y = map(float, options.goal.split(","))
        scenario = scenario_for_world(options.world, (x, y, z, yaw), (goal_x, goal_y))
        yield *load_parts(scenario), scenario
        return
    for name in ("ditch", "friction", "rubble"):
        scenario = load_scenario(SCENARIOS / f"{name}.yaml")
        yield *load_parts(scenario), scenario
    husky = read_model(SDF / "robots" / "husky.sdf")
    for number in range(options.worlds):
        yield random_world(number), husky, random_scenario(number)


def row(world: World, robot: Model, scenario: Scenario, tests: int) -> int:
    """Prints the row of one world. Returns how many of its implied tests differ."""
    simulator, chance = Variants(world, robot, scenario), random.Random(0)
    everything = frozenset(world.elements())
    ties = Ties.among(simulator.ties(everything) or ())
    whole = simulator.run(everything, 0)
    assert whole.took_part is not None, "who took part is unknown"
    differ, recording = 0, cost(simulator, everything)
    for seed in range(tests // PARTS):
        there = everything if seed % 2 == 0 else part(everything, chance)
        made = simulator.run(there, seed)
        if made.took_part is None:
            continue
        for _ in range(PARTS):
            keep = ties.closed((made.took_part & there) | part(there, chance), there)
            differ += bits(simulator.run(keep, seed), keep) != bits(made, keep)
    met = len(whole.took_part & everything)
    count = tests // PARTS * PARTS
    print(f"| {scenario.name} | {len(everything)} | {met} | {count} | {differ} | {recording:+.1%} |", flush=True)
    return differ


def part(models: frozenset[str], chance: random.Random) -> frozenset[str]:
    return frozenset(chance.sample(sorted(models), k=chance.randint(0, len(models))))


def bits(result: RunResult, keep: frozenset[str]) -> tuple[object, ...]:
    motions = {name: rows.tobytes() for name, rows in result.motions.items() if name in keep}
    return result.outcome, result.failure, result.trajectory.tobytes(), motions


def cost(simulator: Variants, keep: frozenset[str]) -> float:
    """What recording adds to the time of a run, as a part of that: the time within `Reached.look`."""
    spent, look = 0.0, Reached.look

    def timed(*arguments: object) -> None:
        nonlocal spent
        began = time.perf_counter()
        look(*arguments)  # type: ignore[arg-type]
        spent += time.perf_counter() - began

    Reached.look = timed  # type: ignore[method-assign, assignment]
    began = time.perf_counter()
    simulator.run(keep, 0)
    whole = time.perf_counter() - began
    Reached.look = look  # type: ignore[method-assign]
    return spent / (whole - spent)


def random_scenario(number: int) -> Scenario:
    """It sees by lidar in every second world."""
    sees = {"sensors": {"lidar": {"range": 6.0}}, "controller": {"use": "costmap"}} if number % 2 else {}
    data = {
        "name": f"random {number}",
        "world": "random.sdf",
        "robot": {"model": "husky.sdf", "spawn": {"x": 0, "y": 0, "z": 0.14}},
        "goal": {"x": 6, "y": 0},
        "failure": {"timeout": 8.0},
    }
    return validate(data | sees, "slices")


def random_world(number: int) -> World:
    """A flat world with things beside and in the robot's way."""
    chance = random.Random(number)
    kinds = (tile, wall, door, pile, shelf, ball)
    places = ((chance.uniform(0.9, 5.0), chance.uniform(-4.0, 4.0)) for _ in range(24))
    things = "".join(chance.choice(kinds)(number, x, y) for number, (x, y) in enumerate(places))
    ground = model("ground", 0, 0, 0, "<plane><normal>0 0 1</normal></plane>")
    return parse_world(
        f'<sdf version="1.9"><world name="w">{ground}{things}</world></sdf>'.encode(), Path("random.sdf")
    )


def tile(number: int, x: float, y: float) -> str:
    return model(f"tile_{number}", x, y, 0.01, box(0.5, 0.4, 0.02))


def wall(number: int, x: float, y: float) -> str:
    return model(f"wall_{number}", x, y, 0.5, box(0.2, 0.6, 1.0))


def door(number: int, x: float, y: float) -> str:
    hinge = (
        '<joint name="hinge" type="revolute"><parent>world</parent><child>link</child><pose>0 0.5 0 0 0 0</pose>'
        "<axis><xyz>0 0 1</xyz><dynamics><damping>0.5</damping></dynamics></axis></joint>"
    )
    return model(f"door_{number}", x, y, 0.6, box(0.05, 1.0, 0.8), mass=3.0, more=hinge)


def pile(number: int, x: float, y: float) -> str:
    cubes = [
        model(f"pile_{number}_{storey}", x + 0.1 * storey, y, 0.15 + 0.31 * storey, CUBE, 1.0) for storey in (0, 1)
    ]
    return "".join(cubes)


def shelf(number: int, x: float, y: float) -> str:
    return model(f"shelf_{number}", x, y, 0.2, box(0.4, 0.4, 0.4)) + model(f"on_shelf_{number}", x, y, 0.55, CUBE, 1.0)


def ball(number: int, x: float, y: float) -> str:
    return model(f"ball_{number}", x, y, 0.8, "<sphere><radius>0.2</radius></sphere>", 1.0)


def box(x: float, y: float, z: float) -> str:
    return f"<box><size>{x} {y} {z}</size></box>"


CUBE = box(0.3, 0.3, 0.3)


def model(name: str, x: float, y: float, z: float, shape: str, mass: float = 0.0, more: str = "") -> str:
    """A model of one shape, static without a mass (kg)."""
    moments = "".join(f"<{axis}>{0.03 * mass}</{axis}>" for axis in ("ixx", "iyy", "izz"))
    inertial = f"<inertial><mass>{mass}</mass><inertia>{moments}</inertia></inertial>" if mass else ""
    static = "" if mass else "<static>true</static>"
    collision = f'<collision name="c"><geometry>{shape}</geometry></collision>'
    return (
        f'<model name="{name}">{static}<pose>{x} {y} {z} 0 0 0</pose><link name="link">{inertial}{collision}</link>{more}'
        "</model>"
    )


if __name__ == "__main__":
    sys.exit(main())
