"""Other reducers on the same work as ddenv: picire's ddmin, and leaving out one model after another.

    python benchmarks/peers.py [--scenarios ditch,rubble,friction] [--reducers WORDS] [--jobs 2] [--seed 0]
        [--shuffle N] [--early-stop]

All ask the same oracle: the same simulator, the same f from the same baseline runs, the same seeds for the first run and the
re-runs of a candidate, which the first run with f accepts, the same number of parallel tests. Everything up to the end of the
search counts: the time from the start of the program, with building the simulator; the baseline; tests that were made ahead and
not needed. "+ n stopped" are tests that were ended halfway. 1-minimal: each model that is left was left out once, with all
re-runs, and f did not show; what a reducer did not test of this is tested after its time was measured. So is ddenv's
certificate, which the others do not have.

ddenv searches as in a study (n grows steadily, what is implied is skipped), but accepts as the others do, at the first run with
f. Unlike the others it writes a run file that can be watched and resumed, and ends a test that takes too long. It knows where
the models stand and where the robot drove; the others only know the names, in the order of the file. Their number of tests
depends on that order: in the ditch the two needed models stand first. With --shuffle they get a random order; N is its seed.
Needs `pip install '.[bench]'`.
"""

from __future__ import annotations

import argparse
import multiprocessing
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil
from peers_reducers import REDUCERS, reduce_in_process
from peers_tests import Counts, counts

from ddenv.engine.pool import FOR_DRAKE, added_to_environment
from ddenv.errors import UserError
from ddenv.runfile.fold import fold
from ddenv.runfile.state import CERTIFY
from ddenv.runfile.store import RunFile
from ddenv.runs.subject import with_options
from ddenv.study.plan import PAIRS
from ddenv.text import first_of
from ddenv.world.load import find_scenario, load_scenario
from ddenv.world.scenario import Scenario

HEADER = ("reducer", "tests", "of which re-runs", "time, s", "models left", "1-minimal", "names left")
# The others know no rate that could be kept.
SEARCH = ["--accept-rate", "first"]
OURS = {f"ddenv, {pair}": ["--pair", pair, *SEARCH] for pair in PAIRS} | {
    "ddenv, splitting": ["--algorithm", "splitting", *SEARCH]
}
# Maximum number of models named in a cell.
MOST_NAMES = 6
# Time between two lines of progress, and the maximum time for ddenv to stop, s.
LOOK = 1.0
STOP = 20.0


@dataclass(frozen=True)
class Asked:
    """One scenario with its name and its settings, and the folder for what is written."""

    name: str
    scenario: Scenario
    jobs: int
    shuffle: int | None
    folder: Path


@dataclass(frozen=True)
class Result:
    counts: Counts
    seconds: float
    kept: tuple[str, ...]
    minimal: bool


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--scenarios", default="ditch,rubble,friction", help="bundled names or YAML files")
    parser.add_argument("--reducers", default="", help="words of their names; all by default")
    parser.add_argument("--jobs", type=int, default=2, help="tests at the same time")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first run")
    parser.add_argument("--shuffle", type=int, help="seed of a random order of the models, for the other reducers")
    parser.add_argument("--early-stop", action="store_true", help="end a test when the robot is stuck for good")
    options = parser.parse_args()
    if options.jobs < 1:
        parser.error("--jobs: must be at least 1")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        changes = {"seed": options.seed, "early_stop": options.early_stop}
        reducers = reducers_of(options.reducers)
        scenarios = {
            name: with_options(load_scenario(find_scenario(name)), **changes) for name in options.scenarios.split(",")
        }
        with tempfile.TemporaryDirectory() as folder:
            for number, (name, scenario) in enumerate(scenarios.items()):
                place = Path(folder) / str(number)
                place.mkdir()
                table(Asked(name, scenario, options.jobs, options.shuffle, place), reducers)
    except UserError as error:
        parser.error(str(error))
    except KeyboardInterrupt:
        sys.exit(130)


def reducers_of(words: str) -> list[str]:
    """The reducers with one of these words in their names. Raises UserError."""
    names = [*OURS, *REDUCERS]
    asked = [word.strip() for word in words.split(",")]
    for word in asked:
        if not any(word in name for name in names):
            raise UserError(f"--reducers: '{word}' is in no name; there are: {'; '.join(names)}")
    return [name for name in names if any(word in name for word in asked)]


