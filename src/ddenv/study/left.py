"""How long a study will take still: from the cells that have ended, from those in work, and from what their tests took."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import mean

from ddenv.forecast.estimate import expect, remaining
from ddenv.runfile.state import RunState
from ddenv.study.order import Size
from ddenv.study.plan import Cell
from ddenv.study.work import Work


def seconds_left(
    running: Sequence[Work], waiting: Sequence[Cell], ended: Sequence[Work], worlds: dict[str, Size], jobs: int
) -> float | None:
    """Until the last cell has ended, s; None where nothing tells."""
    now = {id(each): _of_running(each) for each in running}
    times = [_of_waiting(cell, (*running, *ended), worlds) for cell in waiting]
    if any(each is None for each in (*now.values(), *times)):
        return None
    alone = [now[id(each)] / each.workers for each in running]
    return max([(sum(now.values()) + sum(times)) / jobs, *alone])


def _of_running(each: Work) -> float | None:
    """What one worker would need still, s."""
    left = remaining(each.state, True)
    if left is not None and left.seconds is not None:
        return left.seconds[1] * max(1, each.state.jobs)
    # Full runs at the end, and the check: a handful of tests.
    return 0.0 if each.check is not None or each.state.confirming else None


def _of_waiting(cell: Cell, others: Sequence[Work], worlds: dict[str, Size]) -> float | None:
    """What one worker would need, s: what other cells of the scenario took, or what such a cell is expected to take."""
    same = [each for each in others if each.cell.scenario.name == cell.scenario.name]
    over = [_spent(each.state) for each in same if each.state.status == "finished"]
    if over:
        return mean(over)
    size = worlds[cell.scenario.name]
    one = [seconds for each in same if (seconds := _of_a_test(each.state)) is not None]
    if not one:
        costs = [
            seconds * size.cost / worlds[each.cell.scenario.name].cost
            for each in others
            if (seconds := _of_a_test(each.state)) is not None
        ]
        one = [mean(costs)] if costs else []
    if not one:
        return None
    return mean(one) * _expected(cell, size.models)


def _expected(cell: Cell, models: int) -> int:
    asked = cell.scenario.reduction
    tests = expect(
        models,
        asked.algorithm,
        asked.pair,
        asked.iterations,
        growth=asked.growth,
        skip=asked.skip,
        candidates=asked.candidates,
        complement_order=asked.complement_order,
        n_partitions=asked.n_partitions,
    )
    return asked.baseline_runs + tests.tests


def _spent(state: RunState) -> float:
    """What a cell's tests took, s, one after another; those taken over from another cell cost nothing."""
    return sum(test.wall_seconds for test in state.finished_tests if not test.taken)


def _of_a_test(state: RunState) -> float | None:
    tests = [test.wall_seconds for test in state.finished_tests]
    return mean(tests) if tests else None
