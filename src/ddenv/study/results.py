"""The result of a cell, read from its run file: what its search left, and what its certificate shows of that."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ddenv.errors import UserError
from ddenv.evidence.claims import current, is_minimal
from ddenv.runfile.events import (
    BaselineFinished,
    CandidateJudged,
    CertificateFinished,
    Created,
    Finished,
    LeftOut,
    RateLost,
    Reduced,
    TestFinished,
)
from ddenv.runfile.failures import Baseline
from ddenv.runfile.follow import steps
from ddenv.runfile.progress import Certificate
from ddenv.runfile.state import RunState
from ddenv.runfile.store import Recorded, RunFile
from ddenv.study.plan import Cell
from ddenv.study.study_folder import run_path
from ddenv.world.access import read_bytes


def difference(file: RunFile, cell: Cell) -> str:
    """How the run file differs from the cell, "" if it does not. Raises UserError if it cannot be read."""
    first = next((recorded.event for recorded in file.events(most=1)), None)
    if not isinstance(first, Created):
        raise UserError(f"{file.path}: damaged run file: it does not begin with its scenario")
    asked = json.loads(cell.scenario.model_dump_json())
    if _compared(first.scenario) != _compared(asked):
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
    """`tests` are the baseline and the tests behind each verdict of the search, `reruns` of them re-runs; `certificate_tests` are
    those that the certificates rest on. They do not depend on the number of workers; tests made `ahead` of time and not needed do.

    `minimal`: the certificate shows it; `problem` says why not, "" if it does. `sizes` are (tests of the search, models left) from
    the end of the baseline on. `seconds` and `certificate_seconds` are the times of these tests, one after another. `taken` of all
    tests were reused from other cells. `whole_shown` of `whole_runs` of the counted runs of the whole world showed f. A candidate
    without f cost `misses` tests at least. `steps_back`: how often the run went back because the rate of f was lost.

    `simulated` and `certificate_simulated` are those of them that no other run implied, with the audits of slices.
    """

    cell: Cell
    ended: bool = False
    minimal: bool = False
    problem: str = "not made yet"
    elements: tuple[str, ...] = ()
    left: tuple[str, ...] = ()
    tests: int = 0
    reruns: int = 0
    certificate_tests: int = 0
    simulated: int = 0
    certificate_simulated: int = 0
    ahead: int = 0
    taken: int = 0
    seconds: float = 0.0
    certificate_seconds: float = 0.0
    version: str = ""
    simulator: str = ""
    baseline: Baseline | None = None
    baseline_runs: int = 0
    whole_shown: int = 0
    whole_runs: int = 0
    misses: int = 1
    steps_back: int = 0
    sizes: tuple[tuple[int, int], ...] = ()
    certificate: Certificate | None = None

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
            story = _story(file.events())
            if other := difference(file, cell):
                return Found(cell, problem=f"its run was made with {other}")
    except UserError as error:
        return Found(cell, problem=str(error))
    state = story.state
    if not all(0 < number <= len(state.tests) for number in (*story.search, *story.certificates)):
        return Found(cell, problem=f"{path}: damaged run file: a verdict rests on tests that are not there")
    tests = [state.tests[number - 1] for number in story.search]
    fresh = [state.tests[number - 1] for number in story.certificates]
    certificate = current(state) if state.status == "finished" else None
    minimal = state.minimal and certificate is not None and is_minimal(certificate)
    # A certificate runs the whole world only where what is left missed f: its runs would show the rate as too low.
    whole = [test.outcome for test in tests if test.environment == 0 and test.outcome in ("similar", "other", "pass")]
    return Found(
        cell,
        ended=state.ended,
        minimal=minimal,
        problem="" if minimal else _problem(state),
        elements=state.elements,
        left=state.environment,
        tests=len(tests),
        reruns=sum(test.is_deflake_run for test in tests),
        certificate_tests=len(fresh),
        simulated=sum(test.implied_by is None for test in tests) + state.audits,
        certificate_simulated=sum(test.implied_by is None for test in fresh),
        ahead=state.tests_done - state.audits - len(tests) - len(fresh),
        taken=sum(test.taken for test in state.tests),
        seconds=sum(test.wall_seconds for test in tests),
        certificate_seconds=sum(test.wall_seconds for test in fresh),
        version=state.engine_version,
        simulator=state.simulator,
        baseline=state.baseline,
        baseline_runs=sum(test.phase == "baseline" for test in tests),
        whole_shown=whole.count("similar"),
        whole_runs=len(whole),
        misses=min(story.misses, default=1 + cell.scenario.reduction.iterations),
        steps_back=story.steps_back,
        sizes=story.sizes,
        certificate=certificate,
    )


def _problem(state: RunState) -> str:
    if state.minimal:
        return "it has no certificate"
    if state.status == "finished":
        return state.reason
    return state.reason if state.ended else "has not ended"


@dataclass(frozen=True, slots=True)
class _Story:
    """What a run's events add up to. `search` and `certificates` are the tests that those rest on, in order; each entry of `misses`
    is what a candidate without f cost.
    """

    state: RunState
    search: tuple[int, ...]
    certificates: tuple[int, ...]
    sizes: tuple[tuple[int, int], ...]
    misses: tuple[int, ...]
    steps_back: int


def _story(events: Iterable[Recorded]) -> _Story:
    state, steps_back = RunState(), 0
    search: dict[int, None] = {}
    certificates: dict[int, None] = {}
    sizes: list[tuple[int, int]] = []
    misses: list[int] = []
    for recorded, _, state in steps(events):
        match event := recorded.event:
            case TestFinished(test) if state.tests[test - 1].phase == "baseline":
                search[test] = None
            case CandidateJudged():
                search |= dict.fromkeys(event.tests)
                if event.verdict == "dissimilar" and event.tests:
                    misses.append(len(event.tests))
            case CertificateFinished() | RateLost():
                certificates |= dict.fromkeys(event.tests)
                steps_back += isinstance(event, RateLost)
        if isinstance(event, BaselineFinished | Reduced | RateLost | LeftOut | Finished):
            sizes.append((len(search), len(state.environment)))
    return _Story(state, tuple(search), tuple(certificates), tuple(sizes), tuple(misses), steps_back)
