"""A reduction that the user guides by hand: on a simulator that costs nothing."""

import tempfile
from dataclasses import asdict
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.evidence.claims import helping
from ddenv.run_numbers import CERTIFICATES
from tests.engine.fake import ELEMENTS, FakePool, drive, new_run
from tests.engine.guided import COMMANDS, Disturbed, Guided, at_once, guided, numbers, until  # noqa: F401
from tests.engine.killing import finished_tests, killed
from tests.engine.oracles import flaky, needs
from tests.engine.reading import events, models_in, send, state_of
from tests.tiers import examples


def test_a_pinned_model_stays_and_is_part_of_every_candidate(tmp_path):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "pin", {"models": numbers("ball")}

    path = new_run(tmp_path)
    pool = Guided(path, needs("wall"), guide())
    state = drive(path, pool)
    assert set(state.environment) == {"wall", "ball"}
    assert state.minimal
    assert state.reason.endswith("; 1 pinned model was never left out")
    search = [event.id for event in events(path) if event.kind == "leg_started"][-1]
    started = [
        asdict(event.event)["test"]
        for event in events(path)
        if event.kind == "test_started" and event.id > search
    ]
    assert all("ball" in models_in(state, test) for test in started)
    assert [one.kind for one in state.decisions] == ["pin"]


def test_all_pinned_is_the_end(tmp_path):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "pin", {"models": list(range(len(ELEMENTS)))}

    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert state.environment == ELEMENTS
    assert state.minimal


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_selection_by_hand_is_tested_and_adopted(tmp_path, jobs):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield "pause", {}
        yield "try", {"models": numbers("ball", "beam")}
        yield "try", {"models": numbers("wall", "beam")}
        # They are tested while the rounds are paused.
        state = yield from until(
            lambda state: len(state.trials) == 2 and all(one.verdict for one in state.trials)
        )
        assert state.status == "paused"
        assert [trial.verdict for trial in state.trials] == ["dissimilar", "similar"]
        yield "adopt", {"trial": 1}
        state = yield from until(lambda state: state.refusal[1])
        assert "did not show f" in state.refusal[1]
        yield "adopt", {"trial": 2}
        state = yield from until(lambda state: state.here.how == "adopted")
        assert set(state.environment) == {"wall", "beam"}
        yield "resume", {}

    state = guided(new_run(tmp_path, iterations=3), needs("wall"), guide(), jobs)
    assert state.environment == ("wall",)
    assert state.minimal
    assert state.trials[1].adopted
    assert len(state.trials[0].tests) == 4
    *_, adopted, last = state.nodes
    assert (adopted.how, last.how, last.parent) == ("adopted", "reduced", adopted.number)


def test_another_failure_is_taken_for_as_good(tmp_path):
    def oracle(keep, _):
        # Without the beam the robot gets stuck elsewhere.
        return "similar" if {"wall", "beam"} <= keep else "other" if "wall" in keep else "pass"

    def guide():
        state = yield from until(lambda state: any(test.outcome == "other" for test in state.tests))
        test = next(test for test in state.tests if test.outcome == "other")
        yield "pause", {}
        yield "accept_other", {"test": test.id}
        state = yield from until(lambda state: len(state.failures) == 2)
        assert not any(test.outcome == "other" for test in state.tests)
        assert state.here.how == "accepted"
        yield "resume", {}

    state = guided(new_run(tmp_path), oracle, guide())
    assert state.environment == ("wall",)
    assert state.minimal


def test_a_model_that_only_helps_is_left_out_and_the_search_goes_on(tmp_path):
    def oracle(keep, seed):
        # In the search f is gone without the beam; with fresh seeds it is only rarer.
        return (
            "similar"
            if "wall" in keep and ("beam" in keep or (seed >= CERTIFICATES.start and seed % 11))
            else "pass"
        )

    path = new_run(tmp_path, accept_rate="kept")
    before = drive(path, FakePool(oracle, 2))
    assert (set(before.environment), before.minimal) == ({"wall", "beam"}, False)
    assert helping(before.certificate) == ("beam",)
    send(path, "leave_out", model=ELEMENTS.index("beam"))
    state = drive(path, FakePool(oracle, 2))
    assert (state.environment, state.minimal) == (("wall",), True)
    assert (state.here.how, state.decisions[-1].words) == (
        "left_out",
        "left out beam, which only helped",
    )
    # The run that it rests on is one of the certificate's.
    test = state.tests[state.here.evidence_test - 1]
    assert (test.without, test.outcome, test.id in range(len(before.tests))) == (
        "beam",
        "similar",
        True,
    )


