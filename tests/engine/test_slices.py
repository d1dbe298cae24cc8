"""Slices: a test that a finished run implies is not made, models that did not affect a run go
without one, and audits find what is wrong.
"""

import tempfile
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ddenv.runfile.events import SlicesRefuted
from ddenv.runfile.fold import fold
from ddenv.runfile.state import CERTIFY
from tests.engine.fake import drive
from tests.engine.guided import Guided, at_once, until  # noqa: F401
from tests.engine.killing import Killed, kill_after, killed, resumed
from tests.engine.participation import MODELS, Participation, sliced_run
from tests.engine.reading import events, models_in, state_of
from tests.engine.test_repeating import another_drake
from tests.tiers import examples

NEEDED = st.sets(st.sampled_from(MODELS), min_size=1, max_size=3).map(
    lambda names: tuple(sorted(names))
)
TIES = st.lists(
    st.tuples(*2 * [st.sampled_from(MODELS)]).filter(lambda tie: tie[0] != tie[1]), max_size=5
).map(tuple)
SIMULATORS = st.builds(Participation, salt=st.integers(0, 99), needed=NEEDED, ties=TIES)
FLAKY = st.builds(
    Participation, salt=st.integers(0, 99), needed=NEEDED, ties=TIES, tenths=st.sampled_from([6, 9])
)


def worlds_of(state):
    """The models in the world of each test."""
    return [(test, models_in(state, test.id)) for test in state.tests]


def journey(state):
    """The environments of a run in their order, and how it ended."""
    return [(node.how, node.environment) for node in state.nodes], state.minimal, state.reason


@given(made_by=SIMULATORS, accept=st.sampled_from(["first", "kept"]), seed=st.integers(0, 9))
@examples(0.5)
def test_every_outcome_is_that_of_a_simulation_and_the_end_is_the_same(made_by, accept, seed):
    with tempfile.TemporaryDirectory() as folder:
        ends = []
        for wanted in (True, False):
            path, pool = (
                sliced_run(Path(folder), slice=wanted, accept_rate=accept),
                made_by.pool(seed=seed),
            )
            state = drive(path, pool)
            for test, keep in worlds_of(state):
                outcome, met, _ = made_by.run(keep, test.seed)
                assert test.outcome == outcome
                assert (
                    test.took_part is not None and set(test.took_part.names(state.elements)) == met
                )
            ends.append((state.environment, state.minimal))
            assert state.made == len(pool.made)
            assert state.refuted is None
            assert wanted or not (state.implied or state.audits)
        assert (
            ends[0] == ends[1] == (tuple(name for name in MODELS if name in made_by.needed), True)
        )


@pytest.mark.parametrize(("share", "simulated"), [(0.1, 1), (-1.0, 0)])
def test_what_a_certificate_rests_on_is_simulated_where_that_is_cheap(
    tmp_path, monkeypatch, share, simulated
):
    """One of the fresh runs of this simulator follows from another one."""
    monkeypatch.setattr("ddenv.engine.slicing.CHEAP", share)
    made_by = Participation(salt=8, needed=(MODELS[0], MODELS[3]), tenths=8)
    state = drive(sliced_run(tmp_path, accept_rate="kept", audit=1_000_000), made_by.pool())
    fresh = [test for test in state.finished_tests if test.phase == CERTIFY]
    audits, implied = (
        sum(getattr(test, kind) is not None for test in fresh) for kind in ("audits", "implied_by")
    )
    assert (audits, implied) == (simulated, 1 - simulated)


METHODS = [
    {},
    {"algorithm": "splitting"},
    {"pair": "model2model/timestep"},
    {"pair": "learner/timestep"},
]
HALF = Participation(salt=40, needed=(MODELS[18], MODELS[3], MODELS[7]), tenths=6)


@pytest.mark.fuzz
@given(
    made_by=FLAKY, jobs=st.integers(2, 4), seed=st.integers(0, 9), method=st.sampled_from(METHODS)
)
# What a run has in view beside what took part in it is otherwise where it is simulated again.
@example(made_by=HALF, jobs=3, seed=0, method=METHODS[2])
@example(made_by=HALF, jobs=3, seed=0, method=METHODS[3])
@examples(0.3)
def test_neither_workers_nor_audits_change_anything(made_by, jobs, seed, method):
    with tempfile.TemporaryDirectory() as folder:
        alone, together = (
            drive(
                sliced_run(Path(folder), accept_rate="kept", audit=audit, **method),
                made_by.pool(workers, seed),
            )
            for workers, audit in ((1, 1), (jobs, 1_000_000))
        )
    assert together.refuted is None
    assert journey(together) == journey(alone)


@given(
    made_by=FLAKY,
    moments=st.lists(st.integers(1, 60), min_size=1, max_size=6),
    jobs=st.integers(1, 3),
    accept=st.sampled_from(["first", "kept"]),
)
@examples(0.3)
def test_killed_at_any_moment_it_resumes_to_the_same_end_and_makes_no_test_twice(
    made_by, moments, jobs, accept
):
    with tempfile.TemporaryDirectory() as folder:
        undisturbed = drive(sliced_run(Path(folder), accept_rate=accept), made_by.pool())
        path = sliced_run(Path(folder), accept_rate=accept)
        killed(path, made_by.pool(jobs), moments)
        state = resumed(path, made_by.pool(jobs))
        assert journey(state) == journey(undisturbed)
        finished = [(keep, test.run) for test, keep in worlds_of(state) if test.is_finished]
        assert len(finished) == len(set(finished))


