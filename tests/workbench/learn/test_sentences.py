"""What is said of a moment fits what happened there: in every moment of the recorded runs."""

import pytest

from ddenv.runfile.position import position_in
from ddenv.runfile.run_settings import settings
from ddenv.runfile.store import RunFile
from ddenv.workbench.run.browsing import Moments, what_happened
from ddenv.workbench.run.explain import explain
from tests.learn.lessons import RUNS
from tests.tiers import slow

# By algorithm, the lines of a first run, a re-run, a verdict with f, a reduction and the end. Splitting has a line of its own for
# its last sweep.
LINES = {
    "ddenv": ({5}, {7}, {10}, {11}, {21}),
    "ddmin": ({4}, {5}, {6}, {6}, {8}),
    "splitting": ({3, 7}, {4}, {5, 7}, {5, 7}, {8}),
}
FAILING = ("fails", "failed", "got stuck", "shows f", "showed f")


def moments(run):
    with RunFile(run) as file:
        position, snapshots = position_in(file.events()), Moments(file)
        for id in position.ids:
            moment = position.moment(id)
            yield moment, explain(snapshots.of(moment, what_happened(moment)))


QUICK = [run for run in RUNS if run.stem in ("delivery", "quay-kept", "ditch-sliced")]


@pytest.mark.parametrize("run", slow(pytest.mark.screens, RUNS, but=QUICK), ids=lambda run: run.stem)
def test_every_sentence_fits_its_moment(run):
    seen = set()
    for moment, explained in moments(run):
        kind, data, state = moment.event.kind, moment.event.data, moment.after
        said = " ".join(explained.sentences)
        here = f"event {moment.event.id}, {kind}: {explained}"
        first, again, shown, reduced, end = LINES[settings(state).algorithm]
        assert explained.sentences, here
        if kind == "test_started" and data["phase"] == "round":
            assert explained.line in (first if data["run"] == 0 else again), here
            assert not any(
                word in said.replace("It shows f if", "").replace("last time", "") for word in ("shows f",)
            ), here
        elif kind == "test_finished" and state.tests[data["test"] - 1].phase == "round":
            test = state.tests[data["test"] - 1]
            seen.add(test.outcome)
            if test.outcome == "pass":
                assert not any(word in said for word in FAILING), here
            elif test.outcome == "similar":
                assert "goal was reached" not in said and "did not show" not in said, here
                assert "f showed in" in said or "shows f" in said, here
            else:
                assert "goal was reached" not in said and "f showed" not in said, here
        elif kind == "candidate_judged":
            one = state.round.candidates[data["candidate"]]
            if one.verdict == "similar":
                assert explained.line in shown and f"{one.label} shows f" in said, here
                assert "No candidate" not in said and "Next is" not in said, here
            else:
                assert f"{one.label} shows f" not in said, here
        elif kind == "reduced":
            assert explained.line in reduced and "E is now" in said, here
            assert f"→ {len(state.environment)} model" in said, here
        elif kind == "finished":
            assert explained.line in end, here
    assert "similar" in seen and len(seen) > 1
