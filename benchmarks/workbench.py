"""How fast the workbench answers in a real terminal (`programs.py`), on an idle machine and beside
two busy processes.

    python benchmarks/workbench.py [--quick]

The first paint is there when the screen has words, counted from before the start of the program,
beside `python -c "import textual.app"`. Keys are pressed on runs that have ended, where nothing
else writes: of the ditch, and of 10,000 tests in a world of 5,000 models (`long_run.py`). An answer
is complete when nothing more comes for 50 ms; its time ends with its last write. `down` in a bare
Textual table is beside it. Bytes a second are those of a running reduction of the ditch.
"""

from __future__ import annotations

import argparse
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from programs import Terminal, memory_of

HERE = Path(__file__).parent
DDENV = [sys.executable, "-c", "from ddenv.cli import main; main()"]
BARE = [sys.executable, str(HERE / "workbench.py"), "--bare"]
KEYS = {
    "down in the table": ("\x1b[B", "\x1b[A"),
    "+ on the map": ("+", "-"),
    "tab": ("\t", "\x1b[Z"),
}
# So many letters and digits on the screen: it has begun.
WORDS = 150
QUIET = 0.05  # s
# The search of this run outlasts the look at it: each candidate without f is run 1,001 times.
LONG = ["--jobs", "2", "--accept-rate", "first", "--iterations", "1000", "--no-slice"]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="fewer starts and keys, and a run of 200 tests"
    )
    parser.add_argument("--bare", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.bare:
        bare_table()
        return
    starts, presses, tests, models = (2, 10, 200, 500) if options.quick else (5, 100, 10_000, 5_000)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment = os.environ | {
            "DDENV_HOME": name,
            "PYTHONDONTWRITEBYTECODE": "",
            "PYTHONPYCACHEPREFIX": f"{name}/pyc",
        }
        ditch, large = folder / "ditch.ddenv", folder / "large.ddenv"
        bytes_a_second = watched(
            folder / "running.ddenv", environment, 3.0 if options.quick else 20.0
        )
        subprocess.run(
            [*DDENV, "run", "ditch", "--budget", "40", "--output", ditch],
            env=environment,
            stdout=subprocess.DEVNULL,
            check=False,  # its exit code says that the budget was used up
        )
        subprocess.run(
            [
                sys.executable,
                HERE / "long_run.py",
                large,
                "--tests",
                str(tests),
                "--models",
                str(models),
            ],
            check=True,
        )
        print("| figure | idle | two busy processes | aim |\n|---|---|---|---|")
        idle = figures(ditch, large, environment, starts, presses)
        with busy():
            loaded = figures(ditch, large, environment, starts, presses)
        for what, (value, aim) in idle.items():
            print(f"| {what} | {value} | {loaded[what][0]} | {aim} |")
        print(f"| bytes a second of a running reduction | {bytes_a_second:,.0f} | | 10,000 |")


def figures(
    ditch: Path, large: Path, environment: dict[str, str], starts: int, presses: int
) -> dict[str, tuple[str, str]]:
    """Each figure with its aim."""
    found = {
        "`ddenv`: first paint": (first_paint([], environment, starts), "1.8 x"),
        "`ddenv open RUN`: first paint": (
            first_paint(["open", str(ditch)], environment, starts),
            "1.8 x",
        ),
    }
    for run, words, aim in ((ditch, "", "p95 30 ms"), (large, ", large run", "p95 50 ms")):
        with started([*DDENV, "open", str(run)], environment) as terminal:
            for name, keys in KEYS.items():
                found[f"{name}{words}"] = (answers(terminal, keys, presses), aim)
            found[f"memory{words}"] = (
                f"{memory_of(Path(f'/proc/{terminal.id}')) / 1e6:.0f} MB",
                "",
            )
    with started(BARE, environment) as terminal:
        found["down in a bare table"] = (answers(terminal, KEYS["down in the table"], presses), "")
    return found


@contextmanager
def started(words: list[str], environment: dict[str, str]) -> Iterator[Terminal]:
    """A program whose screen is complete."""
    terminal = Terminal(words, environment)
    try:
        begun(terminal)
        terminal.settle(1.0, 20.0)
        yield terminal
    finally:
        terminal.leave()


def begun(terminal: Terminal) -> float:
    """When the screen had words."""
    while terminal.letters() < WORDS:
        if not terminal.look(30.0):
            raise TimeoutError("nothing is written")
    return terminal.writes[-1][0]


def first_paint(words: list[str], environment: dict[str, str], times: int) -> str:
    """The median of some starts, each beside the bare import; one start before them compiles the
    program.
    """
    first, bare = [], []
    for number in range(times + 1):
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", "import textual.app"], check=True, env=environment)
        imported = time.perf_counter() - began
        terminal = Terminal([*DDENV, *words], environment)
        try:
            painted = begun(terminal) - terminal.started
        finally:
            terminal.leave()
        if number:
            first.append(painted)
            bare.append(imported)
    paint, textual = statistics.median(first), statistics.median(bare)
    return f"{paint:.2f} s, {paint / textual:.1f} x"


def answers(terminal: Terminal, keys: tuple[str, str], times: int) -> str:
    """Presses a key and the one that undoes it in turn: p50 / p95 from the key to its complete
    answer.
    """
    seconds = []
    for number in range(times):
        terminal.watch(random.uniform(0.08, 0.16))
        at = terminal.press(keys[number % 2])
        if terminal.look(1.0):
            terminal.settle(QUIET, 2.0)
            seconds.append(terminal.writes[-1][0] - at)
    if len(seconds) < times:
        return f"{times - len(seconds)} of {times} not answered"
    hundredths = statistics.quantiles(seconds, n=100, method="inclusive")
    return f"{1000 * hundredths[49]:.0f} / {1000 * hundredths[94]:.0f} ms"


def watched(run: Path, environment: dict[str, str], seconds: float) -> float:
    """Bytes a second that the workbench writes while a reduction runs and no key is pressed."""
    words = [*DDENV, "run", "ditch", *LONG, "--output", str(run)]
    with subprocess.Popen(
        words, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as engine:
        try:
            while not run.exists():
                time.sleep(0.1)
            with started([*DDENV, "open", str(run)], environment) as terminal:
                terminal.writes.clear()
                terminal.watch(seconds)
                written = sum(len(text) for _, text in terminal.writes)
        finally:
            engine.terminate()
    return written / seconds


@contextmanager
def busy() -> Iterator[None]:
    """Two processes that compute as politely as the engine's workers do."""
    processes = [
        subprocess.Popen(["nice", sys.executable, "-c", "while True: pass"]) for _ in range(2)
    ]
    try:
        yield
    finally:
        for process in processes:
            process.kill()


def bare_table() -> None:
    """A bare Textual table: how long any such program takes from a key to its answer."""
    from textual.app import App, ComposeResult
    from textual.widgets import DataTable

    class Bare(App[None]):
        def compose(self) -> ComposeResult:
            yield DataTable(cursor_type="row")

        def on_mount(self) -> None:
            table = self.query_one(DataTable)
            table.add_columns("#", "candidate", "models", "distance", "tests", "verdict")
            for number in range(30):
                table.add_row(str(number), f"part {number}", "12", "3.4 m", "4/4", "dissimilar")

    Bare().run()


if __name__ == "__main__":
    main()
