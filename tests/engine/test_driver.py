"""The engine's promises, on a simulator that costs nothing."""

import json
import sqlite3
import tempfile
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.engine.control import Stopped
from ddenv.engine.driver import Driver
from ddenv.errors import UserError
from ddenv.runfile.events import RoundStarted
from ddenv.schemas import names
from tests.engine.fake import ELEMENTS, FakePool, drive, new_run
from tests.engine.guided import Guided, at_once, guided, until  # noqa: F401
from tests.engine.killing import Killed, finished_tests, kill_after, killed, resumed, story
from tests.engine.oracles import flaky, needs
from tests.engine.reading import state_of, told
from tests.tiers import examples


@pytest.mark.parametrize("algorithm", names("algorithm"))
@pytest.mark.parametrize("pair", ["model2model/failure-proximal", "learner/timestep"])
def test_every_algorithm_finds_the_needed_models(tmp_path, algorithm, pair):
    """`tests/reduction` has every pair: an engine gives them all the same evidence."""
    state = drive(
        new_run(tmp_path, algorithm=algorithm, pair=pair), FakePool(needs("wall", "beam"), 2)
    )
    # In the order of the world, whatever order the algorithm has them in.
    assert state.environment == tuple(name for name in ELEMENTS if name in ("wall", "beam"))
    assert state.minimal and state.status == "finished"


def test_the_settings_of_the_scenario_reach_the_algorithm(tmp_path):
    exact = drive(new_run(tmp_path), FakePool(needs("wall", "beam"), 1))
    fewer = drive(
        new_run(tmp_path, growth="steady", skip="implied"), FakePool(needs("wall", "beam"), 1)
    )
    assert fewer.environment == exact.environment
    assert len(fewer.tests) < len(exact.tests)


# What was tried first, what remembers what it saw, and what splits by what was seen.
METHODS = [
    {"pair": "model2model/avg-trajectory-proximal"},
    {"pair": "learner/timestep"},
    {"pair": "trajectoryseg/min-trajectory-proximal", "growth": "steady", "skip": "implied"},
    {"algorithm": "splitting"},
]
every_method = pytest.mark.parametrize(
    "method", METHODS, ids=lambda method: "-".join(method.values())
)


def test_where_f_is_flaky_splitting_looks_once_and_a_miss_shows_nothing_yet(tmp_path):
    path = new_run(tmp_path, algorithm="splitting", iterations=3)
    state = drive(path, FakePool(flaky(5, "wall", "ball"), 2))
    assert set(state.environment) == {"wall", "ball"}
    judged = told(path, "candidate_judged")
    looked = [data for data in judged if data["verdict"] == "missed"]
    assert looked
    assert judged[0]["verdict"] in ("similar", "missed")
    # At the end each model has had all its runs.
    assert [data["verdict"] for data in judged[-2:]] == ["dissimilar", "dissimilar"]


def test_what_a_run_noticed_is_recorded_and_looked_at(tmp_path):
    path = new_run(tmp_path, pair="model2model/timestep")
    state = drive(path, FakePool(needs("wall", "beam"), 1))
    assert dict(state.tests[0].first_sensed) == {"wall": 0.25, "beam": 0.5}
    assert dict(state.tests[0].first_touched) == {"beam": 1.5}
    # The partition of the wall, which was sensed first, is tried first in each round.
    rounds = told(path, "round_started")
    wall = ELEMENTS.index("wall")
    assert all(wall in data["partitions"][0] for data in rounds)


@pytest.mark.parametrize("number", [1, 3])
def test_a_run_that_would_now_go_another_way_is_not_mixed_up(tmp_path, number):
    """Whichever round it is that differs: nothing is written to the file that would make no sense
    in it.
    """
    path = new_run(tmp_path)
    with pytest.raises(Killed):
        drive(path, FakePool(needs("wall", "beam"), 1), prepare=lambda file: kill_after(file, 50))
    with sqlite3.connect(path) as db:
        rounds = db.execute("SELECT id, data FROM event WHERE kind = 'round_started'").fetchall()
        assert len(rounds) >= 3
        id, text = rounds[number - 1]
        data = json.loads(text)
        (first, *rest), (second, *more), *others = data["partitions"]
        text = json.dumps(data | {"partitions": [[second, *rest], [first, *more], *others]})
        db.execute("UPDATE event SET data = ? WHERE id = ?", (text, id))
    for _ in range(2):
        with pytest.raises(
            UserError, match=f"round {number} would now differ: the run was started with other"
        ):
            drive(path, FakePool(needs("wall", "beam"), 1))


