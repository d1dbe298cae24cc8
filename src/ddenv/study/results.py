"""What a cell came to, read from its run file, and the rows of the tables: the results of a method,
one for each seed.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import NamedTuple

import yaml

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
from ddenv.runfile.fold import steps
from ddenv.runfile.progress import Certificate
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.study.plan import Cell, Method, Plan, run_path
from ddenv.text import Data, Names
from ddenv.world.access import read_bytes
from ddenv.world.scenario import Scenario


def difference(file: RunFile, cell: Cell) -> str:
    """How the run file differs from the cell, "" if it does not. Raises UserError if it cannot be
    read.
    """
    first = next((recorded.event for recorded in file.events(most=1)), None)
    if not isinstance(first, Created):
        raise UserError(f"{file.path}: damaged run file: it does not begin with its scenario")
    asked = json.loads(cell.scenario.model_dump_json())
    if _compared(first.scenario) != _compared(asked):
        return "another scenario, or with other options"
    if file.document("world") != read_bytes(cell.scenario.world):
        return "another world"
    if file.document("robot") == read_bytes(cell.scenario.robot.model):
        return ""
    return "another robot"


def _compared(scenario: object) -> object:
    """A scenario without its description and paths: a study may continue in another folder."""
    if not isinstance(scenario, dict):
        return None
    kept = {
        key: value
        for key, value in scenario.items()
        if key not in ("description", "world", "folder")
    }
    for part, key in (("robot", "model"), ("reading", "model_path")):
        if isinstance(kept.get(part), dict):
            kept[part] = {name: value for name, value in kept[part].items() if name != key}
    return kept


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """`tests` are the baseline and the tests behind each verdict of the search, `reruns` of them
    re-runs; `certificate_tests` are those that the certificates rest on. They do not depend on the
    number of workers; tests made `ahead` of time and not needed do.

    `minimal`: the certificate shows it; `problem` says why not, "" if it does. `sizes` are (tests
    of the search, models left) from the end of the baseline on. `seconds` and `certificate_seconds`
    are the times of these tests, one after another. `taken_over` of all tests were reused from
    other cells. `whole_f` of `whole_runs` of the counted runs of the whole world showed f. A
    candidate without f cost `misses` tests at least. `steps_back`: how often the run went back
    because the rate of f was lost.

    `simulated` and `certificate_simulated` are those of them that no other run implied, with the
    audits of slices.
    """

    cell: Cell
    ended: bool = False
    minimal: bool = False
    problem: str = "not made yet"
    elements: Names = ()
    left: Names = ()
    tests: int = 0
    simulated: int = 0
    reruns: int = 0
    certificate_tests: int = 0
    certificate_simulated: int = 0
    ahead: int = 0
    taken_over: int = 0
    seconds: float = 0.0
    certificate_seconds: float = 0.0
    steps_back: int = 0
    version: str = ""
    simulator: str = ""
    baseline: BaselineFinished | None = None
    whole_runs: int = 0
    whole_f: int = 0
    misses: int = 1
    sizes: tuple[tuple[int, int], ...] = ()
    certificate: Certificate | None = None

    @property
    def smaller(self) -> float:
        """The share of the models that was removed."""
        if self.elements:
            return 1 - len(self.left) / len(self.elements)
        return 0.0

    @property
    def bound(self) -> int:
        """The minimum of tests for any search that ends here, without its certificate.

        After the baseline, f has to show once in what is left, and each of its models has to be
        left out without success, alone or with others that are not left, with `misses` tests each.
        """
        shown_once = int(len(self.left) < len(self.elements))
        return (
            self.cell.scenario.reduction.baseline_runs + shown_once + len(self.left) * self.misses
        )


def read_cell(folder: Path, cell: Cell) -> Result:
    """The result of a cell so far; if it cannot be read, `problem` says so."""
    path = run_path(folder, cell)
    if not path.exists():
        return Result(cell=cell)
    try:
        with RunFile(path) as file:
            result = _read(file, cell)
            other = difference(file, cell)
    except UserError as error:
        return Result(cell=cell, problem=str(error))
    if other:
        return Result(cell=cell, problem=f"its run was made with {other}")
    return result


def _read(file: RunFile, cell: Cell) -> Result:
    state = RunState()
    # The numbers of the tests that the search and the certificates rest on, in order.
    search = dict[int, None]()
    fresh = dict[int, None]()
    sizes = list[tuple[int, int]]()
    misses = list[int]()
    steps_back = 0
    for recorded, _, state in steps(file.events()):
        match event := recorded.event:
            case TestFinished(test=test) if state.test(test).phase == "baseline":
                search[test] = None
            case CandidateJudged():
                search |= dict.fromkeys(event.tests)
                if event.verdict == "dissimilar" and event.tests:
                    misses.append(len(event.tests))
            case CertificateFinished() | RateLost():
                fresh |= dict.fromkeys(event.tests)
                steps_back += isinstance(event, RateLost)
        if isinstance(event, BaselineFinished | Reduced | RateLost | LeftOut | Finished):
            sizes.append((len(search), len(state.environment)))
    if not all(0 < number <= len(state.tests) for number in (*search, *fresh)):
        raise UserError(
            f"{file.path}: damaged run file: a verdict relies on tests that are missing"
        )
    tests, fresh_tests = ([state.test(number) for number in numbers] for numbers in (search, fresh))
    certificate = current(state) if state.status == "finished" else None
    minimal = state.minimal and certificate is not None and is_minimal(certificate)
    if state.minimal:
        problem = "it has no certificate"
    elif state.ended:
        problem = state.reason
    else:
        problem = "has not ended"
    # A certificate runs the whole world only where what is left missed f: its runs would show the
    # rate as too low.
    whole = [
        test.outcome
        for test in tests
        if test.environment == 0 and test.outcome in ("similar", "other", "pass")
    ]
    return Result(
        cell=cell,
        ended=state.ended,
        minimal=minimal,
        problem="" if minimal else problem,
        elements=state.elements,
        left=state.environment,
        tests=len(tests),
        simulated=sum(test.implied_by is None for test in tests) + state.audits,
        reruns=sum(test.is_deflake_run for test in tests),
        certificate_tests=len(fresh),
        certificate_simulated=sum(test.implied_by is None for test in fresh_tests),
        ahead=state.tests_done - state.audits - len(tests) - len(fresh),
        taken_over=sum(test.taken for test in state.tests),
        seconds=sum(test.wall_seconds for test in tests),
        certificate_seconds=sum(test.wall_seconds for test in fresh_tests),
        steps_back=steps_back,
        version=state.engine_version,
        simulator=state.simulator,
        baseline=state.baseline,
        whole_runs=len(whole),
        whole_f=whole.count("similar"),
        misses=min(misses, default=1 + cell.scenario.reduction.iterations),
        sizes=tuple(sizes),
        certificate=certificate,
    )


class Paper(NamedTuple):
    """A row of the paper: the number of its table, tests, which part of the models was removed, and
    minutes.
    """

    table: str
    tests: int
    smaller: float
    minutes: int


# The paper's tables, by scenario: their numbers, and their rows by pair.
TABLES: Data = yaml.safe_load(Path(__file__).with_name("paper.yaml").read_text())


def paper_row(cell: Cell) -> Paper | None:
    """The paper's numbers for a cell; None if it has none. It knows no slices."""
    table = TABLES.get(cell.scenario.name, {"rows": {}})
    row = table["rows"].get(cell.method.pair)
    if row and cell.method.algorithm == "ddenv" and not cell.slices:
        return Paper(table["table"], **row)
    return None


