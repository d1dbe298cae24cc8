"""What the user decides at awkward moments: while a reduction waits, one thing right after another,
or as the engine is killed.
"""

import pytest

from ddenv.engine.control import Stopped
from ddenv.runfile.store import RunFile
from tests.engine.fake import ELEMENTS, FakePool, drive, new_run
from tests.engine.guided import at_once, guided, numbers, until  # noqa: F401
from tests.engine.killing import Killed, kill_after
from tests.engine.oracles import flaky, needs
from tests.engine.reading import send, state_of, told


def elsewhere(keep, _):
    """f needs the wall and the beam; without the beam the robot gets stuck elsewhere."""
    return "similar" if {"wall", "beam"} <= keep else "other" if "wall" in keep else "pass"


def first_waits(before=None):
    """A guide's beginning: the command `before` in the first round, and on to the first reduction,
    which waits.
    """
    yield from until(lambda state: state.round is not None)
    yield "pause", {}
    if before:
        yield before
    yield "accept_mode", {"mode": "ask"}
    yield "resume", {}
    return (yield from until(lambda state: state.waiting_candidate is not None))


def test_what_is_tried_by_hand_goes_before_the_search(tmp_path):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "try", {"models": numbers("wall", "beam")}
        before = yield from until(lambda state: state.trials)
        after = yield from until(lambda state: state.trials[0].verdict)
        assert after.tests_done - before.tests_done <= 2

    assert (
        guided(new_run(tmp_path, iterations=3), flaky(1, "wall", "beam"), guide()).trials[0].verdict
        == "similar"
    )


@pytest.mark.parametrize("refused", ["vetoed", "rejected"])
def test_while_one_waits_an_earlier_one_is_wanted_after_all(tmp_path, refused):
    def guide():
        veto = ("veto", {"round": 1, "candidate": 0})
        state = yield from first_waits(veto if refused == "vetoed" else None)
        if refused == "rejected":
            yield "reject", {"round": 1, "candidate": 0}
            state = yield from until(lambda state: state.waiting_candidate == 1)
        assert (state.waiting_candidate, state.round.candidates[0].verdict) == (1, refused)
        yield "unveto", {"round": 1, "candidate": 0}
        # One that does not wait any more is not taken.
        yield "accept", {"round": 1, "candidate": 1}
        state = yield from until(lambda state: state.waiting_candidate == 0)
        assert "no longer waits" in state.refusal[1]
        assert state.round.candidates[0].verdict == "similar"
        yield "accept_mode", {"mode": "automatic"}

    path = new_run(tmp_path)
    state = guided(path, lambda *_: "similar", guide())
    assert told(path, "reduced")[0]["candidate"] == 0
    # Resumed, it goes the same way.
    again = FakePool(lambda *_: "similar", 1)
    assert drive(path, again).environment == state.environment
    assert not again.made


def test_what_waits_is_not_accepted_once_the_search_has_to_begin_anew(tmp_path):
    def guide():
        state = yield from first_waits()
        waits = {"round": state.round.number, "candidate": state.waiting_candidate}
        yield "pause", {}
        yield "pin", {"models": numbers("ball")}
        state = yield from until(lambda state: state.pinned)
        assert (state.status, state.waiting_candidate) == ("paused", None)
        yield "accept", waits
        yield from until(lambda state: "no longer waits" in state.refusal[1])
        yield "accept_mode", {"mode": "automatic"}
        yield "resume", {}

    assert set(guided(new_run(tmp_path), needs("wall"), guide()).environment) == {"wall", "ball"}


def test_what_is_accepted_is_taken_before_the_next_decision(tmp_path):
    path = new_run(tmp_path)

    def guide():
        state = yield from first_waits()
        send(path, "accept", round=state.round.number, candidate=state.waiting_candidate)
        yield "undo", {}
        yield "accept_mode", {"mode": "automatic"}

    state = guided(path, needs("wall"), guide())
    assert (state.nodes[1].how, state.nodes[1].rejected, state.nodes[2].parent) == (
        "reduced",
        True,
        0,
    )


def test_a_pinned_model_that_was_not_there_yet_is_unpinned_by_undo(tmp_path):
    def guide():
        yield from until(lambda state: len(state.nodes) == 2)
        yield "pause", {}
        state = yield from until(lambda state: state.paused)
        gone = next(name for name in ELEMENTS if name not in state.environment)
        yield "try", {"models": numbers(gone, "wall")}
        yield from until(lambda state: state.trials and state.trials[0].verdict)
        yield "adopt", {"trial": 1}
        yield "pin", {"models": numbers(gone)}
        yield from until(lambda state: state.pinned)
        yield "undo", {}
        state = yield from until(lambda state: not state.pinned)
        assert gone not in state.environment
        assert f"unpinned {gone}" in state.decisions[-1].words
        yield "resume", {}

    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert state.environment == ("wall",)
    assert state.minimal


