"""The time of a step, forward, back and far away, through a long run: of its place alone, and on the screen of lessons.

    python benchmarks/stepping.py [--tests N] [--models N] [--steps N]

Prints a row for each kind of step, in ms: median, 95th percentile, maximum. *Beside* is the median of the same screen drawn again
without a step.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ddenv.runfile.position import position_in
from ddenv.runfile.store import RunFile
from ddenv.workbench.app import Workbench
from ddenv.workbench.learn.lesson_screen import LessonScreen
from ddenv.workbench.shared.messages import ShowLesson

STEPS = (("moment", 1), ("moment", -1), ("decision", 1), ("decision", -1), ("reduction", 1), ("reduction", -1))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tests", type=int, default=10_000)
    parser.add_argument("--models", type=int, default=500)
    parser.add_argument("--steps", type=int, default=40, help="of each kind")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "long.ddenv"
        words = ["--tests", str(options.tests), "--models", str(options.models)]
        subprocess.run([sys.executable, str(Path(__file__).with_name("long_run.py")), str(run), *words], check=True)
        print("| step | median | 95 % | maximum | beside |")
        print("|---|---|---|---|---|")
        of_place(run, options.steps)
        asyncio.run(on_screen(run, options.steps))


def of_place(run: Path, steps: int) -> None:
    """Jumps to random moments, and what is known there."""
    chance = random.Random(0)
    with RunFile(run) as file:
        position = position_in(file.events())
        took = []
        for _ in range(10 * steps):
            began = time.perf_counter()
            position.go(chance.choice(position.ids))
            position.moment(position.at)
            took.append(time.perf_counter() - began)
    print(row("to any moment, without a screen", took, None), flush=True)


async def on_screen(run: Path, steps: int) -> None:
    """Each kind of step from random moments, until it is drawn."""
    chance = random.Random(0)
    app = Workbench(first=ShowLesson(run))
    async with app.run_test(size=(120, 36)) as pilot:
        await app.workers.wait_for_complete()
        await pilot.pause()
        screen = app.screen
        assert isinstance(screen, LessonScreen)
        position = screen.course.position
        for what, by in STEPS:
            took, beside = [], []
            for _ in range(steps):
                position.go(chance.choice(position.ids))
                beside.append(await drawn(pilot, screen._show_run))
                took.append(await drawn(pilot, lambda what=what, by=by: screen.action_move(what, by)))
            print(row(f"{'next' if by > 0 else 'last'} {what}, drawn", took, beside), flush=True)


async def drawn(pilot, act) -> float:
    began = time.perf_counter()
    act()
    await pilot._wait_for_screen()
    return time.perf_counter() - began


def row(name: str, took: list[float], beside: list[float] | None) -> str:
    times = sorted(1e3 * each for each in took)
    high = times[int(0.95 * (len(times) - 1))]
    bare = "" if beside is None else f"{1e3 * statistics.median(beside):.1f}"
    return f"| {name} | {statistics.median(times):.1f} | {high:.1f} | {times[-1]:.1f} | {bare} |"


if __name__ == "__main__":
    main()
