"""How often the robot fails in the scenarios that come with ddenv, and in the same worlds with the
cause taken away.

    python benchmarks/failure_rates.py [--seeds N] [--jobs N] [--scenarios ditch,rubble,friction]

Repaired worlds: the ditch is filled, the cinder blocks of the rubble are gone, all patches are as
rough as the asphalt. A run failed if it did not reach the goal; it shows f if it ended within
epsilon of the failed run that has most others there. Intervals are Wilson's, 95 %.
"""

import argparse
import runpy
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from ddenv.evidence.rates import wilson_interval
from ddenv.robot.result import RunResult
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.runfile.failures import alike
from ddenv.runs.experiment import load_parts
from ddenv.world.load import SCENARIOS, SDF, load_scenario
from ddenv.world.model import World
from ddenv.world.sdf.read import parse_world

SCRIPTS = SDF / "worlds"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scenarios", default="ditch,rubble,friction")
    arguments = parser.parse_args()
    print("| scenario | world | failed | f | how |")
    print("|---|---|---|---|---|")
    with ProcessPoolExecutor(arguments.jobs, mp_context=get_context("spawn")) as pool:
        for name in arguments.scenarios.split(","):
            for repaired in (False, True):
                shares = [
                    range(arguments.seeds)[job :: arguments.jobs] for job in range(arguments.jobs)
                ]
                asked = [(name, repaired, seeds) for seeds in shares]
                results = [
                    result
                    for share in pool.map(runs, *zip(*asked, strict=True))
                    for result in share
                ]
                print(row(name, repaired, results), flush=True)


def repaired_world(name: str) -> World:
    """The world of a scenario with the cause of its failure taken away."""
    sys.path.insert(0, str(SCRIPTS))
    try:
        text = runpy.run_path(str(SCRIPTS / f"make_{name}.py"))[name](repaired=True)
    finally:
        sys.path.remove(str(SCRIPTS))
    return parse_world(text.encode(), Path(f"{name} repaired"))


def runs(name: str, repaired: bool, seeds: range) -> list[RunResult]:
    scenario = load_scenario(SCENARIOS / f"{name}.yaml")
    world, robot = load_parts(scenario)
    if repaired:
        world = repaired_world(name)
    template = Plant(world, robot, scenario)
    return [template.run(frozenset(world.elements()), seed) for seed in seeds]


def row(name: str, repaired: bool, results: list[RunResult]) -> str:
    failed = [result for result in results if result.outcome != "pass"]
    similar = 0
    if failed:
        epsilon = load_scenario(SCENARIOS / f"{name}.yaml").failure.epsilon
        similar = len(alike([result.end_pose[:3] for result in failed], epsilon)[0])
    kinds = ", ".join(
        f"{count} {kind}" for kind, count in Counter(one.failure for one in failed).most_common()
    )
    cells = [
        name,
        "repaired" if repaired else "whole",
        share(len(failed), len(results)),
        share(similar, len(results)),
    ]
    return f"| {' | '.join(cells)} | {kinds or '-'} |"


def share(count: int, of: int) -> str:
    low, high = wilson_interval(count, of)
    return f"{count} of {of} ({low:.2f} to {high:.2f})"


if __name__ == "__main__":
    main()
