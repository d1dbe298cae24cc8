"""What idle workers make ahead of time: it changes no result, whatever their number, and what
nobody needs is counted.
"""

import tempfile
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ddenv.runfile.events import (
    CandidateJudged,
    CertificateFinished,
    Finished,
    LeftOut,
    RateLost,
    Reduced,
)
from ddenv.runfile.fold import fold
from ddenv.runfile.state import BROKEN
from tests.engine.fake import FakePool, drive
from tests.engine.killing import killed
from tests.engine.oracles import needs
from tests.engine.participation import MODELS, Participation, sliced_run
from tests.engine.reading import events, models_in, told
from tests.engine.test_certify import at_rates
from tests.tiers import examples, slow

METHODS = [
    {"accept_rate": "kept", "growth": "steady", "skip": "implied"},
    {"accept_rate": "kept", "algorithm": "splitting"},
    {"accept_rate": "kept", "algorithm": "probdd"},
    {"accept_rate": "kept", "pair": "learner/timestep", "growth": "steady", "skip": "implied"},
    {"accept_rate": "kept", "pair": "timeseg/min-trajectory-proximal"},
    {"accept_rate": "first", "algorithm": "ddmin"},
    {},
]


def decided(path):
    """All that a run decided, with the tests that it rests on, as (models, run), and those known as
    its last search began.
    """
    recorded = events(path)
    state = fold(recorded)

    def named(tests):
        return sorted((sorted(models_in(state, test)), state.tests[test - 1].run) for test in tests)

    found = []
    for event in (one.event for one in recorded):
        match event:
            case CandidateJudged():
                found.append((event.round, event.candidate, event.verdict, named(event.tests)))
            case Reduced():
                found.append(
                    (
                        event.round,
                        event.candidate,
                        state.environments[event.environment].names(state.elements),
                    )
                )
            case RateLost():
                found.append((event.node, event.lost, event.again, named(event.tests)))
            case LeftOut():
                found.append(("left out", event.without))
            case CertificateFinished():
                assert {state.tests[test - 1].phase for test in event.tests} == {"certify"}
                claims = [
                    (one.without, one.verdict, one.shown, one.runs, one.outcomes)
                    for one in event.claims
                ]
                found.append((claims, named(event.tests)))
            case Finished():
                found.append(event)
    made = [
        (test.environment, test.run) for test in state.finished_tests if test.outcome not in BROKEN
    ]
    assert len(made) == len(set(made)), "a test was made twice"
    found.append(named(state.search.tests))
    return found, state


@pytest.mark.parametrize("method", slow(pytest.mark.fuzz, METHODS, but=[METHODS[1]]), ids=str)
@given(
    salt=st.integers(0, 99),
    needed=st.sets(st.sampled_from(MODELS), min_size=1, max_size=4).map(frozenset),
    fewer=st.sampled_from([0.0, 0.2, 0.5]),
    rate=st.sampled_from([1.0, 0.9]),
    workers=st.sampled_from([2, 8, 64]),
    seed=st.integers(0, 9),
)
# A search that begins again after rounds that were made ahead of time.
@example(salt=0, needed=frozenset(MODELS[2:4]), fewer=0.2, rate=1.0, workers=8, seed=3)
@examples(0.2)
def test_any_number_of_workers_comes_to_the_same_verdicts(
    salt, needed, fewer, rate, workers, seed, method
):
    oracle = at_rates(salt, (needed, rate), (needed - {min(needed)}, fewer))
    with tempfile.TemporaryDirectory() as folder:
        alone = sliced_run(Path(folder), **method)
        drive(alone, FakePool(oracle, 1))
        expected, state = decided(alone)
        assert not state.ahead
        path = sliced_run(Path(folder), **method)
        drive(path, FakePool(oracle, workers, seed))
        assert decided(path)[0] == expected


@pytest.mark.fuzz
@given(moments=st.lists(st.integers(1, 90), min_size=1, max_size=4), salt=st.integers(0, 99))
@examples(0.2)
def test_an_engine_that_goes_on_knows_what_was_made_ahead(moments, salt):
    """Killed at any moment, with another number of workers each time."""
    simulated = Participation(salt, MODELS[2:4], tenths=9)
    with tempfile.TemporaryDirectory() as folder:
        alone, path = sliced_run(Path(folder), **METHODS[0]), sliced_run(Path(folder), **METHODS[0])
        drive(alone, simulated.pool(1))
        killed(path, simulated.pool(64), moments)
        for workers in (8, 1):
            drive(path, simulated.pool(workers))
        journeys = [
            [one for one in decided(each)[0] if not isinstance(one, Finished)]
            for each in (path, alone)
        ]
        assert journeys[0] == journeys[1]


@pytest.fixture
def runs(tmp_path):
    made = []
    for workers in (1, 64):
        path = sliced_run(tmp_path, **METHODS[0])
        pool = FakePool(needs(*MODELS[5:8]), workers)
        drive(path, pool)
        made.append((decided(path)[1], pool))
    return made


def test_what_ran_ahead_for_nothing_is_counted(runs):
    (alone, _), (together, pool) = runs
    assert alone.ahead == 0
    assert together.ahead == len(pool.made) - alone.tests_done > 0


def test_idle_workers_make_nothing_of_later_rounds(runs):
    _, (state, _) = runs
    phases = [test.phase for test in state.tests]
    assert set(phases) <= {"baseline", "round", "audit", "certify"}
    assert phases.index("certify") > max(
        place for place, phase in enumerate(phases) if phase == "round"
    )
    rounds = [test.round for test in state.tests if test.phase == "round"]
    assert rounds == sorted(rounds)


def test_the_workers_take_the_tests_of_the_list_in_its_order(tmp_path):
    """Re-runs of a candidate come before tests of the next ones."""
    path = sliced_run(tmp_path, accept_rate="first", iterations=25)
    drive(path, FakePool(needs(MODELS[0], MODELS[3]), 4))
    begun = [data for data in told(path, "test_started") if data["phase"] == "round"]
    first = [(one["candidate"], one["run"]) for one in begun if one["round"] == begun[15]["round"]]
    assert first == sorted(first)
