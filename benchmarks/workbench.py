"""How fast the workbench is in a real terminal (a pty of 120x36 with 16 million colours), also while two simulations run.

    python benchmarks/workbench.py [--quick] [--hour SECONDS]

The output is read as a terminal shows it. The first paint is there when the screen has words, counted from before the start of
the program, beside `python -c "import textual.app"`; it is complete when no more comes. A key is answered when as much of the
screen changed as this key changes; the table also has how often as much changes in 50 ms without a key. Times of keys are p50 /
p95 / p99.

Two simulations are a reduction of the ditch with two workers, and the screen is attached to it. On the idle machine the same
events are replayed at the same pace (`replay.py`). The large run (`long_run.py`) has 10,000 tests in a world of 5,000 models and
goes on while it is watched, with the two simulations beside it. For the hour all events of an hour are replayed in --hour seconds
(90): all the tests of an hour, but only as many frames as these seconds have; with 3600 also its frames. Memory is RSS. --quick
measures neither the large run nor the hour and takes less than a minute, all takes seven.
"""

from __future__ import annotations

import argparse
import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from watching import BARE_KEY, DDENV, KEYS, answers, attached, by_itself, rate, starts

HERE = Path(__file__).parent
HEAVY = ("matplotlib", "pydrake", "scipy", "sklearn")
# Prints the names of all imported modules.
NAMES = "DDENV_BENCHMARK_NAMES"
PROBE = (
    "import atexit, os, pathlib, sys; from ddenv.cli import main;"
    f"atexit.register(lambda: pathlib.Path(os.environ['{NAMES}']).write_text(' '.join(sys.modules))); main()"
)
# A reduction that takes longer than all measurements beside it on any machine: each candidate without f is run 1,001 times.
SIMULATIONS = ("run", "ditch", "--jobs", "2", "--accept-rate", "first", "--iterations", "1000", "--no-slice")
LARGE_TESTS = 10_000


@dataclass(frozen=True)
class Effort:
    """How often the program is started, how often each key is pressed, how long a run is watched, and given to settle, s."""

    starts: int
    presses: int
    watch: float
    settle: float


FULL, QUICK = Effort(5, 100, 30.0, 6.0), Effort(2, 10, 3.0, 0.5)
TARGETS = {
    "`ddenv`: first paint": "0.4 s",
    "`ddenv open RUN`: first paint": "0.4 s",
    **{f"key to paint: {key.name}": "p95 50 ms" for key in KEYS},
    f"key to paint: {BARE_KEY.name}": "",
    "as much changed without a key": "few",
    "bytes a second, on average": "",
    "bytes in a second, maximum": "",
    "memory, MB": "",
}
Figures = dict[str, str]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--hour", type=float, default=90.0)
    options = parser.parse_args()
    effort = QUICK if options.quick else FULL
    with tempfile.TemporaryDirectory() as name:
        folder, environment = Path(name), os.environ | {"DDENV_HOME": name} | installed(name)
        recorded, large = folder / "recorded.ddenv", {}
        with simulations(recorded, environment):
            loaded = figures(recorded, environment, effort)
            if not options.quick:
                large = of_large_run(folder, environment, effort)
        with replayed(recorded, folder / "replayed.ddenv") as run:
            idle = figures(run, environment, effort)
        print("| figure | idle | two simulations | and a large run | target |\n|---|---|---|---|---|")
        for what, target in TARGETS.items():
            print(f"| {what} | {idle[what]} | {loaded[what]} | {large.get(what, '')} | {target} |")
        print(f"| imported of {', '.join(HEAVY)} | {heavy(recorded, environment)} | | | none |", flush=True)
        if not options.quick:
            memory = hour(recorded, environment, options.hour)
            print(f"| memory at 10 / 50 / 100 % of an hour, MB | {memory} | | | flat |")


