"""How fast real worlds run: a world file, or `friction` among crates that the robot cannot reach.

    python benchmarks/real_worlds.py [--models 25,5000] [--clear M] [--tests N] [--jobs N]
    python benchmarks/real_worlds.py WORLD --spawn X,Y,Z,YAW --goal X,Y

Prints a row for each world. *Read* and *build* are the times until it can be simulated. *Simulated s a second* counts CPU seconds
of one core over full runs of the whole world, without the first one, in which piles are rehearsed. Then an engine with one worker
makes tests: *between tests* is the time that passes for each of them besides the run itself. *Memory* is the largest sum over all
processes of an engine with `--jobs` workers; a page that several of them share counts once.
"""

from __future__ import annotations

import argparse
import gc
import math
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from ddenv.robot.drake.region import WIDTH, Region
from ddenv.robot.simulation.template import Variants
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.programs import start_engine
from ddenv.runs.subject import load_parts, scenario_for_world, with_options
from ddenv.world.load import SCENARIOS, load_scenario
from ddenv.world.scenario import Scenario

GAP = 2.0  # m between the middles of two crates
CRATE = 0.8  # m
# The models of `friction` that can be removed.
OWN = 25


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", nargs="?", type=Path)
    parser.add_argument("--spawn", default="0,0,0.2,0", help="x, y, z m and yaw rad; with a world file")
    parser.add_argument("--goal", default="5,0", help="x, y m; with a world file")
    parser.add_argument("--models", default="25,5000", help="how many models are in the generated worlds")
    parser.add_argument("--clear", type=float, default=12.0, help="distance of the crates from the robot's way, m")
    parser.add_argument("--seeds", type=int, default=4, help="runs to measure the speed with")
    parser.add_argument("--tests", type=int, default=14, help="tests to measure time between tests and memory with")
    parser.add_argument("--jobs", type=int, default=2, help="workers to measure the memory with")
    options = parser.parse_args()
    print(
        "| world | models | read, s | build, s | simulated s a second | CPU s a test | between tests, ms | memory, MB |"
    )
    print("|---|---|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for scenario in scenarios(options, Path(folder)):
            print(row(scenario, Path(folder), options.seeds, options.tests, options.jobs), flush=True)


def scenarios(options: argparse.Namespace, folder: Path) -> Iterator[Scenario]:
    if options.world is not None:
        x, y, z, yaw = map(float, options.spawn.split(","))
        goal_x, goal_y = map(float, options.goal.split(","))
        yield scenario_for_world(options.world, (x, y, z, yaw), (goal_x, goal_y))
        return
    friction = load_scenario(SCENARIOS / "friction.yaml")
    for models in map(int, options.models.split(",")):
        path = folder / f"friction_{models}.sdf"
        path.write_bytes(among_crates(friction, models - OWN, options.clear))
        yield with_options(friction, world=path)


def among_crates(scenario: Scenario, crates: int, clear: float) -> bytes:
    """The world of a scenario with static crates around it, none within `clear` (m) of the straight way to the goal."""
    spawn, goal = scenario.robot.spawn, scenario.goal
    way = Region.of((spawn.x, spawn.y), (goal.x, goal.y), ())
    grid = [(GAP * i, GAP * j) for i in range(-60, 61) for j in range(-60, 61)]
    far = [
        place for place in sorted(grid, key=lambda place: math.dist(place, (0, 0))) if WIDTH - way.depth(place) > clear
    ]
    text = "".join(crate(number, *place) for number, place in enumerate(far[:crates]))
    return scenario.world.read_bytes().replace(b"</world>", text.encode() + b"</world>")


def crate(number: int, x: float, y: float) -> str:
    box = f"<box><size>{CRATE} {CRATE} {CRATE}</size></box>"
    link = f'<link name="link"><collision name="box"><geometry>{box}</geometry></collision></link>'
    return (
        f'<model name="crate_{number:04}"><static>true</static><pose>{x} {y} {CRATE / 2} 0 0 0</pose>{link}</model>\n'
    )


def row(scenario: Scenario, folder: Path, seeds: int, tests: int, jobs: int) -> str:
    started = time.perf_counter()
    world, robot = load_parts(scenario)
    read = time.perf_counter() - started
    variants = Variants(world, robot, scenario)
    build = time.perf_counter() - started - read
    elements = frozenset(world.elements())
    variants.run(elements, seeds)
    began, simulated = time.process_time(), 0.0
    for seed in range(seeds):
        simulated += variants.run(elements, seed).simulated_seconds
    spent = time.process_time() - began
    del variants
    gc.collect()
    between = engine(scenario, folder / "one.ddenv", tests, 1).between
    memory = engine(scenario, folder / "all.ddenv", tests, jobs).memory
    return (
        f"| {scenario.world.stem} | {len(elements)} | {read:.1f} | {build:.1f} | {simulated / spent:.1f} | {spent / seeds:.2f} "
        f"| {1000 * between:.0f} | {memory / 1e6:.0f} |"
    )


@dataclass
class Measured:
    """`between` s of a test besides its run; `memory` bytes of all processes."""

    between: float
    memory: float


def engine(scenario: Scenario, path: Path, tests: int, jobs: int) -> Measured:
    """Lets an engine make `tests` tests."""
    path.unlink(missing_ok=True)
    create_run(with_options(scenario, budget=tests), path)
    process = start_engine(path, jobs)
    with largest(process.pid) as memory:
        process.wait()
    with RunFile(path) as file:
        events = [event for event in file.events() if event.kind.startswith("test_")]
    ended = [event for event in events if event.kind == "test_finished"]
    if len(ended) < 2:
        raise SystemExit(
            f"{len(ended)} of {tests} tests ended: too few to measure the time between them; see {path}.log"
        )
    # The first test also waits for the worker to start.
    span = ended[-1].time - ended[0].time
    busy = sum(event.data["wall_seconds"] for event in ended[1:])
    return Measured((span - busy) / (len(ended) - 1), max(memory))


@contextmanager
def largest(session: int) -> Iterator[list[float]]:
    """Appends the memory of all processes of a session, bytes, again and again."""
    found, done = [0.0], threading.Event()

    def look() -> None:
        while not done.wait(0.2):
            found.append(sum(memory_of(process) for process in Path("/proc").glob("[0-9]*") if of(process, session)))

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield found
    finally:
        done.set()
        thread.join()


def of(process: Path, session: int) -> bool:
    try:
        return int((process / "stat").read_text().rpartition(")")[2].split()[3]) == session
    except OSError:
        return False


def memory_of(process: Path) -> float:
    """Memory in use, where a page that n processes share counts 1 / n, bytes."""
    try:
        lines = (process / "smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    return next((1024.0 * int(line.split()[1]) for line in lines if line.startswith("Pss:")), 0.0)


if __name__ == "__main__":
    main()
