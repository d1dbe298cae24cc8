"""The lessons that come with ddenv, for tests of all of them."""

from __future__ import annotations

from functools import cache

from ddenv.learn.catalog import LESSONS, Opened, bundled, open_lesson
from ddenv.learn.lesson import Answer, Question
from ddenv.learn.lesson_course import Course
from ddenv.learn.score import Score

FILES = bundled()
# Stands for a search of one's own.
ALONE = Question("", (Answer("found", True, ""), Answer("not found", False, "")))
RUNS = sorted(LESSONS.glob("*.ddenv"))


@cache
def opened(number: int) -> Opened:
    return open_lesson(FILES[number])


def course(number: int, score: Score | None = None) -> Course:
    lesson = opened(number)
    return Course(lesson.position, lesson, score)


def through(walk: Course, answer) -> Course:
    """Goes to the end; `answer(question)` returns the place of an answer, or None to skip. Who
    answers right searches well.
    """
    for _ in range(500):
        if walk.step == walk.last:
            return walk
        question = walk.page.question
        if question is not None and walk.page.chosen is None:
            place = answer(question)
            assert walk.skip() if place is None else walk.answer(place)
        if walk.due and walk.activity == "try" and question is None and answer(ALONE) is not None:
            attempt = walk.attempt
            if answer(ALONE) == ALONE.right:
                attempt.test(attempt.oracle.minimal[0])
            attempt.end()
            walk.keep(attempt)
        if walk.due:
            assert not walk.go_on() and walk.skip()
        assert walk.go_on()
    raise AssertionError("the lesson has no end")
