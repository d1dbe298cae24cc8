"""The result of a cell: from its run file, and from runs of what is left with seeds that its reduction never used."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from ddenv.errors import UserError
from ddenv.runfile.failures import Baseline
from ddenv.runfile.fold import apply
from ddenv.runfile.state import RunState
from ddenv.runfile.store import Event, RunFile
from ddenv.study.plan import Cell
from ddenv.study.study_folder import check_path, run_path
from ddenv.words import count
from ddenv.world.files.access import read_bytes, write_file

# Between the seeds of a reduction and those of its check.
APART = 100_000


@dataclass(frozen=True, slots=True)
class Check:
    """Runs from `seed` on, `runs` of each: f showed in `shown` runs with all that is left, in `without[model]` without that one."""

    seed: int
    runs: int
    shown: int
    without: dict[str, int]

    @property
    def holds(self) -> bool:
        """Whether f showed, but never without one of the models that are left."""
        return self.shown > 0 and not any(self.without.values())


def start_check(run: Path, cell: Cell, jobs: int) -> tuple[subprocess.Popen[bytes], IO[str]]:
    """Starts the runs as a program; what it prints goes to the file. As many runs of each as a candidate gets in a reduction."""
    words = [sys.executable, "-m", "ddenv", "test", "--minimal", "--leave-each-out", "--json"]
    words += ["--seed", str(_seed(cell)), "--repeat", str(_runs(cell)), "--jobs", str(jobs), "--", str(run)]
    output = tempfile.TemporaryFile("w+")  # noqa: SIM115
    # A ctrl+c goes to the study, which ends its programs itself.
    program = subprocess.Popen(
        words, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
    )
    return program, output


def write_check(folder: Path, cell: Cell, output: IO[str]) -> None:
    """Stores the result of a check that has ended. Raises UserError with the check's own message if it failed."""
    output.seek(0)
    text = output.read()
    try:
        runs = json.loads(text.strip().rpartition("\n")[2])["runs"]
        shown = Counter(run["without"] for run in runs if run["outcome"] == "similar")
        names = dict.fromkeys(run["without"] for run in runs if run["without"] is not None)
        found = {"all": shown[None], "without": {name: shown[name] for name in names}}
    except (ValueError, TypeError, KeyError):
        said = text.strip().rpartition("\n")[2] or "without a reason"
        raise UserError(f"what is left could not be checked: {said}") from None
    kept = {"seed": _seed(cell), "runs": _runs(cell), **found}
    write_file(check_path(folder, cell), json.dumps(kept).encode())


