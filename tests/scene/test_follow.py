"""What is shown: pure functions of the run's state, the running tests and the time."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ddenv.runfile.fold import fold
from ddenv.runfile.store import Live
from ddenv.scene.shot import HOLD, shot, shot_of


def live(test: int, slot: int = 0) -> Live:
    return Live(slot=slot, test=test, time=1.0, pose=(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))


def state_of(writer):
    return fold(writer.run.events())


def test_before_the_first_round_the_whole_world_is_shown(writer):
    def shown(*rows):
        found = shot(state_of(writer), rows)
        assert len(found.models) == 4 and not found.left_out | found.removed
        return found.kind, found.test, found.title

    assert shown() == ("start", None, "the robot at its start")
    writer.start_engine()
    writer.start_test(1)
    assert shown(live(1)) == ("live", 1, "baseline · test 1 · runs now")


def test_rows_of_unknown_and_finished_tests_are_ignored_and_the_failure_is_shown_again(writer):
    writer.baseline()
    for rows in ([], [live(1), live(7), live(0), live(-1)]):
        found = shot(state_of(writer), rows)
        assert (found.kind, found.test, len(found.models)) == ("replay", 1, 4)


def test_a_running_candidate_shows_its_own_environment(in_round):
    in_round.start_test(2, candidate=1, run=1)
    found = shot(state_of(in_round), [live(2)])
    assert found.models == {"board", "asphalt"}
    assert found.left_out == {"left wall", "tile/é <b>1</b>"}
    assert not found.removed
    assert found.title == "round 1 · part B · test 2 · re-run 1 · runs now"


def test_a_chosen_row_is_shown_by_its_test_or_else_by_its_models(in_round):
    chosen = lambda *rows: shot_of(state_of(in_round), state_of(in_round).round.candidates[1], rows)  # noqa: E731
    assert (chosen().kind, chosen().models, chosen().title) == (
        "start",
        {"board", "asphalt"},
        "part B · not tested yet",
    )
    in_round.start_test(2, candidate=1)
    assert (chosen(live(2)).kind, chosen(live(2)).test) == ("live", 2)
    in_round.finish_test(2, "similar")
    in_round.start_test(3, candidate=1, run=1)
    in_round.finish_test(3, "pass")
    assert (chosen().kind, chosen().test) == ("replay", 2)
    assert chosen().title == "part B · test 2 · similar"


def test_a_try_has_its_own_models(writer):
    writer.baseline()
    writer.append("trial_started", {"trial": 1, "models": [0, 2]})
    writer.append(
        "test_started",
        {
            "test": 2,
            "phase": "hand",
            "round": None,
            "candidate": None,
            "trial": 1,
            "run": 0,
            "seed": 0,
        },
    )
    found = shot(state_of(writer), [live(2)])
    assert (found.models, found.title) == ({"left wall", "board"}, "try 1 · test 2 · runs now")


@pytest.mark.parametrize("together", [False, True])
def test_a_fresh_run_shows_its_own_environment(writer, together):
    writer.baseline()
    writer.append("supports", {"pairs": [[1, 0]]})
    number = [0]

    def shown(**place):
        number[0] += 1
        test = {"test": 1 + number[0], "round": None, "candidate": None, "run": 10_000, "seed": 0}
        writer.append("test_started", test | {"phase": "certify"} | place)
        state = state_of(writer)
        reduction = state.scenario["reduction"] | {"keep_supports": together}
        state = state.changed(scenario=state.scenario | {"reduction": reduction})
        found = shot(state, [live(1 + number[0])])
        return found.models, found.title.split(" · ")[0]

    elements = state_of(writer).elements
    everything = frozenset(elements)
    assert shown(node=0) == (everything, "the whole world, in full")
    gone = frozenset(elements[: 1 + together])
    more = " and 1 more" if together else ""
    left = list(range(1 + together, len(elements)))
    assert shown(environment=left, without=0) == (
        everything - gone,
        f"the whole world without {elements[0]}{more}",
    )


def test_a_reduction_is_shown_while_it_waits_and_in_what_is_left(in_round):
    in_round.start_test(2, candidate=0)
    in_round.finish_test(2, "similar")
    in_round.append(
        "candidate_judged", {"candidate": 0, "verdict": "similar", "tests": [2], "known": 0}
    )
    in_round.append("waiting", {"candidate": 0})
    found = shot(state_of(in_round), [])
    assert (found.kind, found.test, found.left_out) == ("replay", 2, {"board", "asphalt"})
    in_round.append("reduced", {"candidate": 0, "environment": [0, 1], "evidence_test": 2})
    found = shot(state_of(in_round), [])
    assert (found.kind, found.test, found.models) == ("replay", 2, {"left wall", "tile/é <b>1</b>"})
    assert found.removed == {"board", "asphalt"} and not found.left_out


def test_a_test_is_shown_to_its_end(in_round):
    in_round.start_test(2, candidate=0)
    in_round.start_test(3, candidate=1)
    state = state_of(in_round)
    first = shot(state, [live(3)])
    assert shot(state, [live(2, 0), live(3, 1)], first).test == 3
    assert shot(state, [live(2, 0)], first).test == 2


def test_between_two_tests_the_last_one_stays_for_a_while(in_round):
    in_round.start_test(2, candidate=0)
    running = shot(state_of(in_round), [live(2)])
    in_round.finish_test(2, "pass")
    state = state_of(in_round)
    assert shot(state, [live(2)], running, HOLD / 2) == running
    assert shot(state, [], running, HOLD + 1).kind == "replay"
    assert shot(replace(state, status="paused"), [], running, 0.0).kind == "replay"
