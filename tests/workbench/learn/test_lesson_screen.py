"""Lessons on the screen: the list, a lesson with right, wrong and skipped answers, and any run step by step."""

import pytest
from textual.widgets import OptionList, Static

from ddenv.learn.shelf import LESSONS, bundled
from ddenv.workbench.app import Workbench
from ddenv.workbench.learn.lesson_screen import LessonScreen
from ddenv.workbench.learn.lessons_screen import LessonsScreen
from ddenv.workbench.learn.progress import all_scores
from ddenv.workbench.learn.variables_pane import Variables
from ddenv.workbench.messages import ShowLesson, ShowLessons

SIZES = [(80, 24), (120, 36)]


def text(pilot):
    return str(pilot.app.screen.query_one("#lesson-text", Static).content)


@pytest.mark.parametrize("size", SIZES, ids=str)
async def test_a_lesson_from_start_to_end(size):
    async with Workbench(first=ShowLessons(bundled()[0])).run_test(size=size) as pilot:
        await pilot.pause()
        screen = pilot.app.screen
        assert isinstance(screen, LessonScreen)
        turn = 0
        while screen.course.step < screen.course.last:
            page = screen.course.page
            if page.question is not None and page.chosen is None:
                right = page.question.right
                wrong = (right + 1) % len(page.question.answers)
                key = ("abcdef"[right], "abcdef"[wrong], "s")[turn % 3]
                await pilot.press("enter")
                assert screen.course.page.chosen is None, "an open question is not passed over unseen"
                await pilot.press(key)
                said = text(pilot)
                assert ("✓ Right", "✗ No", "Skipped")[turn % 3] in said
                turn += 1
            await pilot.press("enter")
        assert turn > 10
        assert "questions right" in text(pilot)
        await pilot.press("escape")
        assert isinstance(pilot.app.screen, LessonsScreen)
        row = pilot.app.screen.query_one(OptionList).get_option_at_index(0).prompt
        assert "done" in str(row)
    assert all_scores()["what-delta-debugging-is"].done


async def test_a_lesson_goes_on_where_it_was_left():
    async with Workbench(first=ShowLessons(bundled()[0])).run_test(size=(120, 36)) as pilot:
        await pilot.pause()
        await pilot.press("enter", "escape", "enter")
        await pilot.pause()
        assert pilot.app.screen.course.step == 1
        await pilot.press("backspace")
        assert pilot.app.screen.course.step == 0


async def test_any_run_is_stepped_through_forward_and_back():
    async with Workbench(first=ShowLesson(LESSONS / "delivery.ddenv")).run_test(size=(120, 36)) as pilot:
        await pilot.pause()
        course = pilot.app.screen.course
        begin = course.at
        await pilot.press("right", "right", "left", "left")
        assert course.at == begin
        await pilot.press("right_curly_bracket")
        assert "E" in [one.name for one in pilot.app.screen.query_one(Variables)._variables if one.changed]
        assert len(course.position.now.environment) == 6
        await pilot.press("left_parenthesis", "right_parenthesis", "right_parenthesis")
        await pilot.press("p")
        assert course.page.question is not None
        await pilot.press("s")
        assert "Skipped" in text(pilot)
        await pilot.press("enter")
        assert course.page.question is None


async def test_the_setup_screen_leads_to_the_lessons():
    async with Workbench().run_test(size=(120, 36)) as pilot:
        await pilot.pause()
        await pilot.press("L")
        await pilot.pause()
        assert isinstance(pilot.app.screen, LessonsScreen)
        await pilot.press("escape")
        assert not isinstance(pilot.app.screen, LessonsScreen)
