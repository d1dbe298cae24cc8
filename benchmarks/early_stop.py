"""Runs the robot in random parts of worlds, each seed both ways: with early stop, and to the end.

    python benchmarks/early_stop.py [--scenario ditch] [--world FILE:SPAWN:GOAL ...]
                                    [--environments N] [--seeds S] [--seconds N] [--jobs N]

A world is any SDF file, with x,y,z,yaw of the start and x,y of the goal:
`arena.world:-8,0,0.4,0:7.5,0.5`. What it lacks is stood in for; `--model-path` has folders with
models.

f is fixed from baseline runs of the whole world, as a reduction does it. A verdict differs if early
stop changes the outcome of a run: similar, other or pass. The parts are of all sizes, from a single
model to all. A run that does not end early is not made again: it is the run to its end. Of a run
that does, the longer one has to begin with its bits; `moved` is how far the robot still moved then,
at most.
"""

import argparse
import multiprocessing
import random
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from ddenv.engine.judging import fix_failure
from ddenv.evidence.rates import wilson_interval
from ddenv.robot.oracle import Failure, ends_of, judge
from ddenv.robot.result import Ends, RunResult
from ddenv.robot.simulation.plant_cache import PlantCache
from ddenv.runfile.state import Test
from ddenv.runs import processor
from ddenv.runs.experiment import load_parts, reading_of, scenario_for_world, with_options
from ddenv.world.load import find_scenario, load_scenario
from ddenv.world.scenario import Reduction, Scenario, seed_of

Asked = tuple[frozenset[str], int]
# The same test to its end, and with early stop.
Both = tuple[RunResult, RunResult]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument(
        "--scenario",
        action="append",
        default=[],
        help="a bundled name or a YAML file; may be repeated",
    )
    parser.add_argument(
        "--world", action="append", default=[], help="FILE:SPAWN:GOAL; may be repeated"
    )
    parser.add_argument(
        "--model-path", action="append", default=[], type=Path, help="a folder with models"
    )
    parser.add_argument("--time-step", type=float, help="of worlds, s")
    parser.add_argument("--environments", type=int, default=100, help="random parts of each world")
    parser.add_argument("--seeds", type=int, default=4, help="runs of each part")
    parser.add_argument("--baseline", type=int, default=4, help="runs of the whole world")
    parser.add_argument("--seconds", type=float, default=1e9, help="real time for each world")
    parser.add_argument("--jobs", type=int, default=processor.usable_cores())
    options = parser.parse_args()
    scenarios = [load_scenario(find_scenario(name)) for name in options.scenario]
    scenarios += [of_world(text, options.model_path, options.time_step) for text in options.world]
    print(
        "| world | tests | ended early | verdicts that differ | at most (95 %) | moved | "
        "simulated time |"
    )
    print("|---|---|---|---|---|---|---|", flush=True)
    total: list[tuple[Both, Failure]] = []
    for scenario in scenarios or [load_scenario(find_scenario("ditch"))]:
        pairs = measured(scenario, options)
        total += pairs
        print(row(scenario.name, pairs), flush=True)
    print(row("all", total))


def of_world(text: str, folders: list[Path], time_step: float | None) -> Scenario:
    """The scenario of the bundled robot in `FILE:SPAWN:GOAL`."""
    path, spawn, goal = text.rsplit(":", 2)
    x, y, z, yaw = map(float, spawn.split(","))
    goal_x, goal_y = map(float, goal.split(","))
    scenario = scenario_for_world(Path(path), (x, y, z, yaw), (goal_x, goal_y))
    scenario = with_options(scenario, reading=reading_of(model_path=folders, stand_in=["auto"]))
    if time_step is None:
        return scenario
    simulation = scenario.simulation.model_copy(update={"time_step": time_step})
    return scenario.model_copy(update={"simulation": simulation})