@given(made_by=SIMULATORS, jobs=st.integers(1, 3), data=st.data())
@examples(0.3)
def test_a_simulator_that_does_not_say_all_is_found_out(made_by, jobs, data):
    """Whatever it hides, the run ends as if it had never been asked."""
    liar = Participation(
        made_by.salt, made_by.needed, made_by.ties, hidden=frozenset(made_by.needed)
    )
    with tempfile.TemporaryDirectory() as folder:
        path = sliced_run(
            Path(folder), accept_rate=data.draw(st.sampled_from(["first", "kept"])), audit=1
        )
        state = drive(path, liar.pool(jobs))
        assert set(state.environment) == set(made_by.needed)
        assert state.minimal
        if state.refuted is not None:
            assert not state.implied
            assert all(
                test.outcome == made_by.run(keep, test.seed)[0]
                for test, keep in worlds_of(state)
                if test.is_finished
            )


LIAR = Participation(1, ("box_1", "box_7"), hidden=frozenset({"box_7"}))


def test_an_engine_that_is_killed_before_it_compares_does_so_when_it_resumes(tmp_path):
    path = sliced_run(tmp_path, accept_rate="first", audit=1)

    def stop_at_once(file):
        append = file.append

        def limited(event, *values):
            if isinstance(event, SlicesRefuted):
                raise Killed
            return append(event, *values)

        file.append = limited

    with pytest.raises(Killed):
        drive(path, LIAR.pool(), prepare=stop_at_once)
    assert state_of(path).refuted is None
    state = drive(path, LIAR.pool())
    assert state.refuted is not None
    assert (set(state.environment), state.minimal) == ({"box_1", "box_7"}, True)


def test_what_rested_on_slices_is_open_again(tmp_path):
    path = sliced_run(tmp_path, accept_rate="first", audit=1)
    state = drive(path, LIAR.pool())
    written = events(path)
    event = next(event for event in written if event.kind == "slices_refuted")
    before, after = (fold(written[: event.id - 1 + step]) for step in (0, 1))
    assert before.here.how == "sliced"
    assert after.environment == state.elements
    assert after.implied == 0
    assert [point.tests for point in after.history] == sorted(
        point.tests for point in after.history
    )
    assert not any(test.implied_by for test in after.tests if test.is_finished)
    assert state.made == sum(test.is_finished for test in state.tests)


HONEST = Participation(2, ("box_1", "box_7"), ties=(("box_1", "box_20"),))


def guided(path, guide):
    return drive(path, HONEST.told(Guided(path, HONEST.outcome, guide)))


def test_a_slice_that_is_taken_back_is_not_taken_again(tmp_path):
    def guide():
        yield from until(lambda state: state.here is not None and state.here.how == "sliced")
        yield "undo", {}

    state = guided(sliced_run(tmp_path, accept_rate="kept"), guide())
    assert [(node.how, node.rejected) for node in state.nodes[:2]] == [
        ("start", False),
        ("sliced", True),
    ]
    assert all(set(node.environment) != set(state.nodes[1].environment) for node in state.nodes[2:])
    assert set(state.environment) == set(HONEST.needed)


def test_a_pinned_model_is_in_every_slice_with_what_it_is_tied_to(tmp_path):
    def guide():
        yield from until(lambda state: len(state.tests) == 1)
        yield "pin", {"models": [1 + MODELS.index("box_23")]}

    path = sliced_run(tmp_path, accept_rate="first")
    state = guided(path, guide())
    assert state.nodes[1].how == "sliced"
    assert {"box_1", "box_20", "box_23"} <= set(state.nodes[1].environment)
    assert set(state.environment) == {*HONEST.needed, "box_23"}


def test_where_each_reduction_waits_for_the_user_none_is_made_without_a_test(tmp_path):
    def guide():
        while True:
            state = yield from until(
                lambda state: state.waiting_candidate is not None or state.ended
            )
            yield "accept", {"round": state.round.number, "candidate": state.waiting_candidate}

    path = sliced_run(tmp_path, accept_rate="first")
    pool = HONEST.told(Guided(path, HONEST.outcome, guide()))
    state = drive(path, pool, accept_mode="ask")
    assert {node.how for node in state.nodes[1:]} == {"reduced"}
    assert state.implied


def test_an_audit_that_senses_what_took_part_at_another_time_is_found_out(tmp_path):
    pool = HONEST.pool()
    pool.sensed = lambda keep, seed: dict.fromkeys(keep, len(keep) / 10)
    assert drive(sliced_run(tmp_path, accept_rate="kept", audit=1), pool).refuted is not None


def test_what_went_without_a_test_is_no_evidence_of_its_rate(tmp_path):
    state = drive(sliced_run(tmp_path, accept_rate="kept"), HONEST.pool())
    sliced = next(node for node in state.nodes if node.how == "sliced")
    chose = set(sliced.sliced_by)
    assert chose
    assert not chose & set(sliced.runs)


def test_implied_tests_do_not_count_for_the_budget(tmp_path):
    path = sliced_run(tmp_path, accept_rate="kept", budget=30)
    with pytest.raises(Exception, match="the budget of 30 tests is used up"):
        drive(path, HONEST.pool())
    state = state_of(path)
    assert state.made == 30
    assert state.tests_done == 30 + state.implied > 30


def test_what_was_made_with_other_software_implies_no_test_of_this(tmp_path, monkeypatch):
    path = sliced_run(tmp_path, accept_rate="kept", audit=1)
    with pytest.raises(Killed):
        drive(path, HONEST.pool(), prepare=lambda file: kill_after(file, 10))
    another_drake(monkeypatch)
    pool = HONEST.pool()
    pool.aside = lambda keep, seed: HONEST.run(keep, seed)[2] / 2**32 + 1e-9
    state = drive(path, pool, mixed=True)
    assert state.physics.mixed
    assert state.refuted is None
    assert state.minimal
