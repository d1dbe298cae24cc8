"""Searches side by side: recorded ones repeat, those of run files are as recorded, and the reason
for a win adds up.
"""

import json
import shutil
import sqlite3

import pytest
from docs.lessons import delivery
from docs.lessons.record_plays import record_plays

from ddenv.errors import UserError
from ddenv.learn.attempt import RecordedRound, read_oracle
from ddenv.learn.catalog import LESSONS
from ddenv.learn.race import (
    KINDS,
    Play,
    Race,
    bet,
    plays_of_runs,
    recorded_play,
    reductions,
    result,
    spent,
    why,
)
from ddenv.runfile.store import RunFile
from tests.learn.lessons import RUNS, opened

DELIVERY, DITCH = LESSONS / "delivery.ddenv", LESSONS / "ditch.ddenv"
PLAYS = [*opened(0).plays.values(), *(plays_of_runs([run])[0] for run in RUNS)]
by_name = lambda play: play.name  # noqa: E731


@pytest.mark.parametrize("play", PLAYS, ids=by_name)
def test_every_test_of_a_search_is_of_one_kind(play):
    for tests in range(play.tests + 1):
        numbers = spent(play, tests)
        assert sum(numbers.values()) == tests
        assert numbers.keys() == KINDS.keys()
    # These do not only shrink by tests: one goes back, the other goes on with a slice.
    if play.name not in ("quay-kept", "ditch-sliced"):
        assert len(play.begins) - len(play.left) == sum(reductions(play))


@pytest.mark.parametrize("play", opened(0).plays.values(), ids=by_name)
def test_a_recorded_search_is_what_the_robot_does(play):
    left = play.begins
    for turn in play.turns:
        assert turn.outcome == delivery.outcome(turn.candidate.models)
        assert set(turn.candidate.split.environment) == set(left)
        left = turn.candidate.models if turn.outcome == "similar" else left
        assert set(turn.left) == set(left)


def test_what_algorithms_do_is_recorded_again_to_the_letter(tmp_path):
    for name in ("delivery.ddenv", "delivery.oracle.json", "1-what-delta-debugging-is.yaml"):
        shutil.copy(LESSONS / name, tmp_path)
    file = tmp_path / "delivery.oracle.json"
    before = json.loads(file.read_text())
    file.write_text(json.dumps(before | {"plays": {}}))
    lesson = tmp_path / "1-what-delta-debugging-is.yaml"
    lesson.write_text(
        lesson.read_text().replace(
            "[ddmin, ddenv, probdd, splitting]", "[ddmin, timeseg/sequential]"
        )
    )
    _, names = record_plays(lesson)
    after = json.loads(file.read_text())
    assert set(names) == {*before["plays"], "timeseg/sequential"} == set(after["plays"])
    assert {name: after["plays"][name] for name in before["plays"]} == before["plays"]
    assert after["outcomes"] == before["outcomes"]


def test_a_recorded_search_that_does_not_fit_is_refused():
    oracle = read_oracle(LESSONS / "delivery.oracle.json")
    halves = (oracle.models[:4], oracle.models[4:])
    for rounds in (
        [RecordedRound(((*oracle.models[:4],),), ("part A",))],
        [RecordedRound(halves, ("part C",))],
        [RecordedRound(halves, ())],
        # Nothing is tested after f has shown.
        [RecordedRound(halves, ("part A", "part B"))],
    ):
        oracle.rounds["mine"] = tuple(rounds)
        with pytest.raises(UserError, match="plays: mine: round 1"):
            recorded_play("mine", oracle)


def test_a_run_file_has_the_search_that_was_recorded():
    play = plays_of_runs([DELIVERY])[0]
    with RunFile(DELIVERY) as file:
        tests = [
            one.event
            for one in file.events()
            if one.kind == "test_started" and one.event.phase == "round"
        ]
    assert play.tests == len(tests) == 38
    assert play.left == ("sign", "barrel", "cone") and play.ended
    assert sum(turn.again for turn in play.turns) == sum(each.run > 0 for each in tests)


def test_only_runs_of_one_world_race(tmp_path):
    with pytest.raises(UserError, match=f"{DITCH}: its world is not that of {DELIVERY}"):
        plays_of_runs([DELIVERY, DITCH])
    with pytest.raises(UserError, match="needs different runs"):
        plays_of_runs([DELIVERY, DELIVERY])
    shutil.copy(DELIVERY, new := tmp_path / "new.ddenv")
    with sqlite3.connect(new) as database:
        database.execute("DELETE FROM event WHERE id > 9")
    with pytest.raises(UserError, match="has no search tests yet"):
        plays_of_runs([DELIVERY, new])


def test_the_winner_and_the_reason_come_from_the_tests():
    plays = opened(0).plays
    said = result([plays["ddmin"], plays["ddenv"], plays["splitting"]])
    assert said == (
        "splitting needed the fewest tests: 7. ddenv needed the most: 14.",
        "ddenv left out a part and lost f 7 times, splitting only 4 times.",
    )
    assert (
        why(plays["splitting"], plays["ddmin"])
        == "ddmin tested a part alone and did not see f 6 times, splitting never."
    )
    recorded = plays_of_runs([DELIVERY])[0]
    assert "delivery repeated a test and did not see f 17 times, ddmin never." in (
        said := result([plays["ddmin"], recorded])
    )
    assert result([plays["ddmin"], plays["ddmin"]]) == ("All needed 9 tests.",)
    half = Play(name="half", begins=recorded.begins, turns=recorded.turns[:3], ended=False)
    assert result([half, recorded])[0].startswith("half did not finish")
    assert result([half, recorded])[-1] == "So there is no winner."


def test_a_race_goes_test_by_test_and_a_bet_has_one_right_answer():
    plays = tuple(opened(0).plays.values())
    race = Race(plays)
    assert race.longest == 14 and not race.go(-1) and race.now(plays[0]) is None
    assert race.go(100) and race.over and race.now(plays[0]) == plays[0].turns[-1]
    assert not race.go(14) and race.go(8) and not race.over
    assert [race.is_done(play) for play in plays] == [play.tests <= 8 for play in plays]
    question = bet(plays)
    assert question.answers[question.right].text == "splitting"
    assert [answer.right for answer in bet([plays[0], plays[0]]).answers] == [False, False, True]
