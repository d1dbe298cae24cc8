"""Reduces a scenario with pairs and algorithms, and compares with running the same tests one after another.

    python benchmarks/reduction.py [--scenario ditch] [--pairs paper|all|A/B,C/D] [--algorithms ddenv|all|X,Y] [--jobs N]

"faster than one after another" is the sum of all tests' own times divided by the time of the reduction: the gain by the workers,
after the costs of the engine, the run file and building the world.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from ddenv.errors import UserError
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.study.plan import Method, make_plan
from ddenv.words import first_of

HEADER = (
    "algorithm",
    "pair",
    "tests",
    "re-runs",
    "models left",
    "smaller",
    "time, s",
    "s a test",
    "faster than one after another",
    "minimal",
    "left",
)
# Maximum number of models named in a cell.
MOST_NAMES = 4


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenario", default="ditch", help="a bundled name or a YAML file")
    parser.add_argument("--pairs", default="paper", help="paper, all, or pairs separated by commas")
    parser.add_argument("--algorithms", default="ddenv", help="all, or names separated by commas")
    parser.add_argument("--jobs", type=int, default=2, help="tests at the same time")
    options = parser.parse_args()
    try:
        methods = make_plan([options.scenario], options.pairs, options.algorithms).methods
    except UserError as error:
        parser.error(str(error))
    header = " | ".join(HEADER).replace("pair", f"pair, {options.jobs} jobs")
    print(f"| {header} |\n|{'---|' * len(HEADER)}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for number, method in enumerate(methods):
            cells = row(options.scenario, method, options.jobs, Path(folder) / f"{number}.ddenv")
            print(f"| {' | '.join(cells)} |", flush=True)


def row(scenario: str, method: Method, jobs: int, path: Path) -> list[str]:
    """The cells of one reduction, or of its error."""
    words = ["run", scenario, "--algorithm", method.algorithm, "--pair", method.pair]
    words += ["--jobs", str(jobs), "--output", str(path), "--json"]
    done = subprocess.run([sys.executable, "-m", "ddenv", *words], capture_output=True, text=True)
    first = [method.algorithm, "/".join(method.used) or "-"]
    if not done.stdout:
        return [*first, done.stderr.strip().rpartition("\n")[2], *[""] * (len(HEADER) - 3)]
    return [*first, *_results(json.loads(done.stdout), path)]


def _results(told: dict, path: Path) -> list[str]:
    with RunFile(path) as file:
        alone = sum(test.wall_seconds for test in fold(file.events()).finished_tests)
    before, after, seconds = told["models_before"], told["models_after"], told["wall_seconds"]
    return [
        str(told["tests"]),
        str(told["deflake_runs"]),
        f"{after} of {before}",
        f"{1 - after / before:.0%}",
        f"{seconds:.0f}",
        f"{alone / told['tests']:.2f}",
        f"{alone / seconds:.2f}",
        "yes" if told["minimal"] else "no",
        first_of(told["kept"], MOST_NAMES),
    ]


if __name__ == "__main__":
    main()
