"""What keys mean for a run and why they are not possible, without a screen."""

import fake_moments

from ddenv.guiding.commands import Context, written
from ddenv.guiding.key_offers import Pointed, offer


def why_not(action, state, row=None, models=()):
    return offer(action, Context(state), Pointed(row, models=tuple(models))).why_not


def meant(action, state, row=None, models=()):
    return written(offer(action, Context(state), Pointed(row, models=tuple(models))).command)


def test_what_a_means_for_a_try(run):
    fake_moments.guided(run)
    state = run.state
    adopted, vain, under_way = state.trials
    assert "is the environment already" in why_not("accept", state, adopted)
    assert meant("accept", state, vain)[0] == "accept_other"
    assert "try 3 is not judged yet" in why_not("accept", state, under_way)
    run.finish(*under_way.tests, "similar", 0.1, failure="stuck")
    run.judge_trial(3, "similar", list(under_way.tests))
    state = run.state
    assert "lacks crate_00, which is pinned" in why_not("accept", state, state.trials[2])
    run.write("unpinned", models=[0])
    now = Context(run.state)
    assert [offer("accept", now, Pointed(row)).words for row in now.state.trials] == [
        "",
        "count as f",
        "adopt",
    ]
    # From anywhere it adopts the last try that shows f.
    assert (
        meant("accept", run.state)
        == meant("accept", run.state, run.state.trials[2])
        == ("adopt", {"trial": 3})
    )


def test_the_nearest_other_failure_is_the_one_to_accept(run):
    run.created().baseline()
    run.start_round(2)
    tests = [
        run.test(0, "other", away, number, "tipped over")
        for number, away in enumerate((2.0, 0.5, 3.0))
    ]
    state = run.state
    assert meant("accept", state, state.round.candidates[0]) == ("accept_other", {"test": tests[1]})


def test_what_the_cursor_only_follows_is_not_accepted(run):
    run.created().baseline()
    run.start_round(2)
    run.test(0, "other", 2.0, 0, "tipped over")
    state = run.state
    followed = Pointed(state.round.candidates[0], follows=True)
    assert "nothing to accept" in offer("accept", Context(state), followed).why_not
    run.write("paused")
    assert offer("accept", Context(run.state), followed).words == "count as f"


def test_models_that_cannot_be_pinned_or_tried(run):
    fake_moments.guided(run)
    state = run.state
    assert "floor is protected" in why_not("pin", state, models=["floor"])
    assert "crate_09 is removed already" in why_not("pin", state, models=["crate_09"])
    assert "nothing is left out" in why_not("without", state, models=["crate_09"])
    assert "nothing is left out" in why_not("only", state, models=state.environment)
    assert meant("only", state, models=["crate_09", "crate_01"]) == ("try", {"models": [1, 9]})
    assert meant("without", state, models=state.environment) == ("try", {"models": []})


def test_before_f_is_known_nothing_is_tried_or_undone(run):
    run.created()
    state = run.state
    assert "the baseline comes first" in why_not("only", state, models=["crate_01"])
    assert "no reduction to take back" in why_not("undo", state)
    assert meant("pin", state, models=["crate_01"]) == ("pin", {"models": [1]})
    assert "no candidates yet" in why_not("veto", state)


def test_a_round_that_is_over_cannot_be_vetoed(run):
    state = fake_moments.certifying(run).state
    assert why_not("veto", state) == "the rounds are over"
    run.write("finished", minimal=True, reason="no candidate showed f")
    state = run.state
    assert why_not("veto", state, state.round.candidates[0]) == "this round is over"
