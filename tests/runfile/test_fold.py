"""Events to state: what a state says of tests and candidates is right, and no state is ever changed
by a later event.
"""

import json
import tracemalloc
from collections.abc import Iterator
from dataclasses import fields
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.errors import UserError
from ddenv.runfile.fold import apply, fold
from ddenv.runfile.state import OUTCOMES, RunState
from ddenv.runfile.store import Recorded, recorded
from tests.shorthand import story, typed

NAMES = [f"box {number}" for number in range(6)]


def state_after(*happened: tuple[str, dict], names=NAMES) -> RunState:
    """The state after these events of a run of six boxes."""
    return fold(story((("created", {"scenario": {}, "elements": list(names)}), *happened)))


def with_event(state: RunState, kind: str, **data) -> RunState:
    for event in typed(state, kind, data):
        state = apply(state, Recorded(state.revision + 1, float(state.revision), event))
    return state


def read_back(*happened: tuple[str, dict]) -> RunState:
    """The same of events as they stand in a file, whether they make sense or not."""
    first = ("created", {"scenario": {}, "elements": NAMES})
    rows = enumerate((first, *happened), 1)
    return fold([recorded(number, 0.0, kind, json.dumps(data)) for number, (kind, data) in rows])


def round_event(
    partitions: list[list[int]], environment=range(6), number: int = 1
) -> tuple[str, dict]:
    """A round whose candidates are each partition and its complement."""
    candidates = [
        [kind, part, 1.0] for part in range(len(partitions)) for kind in ("partition", "complement")
    ]
    split = {"environment": list(environment), "partitions": partitions, "candidates": candidates}
    return "round_started", {"round": number, "n_partitions": len(partitions), **split}


def started(test: int = 1, candidate: int | None = None, run: int = 0) -> tuple[str, dict]:
    phase, round = ("baseline", None) if candidate is None else ("round", 1)
    place = {"test": test, "phase": phase, "round": round, "candidate": candidate}
    return "test_started", {**place, "run": run, "seed": run}


def finished(test: int = 1, outcome: str = "pass", **more) -> tuple[str, dict]:
    end = {
        "failure": "",
        "distance": 0.5,
        "end_pose": None,
        "simulated_seconds": 2.0,
        "wall_seconds": 1.0,
    }
    end |= {"first_sensed": [], "first_touched": [], "cut": False}
    return "test_finished", {"test": test, "outcome": outcome, **end, **more}


# Candidates.


def test_a_candidate_has_the_models_of_its_partition_or_all_others_in_their_order():
    state = state_after(round_event([[4, 1], [0], [5, 3]], environment=[0, 1, 3, 4, 5]))
    models = [candidate.models for candidate in state.round.candidates]
    assert models == [
        ("box 4", "box 1"),
        ("box 0", "box 3", "box 5"),
        ("box 0",),
        ("box 1", "box 3", "box 4", "box 5"),
        ("box 5", "box 3"),
        ("box 0", "box 1", "box 4"),
    ]
    assert [candidate.size for candidate in state.round.candidates] == [
        len(each) for each in models
    ]


def test_a_part_keeps_its_letter_from_round_to_round():
    rounds = [
        [[0, 1, 2], [3], [4, 5]],
        # Half of A is new, in the first place; the others come in another order.
        [[1, 2], [4, 5], [0], [3]],
        [[3], [1], [2]],
    ]
    labels = []
    for number, parts in enumerate(rounds, 1):
        everything = sorted(model for part in parts for model in part)
        events = [
            round_event(earlier, number=place)
            for place, earlier in enumerate(rounds[: number - 1], 1)
        ]
        state = state_after(*events, round_event(parts, environment=everything, number=number))
        labels.append([one.label for one in state.round.candidates if one.kind == "partition"])
        assert [state.round.split.letter_of[f"box {part[0]}"] for part in parts] == [
            "ABCDE".index(label[-1]) for label in labels[-1]
        ]
    assert labels == [
        ["part A", "part B", "part C"],
        ["part A", "part C", "part D", "part B"],
        ["part B", "part A", "part C"],
    ]


