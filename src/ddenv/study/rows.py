"""The rows of a study's tables: the cells of one scenario and one method, which differ in their seeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

from ddenv.study.bound import least_to_show
from ddenv.study.found import Found
from ddenv.study.plan import Method, Plan
from ddenv.world.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Row:
    """What the cells of a method came to, in the order of their seeds."""

    method: Method
    found: tuple[Found, ...]

    @property
    def minimal(self) -> tuple[Found, ...]:
        """Those that have a minimal environment."""
        return tuple(each for each in self.found if each.minimal)

    @property
    def bound(self) -> float | None:
        """The least tests that any method needs to show what it found, the median of the seeds; None where nothing is minimal."""
        bounds = [least_of(each, least_to_show) for each in self.minimal]
        return median(bounds) if bounds else None

    @property
    def tests(self) -> float | None:
        """Their median."""
        return median(each.tests for each in self.minimal) if self.minimal else None


@dataclass(frozen=True, slots=True)
class Group:
    """All rows of a scenario."""

    scenario: Scenario
    rows: tuple[Row, ...]

    @property
    def minimal(self) -> tuple[Found, ...]:
        """All cells that have a minimal environment."""
        return tuple(each for row in self.rows for each in row.minimal)

    @property
    def models(self) -> int:
        """How many models of its world can be removed; 0 where no run has begun."""
        return max(len(each.elements) for row in self.rows for each in row.found)


def groups(plan: Plan, found: Sequence[Found]) -> tuple[Group, ...]:
    """The cells of `plan`, in its order, as rows of its scenarios."""
    cells = iter(found)
    return tuple(
        Group(scenario, tuple(Row(method, tuple(next(cells) for _ in range(plan.seeds))) for method in plan.methods))
        for scenario in plan.scenarios
    )


def least_of(found: Found, bound: Callable[[int, int, int, int], int]) -> int:
    """One of the bounds for a cell that is minimal."""
    reduction = found.cell.scenario.reduction
    return bound(len(found.elements), len(found.left), reduction.iterations, reduction.baseline_runs)


def spread(values: Sequence[float], said: Callable[[float], str]) -> str:
    """One value, or the median with the range; "–" for none."""
    if not values:
        return "–"
    low, high = said(min(values)), said(max(values))
    middle = said(median(values))
    return middle if low == high else f"{middle} ({low} to {high})"
