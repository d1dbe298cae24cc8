"""What idle workers make ahead of time: it changes no result, whatever their number, and what nobody needs is counted."""

import tempfile
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from zlib import crc32

import pytest
from ddenv.engine.ahead import LONGEST, Ahead
from ddenv.reduction.rounds_ahead import Place, RoundsAhead
from hypothesis import example, given
from hypothesis import strategies as st

from ddenv.engine.journal import Journal
from ddenv.reduction.round import make_round
from ddenv.runfile.state import AHEAD, BROKEN, FRESH
from ddenv.runfile.store import RunFile
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.oracles import needs
from tests.engine.participation import MODELS, Participation, sliced_run
from tests.engine.test_certify import _killed, at_rates
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
WORKERS = (2, 8, 64)


def decided(path):
    """All that a run decided, with the tests that it rests on, as (models, run), and those known as its last search begins."""
    found = []
    with RunFile(path) as file:
        journal = Journal(file)
        for event in file.events():
            if event.kind in (
                "candidate_judged",
                "reduced",
                "rate_lost",
                "left_out",
                "certificate_finished",
                "finished",
            ):
                data = {
                    key: value for key, value in asdict(event.event).items() if key not in ("known", "evidence_test")
                }
                if "tests" in data:
                    tests = [journal.state.tests[test - 1] for test in data["tests"]]
                    data["tests"] = sorted((sorted(journal.keep_of_test(one.id)), one.run) for one in tests)
                found.append((event.kind, data))
        made = [
            (journal.keep_of_test(one.id), one.run) for one in journal.state.finished_tests if one.outcome not in BROKEN
        ]
    assert len(made) == len(set(made)), "a test was made twice"
    leg = journal.begin_leg()
    found.append(
        ("leg", [(sorted(journal.keep_of_test(test)), journal.state.tests[test - 1].run) for test in leg.tests])
    )
    return found, journal.state


@pytest.mark.parametrize("method", slow(pytest.mark.fuzz, METHODS, but=[METHODS[1], METHODS[6]]), ids=str)
@given(
    salt=st.integers(0, 99),
    needed=st.sets(st.sampled_from(MODELS), min_size=1, max_size=4).map(frozenset),
    fewer=st.sampled_from([0.0, 0.2, 0.5]),
    rate=st.sampled_from([1.0, 0.9]),
    seed=st.integers(0, 9),
)
# A search that begins again after rounds that were made ahead of time.
@example(salt=0, needed=frozenset(MODELS[2:4]), fewer=0.2, rate=1.0, seed=3)
@examples(0.1)
def test_any_number_of_workers_comes_to_the_same_verdicts(salt, needed, fewer, rate, seed, method):
    oracle = at_rates(salt, (needed, rate), (needed - {min(needed)}, fewer))
    with tempfile.TemporaryDirectory() as folder:
        alone = sliced_run(Path(folder), **method)
        drive(alone, FakePool(oracle, 1))
        expected, state = decided(alone)
        assert not any(test.phase == AHEAD for test in state.tests)
        for workers in WORKERS:
            path = sliced_run(Path(folder), **method)
            drive(path, FakePool(oracle, workers, seed))
            assert decided(path)[0] == expected, workers


def breaks(salt, *names):
    """Shows f with all of the names; some worlds cannot be simulated."""

    def oracle(keep, seed):
        if crc32(f"{salt} {sorted(keep)}".encode()) % 5 == 0 and len(keep) < len(MODELS) // 2:
            return "error"
        return needs(*names)(keep, seed)

    return oracle


@given(salt=st.integers(0, 99), seed=st.integers(0, 9))
@examples(0.2)
def test_worlds_that_break_ahead_of_time_break_no_run(salt, seed):
    with tempfile.TemporaryDirectory() as folder:
        alone, together = sliced_run(Path(folder), **METHODS[1]), sliced_run(Path(folder), **METHODS[1])
        drive(alone, FakePool(breaks(salt, *MODELS[3:5]), 1))
        drive(together, FakePool(breaks(salt, *MODELS[3:5]), 64, seed))
        assert decided(together)[0] == decided(alone)[0]


@given(moments=st.lists(st.integers(1, 90), min_size=1, max_size=4), salt=st.integers(0, 99))
@examples(0.2)
def test_an_engine_that_goes_on_knows_what_was_made_ahead(moments, salt):
    """Killed at any moment, with another number of workers each time."""
    simulated = Participation(salt, MODELS[2:4], tenths=9)
    with tempfile.TemporaryDirectory() as folder:
        alone, path = sliced_run(Path(folder), **METHODS[0]), sliced_run(Path(folder), **METHODS[0])
        drive(alone, simulated.pool(1))
        _killed(path, simulated.pool(64), moments)
        for workers in (8, 1):
            drive(path, simulated.pool(workers))
        journeys = [[(kind, data) for kind, data in decided(each)[0] if kind != "finished"] for each in (path, alone)]
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


def test_later_rounds_and_the_certificate_are_begun_ahead_of_time(runs):
    _, (state, _) = runs
    last_round = max(test.id for test in state.tests if test.phase == "round")
    assert AHEAD in {test.phase for test in state.tests}
    assert any(test.phase in FRESH and test.id < last_round for test in state.tests)


def test_nothing_beyond_the_round_is_made_where_tests_are_counted(tmp_path):
    path = new_run(tmp_path, budget=500)
    state = drive(path, FakePool(needs("wall", "beam"), 16))
    assert {test.phase for test in state.tests} == {"baseline", "round", "certify"}


@pytest.mark.parametrize("workers", [2, 4])
def test_the_next_test_of_the_search_never_waits_for_those_of_later_rounds(tmp_path, workers):
    path = sliced_run(tmp_path, accept_rate="first", iterations=25)
    drive(path, FakePool(needs(MODELS[0], MODELS[3]), workers))
    with RunFile(path) as file:
        begun = [asdict(event.event) for event in file.events() if event.kind == "test_started"]
    # Nobody looks so far ahead in the runs of one candidate.
    first = [(one["phase"], one["candidate"], one["run"]) for one in begun]
    late = first.index(("round", 0, 12))
    assert late - first.index(("round", 0, 11)) <= 2 * workers


def test_no_look_begins_a_step_that_would_take_too_long(tmp_path, monkeypatch):
    """Commands wait for it."""
    now, steps, looks = 0.0, 0, []
    find, look = RoundsAhead._next, Ahead.likely

    def found(*place):
        nonlocal now, steps
        now, steps = now + 0.7 * LONGEST, steps + 1
        return find(*place)

    def looked(*asked):
        began = now
        likely = look(*asked)
        looks.append(now - began)
        return likely

    monkeypatch.setattr("ddenv.engine.ahead.time", SimpleNamespace(monotonic=lambda: now))
    monkeypatch.setattr(RoundsAhead, "_next", found)
    monkeypatch.setattr(Ahead, "likely", looked)
    drive(sliced_run(tmp_path, **METHODS[1]), FakePool(needs(*MODELS[3:5]), 16))
    assert steps > 2
    assert max(looks) <= LONGEST


def test_candidates_that_are_judged_are_forgotten(tmp_path):
    """The models of 10,000 candidates of 10,000 models each would take gigabytes."""
    models = [str(number) for number in range(20)]
    round = make_round(20, tuple(models), [((name,), 0.0) for name in models])
    place = Place((), round, keeps={index: frozenset() for index in range(40)}, after=dict.fromkeys([None, *range(40)]))
    place.judged(30)
    assert list(place.keeps) == list(range(29, 40)) and list(place.after) == [None, *range(29, 40)]
