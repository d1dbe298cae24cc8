"""Whether a run really repeats where models that did not affect it are removed: simulates tests
that a finished run implies.

    python benchmarks/slices.py [--worlds N] [--tests N] [--from NUMBER]
    python benchmarks/slices.py ditch|friction|rubble [--seconds S] [--tests N]
    python benchmarks/slices.py WORLD --spawn X,Y,Z,YAW --goal X,Y [--stand-in URI=SHAPE]
                                [--inside] [--seconds S] [--tests N]
    python benchmarks/slices.py ... --forget KIND

Without a name: small random worlds (`small_worlds.py`), N of each kind. Of each world, random parts
run, and then random parts of these that keep what took part and break no tie. Every bit must be the
same. With `--forget` one kind of participant is left out on purpose, which the comparison must
find. Prints a row for each kind of world; exits with 1 if tests differ.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from small_worlds import KINDS, small_scenario, small_world

from ddenv.environment import Environment
from ddenv.evidence.slices import Ties
from ddenv.robot.piles.pile_simulator import PileCache
from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.result import RunResult
from ddenv.robot.sensing.lidar import Lidar
from ddenv.robot.simulation.plant_cache import Plant, PlantCache
from ddenv.robot.simulation.taking_part import Reached
from ddenv.runs.experiment import load_parts, reading_of, scenario_for_world, with_options
from ddenv.world.load import SCENARIOS, SDF, load_scenario
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.read import read_model

FORGOTTEN = {
    "robot": lambda: setattr(Reached, "_look_around_robot", lambda *_: None),
    "models": lambda: setattr(Reached, "_look_around_models", lambda *_: None),
    "awake": lambda: setattr(Sleep, "took_part", frozenset()),
    "lidar": lambda: setattr(Lidar, "took_part", {}),
    "unusual": lambda: setattr(PileCache, "unusual", lambda *_: frozenset()),
    "carriers": lambda: setattr(Plant, "_carriers", lambda *_: frozenset()),
    "ties": lambda: setattr(PlantCache, "ties", lambda *_: []),
}
# Implied tests of each run.
PARTS = 6
# How often a part is drawn that is smaller than what ran, and was not drawn before.
DRAWS = 10


@dataclass
class Count:
    """Of one kind of world: how many worlds, runs, implied tests and differences, and what all that
    took, CPU s.
    """

    worlds: int = 0
    runs: int = 0
    tests: int = 0
    differ: int = 0
    seconds: float = 0.0


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("world", nargs="?", help="a scenario's name or a world file")
    parser.add_argument(
        "--spawn", default="0,0,0.2,0", help="x, y, z m and yaw rad; with a world file"
    )
    parser.add_argument("--goal", default="5,0", help="x, y m; with a world file")
    parser.add_argument(
        "--stand-in", action="append", default=[], help="as in `ddenv run`; with a world file"
    )
    parser.add_argument(
        "--inside", action="store_true", help="as in `ddenv run`; with a world file"
    )
    parser.add_argument(
        "--seconds", type=float, help="simulated time of a run; the scenario's by default"
    )
    parser.add_argument(
        "--tests", type=int, default=36, help="implied tests of each world, at most"
    )
    parser.add_argument("--worlds", type=int, default=10, help="small worlds of each kind")
    parser.add_argument(
        "--from",
        type=int,
        default=0,
        dest="first",
        help="number of the first small world, and seed",
    )
    parser.add_argument("--forget", choices=FORGOTTEN, help="a kind of participant to leave out")
    options = parser.parse_args()
    if options.forget:
        FORGOTTEN[options.forget]()
    print("| worlds | how many | runs | implied tests | that differ | CPU s |")
    print("|---|---|---|---|---|---|", flush=True)
    if options.world is not None:
        return int(row(options.world, [named(options)], options.tests, options.first) > 0)
    husky = read_model(SDF / "robots" / "husky.sdf")
    numbers = range(options.first, options.first + options.worlds)
    differ = [
        row(
            kind,
            ((small_world(kind, one), husky, small_scenario(one)) for one in numbers),
            options.tests,
            0,
        )
        for kind in KINDS
    ]
    return int(sum(differ) > 0)


def named(options: argparse.Namespace) -> tuple[World, Model, Scenario]:
    bundled = SCENARIOS / f"{options.world}.yaml"
    if bundled.is_file():
        scenario = load_scenario(bundled)
    else:
        x, y, z, yaw = map(float, options.spawn.split(","))
        goal_x, goal_y = map(float, options.goal.split(","))
        scenario = scenario_for_world(Path(options.world), (x, y, z, yaw), (goal_x, goal_y))
        scenario = with_options(
            scenario, reading=reading_of(stand_in=options.stand_in, inside=options.inside)
        )
    scenario = with_options(scenario, timeout=options.seconds)
    return *load_parts(scenario), scenario


def row(kind: str, worlds: Iterable[tuple[World, Model, Scenario]], tests: int, first: int) -> int:
    """Prints the row of one kind of world. Returns how many of its implied tests differ."""
    found, began = Count(), time.process_time()
    for world, robot, scenario in worlds:
        audit(PlantCache(world, robot, scenario), frozenset(world.elements()), tests, first, found)
    found.seconds = time.process_time() - began
    print(
        (
            f"| {kind} | {found.worlds} | {found.runs} | {found.tests} | {found.differ} | "
            f"{found.seconds:.0f} |"
        ),
        flush=True,
    )
    return found.differ


def audit(
    simulator: PlantCache, everything: frozenset[str], tests: int, first: int, found: Count
) -> None:
    """Simulates implied tests in one world, and counts them in `found`."""
    chance = random.Random(first)
    elements = sorted(everything)
    number = {name: place for place, name in enumerate(elements)}
    ties = Ties.among(
        (number[name], number[other]) for name, other in simulator.ties(everything) or ()
    )
    found.worlds += 1
    for seed in range(first, first + tests // PARTS):
        there = everything if seed % 2 == 0 else part(everything, chance)
        made = simulator.run(there, seed)
        found.runs += 1
        if made.took_part is None:
            continue
        took_part, tried = made.took_part & there, {there}
        for _ in range(DRAWS):
            drawn = Environment.of(number[name] for name in took_part | part(there, chance))
            closed = ties.closed(drawn, Environment.of(number[name] for name in there))
            keep = frozenset(closed.names(elements))
            if keep not in tried and len(tried) <= PARTS:
                tried.add(keep)
                found.tests += 1
                found.differ += bits(simulator.run(keep, seed), keep) != bits(made, keep)


def part(models: frozenset[str], chance: random.Random) -> frozenset[str]:
    return frozenset(chance.sample(sorted(models), k=chance.randint(0, len(models))))


def bits(result: RunResult, keep: frozenset[str]) -> tuple[object, ...]:
    motions = {name: rows.tobytes() for name, rows in result.motions.items() if name in keep}
    return result.outcome, result.failure, result.trajectory.tobytes(), motions


if __name__ == "__main__":
    sys.exit(main())