def test_a_veto_of_what_was_known_teaches_a_resumed_run_nothing_else(tmp_path, monkeypatch):
    """A set was without f in an earlier round, and is vetoed when it comes again: what it taught
    stays learnt.
    """
    learnt = []
    learn = Driver._learn

    def noted(self, *what):
        learn(self, *what)
        learnt.append(len(self._trials))

    monkeypatch.setattr(Driver, "_learn", noted)
    oracle, method = needs("deck", "wall"), {"pair": "timeseg/sequential", "iterations": 0}
    drive(path := new_run(tmp_path, **method), FakePool(oracle, 1))
    tests = state_of(path).tests
    earlier = [
        data
        for data in told(path, "candidate_judged")
        if any(tests[test - 1].round != data["round"] for test in data["tests"])
    ]
    # Behind one that has to be tested: there is time for a veto.
    again = next(data for data in earlier if data["candidate"] > 1)
    path = new_run(tmp_path, **method)
    learnt.clear()
    with pytest.raises(Killed):
        drive(
            path,
            FakePool(oracle, 1),
            prepare=lambda file: _veto_in(file, again["round"], again["candidate"]),
        )
    first = list(learnt)
    assert state_of(path).refused
    learnt.clear()
    drive(path, FakePool(oracle, 1))
    assert learnt[: len(first)] == first


def _veto_in(file, round, candidate):
    """The user vetoes a candidate as soon as its round begins; the engine is killed when the next
    one begins.
    """
    append = file.append

    def watched(event, *rest):
        if isinstance(event, RoundStarted) and event.round == round + 1:
            raise Killed
        recorded = append(event, *rest)
        if isinstance(event, RoundStarted) and event.round == round:
            file.send("veto", round=round, candidate=candidate)
        return recorded

    file.append = watched


def test_a_schema_that_is_not_installed_is_told(tmp_path):
    path = new_run(tmp_path, pair="model2model/by-colour")
    with pytest.raises(UserError, match="no prioritization 'by-colour'"):
        drive(path, FakePool(needs("wall"), 1))


def test_one_worker_makes_no_test_for_nothing(tmp_path):
    """On one worker, each test made is part of a verdict."""
    state = drive(path := new_run(tmp_path), pool := FakePool(flaky(1, "wall"), 1))
    assert len(pool.made) == len(set(pool.made)) == len(state.tests)
    judged = {test for data in told(path, "candidate_judged") for test in data["tests"]}
    assert judged == {test.id for test in state.tests if test.phase == "round"}


@every_method
@given(
    salt=st.integers(0, 5),
    moments=st.lists(st.integers(1, 60), min_size=1, max_size=4),
    jobs=st.integers(1, 3),
)
@examples(0.1)
def test_killed_at_any_moment_it_resumes_to_the_same_end(method, salt, moments, jobs):
    with tempfile.TemporaryDirectory() as folder:
        oracle = flaky(salt, "wall", "beam")
        undisturbed = drive(new_run(Path(folder), **method), FakePool(oracle, jobs))
        path, pool = new_run(Path(folder), **method), FakePool(oracle, jobs, salt)
        killed(path, pool, moments)
        state = resumed(path, pool)
        assert story(state) == story(undisturbed)
        finished = finished_tests(path)
        assert len(finished) == len(set(finished))
        assert not any(test.outcome == "running" for test in state.tests)


def test_a_robot_that_does_not_fail_ends_the_run(tmp_path):
    state = drive(new_run(tmp_path), FakePool(lambda *_: "pass", 2))
    assert state.status == "finished"
    assert not state.minimal
    assert "reached its goal in all 3 baseline runs" in state.reason
    assert state.rounds_done == 0