def test_a_round_of_many_one_model_partitions_is_small():
    """The names of all 4,000 candidates, half of them of 1,999 models, would take 32 MB."""
    before = state_after(names=[str(number) for number in range(2000)])
    [event] = typed(before, *round_event([[number] for number in range(2000)], range(2000)))
    tracemalloc.start()
    try:
        state = apply(before, Recorded(2, 0.0, event))
        assert len(state.round.candidates) == 4000
        assert tracemalloc.get_traced_memory()[1] < 4e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("test", [0, 1, 10**14])
def test_a_verdict_by_a_test_that_cannot_be_is_told(test):
    before = state_after(round_event([[0], [1]]))
    with pytest.raises(UserError, match="candidate_judged"):
        judged = {"round": 1, "candidate": 0, "verdict": "dissimilar", "tests": [test]}
        apply(before, recorded(3, 0.0, "candidate_judged", json.dumps(judged)))


@pytest.mark.parametrize(
    "changed",
    [
        {"environment": 1},
        {"environment": -1},
        {"environment": [0, 1]},
        {"partitions": [[0], [0]]},
        {"partitions": [[0], [6]]},
        {"partitions": [[0], [10**12]]},
        {"partitions": [[0], [-1]]},
        {"pinned": "3"},
        {"pinned": "40"},
        {"pinned": [2]},
        {"partitions": [[0], []]},
        {"candidates": [["partition", 2, None]]},
        {"candidates": [["partition", 1.0, None]]},
        {"candidates": [["partition", -1, None]]},
        {"candidates": [["part", 0, None]]},
        {"candidates": [["partition", 0, None], ["partition", 0, 1.0]]},
        {"candidates": [["partition", 0, "nan"]]},
    ],
    ids=str,
)
def test_rounds_that_make_no_sense_are_told(changed):
    kind, data = round_event([[0], [1]])
    data["environment"] = 0
    read_back((kind, data))
    with pytest.raises(UserError, match=r"damaged run file: event 2 \(round_started\)"):
        read_back((kind, data | changed))


# Tests.


@pytest.mark.parametrize("key", ["first_sensed", "first_touched"])
@pytest.mark.parametrize(
    "pair",
    [
        [6, 1.0],
        [-1, 1.0],
        [0.0, 1.0],
        ["0", 1.0],
        [0, -0.1],
        [0, "nan"],
        [0, "inf"],
        [0, None],
        [0, 10**400],
        [0],
        0,
    ],
    ids=lambda pair: str(pair)[:12],
)
def test_sensed_models_that_make_no_sense_are_told(key, pair):
    with pytest.raises(UserError, match=r"damaged run file: event 3 \(test_finished\)"):
        read_back(
            (started()[0], started()[1] | {"environment": 0}), finished(**{key: [[1, 1.0], pair]})
        )


def test_full_runs_of_what_is_left_are_told_apart():
    whole, one = (
        {**started(test)[1], "phase": "certify", "without": left}
        for test, left in ((2, None), (3, 4))
    )
    terms = {
        "certificate": 1,
        "run": 0,
        "keep_rate": 0.8,
        "rate": 0.9,
        "error": 0.05,
        "at_least": 10,
    }
    state = state_after(
        started(1), ("certificate_started", terms), ("test_started", whole), ("test_started", one)
    )
    assert state.confirming
    assert [(test.id, test.without) for test in state.confirm_tests] == [(2, None), (3, "box 4")]
    assert [len(state.models_of(test)) for test in state.confirm_tests] == [6, 5]
    assert state.deflake_runs == 0


@given(
    steps=st.lists(st.sampled_from(["round", "certify", "certificate"]), max_size=12),
    early=st.integers(0, 2),
)
def test_the_tests_of_the_last_certificate_are_found_whenever_they_were_made(steps, early):
    """Some are made before it starts."""
    state, first, made = state_after(), 0, 0
    for step in [*steps, "certify"]:
        if step == "certificate":
            made, first = made + 1, 100 * (made + 1)
            terms = {"run": first, "keep_rate": 0.8, "rate": 0.9, "error": 0.05, "at_least": 10}
            state = with_event(state, "certificate_started", certificate=made, **terms)
        else:
            run = first + 50 * early if step == "certify" else 0
            where = {"round": None, "candidate": None, "run": run, "seed": run}
            state = with_event(
                state, "test_started", test=len(state.tests) + 1, phase=step, **where
            )
    assert state.confirm_tests == tuple(
        one for one in state.tests if one.phase == "certify" and one.run >= first
    )


