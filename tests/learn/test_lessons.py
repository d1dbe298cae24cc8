"""The lessons that come with ddenv: whole, true, small, and free of everything that only some
systems have.
"""

import os
import subprocess
import sys
from dataclasses import asdict

import pytest
from docs.lessons import delivery, quay, toys

from ddenv.evidence.rates import wilson_interval
from ddenv.learn.attempt import read_oracle
from ddenv.learn.catalog import LESSONS
from ddenv.learn.handout import handout
from ddenv.learn.lesson import Answer
from ddenv.learn.score import Score, score_of, summary
from ddenv.page.html import html
from ddenv.runfile.position import position_in
from ddenv.runfile.store import RunFile
from tests.learn.lessons import FILES, RUNS, course, opened, through

NUMBERS = range(len(FILES))
by_stem = lambda number: FILES[number].stem  # noqa: E731


@pytest.mark.parametrize("number", NUMBERS, ids=by_stem)
def test_right_answers_lead_to_the_end_with_all_points(number):
    end = through(course(number), lambda question: question.right)
    assert end.score.done
    assert end.score.right == len(end.score.answered) == opened(number).asked == end.score.best
    assert summary(opened(number).asked, end.score)[-1] == "No typical misconception was seen."


@pytest.mark.parametrize("number", NUMBERS, ids=by_stem)
def test_wrong_answers_lead_there_too_and_name_what_was_mixed_up(number):
    def wrong(question):
        return next(place for place in range(len(question.answers)) if place != question.right)

    end = through(course(number), wrong)
    assert end.score.done and end.score.right == 0 and end.score.best == 0
    assert len(end.score.misconceptions) >= 3
    assert (
        len(
            [line for line in summary(opened(number).asked, end.score) if "of your answers" in line]
        )
        >= 3
    )


@pytest.mark.parametrize("number", NUMBERS, ids=by_stem)
def test_everything_can_be_skipped(number):
    end = through(course(number), lambda question: None)
    assert end.score.done and not end.score.answered


def test_a_search_without_success_is_no_question_that_was_skipped():
    walk = course(0)
    while walk.activity != "try":
        walk.answer(walk.page.question.right) if walk.is_open else None
        walk.go_on()
    attempt = walk.attempt
    attempt.end()
    walk.keep(attempt)
    end = through(walk, lambda question: question.right)
    assert not attempt.found and end.score.right == len(end.score.answered) == opened(0).asked - 1
    assert (
        summary(opened(0).asked - 1, end.score)[0]
        == f"You answered {end.score.right} of {end.score.right} questions right."
    )
    assert end.page.text[0].spans[0][0].endswith("questions right.")


def test_a_prediction_leaves_the_question_of_its_step_and_its_score_alone():
    walk = course(0)
    while walk.page.question is None:
        assert walk.go_on()
    assert walk.must_answer
    walk.answer(walk.page.question.right)
    score, page, at = walk.score, walk.page, walk.at
    assert not walk.must_answer and walk.foretell()
    assert walk.page.question != page.question and not walk.go_on()
    walk.answer(0)
    while walk.page != page:
        assert walk.go_on() or walk.answer(0)
    assert (walk.score, walk.at, walk.step) == (score, at, score.step)
    assert walk.foretell() and walk.back() and walk.page == page
    assert walk.go_on() and walk.step == score.step + 1


def test_a_search_tells_nothing_of_a_race_before_the_bet_on_it():
    lesson = opened(0).lesson
    race = next(step for step in lesson.steps if step.race)
    walk = course(0)
    while walk.activity != "try":
        walk.skip()
        walk.go_on()
    assert not {play.name for play in walk.plays} & set(race.race)
    number = lesson.steps.index(race)
    walk.score = walk.score.with_answer(str(number), Answer("", True, ""))
    assert {play.name for play in walk.plays} >= set(race.race)


def test_the_place_of_an_answer_does_not_give_it_away():
    places = [
        [step.question.right for step in opened(number).lesson.steps if step.question is not None]
        for number in NUMBERS
    ]
    for each in (*places, [place for lesson in places for place in lesson]):
        assert max(map(each.count, each)) <= len(each) / 2 + 1, places
        assert len(set(each)) >= 3, places