def test_the_failure_that_the_user_chose_is_reduced(tmp_path):
    def oracle(keep, seed):
        """The wall stops the robot, but in every third run the ball does so elsewhere, if it is
        there.
        """
        return (
            "other" if seed % 3 == 0 and "ball" in keep else "similar" if "wall" in keep else "pass"
        )

    usual = drive(new_run(tmp_path, baseline_runs=5, iterations=2), FakePool(oracle, 2))
    rarer = drive(new_run(tmp_path, baseline_runs=5, iterations=2, failure=2), FakePool(oracle, 2))
    assert [(one.name, one.runs) for one in usual.baseline.seen] == [
        ("stuck at (2.00, 0.00)", 3),
        ("stuck at (9.00, 0.00)", 2),
    ]
    assert rarer.baseline.seen == usual.baseline.seen
    assert (usual.environment, usual.baseline.failures) == (("wall",), 3)
    assert (rarer.environment, rarer.baseline.failures) == (("ball",), 2)


def test_ask_mode_waits_and_a_rejected_candidate_is_left_alone(tmp_path):
    asked = []

    def guide():
        """Rejects the first reduction, accepts the others."""
        while True:
            state = yield from until(lambda state: state.waiting_candidate is not None)
            asked.append((state.round.number, state.waiting_candidate))
            yield (
                "accept" if asked[1:] else "reject",
                {"round": asked[-1][0], "candidate": asked[-1][1]},
            )

    path = new_run(tmp_path)
    state = drive(path, Guided(path, needs("wall"), guide()), accept_mode="ask")
    assert len(asked) >= 2
    assert state.environment == ("wall",)
    assert told(path, "decided")[0]["decision"] == "reject"
    assert [(data["round"], data["candidate"]) for data in told(path, "reduced")] == asked[1:]


def test_a_vetoed_candidate_is_not_run_and_the_end_is_not_called_minimal(tmp_path):
    def without_ball(state):
        candidates = () if state.round is None else state.round.candidates
        return next(
            (one for one in candidates if "ball" not in one.models and not one.verdict), None
        )

    def guide():
        while True:
            state = yield from until(without_ball)
            yield "veto", {"round": state.round.number, "candidate": without_ball(state).index}

    state = guided(new_run(tmp_path), needs("wall"), guide())
    assert set(state.environment) == {"wall", "ball"}
    assert not state.minimal
    assert "vetoed or rejected" in state.reason


def test_steps_make_one_test_or_one_round_and_then_pause(tmp_path):
    pauses = []

    def guide():
        yield from until(lambda state: state.tests)
        yield "pause", {}
        for unit in ("test", "test", "test", "round", ""):
            state = yield from until(lambda state: state.paused and not state.running_tests)
            pauses.append((len(state.finished_tests), state.rounds_done))
            yield ("step", {"unit": unit}) if unit else ("stop", {})

    with pytest.raises(Stopped):
        guided(new_run(tmp_path), needs("wall", "far_box"), guide(), 2)
    tests = [count for count, _ in pauses]
    assert [after - before for before, after in pairwise(tests[:4])] == [1, 1, 1]
    assert pauses[4][1] == pauses[3][1] + 1


def test_each_round_has_a_forecast_when_it_begins(tmp_path):
    path = new_run(tmp_path)
    assert drive(path, FakePool(needs("wall", "beam"), 2)).minimal
    forecasts = told(path, "forecast")
    assert [each["round"] for each in forecasts] == [
        each["round"] for each in told(path, "round_started")
    ]
    assert all(low <= likely <= high for low, likely, high in (each["tests"] for each in forecasts))


def test_a_model_that_is_left_and_cannot_be_seen_is_named_beside_the_result(tmp_path):
    state = drive(new_run(tmp_path), FakePool(needs("post"), 1))
    words = "what is left has models without a visual, which can be hit but not seen: post"
    assert dict(state.notes)["unseen"] == words
