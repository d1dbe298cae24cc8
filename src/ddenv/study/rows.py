"""The rows of a study's tables: the cells of one scenario and one method, which differ in their seeds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice
from statistics import median

from ddenv.study.plan import Cell, Method, Plan
from ddenv.study.results import Found
from ddenv.world.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Theirs:
    """A row of the paper: tests, which part of the models was removed, and minutes."""

    tests: int
    smaller: float
    minutes: int


TABLES = {"ditch": "II", "rubble": "III", "friction": "IV"}
_ROWS = {
    "ditch": {
        "model2model/failure-proximal": Theirs(268, 0.84, 420),
        "model2model/avg-trajectory-proximal": Theirs(82, 0.95, 108),
        "timeseg/avg-trajectory-proximal": Theirs(359, 0.84, 487),
    },
    "rubble": {
        "model2model/failure-proximal": Theirs(179, 0.81, 274),
        "model2model/avg-trajectory-proximal": Theirs(178, 0.78, 277),
        "timeseg/avg-trajectory-proximal": Theirs(162, 0.89, 231),
    },
    "friction": {
        "model2model/failure-proximal": Theirs(727, 0.44, 1098),
        "model2model/avg-trajectory-proximal": Theirs(116, 0.76, 183),
        "timeseg/avg-trajectory-proximal": Theirs(430, 0.68, 641),
    },
}


def theirs(cell: Cell) -> Theirs | None:
    """The paper's numbers for a cell; None if it has none. It knows no slices."""
    if cell.method.algorithm != "ddenv" or cell.slices:
        return None
    return _ROWS.get(cell.scenario.name, {}).get(cell.method.pair)


@dataclass(frozen=True, slots=True)
class Row:
    """The results of a method's cells, in the order of their seeds: `found` without slices, and `sliced` with them."""

    method: Method
    found: tuple[Found, ...]
    sliced: tuple[Found, ...] = ()

    @property
    def over(self) -> tuple[Found, ...]:
        """The cells that came to an end, whatever its certificate shows."""
        return tuple(each for each in self.found if each.certificate is not None)

    @property
    def minimal(self) -> tuple[Found, ...]:
        """The cells whose certificate shows that their end is minimal."""
        return tuple(each for each in self.found if each.minimal)

    @property
    def certified(self) -> bool:
        """Whether all cells are minimal: only then its numbers are those of a success."""
        return all(each.minimal for each in self.found)

    @property
    def bound(self) -> float | None:
        """The minimum of tests for any method to find this result, the median of the seeds; None if nothing is minimal."""
        bounds = [least_of(each, least_to_show) for each in self.minimal]
        return median(bounds) if bounds else None

    @property
    def tests(self) -> float | None:
        """Their median, without those of certificates; None if nothing is minimal."""
        return median(each.tests for each in self.minimal) if self.minimal else None


@dataclass(frozen=True, slots=True)
class Group:
    """All rows of a scenario."""

    scenario: Scenario
    rows: tuple[Row, ...]

    @property
    def over(self) -> tuple[Found, ...]:
        """All cells that came to an end."""
        return tuple(each for row in self.rows for each in row.over)

    @property
    def minimal(self) -> tuple[Found, ...]:
        """All cells that are minimal."""
        return tuple(each for row in self.rows for each in row.minimal)

    @property
    def models(self) -> int:
        """How many models of its world can be removed; 0 before the first run."""
        return max(len(each.elements) for row in self.rows for each in row.found)


def groups(plan: Plan, found: Sequence[Found]) -> tuple[Group, ...]:
    """The cells of `plan`, in its order, as rows of its scenarios."""
    cells = iter(found)

    def row(scenario: Scenario, method: Method) -> Row:
        every = tuple(islice(cells, plan.seeds * (2 if scenario.reduction.slice else 1)))
        return Row(
            method,
            tuple(each for each in every if not each.cell.slices),
            tuple(each for each in every if each.cell.slices),
        )

    return tuple(
        Group(scenario, tuple(row(scenario, method) for method in plan.methods)) for scenario in plan.scenarios
    )


def least_of(found: Found, bound: Callable[[int, int, int, int], int]) -> int:
    """One of the bounds for a cell that is minimal."""
    return bound(len(found.elements), len(found.left), found.misses, found.cell.scenario.reduction.baseline_runs)


def spread(values: Sequence[float], said: Callable[[float], str]) -> str:
    """One value, or the median with the range; "–" for none."""
    if not values:
        return "–"
    low, high = said(min(values)), said(max(values))
    middle = said(median(values))
    return middle if low == high else f"{middle} ({low} to {high})"


def least_to_show(models: int, needed: int, misses: int, baseline_runs: int) -> int:
    """The minimum of tests for a search that ends at `needed` of `models` models, for any method, without its certificate.

    After the baseline, f has to show once in what is left, and each of its models has to be left out without success, with
    `misses` tests each.
    """
    return baseline_runs + (1 if needed < models else 0) + needed * misses


def least_to_find(models: int, needed: int, misses: int, baseline_runs: int) -> int:
    """The minimum of tests to find them, on average, if each set of that size is equally likely.

    A candidate without f costs `misses` tests, one with f at least one. So a test gives at most log2(1/x) bits, where
    x + x^misses = 1 (Kraft's inequality; one bit a test if one miss is enough), and log2 C(n, k) bits are needed. A method that
    knows more, such as that models near f are likelier, may need less.
    """
    least = math.log(math.comb(models, needed)) / -math.log(_root(misses))
    return max(baseline_runs + math.ceil(least - 1e-9), least_to_show(models, needed, misses, baseline_runs))


def _root(cost: int) -> float:
    """x in (0, 1) with x + x^cost = 1."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if middle + middle**cost < 1 else (low, middle)
    return (low + high) / 2
