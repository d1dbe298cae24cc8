"""Which test tells most of a row of the table."""

from __future__ import annotations

from ddenv.runfile.state import CERTIFY, RunState, Test
from ddenv.runs.fresh_runs import FreshRuns
from ddenv.workbench.run.candidate_rows import Item


def of_row(state: RunState, item: Item | None, *, finished: bool = False) -> tuple[int | None, int | None]:
    """The test that tells most of a row, by its number, and one to compare it with: both None without tests.

    The last test of the row that showed f, else its last one, else the last one of all. Of the runs without a model: the first one
    whose partner with the same seed, in what is left, showed f where it did not, and before it that partner. With `finished`, only
    finished tests count.
    """
    tests = [test for test in _tests(state, item) if test.is_finished or not finished]
    if isinstance(item, FreshRuns) and item.without is not None:
        left = {test.run: test for test in _fresh(state, item.node, None) if test.outcome == "similar"}
        pairs = ((left[test.run], test) for test in tests if test.run in left and test.outcome != "similar")
        for partner, test in pairs:
            if test.is_finished:
                return partner.id, test.id
    similar = [test for test in tests if test.outcome == "similar"]
    if similar or tests:
        return (similar or tests)[-1].id, None
    last = (test.id for test in reversed(state.tests) if test.is_finished or not finished)
    return next(last, None), None


def _tests(state: RunState, item: Item | None) -> list[Test]:
    if isinstance(item, Test):
        return [item]
    if isinstance(item, FreshRuns):
        return _fresh(state, item.node, item.without)
    return [] if item is None else [state.tests[id - 1] for id in item.tests if 0 < id <= len(state.tests)]


def _fresh(state: RunState, node: int, without: str | None) -> list[Test]:
    first = 0 if state.certificate is None else state.certificate.first_run
    own = (test for test in state.confirm_tests if test.phase == CERTIFY and test.run >= first)
    return [test for test in own if test.node == node and test.without == without]