def read_check(folder: Path, cell: Cell, left: tuple[str, ...]) -> Check | None:
    """The stored check; None if there is no check of the models that are `left`."""
    path = check_path(folder, cell)
    try:
        kept = json.loads(read_bytes(path))
        without = {str(name): int(number) for name, number in kept["without"].items()}
        found = Check(int(kept["seed"]), int(kept["runs"]), int(kept["all"]), without)
    except (UserError, ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
        return None
    if not all(0 <= number <= found.runs for number in (found.shown, *without.values())):
        return None
    return found if (found.seed, found.runs, set(without)) == (_seed(cell), _runs(cell), set(left)) else None


def _seed(cell: Cell) -> int:
    return cell.seed + APART


def _runs(cell: Cell) -> int:
    return 1 + cell.scenario.reduction.iterations


def difference(file: RunFile, cell: Cell) -> str:
    """How the run file differs from the cell, "" if it does not. Raises UserError if it cannot be read."""
    first = next(iter(file.events(most=1)), None)
    if first is None:
        raise UserError(f"{file.path}: damaged run file: it has no events")
    asked = json.loads(cell.scenario.model_dump_json())
    if _compared(first.data.get("scenario")) != _compared(asked):
        return "another scenario, or with other options"
    if file.document("world") != read_bytes(cell.scenario.world):
        return "another world"
    return "" if file.document("robot") == read_bytes(cell.scenario.robot.model) else "another robot"


def _compared(scenario: object) -> object:
    """A scenario without its description and paths: a study may continue in another folder."""
    if not isinstance(scenario, dict):
        return None
    kept = {key: value for key, value in scenario.items() if key not in ("description", "world", "folder")}
    for part, key in (("robot", "model"), ("reading", "model_path")):
        if isinstance(kept.get(part), dict):
            kept[part] = {name: value for name, value in kept[part].items() if name != key}
    return kept


@dataclass(frozen=True, slots=True)
class Found:
    """`tests` counts what the result rests on: the baseline, the tests behind each verdict, the full runs at the end; `reruns` of
    them are re-runs. They do not depend on the number of workers; tests made `ahead` of time and not needed do.

    `sizes` are (tests, models left) from the end of the baseline on. `seconds` is the time of the tests, one after another.
    `taken` of all tests were reused from other cells. `problem` says why there is no minimal environment, "" if there
    is one.
    """

    cell: Cell
    ended: bool = False
    minimal: bool = False
    problem: str = "not made yet"
    elements: tuple[str, ...] = ()
    left: tuple[str, ...] = ()
    tests: int = 0
    reruns: int = 0
    ahead: int = 0
    taken: int = 0
    seconds: float = 0.0
    version: str = ""
    simulator: str = ""
    baseline: Baseline | None = None
    baseline_runs: int = 0
    sizes: tuple[tuple[int, int], ...] = ()
    check: Check | None = None

    @property
    def holds(self) -> bool:
        """Whether it is minimal, and the check agrees."""
        return self.minimal and self.check is not None and self.check.holds

    @property
    def trouble(self) -> str:
        """Why it is not shown to be minimal; "" if it is."""
        if not self.minimal:
            return self.problem
        if self.check is None:
            return "not checked yet"
        if not self.check.shown:
            return f"f did not show in {count(self.check.runs, 'run')} of what is left with other seeds"
        names = ", ".join(name for name, shown in self.check.without.items() if shown)
        return f"with other seeds f also showed without {names}: there it depends on chance" if names else ""

    @property
    def smaller(self) -> float:
        """The share of the models that was removed."""
        return 1 - len(self.left) / len(self.elements) if self.elements else 0.0


def read_cell(folder: Path, cell: Cell) -> Found:
    """The result of a cell so far; if it cannot be read, `problem` says so."""
    path = run_path(folder, cell)
    if not path.exists():
        return Found(cell)
    try:
        with RunFile(path) as file:
            state, needed, sizes = _story(file.events())
            if other := difference(file, cell):
                return Found(cell, problem=f"its run was made with {other}")
    except UserError as error:
        return Found(cell, problem=str(error))
    if not all(0 < number <= len(state.tests) for number in needed):
        return Found(cell, problem=f"{path}: damaged run file: a verdict rests on tests that are not there")
    tests = [state.tests[number - 1] for number in needed]
    return Found(
        cell,
        ended=state.ended,
        minimal=state.minimal,
        problem=_problem(state),
        elements=state.elements,
        left=state.environment,
        tests=len(tests),
        reruns=sum(test.is_deflake_run for test in tests),
        ahead=state.tests_done - len(tests),
        taken=sum(test.taken for test in state.tests),
        seconds=sum(test.wall_seconds for test in tests),
        version=state.engine_version,
        simulator=state.simulator,
        baseline=state.baseline,
        baseline_runs=sum(test.phase == "baseline" for test in tests),
        sizes=sizes,
        check=read_check(folder, cell, state.environment) if state.minimal else None,
    )


def _problem(state: RunState) -> str:
    if state.minimal:
        return ""
    if state.status == "finished":
        return state.reason
    return state.reason if state.ended else "has not ended"


def _story(events: Iterable[Event]) -> tuple[RunState, list[int], tuple[tuple[int, int], ...]]:
    """The state at the end, the tests behind the result in order, and the sizes of the environment."""
    state = RunState()
    needed: dict[int, None] = {}
    sizes: list[tuple[int, int]] = []
    for event in events:
        state = apply(state, event)
        match event.kind:
            case "test_finished" if _counts_at_once(state, event):
                needed[event.data["test"]] = None
            case "candidate_judged":
                needed |= dict.fromkeys(event.data["tests"])
            case "baseline_finished" | "reduced" | "finished":
                sizes.append((len(needed), len(state.environment)))
    return state, list(needed), tuple(sizes)


def _counts_at_once(state: RunState, event: Event) -> bool:
    """Tests of the baseline and of the confirmation are made because they are needed, never ahead of time."""
    return state.tests[event.data["test"] - 1].phase in ("baseline", "confirm")