def test_answers_are_kept_and_count_once():
    walk = course(0)
    walk.score = Score()
    while walk.page.question is None:
        walk.go_on()
    question = walk.page.question
    walk.answer((question.right + 1) % len(question.answers))
    again = course(0, score_of(asdict(walk.score)))
    assert again.step == walk.step
    again.answer(question.right)
    assert again.score.right == 0 and len(again.score.answered) == 1
    assert score_of({"step": "x"}) == score_of(None) == Score()


def test_the_oracle_of_the_toy_world_knows_every_part_and_agrees_with_the_run():
    oracle = read_oracle(LESSONS / "delivery.oracle.json")
    with RunFile(LESSONS / "delivery.ddenv") as file:
        position = position_in(file.events())
    tests = [test for test in position.end.tests if test.outcome in ("similar", "other", "pass")]
    assert len(tests) > 100
    for test in tests:
        models = position.end.models_of(test)
        assert oracle.outcome(models) == delivery.outcome(models) == test.outcome
    assert {frozenset(kept) for kept in oracle.minimal} == {
        frozenset({"sign", "crate"}),
        frozenset({"sign", "barrel", "cone"}),
    }
    assert len(oracle.showing) == sum(
        delivery.outcome([name for bit, name in enumerate(oracle.models) if number >> bit & 1])
        == "similar"
        for number in range(2 ** len(oracle.models))
    )


def test_the_oracle_of_the_quay_has_the_rates_by_which_its_robot_drives():
    oracle = read_oracle(LESSONS / "quay.oracle.json")
    there = (*toys.QUAY.names, *(name for name, *_ in toys.QUAY.walls), "ground_plane")
    for gone in ((), ("ramp",), ("oil", "ramp"), ("gate",)):
        models = [name for name in there if name not in gone]
        stuck = sum(
            quay.way(models, seed)[0][-1] == (quay.GATE_STOP, quay.OFF) for seed in range(400)
        )
        low, high = wilson_interval(stuck, 400)
        assert low <= oracle.rate(name for name in models if name in toys.QUAY.names) <= high


@pytest.mark.parametrize("run", ["quay-first", "quay-kept"])
def test_the_runs_on_the_quay_follow_the_rule_of_its_robot(run):
    walls = {name for name, *_ in toys.QUAY.walls} | {"ground_plane"}
    with RunFile(LESSONS / f"{run}.ddenv") as file:
        position = position_in(file.events())
    for test in position.end.tests:
        models = {*position.end.models_of(test), *walls}
        corners, reached = quay.way(models, test.seed)
        stuck = "similar" if corners[-1] == (quay.GATE_STOP, quay.OFF) else "other"
        assert test.outcome == ("pass" if reached else stuck)


@pytest.mark.parametrize("number", NUMBERS, ids=by_stem)
def test_a_lesson_has_a_page_to_hand_out(number):
    page = html(handout(opened(number)))
    assert opened(number).lesson.title in page
    assert "<svg" in page and "{" not in page.partition("</style>")[2]


@pytest.mark.parametrize("run", RUNS, ids=lambda run: run.stem)
def test_a_recorded_run_came_to_its_end_and_a_reader_writes_nothing_beside_it(run):
    with RunFile(run) as file:
        end = position_in(file.events()).end
    assert end.status == "finished" and end.certificate.claims
    # The two bytes of SQLite's header that say that a reader makes no log of its own.
    assert run.read_bytes()[18:20] == b"\x01\x01"


@pytest.mark.programs
def test_lessons_and_runs_need_neither_drake_nor_what_windows_lacks(tmp_path):
    code = """
import sys, asyncio
for name in ("pydrake", "fcntl", "termios", "sklearn"):
    sys.modules[name] = None
import tests.learn.without_drake as tried
asyncio.run(tried.main())
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={
            **os.environ,
            "DDENV_HOME": str(tmp_path),
            "TEXTUAL_DRIVER": "textual.drivers.headless_driver:HeadlessDriver",
        },
    )
    assert done.stdout.strip().endswith("all shown"), done.stdout + done.stderr
