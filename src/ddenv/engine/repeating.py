"""Whether a resumed run still computes the same: another Drake, Python or processor may give other bits."""

from __future__ import annotations

import numpy as np

from ddenv.engine.control import Control
from ddenv.engine.journal import Journal
from ddenv.engine.judging import rows_of
from ddenv.engine.limits import wall_limit
from ddenv.engine.pool import Broken
from ddenv.engine.workers import Workers
from ddenv.errors import UserError
from ddenv.robot.result import RunResult
from ddenv.runfile.events import Compared, Comparing
from ddenv.runfile.state import RunState, Test

# How long to wait for the test before looking at commands again, s.
WAIT = 0.05


def check_repeats(journal: Journal, pool: Workers, control: Control, mixed: bool) -> None:
    """Makes the first baseline run again, and compares its bits, if this engine computes with anything else than the earlier ones.

    Raises UserError if they differ, unless the run goes on `mixed`; and Stopped.
    """
    state = journal.state
    test = _comparable(state)
    if state.physics.now == state.physics.proven or test is None:
        return
    journal.record(Comparing(test.id))
    pool.submit(0, frozenset(state.elements), test.seed, limit=wall_limit(state))
    while not (ended := pool.finished(WAIT)):
        control.poll()
    result = ended[0][1]
    same = isinstance(result, RunResult) and np.array_equal(result.trajectory, rows_of(journal.file, test.id))
    if not same and not mixed:
        raise UserError(_differs(journal, result))
    journal.record(Compared(same))


def _comparable(state: RunState) -> Test | None:
    """The first run of the whole world that did not break."""
    baseline = (test for test in state.tests if test.phase == "baseline")
    return next((test for test in baseline if test.outcome in ("similar", "other", "pass", "failed")), None)


def _differs(journal: Journal, result: RunResult | Broken) -> str:
    run, physics = journal.file.path, journal.state.physics
    how = f"broke ({result.failure})" if isinstance(result, Broken) else "gives another trajectory"
    return (
        f"{run}: made again, the first run of the whole world {how}: the tests were made with {physics.before}, and this is "
        f"{physics.after}; 'ddenv resume {run} --mixed' goes on all the same, 'ddenv resume {run} --again' makes all tests again "
        "in a new run"
    )