def table(asked: Asked, reducers: list[str]) -> None:
    reduction = asked.scenario.reduction
    early = ", early stop" if asked.scenario.reduction.early_stop else ""
    order = "" if asked.shuffle is None else f", order {asked.shuffle}"
    first = f"{asked.scenario.name}, seed {reduction.seed}, {asked.jobs} jobs{order}{early}"
    print(f"\n| {' | '.join((first, *HEADER[1:]))} |\n|{'---|' * len(HEADER)}", flush=True)
    for reducer in reducers:
        print(f"| {' | '.join([reducer, *cells(asked, reducer)])} |", flush=True)


def cells(asked: Asked, reducer: str) -> list[str]:
    """The cells of one reduction, or of its error."""

    def report(tests: int) -> None:
        print(f"\r{asked.name}: {reducer}: {tests} tests  ", end="", file=sys.stderr, flush=True)

    report(0)
    try:
        result = ours(asked, reducer, report) if reducer in OURS else theirs(asked, reducer, report)
    except UserError as error:
        return [str(error), *[""] * (len(HEADER) - 2)]
    finally:
        print("\r\x1b[K" if sys.stderr.isatty() else "\n", end="", file=sys.stderr, flush=True)
    made = result.counts
    return [
        f"{made.tests}" + (f" + {made.stopped} stopped" if made.stopped else ""),
        str(made.reruns),
        f"{result.seconds:.0f}",
        str(len(result.kept)),
        "yes" if result.minimal else "no",
        first_of(result.kept, MOST_NAMES),
    ]


def ours(asked: Asked, reducer: str, report: Callable[[int], None]) -> Result:
    """One reduction by ddenv. Raises UserError."""
    path = asked.folder / f"{list(OURS).index(reducer)}.ddenv"
    words = [sys.executable, "-m", "ddenv", "run", asked.name, *OURS[reducer], "--json", "--output", str(path)]
    words += ["--jobs", str(asked.jobs), "--seed", str(asked.scenario.reduction.seed)]
    words += ["--early-stop" if asked.scenario.reduction.early_stop else "--no-early-stop"]
    started = time.time()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as log:
        # In a session of its own it hears of Ctrl+c once, from here.
        program = subprocess.Popen(words, stdout=out, stderr=log, start_new_session=True)
        try:
            while not _ended(program):
                report(_tests_in(path))
        except KeyboardInterrupt:
            program.send_signal(signal.SIGINT)
            program.wait(STOP)
            raise
        printed, said = _content(out), _content(log)
    if not printed:
        raise UserError(said.strip().rpartition("\n")[2] or "ddenv said nothing")
    with RunFile(path) as file:
        events = file.events()
    state = fold(events)
    searched = [event.time for event in events if event.kind == "certificate_started"]
    if not searched:
        raise UserError(f"ddenv's search did not end: {state.reason}")
    tests = sum(test.is_finished and test.phase != CERTIFY for test in state.tests)
    made = Counts(tests, state.deflake_runs, state.tally["lost"])
    # A search ends when no single model can be left out.
    return Result(made, searched[0] - started, state.environment, True)


def _ended(program: subprocess.Popen) -> bool:
    with suppress(subprocess.TimeoutExpired):
        program.wait(LOOK)
        return True
    return False


def _tests_in(path: Path) -> int:
    if not path.exists():
        return 0
    with suppress(UserError), RunFile(path) as file:
        return fold(file.events()).tests_done
    return 0


def _content(file: tempfile._TemporaryFileWrapper) -> str:
    file.seek(0)
    return file.read().decode()


def theirs(asked: Asked, reducer: str, report: Callable[[int], None]) -> Result:
    """One reduction by another reducer. Raises UserError."""
    record = asked.folder / f"{list(REDUCERS).index(reducer)}.tests"
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    work = (reducer, asked.scenario, record, asked.jobs, asked.shuffle, there)
    started = time.perf_counter()
    process = context.Process(target=reduce_in_process, args=work)
    with added_to_environment(FOR_DRAKE):
        process.start()
    there.close()
    try:
        while not here.poll(LOOK):
            report(counts(record).tests)
        message = here.recv()
        seconds = time.perf_counter() - started
        if isinstance(message, str):
            raise UserError(message)
        kept, made = message
        return Result(made, seconds, tuple(kept), here.recv())
    except EOFError:
        raise UserError("the reducer's process died: see above") from None
    finally:
        _kill(process.pid)
        process.join()


def _kill(pid: int) -> None:
    """Ends a process and everything that it started: picire's tests are process groups of their own."""
    with suppress(psutil.NoSuchProcess):
        first = psutil.Process(pid)
        for process in [*first.children(recursive=True), first]:
            with suppress(psutil.NoSuchProcess):
                process.kill()


if __name__ == "__main__":
    main()
