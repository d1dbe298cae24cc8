"""The variables at any moment are those of the run."""

import pytest

from ddenv.learn.variables import variables
from ddenv.runfile.position import position_in
from ddenv.runfile.store import RunFile
from tests.learn.lessons import RUNS


@pytest.mark.parametrize("run", RUNS, ids=lambda run: run.stem)
def test_variables_say_what_is_so_and_what_changed(run):
    with RunFile(run) as file:
        position = position_in(file.events())
    before = None
    for id in position.ids:
        moment = position.moment(id)
        now = {one.name: one for one in variables(moment)}
        state = moment.after
        assert now["E"].value.startswith(f"{len(state.environment)} model")
        assert now["n_partitions"].value == (
            "" if state.round is None else str(state.round.n_partitions)
        )
        if before is not None:
            assert now["E"].changed == (now["E"].value != before["E"].value)
        kind, event = moment.recorded.kind, moment.recorded.event
        if kind == "test_started" and event.phase == "round":
            assert now["result"].value == "..." and now["result"].changed
            assert "[" in now["subenvironments"].value
        if kind == "test_finished" and state.tests[event.test - 1].phase == "round":
            outcome = state.tests[event.test - 1].outcome
            wanted = {"similar": "f again", "pass": "the goal was reached", "other": "not f"}[
                outcome
            ]
            assert now["result"].value.startswith(wanted)
        before = now
