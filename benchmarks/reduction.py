"""Reduces the ditch with each of the paper's three pairs, and compares with running the same tests one after another.

    python benchmarks/reduction.py [--jobs N]

The last column is the sum of all tests' own times over the time the reduction took: what the workers gain, with everything
that the engine, the run file and the building of the world cost.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile

PAIRS = ("model2model/failure-proximal", "model2model/avg-trajectory-proximal", "timeseg/avg-trajectory-proximal")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--jobs", type=int, default=2)
    jobs = parser.parse_args().jobs
    print(
        f"| pair, {jobs} jobs | tests | re-runs | models left | smaller | time, s | s a test | faster than one after another |"
    )
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for number, pair in enumerate(PAIRS):
            print(row(pair, jobs, Path(folder) / f"{number}.ddenv"), flush=True)


def row(pair: str, jobs: int, path: Path) -> str:
    words = [
        sys.executable,
        "-m",
        "ddenv",
        "run",
        "ditch",
        "--pair",
        pair,
        "--jobs",
        str(jobs),
        "--output",
        str(path),
        "--json",
    ]
    told = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    with RunFile(path) as file:
        alone = sum(test.wall_seconds for test in fold(file.events()).finished_tests)
    before, after, seconds = told["models_before"], told["models_after"], told["wall_seconds"]
    return (
        f"| {pair} | {told['tests']} | {told['deflake_runs']} | {after} of {before} | {1 - after / before:.0%} "
        f"| {seconds:.0f} | {alone / told['tests']:.2f} | {alone / seconds:.2f} |"
    )


if __name__ == "__main__":
    main()