def measured(scenario: Scenario, options: argparse.Namespace) -> list[tuple[Both, Failure]]:
    world, _ = load_parts(scenario)
    elements = world.elements(frozenset(scenario.protected))
    whole = [
        (frozenset(elements), seed_of(scenario.reduction, run)) for run in range(options.baseline)
    ]
    asked = tests(elements, options.environments, options.seeds, scenario.reduction)
    until = time.monotonic() + options.seconds
    with multiprocessing.get_context("spawn").Pool(options.jobs, prepare, (scenario,)) as pool:
        failure = fixed(scenario, pool.starmap(full_run, whole))
        jobs = ((one, ends_of([failure])) for one in in_time(asked, until))
        # Jobs are taken from the list as fast as they are made only where the pool is asked for few
        # at a time.
        pairs = []
        while batch := list(islice(jobs, options.jobs)):
            pairs += pool.starmap(both_runs, batch)
    return [(pair, failure) for pair in pairs]


def in_time(asked: list[Asked], until: float) -> Iterator[Asked]:
    return (one for one in asked if time.monotonic() < until)


def tests(
    elements: tuple[str, ...], environments: int, seeds: int, reduction: Reduction
) -> list[Asked]:
    """Random parts of all sizes, each with the first seeds of the reduction."""
    chance = random.Random(0)
    parts = [
        frozenset(chance.sample(elements, chance.randint(1, len(elements))))
        for _ in range(environments)
    ]
    return [(part, seed_of(reduction, run)) for part in parts for run in range(seeds)]


def prepare(scenario: Scenario) -> None:
    """Builds the world once in each process, as the engine's workers do."""
    global _simulator
    _simulator = PlantCache(*load_parts(scenario), scenario)


def full_run(keep: frozenset[str], seed: int) -> RunResult:
    return _simulator.run(keep, seed)


def both_runs(asked: Asked, ends: Ends) -> Both:
    early = _simulator.run(*asked, ends=ends)
    full = _simulator.run(*asked) if early.cut else early
    rows = len(early.trajectory)
    assert np.array_equal(full.trajectory[:rows], early.trajectory), asked
    return full, early


def fixed(scenario: Scenario, results: list[RunResult]) -> Failure:
    """f as the engine fixes it from the runs of the whole world."""
    ran = [
        Test(
            id=number,
            environment=0,
            phase="baseline",
            round=None,
            candidate=None,
            run=number,
            seed=result.seed,
            outcome=result.outcome,
            end_pose=result.end_pose,
        )
        for number, result in enumerate(results)
    ]
    trajectories = {number: result.trajectory for number, result in enumerate(results)}
    spec = scenario.failure
    found = fix_failure(ran, trajectories, spec, scenario.reduction.iterations)
    if isinstance(found, str):
        raise SystemExit(f"{scenario.name}: {found}")
    return Failure(found.position, trajectories[found.failure_test], spec.epsilon, spec.similarity)


def differs(pair: Both, failure: Failure) -> bool:
    """Whether early stop changes its outcome."""
    full, early = pair
    return judge(full, failure).outcome != judge(early, failure).outcome


def moved(pair: Both) -> float:
    """How far the robot still moved after the run could end, m."""
    full, early = pair
    rest = full.trajectory[len(early.trajectory) - 1 :, 1:4]
    return float(np.linalg.norm(rest - rest[0], axis=1).max())


def row(name: str, tested: list[tuple[Both, Failure]]) -> str:
    pairs = [pair for pair, _ in tested]
    wrong = sum(differs(pair, failure) for pair, failure in tested)
    cut = [pair for pair in pairs if pair[1].cut]
    most = f"{wilson_interval(wrong, len(cut))[1]:.1%} of those ended early" if cut else "-"
    kinds = sum(full.failure != early.failure for full, early in cut)
    way = f"{max(map(moved, cut)):.3f} m" if cut else "-"
    full_time, early_time = (sum(pair[kind].simulated_seconds for pair in pairs) for kind in (0, 1))
    saved = f"{1 - early_time / full_time:.0%} less" if pairs else "-"
    return (
        f"| {name} | {len(pairs)} | {len(cut)} | {wrong} ({kinds} kinds) | {most} | {way} | "
        f"{saved} |"
    )


if __name__ == "__main__":
    main()