def test_undo_takes_back_that_another_failure_counts(tmp_path):
    def guide():
        state = yield from until(lambda state: any(test.outcome == "other" for test in state.tests))
        other = next(test.id for test in state.tests if test.outcome == "other")
        yield "pause", {}
        yield "accept_other", {"test": other}
        state = yield from until(lambda state: len(state.failures) == 2)
        # What the other failure needs is not known.
        assert state.lower_bound == 0
        accepted = state.node
        yield "undo", {}
        state = yield from until(lambda state: len(state.failures) == 1)
        assert state.tests[other - 1].outcome == "other"
        yield "go_back", {"node": accepted}
        state = yield from until(lambda state: len(state.failures) == 2)
        assert state.tests[other - 1].outcome == "similar"
        yield "undo", {}
        yield "resume", {}

    state = guided(new_run(tmp_path), elsewhere, guide())
    assert set(state.environment) == {"wall", "beam"}
    assert state.minimal


def test_a_trial_is_not_adopted_where_its_failure_does_not_count(tmp_path):
    def guide():
        state = yield from until(lambda state: any(test.outcome == "other" for test in state.tests))
        yield "pause", {}
        yield (
            "accept_other",
            {"test": next(test.id for test in state.tests if test.outcome == "other")},
        )
        yield "try", {"models": numbers("wall", "ball")}
        yield from until(lambda state: state.trials and state.trials[0].verdict == "similar")
        yield "undo", {}
        yield "adopt", {"trial": 1}
        yield from until(lambda state: "did not show f" in state.refusal[1])
        yield "resume", {}

    assert set(guided(new_run(tmp_path), elsewhere, guide()).environment) == {"wall", "beam"}


def test_what_is_unpinned_is_not_called_minimal_before_it_was_left_out(tmp_path):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "pin", {"models": numbers("ball")}

    path = new_run(tmp_path)
    assert guided(path, needs("wall"), guide()).minimal
    send(path, "unpin", models=numbers("ball"))
    state = drive(path, FakePool(needs("wall"), 1))
    assert state.environment == ("wall",)
    assert [node.environment for node in state.nodes if node.minimal] == [("wall",)]


def test_trials_keep_to_the_budget(tmp_path):
    def guide():
        yield from until(lambda state: state.tests_done >= 4)
        yield "pause", {}
        for number in range(6):
            yield "try", {"models": [number]}

    path = new_run(tmp_path, budget=6)
    with pytest.raises(Stopped, match="the budget of 6 tests is used up"):
        guided(path, needs("wall"), guide(), 2)
    assert state_of(path).tests_done == 6


def test_with_more_budget_the_search_goes_on_as_it_was(tmp_path):
    path, undisturbed = (
        new_run(tmp_path, budget=6, pair="learner/timestep"),
        new_run(tmp_path, pair="learner/timestep"),
    )
    with pytest.raises(Stopped, match="the budget of 6 tests is used up"):
        drive(path, FakePool(needs("wall", "beam"), 1))
    assert state_of(path).tests_done == 6
    send(path, "change", settings={"budget": 500})
    assert drive(path, FakePool(needs("wall", "beam"), 1)).minimal
    drive(undisturbed, FakePool(needs("wall", "beam"), 1))
    assert told(path, "round_started") == told(undisturbed, "round_started")


def test_a_decision_at_the_last_moment_counts(tmp_path):
    class Late(FakePool):
        def finished(self, seconds):
            ended = super().finished(seconds)
            if len(self.made) == len(undisturbed.made) and not viewer.commands():
                viewer.send("try", models=numbers("beam"))
            return ended

    undisturbed, path = FakePool(needs("wall"), 1), new_run(tmp_path)
    drive(new_run(tmp_path), undisturbed)
    with RunFile(path) as viewer:
        state = drive(path, Late(needs("wall"), 1))
    assert state.trials[0].verdict == "dissimilar"


def test_a_decision_counts_once_whenever_the_engine_is_killed(tmp_path):
    for after in range(1, 7):
        path = new_run(tmp_path, iterations=0)
        drive(path, FakePool(needs("wall"), 1))
        send(path, "undo")
        with pytest.raises(Killed):
            drive(
                path,
                FakePool(needs("wall"), 1),
                prepare=lambda file, after=after: kill_after(file, after),
            )
        state = drive(path, FakePool(needs("wall"), 1))
        assert [one.kind for one in state.decisions] == ["undo"]
        assert state.status == "finished" and "wall" in state.environment
