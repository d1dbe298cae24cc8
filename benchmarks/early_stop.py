"""Runs the robot in random parts of a world, each seed twice: to the end, and with early stop.

    python benchmarks/early_stop.py [--scenario ditch] [--environments N] [--seeds S] [--jobs N]

f is fixed from the scenario's baseline, as a reduction does it. A verdict differs if early stop changes the
outcome of a run: similar, other or pass. The parts are of all sizes, from a single model to all but one.
"""

import argparse
import multiprocessing
import random
from dataclasses import replace

from ddenv.engine.judging import fix_failure
from ddenv.evidence.rates import wilson_interval
from ddenv.robot.oracle import Failure, judge
from ddenv.robot.result import RunResult
from ddenv.robot.simulation.template import Variants
from ddenv.runfile.state import Test
from ddenv.runs import processor
from ddenv.runs.subject import load_parts
from ddenv.world.load import find_scenario, load_scenario
from ddenv.world.scenario import Reduction, Scenario, seed_of

Asked = tuple[frozenset[str], int]
# The same test to its end, and with early stop.
Both = tuple[RunResult, RunResult]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenario", default="ditch", help="a bundled name or a YAML file")
    parser.add_argument("--environments", type=int, default=100, help="random parts of the world")
    parser.add_argument("--seeds", type=int, default=4, help="runs of each part")
    parser.add_argument("--jobs", type=int, default=processor.usable_cores())
    options = parser.parse_args()
    scenario = load_scenario(find_scenario(options.scenario))
    world, _ = load_parts(scenario)
    elements = world.elements(frozenset(scenario.protected))
    asked = tests(elements, options.environments, options.seeds, scenario.reduction)
    whole = [(frozenset(elements), seed_of(scenario.reduction, run)) for run in range(scenario.reduction.baseline_runs)]
    with multiprocessing.get_context("spawn").Pool(options.jobs, prepare, (scenario,)) as pool:
        failure = fixed(scenario, pool.map(full_run, whole))
        pairs = list(pool.imap_unordered(both_runs, asked))
    print("| scenario | tests | ended early | verdicts that differ | at most (95 %) | simulated time |")
    print("|---|---|---|---|---|---|")
    print(row(scenario.name, pairs, failure))


def tests(elements: tuple[str, ...], environments: int, seeds: int, reduction: Reduction) -> list[Asked]:
    """Random parts of all sizes, each with the first seeds of the reduction."""
    chance = random.Random(0)
    parts = [frozenset(chance.sample(elements, chance.randrange(1, len(elements)))) for _ in range(environments)]
    return [(part, seed_of(reduction, run)) for part in parts for run in range(seeds)]


def prepare(scenario: Scenario) -> None:
    """Builds the world once in each process, as the engine's workers do."""
    global _simulator
    _simulator = Variants(*load_parts(scenario), scenario)


def full_run(asked: Asked) -> RunResult:
    return _simulator.run(*asked, full=True)


def both_runs(asked: Asked) -> Both:
    return _simulator.run(*asked, full=True), _simulator.run(*asked, full=False)


def fixed(scenario: Scenario, results: list[RunResult]) -> Failure:
    """f as the engine fixes it from the runs of the whole world."""
    ran = [
        Test(number, 0, "baseline", None, None, number, result.seed, result.outcome, end_pose=result.end_pose)
        for number, result in enumerate(results)
    ]
    trajectories = {number: result.trajectory for number, result in enumerate(results)}
    spec = scenario.failure
    found = fix_failure(ran, trajectories, spec, scenario.reduction.iterations)
    if isinstance(found, str):
        raise SystemExit(found)
    return Failure(found.position, trajectories[found.failure_test], spec.epsilon, spec.similarity)


def differs(pair: Both, failure: Failure) -> bool:
    """Whether early stop changes its outcome, with either similarity."""
    ways = [replace(failure, similarity=similarity) for similarity in ("end-pose", "trajectory")]
    return any(judge(pair[0], way).outcome != judge(pair[1], way).outcome for way in ways)


def row(name: str, pairs: list[Both], failure: Failure) -> str:
    wrong = sum(differs(pair, failure) for pair in pairs)
    cut = sum(pair[1].cut for pair in pairs)
    most = f"{wilson_interval(wrong, cut)[1]:.1%} of those ended early" if cut else "-"
    full, early = (sum(pair[kind].simulated_seconds for pair in pairs) for kind in (0, 1))
    return f"| {name} | {len(pairs)} | {cut} | {wrong} | {most} | {1 - early / full:.0%} less |"


if __name__ == "__main__":
    main()