@dataclass(frozen=True, slots=True)
class Row:
    """The results of a method in a scenario, in the order of their seeds: `results` without slices,
    and `sliced` with them.
    """

    scenario: Scenario
    method: Method
    results: tuple[Result, ...]
    sliced: tuple[Result, ...] = ()

    @property
    def paper(self) -> Paper | None:
        return paper_row(self.results[0].cell)

    @property
    def over(self) -> tuple[Result, ...]:
        """The results that came to an end, whatever their certificates show."""
        return tuple(result for result in self.results if result.certificate is not None)

    @property
    def minimal(self) -> tuple[Result, ...]:
        """The results whose certificate shows that they are minimal."""
        return tuple(result for result in self.results if result.minimal)

    @property
    def certified(self) -> bool:
        """Whether all are minimal: only then its numbers are those of a success."""
        return len(self.minimal) == len(self.results)

    @property
    def bound(self) -> float | None:
        """The minimum of tests for any method to find this result, the median of the seeds; None if
        nothing is minimal.
        """
        if self.minimal:
            return median(result.bound for result in self.minimal)
        return None

    @property
    def tests(self) -> float | None:
        """Their median, without those of certificates; None if nothing is minimal."""
        if self.minimal:
            return median(result.tests for result in self.minimal)
        return None

    @property
    def certain(self) -> float | None:
        """The tests of a method that is certified with all seeds; None for another, which is no
        success.
        """
        if self.certified:
            return self.tests
        return None


def rows_of(plan: Plan, results: Sequence[Result]) -> tuple[tuple[Row, ...], ...]:
    """The `results` of the plan's cells as rows, for each scenario a row for each method."""
    found = defaultdict[tuple[str, Method, bool], list[Result]](list)
    for result in results:
        found[result.cell.scenario.name, result.cell.method, result.cell.slices].append(result)
    return tuple(
        tuple(
            Row(
                scenario,
                method,
                *(tuple(found[scenario.name, method, slices]) for slices in (False, True)),
            )
            for method in plan.methods
        )
        for scenario in plan.scenarios
    )


def spread(values: Sequence[float], said: Callable[[float], str]) -> str:
    """One value, or the median with the range; "–" for none."""
    if not values:
        return "–"
    low = said(min(values))
    high = said(max(values))
    middle = said(median(values))
    if low == high:
        return middle
    return f"{middle} ({low} to {high})"