def test_baseline_runs_count_as_what_they_turned_out_to_be():
    told = {
        "runs": 2,
        "failures": 1,
        "rate": 0.5,
        "low": 0.1,
        "high": 0.9,
        "failure_test": 1,
        "iterations_95": 4,
    }
    more = {
        "position": [0, 0, 0],
        "miss_chance": 0.1,
        "outcomes": {"1": "similar"},
        "distances": {"1": 0.0},
    }
    state = state_after(started(1), finished(1, "failed"), started(2), finished(2, "pass"))
    assert state.outcomes() == dict.fromkeys(OUTCOMES, 0) | {"pass": 1, "failed": 1}
    state = with_event(state, "baseline_finished", **told, **more)
    assert state.outcomes() == dict.fromkeys(OUTCOMES, 0) | {"pass": 1, "similar": 1}
    assert state.history[-1].tests == state.tests_done == 2


# Whole runs.

moves = st.tuples(
    st.sampled_from(
        ["start", "start", "finish", "finish", "lose", "judge", "veto", "round", "reduce", "pause"]
    ),
    st.integers(0, 10**6),
)


def next_event(state: RunState, move: str, number: int) -> tuple[str, dict] | None:
    """An event that makes sense in this state, chosen by `number`."""
    running = [test.id for test in state.tests if test.outcome == "running"]
    size, tests = len(state.round.candidates), len(state.tests)
    candidate = number % size
    match move:
        case "start":
            place = started(tests + 1, candidate, number % 4)[1] | {"round": state.round.number}
            return "test_started", place
        case "finish" if running:
            outcome = OUTCOMES[number % len(OUTCOMES)]
            return finished(
                running[number % len(running)], outcome, first_sensed=[[number % 6, 1.0]]
            )
        case "lose" if tests:
            return "test_lost", {"test": 1 + number % tests}
        case "judge":
            return "candidate_judged", {
                "candidate": candidate,
                "verdict": "dissimilar",
                "tests": [],
                "known": 0,
            }
        case "veto":
            return "vetoed", {"candidate": candidate, "verdict": "vetoed"}
        case "round":
            return round_event(
                [[index] for index in range(1 + number % 6)], number=state.round.number + 1
            )
        case "reduce":
            return "reduced", {
                "candidate": candidate,
                "environment": [number % 6],
                "evidence_test": 1,
            }
        case "pause":
            return ("resumed" if state.paused else "paused"), {}
    return None


def grown(steps) -> Iterator[RunState]:
    """The states of a run one after another, each before the next event happens."""
    state = state_after(round_event([[0, 1], [2], [3, 4]]))
    yield state
    for move, number in steps:
        happened = next_event(state, move, number)
        if happened is not None:
            state = with_event(state, happened[0], **happened[1])
            yield state


def seen(state: RunState) -> tuple:
    """All that a viewer can see of a state."""
    models = tuple(candidate.models for candidate in state.round.candidates)
    return repr(state), tuple(state.tests), dict(state.tally), models


@given(st.lists(moves, max_size=40))
def test_a_state_is_never_changed_by_later_events(steps):
    with patch("ddenv.runfile.state.CHUNK", 3):
        kept = [(state, seen(state)) for state in grown(steps)]
        assert all(seen(earlier) == was for earlier, was in kept)


@given(st.lists(moves, max_size=40))
def test_what_is_counted_along_the_way_is_what_the_tests_say(steps):
    with patch("ddenv.runfile.state.CHUNK", 3):
        for state in grown(steps):
            tests = list(state.tests)
            done = [test for test in tests if test.outcome not in ("running", "lost")]
            assert state.finished_tests == tuple(done)
            assert state.tests_done == len(done)
            assert state.running_tests == tuple(test for test in tests if test.outcome == "running")
            assert state.deflake_runs == sum(test.run > 0 for test in done)
            assert state.outcomes() == {
                name: sum(test.outcome == name for test in done) for name in OUTCOMES
            }


@given(st.lists(moves, max_size=20))
def test_events_change_fields_that_a_state_has(steps):
    names = {field.name for field in fields(RunState)}
    assert all(vars(state).keys() == names for state in grown(steps))