def installed(folder: str) -> dict[str, str]:
    """An environment in which a program starts like an installed one: from compiled files."""
    return {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": f"{folder}/compiled"}


def figures(run: Path, environment: dict[str, str], effort: Effort) -> Figures:
    """All figures of a run with a working engine."""
    still = run.with_stem(f"{run.stem}-still")
    with closing(sqlite3.connect(run)) as source, closing(sqlite3.connect(still)) as target:
        source.backup(target)
    measured = {"`ddenv`: first paint": str(starts([], environment, effort.starts))}
    measured["`ddenv open RUN`: first paint"] = str(starts(["open", str(still)], environment, effort.starts))
    with attached(["open", str(run)], environment) as terminal:
        terminal.watch(effort.settle)
        average, most = rate(terminal, effort.watch)
        measured |= {"bytes a second, on average": f"{average:,.0f}", "bytes in a second, maximum": f"{most:,}"}
        alone = [by_itself(terminal, key, effort.presses // 4, 0.05) for key in KEYS]
        changed, looks = sum(len(each.seconds) for each in alone), sum(each.pressed for each in alone)
        measured["as much changed without a key"] = f"{changed} of {looks}"
        for key in KEYS:
            measured[f"key to paint: {key.name}"] = str(answers(terminal, key, effort.presses))
        measured["memory, MB"] = f"{terminal.memory():.0f}"
    with attached([str(HERE / "bare.py")], environment, (sys.executable,)) as terminal:
        measured[f"key to paint: {BARE_KEY.name}"] = str(answers(terminal, BARE_KEY, effort.presses))
    return measured


def of_large_run(folder: Path, environment: dict[str, str], effort: Effort) -> Figures:
    made = folder / "made.ddenv"
    subprocess.run([sys.executable, HERE / "long_run.py", made, "--tests", str(LARGE_TESTS)], check=True)
    with replayed(made, folder / "large.ddenv", "--until", str(LARGE_TESTS)) as run:
        return figures(run, environment, effort)


@contextmanager
def simulations(run: Path, environment: dict[str, str]) -> Iterator[None]:
    """Two workers simulate for this run, whose first round has begun."""
    words = [*DDENV, *SIMULATIONS, "--output", str(run)]
    program = subprocess.Popen(words, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        while not run.exists() or not _count(run, "round_started"):
            if program.poll() is not None:
                sys.exit("the simulations ended before a round began")
            time.sleep(0.2)
        yield
        if program.poll() is not None:
            sys.exit("the simulations ended before all was measured beside them")
    finally:
        program.send_signal(signal.SIGINT)
        program.wait(60)


@contextmanager
def replayed(source: Path, run: Path, *options: str) -> Iterator[Path]:
    """A run that goes on as `source` did; `options` are those of replay.py."""
    words = [sys.executable, HERE / "replay.py", source, run, *options]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as program:
        try:
            if program.stdout.readline() != "ready\n":
                sys.exit("the replay did not begin")
            yield run
        finally:
            program.terminate()


def hour(source: Path, environment: dict[str, str], seconds: float) -> str:
    """Memory of a workbench that is attached while an hour of a run's events is replayed."""
    run = source.with_stem("hour")
    samples: list[tuple[int, float]] = []
    speed = str(3600 / seconds)
    with replayed(source, run, "--speed", speed), attached(["open", str(run)], environment) as terminal:
        until = time.monotonic() + seconds - 4.0
        while time.monotonic() < until:
            terminal.watch(1.0)
            samples.append((_count(run, "test_finished"), terminal.memory()))
    tests = samples[-1][0]
    parts = [next(memory for done, memory in samples if done >= share * tests) for share in (0.1, 0.5, 1.0)]
    grown = 1000 * (parts[-1] - parts[0]) / (0.9 * tests)
    return f"{' / '.join(f'{memory:.0f}' for memory in parts)}: {grown:.1f} kB a test, {tests:,} tests"


def heavy(run: Path, environment: dict[str, str]) -> str:
    """Which of the heavy packages either screen imports."""
    names = run.with_name("modules")
    found: set[str] = set()
    for words in ([], ["open", str(run)]):
        with attached(words, environment | {NAMES: str(names)}, (sys.executable, "-c", PROBE)):
            pass
        found |= set(names.read_text().split()).intersection(HEAVY)
    return ", ".join(sorted(found)) or "none"


def _count(run: Path, kind: str) -> int:
    with closing(sqlite3.connect(run)) as db:
        return db.execute("SELECT count(*) FROM event WHERE kind = ?", (kind,)).fetchone()[0]


if __name__ == "__main__":
    main()
