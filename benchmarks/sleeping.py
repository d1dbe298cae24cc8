"""Drives through a field of loose boards, with and without sleep for the boards that nothing comes near.

    python benchmarks/sleeping.py [--boards N] [--seconds S]
    python benchmarks/sleeping.py --compare SCENARIO [--runs N] [--seconds S]
    python benchmarks/sleeping.py --compare piles [--runs N] [--seconds S]
    python benchmarks/sleeping.py --compare WORLD --spawn X,Y,Z,YAW --goal X,Y [--runs N] [--seconds S]

Each world has N boards (2 kg, 0.9 m long): every tenth lies across the robot's path, the others are piled up in threes beside it,
two with a third across them. The first run in a world also rehearses how each pile settles alone; later runs reuse that.

With `--compare` the whole world runs twice with each seed, until the robot is stuck for good: prints ends and costs
with and without sleep. `piles` are small random worlds (`small_worlds.py`), another one for each seed.
"""

import argparse
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import count, repeat
from pathlib import Path

from small_worlds import small_scenario, small_world

from ddenv.evidence.rates import wilson_interval
from ddenv.robot.simulation.template import Template
from ddenv.runs.subject import load_parts, scenario_for_world, with_options
from ddenv.world.load import SCENARIOS, SDF, load_scenario, validate
from ddenv.world.model import World
from ddenv.world.pose import Vector
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.read import parse_world, read_model

SIZE = (0.9, 0.09, 0.04)  # m
MASS = 2.0  # kg
GROUND = (
    '<model name="ground"><static>true</static><link name="link"><collision name="c"><geometry><plane>'
    "<normal>0 0 1</normal></plane></geometry></collision></link></model>"
)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--boards", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=12.0, help="simulated time of a run")
    parser.add_argument("--compare", metavar="SCENARIO|WORLD")
    parser.add_argument("--spawn", default="0,0,0.2,0", help="x, y, z m and yaw rad; with a world file")
    parser.add_argument("--goal", default="5,0", help="x, y m; with a world file")
    parser.add_argument("--runs", type=int, default=20)
    arguments = parser.parse_args()
    if arguments.compare == "piles":
        compare(piles(arguments.seconds), arguments.runs)
        return
    if arguments.compare:
        scenario = compared(arguments)
        world, robot = load_parts(scenario)
        compare(repeat((Template(world, robot, scenario), scenario)), arguments.runs)
        return
    print("| boards | first run, s a simulated s | later runs, s a simulated s | without sleeping | faster |")
    print("|---|---|---|---|---|")
    for boards in sorted({10, 30, arguments.boards}):
        print(row(boards, arguments.seconds), flush=True)


def row(boards: int, seconds: float) -> str:
    template = template_of(field(boards), seconds)
    everything = frozenset(f"board_{number}" for number in range(boards))
    first, later = (cost(template, everything) for _ in range(2))
    template._sleeping = False
    without = cost(template, everything)
    return f"| {boards} | {first:.3f} | {later:.3f} | {without:.3f} | {without / later:.1f} |"


def cost(template: Template, keep: frozenset[str]) -> float:
    """Wall time (s) for each simulated second of a run, with the rehearsals it needs."""
    started = time.perf_counter()
    result = template.run(keep, seed=1)
    return (time.perf_counter() - started) / result.simulated_seconds


def compared(arguments: argparse.Namespace) -> Scenario:
    """The scenario or world to compare, with the time limit asked for."""
    bundled = SCENARIOS / f"{arguments.compare}.yaml"
    if bundled.exists():
        scenario = load_scenario(bundled)
    else:
        x, y, z, yaw = map(float, arguments.spawn.split(","))
        goal_x, goal_y = map(float, arguments.goal.split(","))
        scenario = scenario_for_world(Path(arguments.compare), (x, y, z, yaw), (goal_x, goal_y))
    return with_options(scenario, timeout=arguments.seconds)


