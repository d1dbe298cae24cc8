"""Lessons on the screen: the list, a lesson with right, wrong and skipped answers, and any run step by step."""

import pytest
from textual.widgets import OptionList, Static

from ddenv.learn.score import Score
from ddenv.learn.shelf import LESSONS, bundled
from ddenv.runfile.store import RunFile
from ddenv.workbench.app import Workbench
from ddenv.workbench.learn.kept_scores import all_scores, keep_score
from ddenv.workbench.learn.lesson_pane import LessonPane
from ddenv.workbench.learn.lesson_screen import LessonScreen
from ddenv.workbench.learn.lessons_screen import LessonsScreen
from ddenv.workbench.learn.variables_pane import Variables
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.messages import ShowLesson, ShowLessons
from tests.tiers import slow

SIZES = slow(pytest.mark.screens, [(80, 24), (120, 36)], but=[(80, 24)])


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
            if screen.course.due:
                await pilot.press("s")
            await pilot.press("enter")
        assert turn > 10
        assert "questions right" in text(pilot)
        await pilot.press("escape")
        assert isinstance(pilot.app.screen, LessonsScreen)
        row = pilot.app.screen.query_one(OptionList).get_option_at_index(0).prompt
        assert "done" in str(row)
    assert all_scores()["what-delta-debugging-is"].done


async def test_enter_shows_the_rest_of_a_long_text_first():
    async with Workbench(first=ShowLessons(bundled()[0])).run_test(size=(80, 24)) as pilot:
        await pilot.pause()
        pane, course = pilot.app.screen.query_one(LessonPane), pilot.app.screen.course
        while not pane.max_scroll_y:
            step = course.step
            await pilot.press("enter")
            await pilot.pause()
            assert course.step == step + 1
        await pilot.press("enter")
        await pilot.pause()
        assert course.step == step + 1 and pane.scroll_y > 0


async def test_at_80_columns_a_hint_is_in_sight_and_the_map_has_the_way_of_the_test_that_is_told():
    keep_score("what-delta-debugging-is", Score(step=10))
    async with Workbench(first=ShowLessons(bundled()[0])).run_test(size=(80, 24)) as pilot:
        await pilot.pause()
        screen = pilot.app.screen
        await pilot.press("h")
        await pilot.pause()
        pane = screen.query_one(LessonPane)
        assert "Hint:" in text(pilot) and pane.scroll_y == pane.max_scroll_y > 0
        asked = text(pilot)
        await pilot.press("p")
        assert screen.course.must_answer and text(pilot) == asked
        await pilot.press("s", "backspace", "backspace", "a")
        assert screen.course.step == 8
        shown = screen.query_one(WorldMap).snapshot
        with RunFile(LESSONS / "delivery.ddenv") as run:
            assert shown.evidence == run.motion(6) != shown.original
        assert [live.test for live in shown.live] == [6]
        assert screen.query_one("#lesson-world").border_title == "World: way of test 6"


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
