"""Makes the run file of a long run in a large world, without a robot.

python benchmarks/long_run.py FILE [--tests N] [--models N]

The models stand in rows on a square, and the robot gets stuck in their middle. Every round has 50 partitions of neighbours;
each of its candidates but the last is run four times (once and three re-runs) and does not show f; the last one, which is
without the last partition, does.
"""

from __future__ import annotations

import argparse
import json
import math
import sqlite3
import time
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ddenv.runfile.store import ROBOT, RunFile, create
from ddenv.world.sdf.read import parse_world

PARTS = 50
RUNS = 4
PACE = 0.3  # between the ends of two tests, s
Happened = tuple[str, dict[str, Any]]
ROBOT_SDF = (
    '<sdf version="1.9"><model name="robot"><link name="base"><collision name="body"><geometry>'
    "<box><size>0.6 0.4 0.2</size></box></geometry></collision></link></model></sdf>"
)
GROUND = (
    '<model name="ground_plane"><static>true</static><link name="link"><collision name="plane"><geometry>'
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
        "reduction": {"pair": "model2model/failure-proximal", "iterations": RUNS - 1, "baseline_runs": RUNS},
    }
    elements = list(parse_world(world, path).elements())
    documents = {"scenario": json.dumps(data).encode(), "world": world, "robot": ROBOT_SDF.encode()}
    create(path, documents, {"scenario": data, "elements": elements})
    samples = way(width)
    with RunFile(path) as file:
        file.own()
        for kind, happened in events(tests, models, width):
            file.append(kind, happened, {ROBOT: samples} if happened.get("outcome") == "similar" else None)
        file.settle()
    pace(path)


def pace(path: Path) -> None:
    """Gives the events the times that such a run takes, the last one now."""
    with sqlite3.connect(path) as db:
        (count,) = db.execute("SELECT count(*) FROM event WHERE kind = 'test_finished'").fetchone()
        (last,) = db.execute("SELECT max(id) FROM event").fetchone()
        step = PACE * count / last
        db.execute("UPDATE event SET time = ? + (id - ?) * ?", (time.time(), last, step))


def world_of(models: int) -> str:
    row = math.ceil(math.sqrt(models))
    boxes = (
        f'<model name="crate {number}"><static>true</static><pose>{number % row} {number // row} 0.25 0 0 {number % 3}</pose>'
        f'<link name="link"><collision name="box"><geometry><box><size>0.5 0.4 0.5</size></box></geometry></collision>'
        f"</link></model>"
        for number in range(models)
    )
    return f'<sdf version="1.9"><world name="crates">{GROUND}{"".join(boxes)}</world></sdf>'


def way(width: float) -> bytes:
    """From the start to the middle of the square, 450 samples in 45 s."""
    rows = array("d")
    for number in range(450):
        along = -2 + (width / 2 + 2) * number / 449
        rows.extend((number / 10, along, along + math.sin(along / 3), 0.2, math.cos(0.4), 0.0, 0.0, math.sin(0.4)))
    return rows.tobytes()


def events(tests: int, models: int, width: float) -> Iterator[Happened]:
    yield "engine_started", {"pid": 1, "jobs": 2, "version": "0.1.0", "simulator": "drake"}
    for run in range(RUNS):
        yield (
            "test_started",
            {"test": run + 1, "phase": "baseline", "round": None, "candidate": None, "run": run, "seed": run},
        )
        yield "test_finished", ended(run + 1, "similar", width)
    yield (
        "baseline_finished",
        {
            "runs": RUNS,
            "failures": RUNS,
            "rate": 1.0,
            "low": 0.51,
            "high": 1.0,
            "failure_test": 1,
            "position": [width / 2, width / 2, 0.2],
            "miss_chance": 0.0,
            "iterations_95": 0,
            "outcomes": dict.fromkeys(map(str, range(1, RUNS + 1)), "similar"),
            "distances": dict.fromkeys(map(str, range(1, RUNS + 1)), 0.1),
        },
    )
    kept, test, number = list(range(models)), RUNS + 1, 0
    while test <= tests:
        number += 1
        partitions = [kept[len(kept) * part // PARTS : len(kept) * (part + 1) // PARTS] for part in range(PARTS)]
        yield "round_started", announced(number, kept, partitions)
        for candidate in range(2 * PARTS):
            runs = RUNS if candidate < 2 * PARTS - 1 else 1
            yield from tried(number, candidate, range(test, test + runs), width)
            test += runs
        kept = [model for part in partitions[:-1] for model in part]
        yield "reduced", {"candidate": 2 * PARTS - 1, "environment": kept, "evidence_test": test - 1}
        yield "round_finished", {}


def announced(number: int, kept: list[int], partitions: list[list[int]]) -> dict[str, Any]:
    candidates = [[kind, part, 0.5 + part] for part in range(PARTS) for kind in ("partition", "complement")]
    return {
        "round": number,
        "n_partitions": PARTS,
        "environment": kept,
        "partitions": partitions,
        "candidates": candidates,
    }


def tried(round: int, candidate: int, tests: range, width: float) -> Iterator[Happened]:
    """All tests of a candidate, and its verdict: similar if there is but one."""
    similar = len(tests) == 1
    for run, test in enumerate(tests):
        place = {"phase": "round", "round": round, "candidate": candidate}
        yield "test_started", {"test": test, **place, "run": run, "seed": run}
        yield "test_finished", ended(test, "similar" if similar else "other" if run % 2 else "pass", width)
    verdict = "similar" if similar else "dissimilar"
    yield "candidate_judged", {"candidate": candidate, "verdict": verdict, "tests": list(tests), "known": 0}


def ended(test: int, outcome: str, width: float) -> dict[str, Any]:
    return {
        "test": test,
        "outcome": outcome,
        "failure": "" if outcome == "pass" else "stuck",
        "distance": 0.12 if outcome == "similar" else 2.34567891,
        "end_pose": [width / 2, width / 2, 0.2, 1.0, 0.0, 0.0, 0.0],
        "simulated_seconds": 45.0,
        "wall_seconds": 0.61234567,
        "first_sensed": [[number, 0.25 * number] for number in range(10)],
        "cut": False,
        "first_touched": [[3, 12.5]],
    }


if __name__ == "__main__":
    main()
