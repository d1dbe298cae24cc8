"""Makes the run file of a long run in a large world, without a robot.

python benchmarks/long_run.py FILE [--tests N] [--models N]

The models stand in rows on a square, and the robot gets stuck in their middle. Every round has 50
partitions of neighbours; each of its candidates but the last is run four times (once and three
re-runs) and does not show f; the last one, which is without the last partition, does.
"""

from __future__ import annotations

import argparse
import json
import math
from array import array
from collections.abc import Iterator
from pathlib import Path

from ddenv.environment import Environment
from ddenv.runfile.events import (
    BaselineFinished,
    CandidateJudged,
    Created,
    EngineStarted,
    EnvironmentNamed,
    Event,
    Outcome,
    Outcomes,
    Reduced,
    RoundFinished,
    RoundStarted,
    TestFinished,
    TestStarted,
)
from ddenv.runfile.store import ROBOT, RunFile, create
from ddenv.world.sdf.read import parse_world

PARTS = 50
RUNS = 4
ROBOT_SDF = (
    '<sdf version="1.9"><model name="robot"><link name="base"><collision name="body"><geometry>'
    "<box><size>0.6 0.4 0.2</size></box></geometry></collision></link></model></sdf>"
)
GROUND = (
    '<model name="ground_plane"><static>true</static><link name="link"><collision '
    'name="plane"><geometry>'
    "<plane><normal>0 0 1</normal></plane></geometry></collision></link></model>"
)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("file", type=Path)
    parser.add_argument("--tests", type=int, default=10_000)
    parser.add_argument("--models", type=int, default=5_000)
    options = parser.parse_args()
    write(options.file, options.tests, options.models)


def write(path: Path, tests: int, models: int) -> None:
    """A run of at least so many tests, at a round's end, in a world of so many models."""
    world = world_of(models).encode()
    width = math.sqrt(models)
    data = {
        "name": "crates",
        "description": "A robot gets stuck among many crates.",
        "world": "crates.sdf",
        "robot": {"model": "robot.sdf", "spawn": {"x": -2.0, "y": -2.0, "z": 0.2, "yaw": 0.8}},
        "goal": {"x": width + 2, "y": width + 2},
        "reduction": {
            "pair": "model2model/failure-proximal",
            "iterations": RUNS - 1,
            "baseline_runs": RUNS,
        },
    }
    elements = list(parse_world(world, path).elements())
    documents = {"scenario": json.dumps(data).encode(), "world": world, "robot": ROBOT_SDF.encode()}
    create(path, documents, Created(scenario=data, elements=tuple(elements)))
    samples = way(width)
    with RunFile(path) as file:
        file.own()
        for event in events(tests, models, width):
            similar = isinstance(event, TestFinished) and event.outcome == "similar"
            file.append(event, {ROBOT: samples} if similar else None)
        file.settle()


def world_of(models: int) -> str:
    row = math.ceil(math.sqrt(models))
    boxes = (
        f'<model name="crate {number}"><static>true</static><pose>{number % row} {number // row} '
        f"0.25 0 0 {number % 3}</pose>"
        '<link name="link"><collision name="box"><geometry><box><size>0.5 0.4 '
        "0.5</size></box></geometry></collision>"
        f"</link></model>"
        for number in range(models)
    )
    return f'<sdf version="1.9"><world name="crates">{GROUND}{"".join(boxes)}</world></sdf>'


def way(width: float) -> bytes:
    """From the start to the middle of the square, 450 samples in 45 s."""
    rows = array("d")
    for number in range(450):
        along = -2 + (width / 2 + 2) * number / 449
        rows.extend(
            (
                number / 10,
                along,
                along + math.sin(along / 3),
                0.2,
                math.cos(0.4),
                0.0,
                0.0,
                math.sin(0.4),
            )
        )
    return rows.tobytes()


def events(tests: int, models: int, width: float) -> Iterator[Event]:
    yield EngineStarted(pid=1, jobs=2, version="0.1.0", simulator="drake")
    runs = range(1, RUNS + 1)
    for test in runs:
        yield TestStarted(test=test, environment=0, run=test - 1, seed=test - 1, phase="baseline")
        yield ended(test, "similar", width)
    judged = Outcomes(dict.fromkeys(runs, "similar"), dict.fromkeys(runs, 0.1))
    yield BaselineFinished(
        runs=RUNS,
        failures=RUNS,
        rate=1.0,
        low=0.51,
        high=1.0,
        failure_test=1,
        position=(width / 2, width / 2, 0.2),
        miss_chance=0.0,
        iterations_95=0,
        judged=judged,
    )
    kept, here, environments, test, number = list(range(models)), 0, 1, RUNS + 1, 0
    while test <= tests:
        number += 1
        parts = [
            tuple(kept[len(kept) * part // PARTS : len(kept) * (part + 1) // PARTS])
            for part in range(PARTS)
        ]
        kinds = [
            (kind, part, 0.5 + part)
            for part in range(PARTS)
            for kind in ("partition", "complement")
        ]
        yield RoundStarted(
            round=number,
            n_partitions=PARTS,
            environment=here,
            partitions=tuple(parts),
            candidates=tuple(kinds),
        )
        whole = Environment.of(kept)
        for candidate, (kind, part, _) in enumerate(kinds):
            runs = RUNS if candidate < 2 * PARTS - 1 else 1
            some = Environment.of(parts[part])
            yield EnvironmentNamed(
                environment=environments, models=some if kind == "partition" else whole - some
            )
            yield from tried(number, candidate, environments, range(test, test + runs), width)
            test, environments = test + runs, environments + 1
        kept, here = [model for part in parts[:-1] for model in part], environments - 1
        yield Reduced(
            round=number, candidate=2 * PARTS - 1, environment=here, evidence_test=test - 1
        )
        yield RoundFinished(round=number)


def tried(
    round: int, candidate: int, environment: int, tests: range, width: float
) -> Iterator[Event]:
    """All tests of a candidate, and its verdict: similar if there is but one."""
    similar = len(tests) == 1
    for run, test in enumerate(tests):
        yield TestStarted(
            test=test,
            environment=environment,
            run=run,
            seed=run,
            phase="round",
            round=round,
            candidate=candidate,
        )
        yield ended(test, "similar" if similar else "other" if run % 2 else "pass", width)
    yield CandidateJudged(
        round=round,
        candidate=candidate,
        verdict="similar" if similar else "dissimilar",
        tests=tuple(tests),
    )


def ended(test: int, outcome: Outcome, width: float) -> TestFinished:
    return TestFinished(
        test=test,
        outcome=outcome,
        failure="" if outcome == "pass" else "stuck",
        distance=0.12 if outcome == "similar" else 2.34567891,
        end_pose=(width / 2, width / 2, 0.2, 1.0, 0.0, 0.0, 0.0),
        simulated_seconds=45.0,
        wall_seconds=0.61234567,
        first_sensed=tuple((number, 0.25 * number) for number in range(10)),
        first_touched=((3, 12.5),),
    )


if __name__ == "__main__":
    main()