def piles(seconds: float) -> Iterator[tuple[Template, Scenario]]:
    husky = read_model(SDF / "robots" / "husky.sdf")
    for number in count():
        scenario = with_options(small_scenario(number), timeout=seconds)
        yield Template(small_world("piles", number), husky, scenario), scenario


def compare(templates: Iterable[tuple[Template, Scenario]], runs: int) -> None:
    """Compares `runs` runs, each in the next of `templates`."""
    cost, ends, other = {True: 0.0, False: 0.0}, [], 0
    for seed, (template, scenario) in zip(range(runs), templates, strict=False):
        pair: list[tuple[str, Vector]] = []
        for sleeping in (True, False):
            template._sleeping = sleeping
            began = time.process_time()
            result = template.run(template.names, seed, full=False)
            cost[sleeping] += (time.process_time() - began) / result.simulated_seconds
            pair.append((result.failure or result.outcome, result.end_pose[:3]))
        ends.append(pair)
        other += pair[0][0] != pair[1][0] or math.dist(pair[0][1], pair[1][1]) > scenario.failure.epsilon
        print(seed, *(f"{kind} at {x:.2f} {y:.2f} {z:.2f}" for kind, (x, y, z) in pair), sep="   ", flush=True)
    for number, label in enumerate(("asleep", "awake")):
        kinds = Counter(pair[number][0] for pair in ends)
        print(label, *(f"{kind}: {share(count, runs)}" for kind, count in kinds.most_common()), sep="   ")
    print(f"end otherwise, or more than epsilon apart: {share(other, runs)}")
    print(f"CPU s a simulated s: {cost[True] / runs:.3f} asleep, {cost[False] / runs:.3f} awake")


def share(count: int, runs: int) -> str:
    low, high = wilson_interval(count, runs)
    return f"{count} of {runs} ({low:.0%} to {high:.0%})"


def template_of(world: World, seconds: float) -> Template:
    scenario = validate(
        {
            "name": "boards",
            "world": "boards.sdf",
            "robot": {"model": "husky.sdf", "spawn": {"x": -2, "y": 0, "z": 0.14}},
            "goal": {"x": 40, "y": 0},
            "failure": {"timeout": seconds},
        },
        "sleeping",
    )
    return Template(world, read_model(SDF / "robots" / "husky.sdf"), scenario)


def field(boards: int) -> World:
    """A flat world with `boards` boards along the x axis."""
    models = [board(number, *place(number)) for number in range(boards)]
    text = f'<sdf version="1.9"><world name="boards">{GROUND}{"".join(models)}</world></sdf>'
    return parse_world(text.encode(), Path("boards.sdf"))


def place(number: int) -> tuple[float, float, float, float]:
    """x, y, z (m) and yaw (rad) of a board."""
    if number % 10 == 0:
        return 0.15 * number, 0.0, SIZE[2] / 2, math.pi / 2
    pile, storey = divmod(number, 3)
    x, y = 0.6 * pile, 2.0 if pile % 2 else -2.0
    if storey == 2:
        return x, y + 0.15, SIZE[2] * 1.5, math.pi / 2
    return x, y + 0.3 * storey, SIZE[2] / 2, 0.0


def board(number: int, x: float, y: float, z: float, yaw: float) -> str:
    a, b, c = SIZE
    inertia = [MASS * (b * b + c * c) / 12, MASS * (a * a + c * c) / 12, MASS * (a * a + b * b) / 12]
    moments = "".join(f"<{name}>{value}</{name}>" for name, value in zip(("ixx", "iyy", "izz"), inertia, strict=True))
    return (
        f'<model name="board_{number}"><pose>{x} {y} {z} 0 0 {yaw}</pose><link name="link"><inertial><mass>{MASS}</mass>'
        f'<inertia>{moments}</inertia></inertial><collision name="c"><geometry><box><size>{a} {b} {c}</size></box></geometry>'
        "</collision></link></model>"
    )


if __name__ == "__main__":
    main()
