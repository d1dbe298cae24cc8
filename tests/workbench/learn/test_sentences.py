"""What is said of a moment fits what happened there: in every moment of the recorded runs."""

import pytest

from ddenv.learn.variables import variables
from ddenv.runfile.position import position_in
from ddenv.runfile.run_settings import settings
from ddenv.runfile.store import RunFile
from ddenv.words.explain import explain
from ddenv.words.news import what_happened
from ddenv.workbench.run.snapshot import Moments
from tests.learn.lessons import RUNS
from tests.tiers import slow

# By algorithm, the lines of a first run, a re-run, a verdict with f, a reduction and the end.
# Splitting has a line of its own for its last sweep.
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


QUICK = [run for run in RUNS if run.stem in ("delivery", "ditch-sliced")]
# What is said of a test in any phase: its sign and words by outcome.
SIGNS = {"similar": "●", "other": "◇", "pass": "○"}


@pytest.mark.parametrize(
    "run", slow(pytest.mark.screens, RUNS, but=QUICK), ids=lambda run: run.stem
)
def test_every_sentence_fits_its_moment(run):
    seen = set()
    for moment, explained in moments(run):
        here = f"event {moment.recorded.id}, {moment.recorded.kind}: {explained}"
        assert explained.sentences, here
        # Nothing is said twice.
        assert len({sentence.lower() for sentence in explained.sentences}) == len(
            explained.sentences
        ), here
        if (check := CHECKS.get(moment.recorded.kind)) is not None:
            lines = LINES[settings(moment.after).algorithm]
            seen |= {check(moment, explained, lines, " ".join(explained.sentences), here)}
    assert "similar" in seen and len(seen) > 2


def of_start(moment, explained, lines, said, here):
    event = moment.recorded.event
    if event.phase != "round":
        return
    first, again, *_ = lines
    # With idle workers the algorithm may still be at the first run while a re-run starts.
    ahead = first if "re-run of it at the same time" in said else set()
    assert explained.line in (first if event.run == 0 else again | ahead), here
    assert "shows f" not in said.replace("It shows f if", ""), here


def of_end(moment, explained, lines, said, here):
    test = moment.after.tests[moment.recorded.event.test - 1]
    happened = explained.sentences[0]
    assert f"est {test.id} " in happened, here
    for outcome, sign in SIGNS.items():
        assert (sign in happened) == (outcome == test.outcome), here
    if test.outcome == "pass":
        assert not any(word in happened for word in FAILING), here
    values_fit(moment, test.outcome, here)
    if test.phase == "round" and moment.recorded.kind == "test_finished":
        words_fit(test.outcome, said, here)
    return test.outcome


def values_fit(moment, outcome, here):
    result = next(one.value for one in variables(moment) if one.name == "result")
    begins = {"similar": "f again", "other": "not f", "pass": "the goal was reached"}
    assert result.startswith(("...", begins.get(outcome, ""))) or not result, (here, result)


def words_fit(outcome, said, here):
    if outcome == "pass":
        assert not any(word in said for word in FAILING), here
    elif outcome == "similar":
        assert "goal was reached" not in said and "did not show" not in said, here
        assert "f showed in" in said or "shows f" in said, here
    else:
        assert "goal was reached" not in said and "f showed" not in said, here


def of_verdict(moment, explained, lines, said, here):
    one = moment.after.round.candidates[moment.recorded.event.candidate]
    if one.verdict == "similar":
        assert explained.line in lines[2] and f"{one.label} shows f" in said, here
        assert "No candidate" not in said and "Next is" not in said, here
    else:
        assert f"{one.label} shows f" not in said, here


def of_reduction(moment, explained, lines, said, here):
    assert explained.line in lines[3] and "E is now" in said, here
    assert f"→ {len(moment.after.environment)} model" in said, here


def of_the_end(moment, explained, lines, said, here):
    assert explained.line in lines[4], here
    # Only a certificate, or the paper's way, makes it minimal.
    assert ("Minimal" in said) == moment.after.certified, here


CHECKS = {
    "test_started": of_start,
    "test_finished": of_end,
    "implied": of_end,
    "candidate_judged": of_verdict,
    "reduced": of_reduction,
    "finished": of_the_end,
}
