"""What whole reductions cost: of the scenarios with each pair, and where most models of a world
take no part.

    python benchmarks/reductions.py [--scenarios ditch,friction] [--pairs paper] [--search-only]
                                    [--jobs N] [SETTING=VALUE ...]
    python benchmarks/reductions.py --models 500,5000 --pairs own [--jobs N] [--keep FOLDER]

An engine reduces each world. *Search* counts the tests that it simulates, the baseline included and
the certificate apart; *all* the certificate, too. *CPU* is the time of all processes, *memory* the
largest sum over them; a page that several share counts once. `--search-only` stops where the
certificate begins. `--models` puts each scenario among crates, walls and piles of boards
(`large_worlds.py`), after the scenario's own world. Settings are such as `accept_rate=first`.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from large_worlds import among_things
from programs import largest

from ddenv.evidence.slices import simulated
from ddenv.runfile.fold import fold
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.engine_job import EngineOptions
from ddenv.runs.experiment import load_parts, with_options
from ddenv.runs.programs import start_engine
from ddenv.settings import SETTINGS
from ddenv.study.plan import PAIRS
from ddenv.world.load import SCENARIOS, load_scenario
from ddenv.world.scenario import Scenario

# How often a run file is looked at, s.
LOOK = 0.5


@dataclass(frozen=True)
class Reduced:
    """The state at the end, the time of all processes (CPU s) and of the clock (s), and their
    memory (bytes).
    """

    state: RunState
    cpu: float
    clock: float
    memory: float


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("settings", nargs="*", metavar="SETTING=VALUE")
    parser.add_argument("--scenarios", default="ditch,friction")
    parser.add_argument(
        "--pairs",
        default="paper",
        help="with commas; paper: those of its tables; own: the scenario's",
    )
    parser.add_argument("--models", default="", help="sizes of the worlds, with commas")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--search-only", action="store_true")
    parser.add_argument("--keep", type=Path, help="a folder for worlds and run files")
    options = parser.parse_args()
    print(
        "| scenario | pair | models | after the slice | left | search | all | CPU s | clock, s | "
        "memory, MB |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or Path(temporary)
        for number, scenario in enumerate(scenarios(options, folder)):
            path = folder / f"{number}.ddenv"
            done = reduced(scenario, path, options.jobs, options.search_only)
            print(row(scenario, done), flush=True)


def scenarios(options: argparse.Namespace, folder: Path) -> Iterator[Scenario]:
    values = dict(setting.split("=", 1) for setting in options.settings)
    for name in options.scenarios.split(","):
        plain = with_options(load_scenario(SCENARIOS / f"{name}.yaml"), **typed(values))
        pairs = {"paper": PAIRS, "own": (plain.reduction.pair,)}.get(
            options.pairs, options.pairs.split(",")
        )
        for pair in pairs:
            scenario = with_options(plain, pair=pair)
            yield scenario
            world, _ = load_parts(scenario)
            for models in map(int, filter(None, options.models.split(","))):
                path = folder / f"{name}_{models}.sdf"
                path.write_bytes(among_things(scenario, world, models))
                yield with_options(scenario, world=path)


def typed(values: dict[str, str]) -> dict[str, float | str]:
    return {
        name: value if SETTINGS[name].choices else float(value) for name, value in values.items()
    }


def reduced(scenario: Scenario, path: Path, jobs: int, search_only: bool) -> Reduced:
    create_run(scenario, path)
    began, spent = time.monotonic(), children()
    engine = start_engine(path, EngineOptions(jobs=jobs))
    with largest(engine.pid) as memory, RunFile(path) as file:
        while engine.poll() is None:
            time.sleep(LOOK)
            if search_only and any(event.kind == "certificate_started" for event in file.events()):
                file.send("stop")
                engine.wait()
        state = fold(file.events())
    return Reduced(state, children() - spent, time.monotonic() - began, max(memory))


def children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def sliced(state: RunState) -> frozenset[str]:
    """The first slice; the whole world if there is none."""
    return frozenset(
        next((node.environment for node in state.nodes if node.sliced_by), state.elements)
    )


def row(scenario: Scenario, done: Reduced) -> str:
    state = done.state
    every = sum(test.is_finished and test.implied_by is None for test in state.tests)
    certified = "certified" if state.certified else f"{state.status}, {state.reason}"
    return (
        f"| {scenario.name} | {scenario.reduction.pair} | {len(state.elements):,} | "
        f"{len(sliced(state))} | {len(state.environment)} {certified} | {simulated(state)} | "
        f"{every} | {done.cpu:.0f} | {done.clock:.0f} | {done.memory / 1e6:.0f} |"
    )


if __name__ == "__main__":
    main()
