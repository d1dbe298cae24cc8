"""Audits slices: some implied tests are simulated all the same, and have to repeat the run that implies them to the last bit."""

from __future__ import annotations

import numpy as np

from ddenv.engine.journal import Journal
from ddenv.robot.result import RunResult
from ddenv.runfile.fold_slices import rests_on_slices
from ddenv.runfile.state import RunState, Test
from ddenv.runfile.store import COLUMNS, ROBOT, RunFile
from ddenv.settings import SETTINGS, read


def audit_is_due(state: RunState) -> bool:
    """Whether the next implied test has to be simulated: the first one, and then one in so many as the setting says."""
    every = read(state.scenario, SETTINGS["audit"])
    return isinstance(every, int) and state.audits * every <= state.implied + state.audits


def compare(journal: Journal, test: int, result: RunResult) -> None:
    """Ends the use of slices if a finished audit differs from the run that implies it."""
    state = journal.state
    source = state.tests[test - 1].audits
    if source is None or state.refuted is not None or repeats(journal.file, state.tests[source - 1], result):
        return
    sound = state.path[0]
    for node in state.path:
        if rests_on_slices(state, node):
            break
        sound = node
    journal.record("slices_refuted", test=test, by=source, node=sound.number)


def repeats(file: RunFile, source: Test, result: RunResult) -> bool:
    """Whether a run has the bits of the finished test `source`."""
    rows = {name: np.array(samples).reshape(-1, COLUMNS) for name, samples in file.motions(source.id).items()}
    again = {ROBOT: result.trajectory, **result.motions}
    ends = (source.outcome == "pass", source.failure, source.cut)
    return (
        ends == (result.outcome == "pass", result.failure, result.cut)
        and rows.keys() == again.keys()
        and all(np.array_equal(rows[name], again[name]) for name in rows)
    )
