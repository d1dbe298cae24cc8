"""Memory of an engine, a workbench and a scene over a long run: their memory after more and more
tests.

    python benchmarks/soak.py [--tests N]

The real engine with one worker and tests that take no time, in a world of 200 models; a workbench
in a terminal, and a scene, show its run from the start. Eight hours of `friction` with two workers
are some 65,000 tests. Prints a row each time another eighth of the tests has ended.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from engine import SCENARIO, Sleeper, work
from long_run import ROBOT_SDF, world_of
from programs import Terminal, memory_of

from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.world.load import load_scenario

# All re-runs of all candidates, so that the search does not end before its budget.
LONG = (
    "{baseline_runs: 4, accept_rate: first, growth: paper, skip: known, iterations: 400, budget: "
    "%d}"
)
STEPS = 8


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tests", type=int, default=65_000)
    parser.add_argument("--engine", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.engine is not None:
        work(options.engine, 1, partial(Sleeper, Path(os.devnull), 0.0))
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "crates.sdf").write_text(world_of(200))
        (folder / "robot.sdf").write_text(ROBOT_SDF)
        (folder / "scenario.yaml").write_text(SCENARIO + LONG % options.tests)
        run = folder / "run.ddenv"
        create_run(load_scenario(folder / "scenario.yaml"), run)
        soak(run, options.tests)


def soak(run: Path, tests: int) -> None:
    """Prints memory, MB, as the run of so many tests grows."""
    words = [sys.executable, __file__, "--engine", str(run)]
    scene = subprocess.Popen(
        [sys.executable, "-m", "ddenv.scene", str(run)], stdout=subprocess.DEVNULL
    )
    engine = subprocess.Popen(words, stdout=subprocess.DEVNULL)
    viewer = Terminal([sys.executable, "-m", "ddenv", "open", str(run)], dict(os.environ))
    print(
        "| tests | after, s | run file, MB | engine, MB | workbench, MB | scene, MB "
        "|\n|---|---|---|---|---|---|"
    )
    began, shown, ended, last = time.monotonic(), 0, 0, 0
    try:
        with RunFile(run) as file:
            while engine.poll() is None:
                viewer.watch(1.0)
                for event in file.events(last):
                    ended, last = ended + (event.kind == "test_finished"), event.id
                if ended * STEPS >= (shown + 1) * tests:
                    shown = ended * STEPS // tests
                    sizes = [
                        memory_of(Path(f"/proc/{process}")) / 1e6
                        for process in (engine.pid, viewer.id, scene.pid)
                    ]
                    row = (
                        f"{ended:,}",
                        f"{time.monotonic() - began:.0f}",
                        f"{run.stat().st_size / 1e6:.0f}",
                    )
                    print(
                        f"| {' | '.join([*row, *(f'{size:.0f}' for size in sizes)])} |", flush=True
                    )
    finally:
        viewer.leave()
        for process in (engine, scene):
            process.terminate()
            process.wait()


if __name__ == "__main__":
    main()