def test_a_veto_is_taken_back(tmp_path):
    def guide():
        state = yield from until(
            lambda state: state.round is not None and len(state.round.candidates) > 3
        )
        # The first two: that one is passed over when it is wanted again.
        for candidate in (0, 1):
            yield "veto", {"round": state.round.number, "candidate": candidate}
        yield from until(lambda now: now.round.candidates[1].verdict == "vetoed")
        for candidate in (0, 1):
            yield "unveto", {"round": state.round.number, "candidate": candidate}

    path = new_run(tmp_path)
    undisturbed = drive(new_run(tmp_path), FakePool(needs("wall"), 1))
    state = guided(path, needs("wall"), guide())
    assert state.environment == undisturbed.environment
    assert state.minimal
    assert {one.kind for one in state.decisions} == {"veto", "unveto"}


@pytest.mark.parametrize(
    ("kind", "data", "why"),
    [
        ("pin", {"models": [99]}, "no such models"),
        ("pin", {"models": "wall"}, "no such models"),
        ("unpin", {"models": [0]}, "not pinned"),
        ("try", {"models": list(range(6))}, "the current environment"),
        ("try", {"models": [True]}, "no such models"),
        ("adopt", {"trial": 1}, "no such try"),
        ("leave_out", {"model": 0}, "no certificate shows a model that only helps"),
        ("accept_other", {"test": 1}, "did not end in another failure"),
        ("accept_other", {"test": -1}, "no such test"),
        ("undo", {}, "no reduction"),
        ("go_back", {"node": 7}, "no such place"),
        ("go_back", {"node": 0}, "there already"),
        ("change", {"settings": {"seed": 3}}, "only pair"),
        ("change", {"settings": {"pair": "timesg/random"}}, "no partitioning 'timesg'"),
        ("change", {"settings": {"algorithm": "x"}}, "no algorithm 'x'"),
        ("change", {"settings": {"iterations": -1}}, "iterations"),
        ("change", {"settings": {"iterations": "2"}}, "iterations"),
        ("change", {"settings": {"iterations": 1}}, "already"),
        ("unveto", {"round": 1, "candidate": 0}, "neither vetoed, rejected nor undone"),
        ("unveto", {"round": 9, "candidate": 0}, "round is over"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(tmp_path, kind, data, why):
    def guide():
        yield from until(lambda state: state.round is not None)
        yield kind, data

    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert state.minimal
    assert state.refusal[0] == 1
    assert why in state.refusal[1]
    assert not state.decisions


@given(
    salt=st.integers(0, 3),
    plan=st.lists(st.tuples(st.integers(3, 30), COMMANDS), max_size=6),
    moments=st.lists(st.integers(5, 80), max_size=2),
    jobs=st.integers(1, 3),
)
@examples(0.25)
def test_whatever_is_decided_and_whenever_it_is_killed_the_run_ends_sound(
    salt, plan, moments, jobs
):
    with tempfile.TemporaryDirectory() as folder:
        path, oracle, plan = (
            new_run(Path(folder)),
            flaky(salt, "wall", "beam"),
            sorted(plan, key=lambda one: one[0]),
        )
        killed(path, Disturbed(path, oracle, jobs, plan, salt), moments)
        state = drive(path, Disturbed(path, oracle, jobs, plan))
        assert state.status == "finished"
        # Whoever folds the file sees the same.
        assert state_of(path) == state
        assert state.pinned <= set(state.environment) or any(
            one.kind == "go_back" for one in state.decisions
        )
        finished = finished_tests(path)
        assert len(finished) == len(set(finished))
        for node in state.nodes[1:]:
            assert node.parent < node.number
            # Another failure counts below where it was accepted.
            assert state.tests[node.evidence_test - 1].outcome in ("similar", "other")
        assert state.tests[state.evidence_test - 1].outcome == "similar"
