"""A position shows at each event what was known then, however it came there, and steps from one
thing to the next.
"""

from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.runfile.fold import fold
from ddenv.runfile.position import position_in
from ddenv.runfile.store import Recorded
from ddenv.runfile.tested import purpose
from tests.shorthand import story

ELEMENTS = [f"box {number}" for number in range(8)]


def happened(rounds: list[list[int]]) -> list[Recorded]:
    """A run whose rounds halve the environment: for each round the numbers of tests of its
    candidates; the last one wins.
    """
    found = [("created", {"scenario": {}, "elements": ELEMENTS})]
    found.append(("engine_started", {"pid": 1, "jobs": 1, "version": "0", "simulator": "none"}))
    test, kept = 0, list(range(len(ELEMENTS)))
    for number, tries in enumerate(rounds, start=1):
        half = (len(kept) + 1) // 2
        parts = [part for part in (kept[:half], kept[half:]) if part]
        candidates = [["partition", index, None] for index in range(len(parts))]
        split = {"environment": kept, "partitions": parts, "candidates": candidates}
        found.append(("round_started", {"round": number, "n_partitions": 2, **split}))
        for candidate, runs in zip(range(len(parts)), tries, strict=False):
            ids = []
            for run in range(runs):
                test += 1
                place = {
                    "phase": "round",
                    "round": number,
                    "candidate": candidate,
                    "run": run,
                    "seed": run,
                }
                found.append(("test_started", {"test": test, **place}))
                found.append(("test_finished", {"test": test, **ENDED}))
                ids.append(test)
            found.append(("forecast", {"round": number, "tests": [1, 2, 3], "tests_done": test}))
            verdict = {"candidate": candidate, "verdict": "dissimilar", "tests": ids, "known": 0}
            found.append(("candidate_judged", verdict))
        if test and len(parts) > 1:
            kept = parts[0]
            found.append(("reduced", {"candidate": 0, "environment": kept, "evidence_test": test}))
        found.append(("round_finished", {}))
    # Ids of events need not follow each other.
    return [
        Recorded(3 * place + 1, float(place), one.event) for place, one in enumerate(story(found))
    ]


ENDED = {
    "outcome": "pass",
    "failure": "",
    "distance": None,
    "end_pose": None,
    "simulated_seconds": 1.0,
}
ENDED |= {"wall_seconds": 1.0, "first_sensed": [], "first_touched": [], "cut": False}
runs = st.lists(st.lists(st.integers(0, 4), min_size=2, max_size=2), max_size=4).map(happened)


@pytest.fixture(autouse=True)
def few_states_are_kept():
    with patch("ddenv.runfile.position.GAP", 3):
        yield


@pytest.mark.hypothesis
@given(events=runs, ids=st.lists(st.integers(0, 200), max_size=8))
def test_the_state_at_any_event_is_that_of_all_events_before_it(events, ids):
    position = position_in(events)
    for id in ids:
        assert position.state(id) == fold(event for event in events if event.id <= id)


@pytest.mark.hypothesis
@given(events=runs, what=st.sampled_from(["moment", "round", "reduction", "decision"]))
def test_steps_back_and_on_pass_the_same_places(events, what):
    position = position_in(events)
    back = []
    while position.step(what, -1):
        back.append(position.at)
    assert back == sorted(set(back), reverse=True)
    on = [position.at] if back else []
    while position.at is not None and position.step(what, 1) and position.at is not None:
        on.append(position.at)
    assert on[: len(back)] == back[::-1]
    assert position.now == fold(events)


def test_a_round_ends_with_what_it_showed():
    position = position_in(happened([[1, 2], [2, 0]]))
    assert [(each.kind, each.number) for each in position.chapters] == [
        ("baseline", 0),
        ("round", 1),
        ("round", 2),
    ]
    assert position.step("round", -1)
    assert position.now.round.number == 1
    assert [candidate.verdict for candidate in position.now.round.candidates] == [
        "dissimilar",
        "dissimilar",
    ]
    assert [(each.models, each.left) for each in position.chapters[1:]] == [(8, 4), (4, 2)]
    assert position.step("round", -1)
    assert position.now.round is None
    assert not position.step("round", -1)


def test_a_test_is_found_with_its_models_after_its_round_is_over():
    position = position_in(happened([[1, 1], [1, 1]]))
    start = position.start_of(2)
    test = position.end.tests[1]
    assert purpose(start.after, start.after.tests[1]) == "round 1 · part B"
    assert purpose(position.end, test) == "round 1"
    assert position.end.models_of(test) == tuple(ELEMENTS[4:])
    assert position.start_of(0) is position.start_of(5) is None


def test_the_place_stays_while_the_run_goes_on():
    events = happened([[1, 1], [1, 1]])
    growing = events[:10]
    position = position_in(growing)
    assert position.step("moment", -1)
    there, number = position.now, position.place[0]
    growing += events[10:]
    position.catch_up()
    assert (position.now, position.place[0]) == (there, number)
    assert position.end == fold(events)
    position.go(None)
    assert position.now == position.end
