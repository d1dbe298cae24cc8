"""Lessons on the screen: the list, a lesson with right, wrong and skipped answers, and any run step
by step.
"""

import pytest
from textual.widgets import OptionList, Static

from ddenv.learn.catalog import LESSONS, bundled, open_lesson
from ddenv.learn.lesson_course import LETTERS
from ddenv.learn.score import Score
from ddenv.runfile.store import RunFile
from ddenv.runs.preferences import state_file
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.learn.kept_scores import all_scores, keep_score
from ddenv.workbench.learn.lesson_pane import LessonPane, Variables
from ddenv.workbench.learn.lesson_screen import LessonScreen
from ddenv.workbench.learn.lessons_screen import LessonsScreen
from ddenv.workbench.map.world_map import WorldMap
from tests.tiers import slow
from tests.workbench.learn.opened import NAME, opened

SIZES = slow(pytest.mark.screens, [(80, 24), (120, 36)], but=[(80, 24)])


def text(pilot):
    return str(pilot.app.screen.query_one("#lesson-text", Static).content)


def footer(pilot):
    return [
        f"{entry.shown} {entry.words}" for entry in pilot.app.screen.query_one(KeyFooter).entries
    ]


@pytest.mark.parametrize("size", SIZES, ids=str)
async def test_a_lesson_from_start_to_end(size):
    async with opened(size) as pilot:
        screen = pilot.app.screen
        assert isinstance(screen, LessonScreen)
        turn = 0
        while screen.course.step < screen.course.last:
            page = screen.course.page
            if page.question is not None and page.chosen is None:
                right = page.question.right
                wrong = (right + 1) % len(page.question.answers)
                key = (LETTERS[right], LETTERS[wrong], "s")[turn % 3]
                await pilot.press("enter")
                assert screen.course.page.chosen is None, (
                    "an open question is not passed over unseen"
                )
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
    assert all_scores()[NAME].done
    assert state_file("lessons.json").stat().st_mode & 0o077 == 0, (
        "nobody else reads a student's answers"
    )


async def test_enter_shows_the_rest_of_a_long_text_first():
    async with opened((64, 20)) as pilot:
        pane, course = pilot.app.screen.query_one(LessonPane), pilot.app.screen.course
        assert pane.max_scroll_y and pane.parent.border_subtitle == "enter shows the rest"
        while pane.scroll_y < pane.max_scroll_y:
            before = pane.scroll_y
            await pilot.press("enter")
            await pilot.pause()
            assert course.step == 0 and pane.scroll_y > before
        assert not pane.parent.border_subtitle
        await pilot.press("enter")
        assert course.step == 1


@pytest.mark.screens
async def test_at_80_columns_a_hint_is_in_sight_and_the_map_has_the_way_of_the_test_that_is_told():
    async with opened((80, 24), step=10) as pilot:
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
        assert screen.query_one("#lesson-world").border_title == "World: path of test 6"


@pytest.mark.screens
async def test_after_a_lesson_comes_the_next_one_by_itself_and_the_list_shows_how_far_one_is():
    names = [open_lesson(file).lesson.name for file in bundled()]
    for name in names[:2]:
        keep_score(name, Score(step=99, done=True))
    async with opened(first=LessonsScreen) as pilot:
        options = pilot.app.screen.query_one(OptionList)
        assert options.highlighted == 2, "the first one that is not done"
        assert "2 of 7 done" in str(pilot.app.screen.query_one("#lessons-header", Static).content)
        await pilot.press("up", "enter")
        await pilot.pause()
        assert "enter opens the next lesson: Order matters" in text(pilot)
        await pilot.press("enter")
        await pilot.pause()
        assert isinstance(pilot.app.screen, LessonScreen)
        assert pilot.app.screen.course.step == 0 and "step 1 of" in str(
            pilot.app.screen.query_one("#lesson-header", Static).content
        )
        await pilot.press("escape")
        await pilot.pause()
        assert pilot.app.screen.query_one(OptionList).highlighted == 2
    keep_score(names[-1], Score(step=99, done=True))
    async with opened(lesson=-1) as pilot:
        await pilot.press("enter")
        assert "next lesson" not in text(pilot) and isinstance(pilot.app.screen, LessonScreen)


@pytest.mark.screens
async def test_what_was_said_before_an_answer_does_not_hide_what_is_said_of_it():
    async with opened((80, 24), step=2) as pilot:
        pane = pilot.app.screen.query_one(LessonPane)
        assert pane.parent.border_subtitle == "a to c, or ↑ ↓ and enter; s skips"
        assert footer(pilot)[:3] == [
            "a to c answer",
            "s skip",
            "h hint",
        ] and "enter go on" not in footer(pilot)
        await pilot.press("enter")
        assert not pilot.app._notifications, "it would hide the answers"
        await pilot.press("backspace", "backspace", "backspace")
        assert len(pilot.app._notifications) == 1
        await pilot.press("enter", "enter", "a")
        await pilot.pause()
        assert not pilot.app._notifications
        # Lines of a remark after its first stand below its words.
        remark = next(
            line for line in text(pilot).splitlines() if line[1:4] == " ✓ " and line[0] in "abc"
        )
        after = text(pilot).splitlines()[text(pilot).splitlines().index(remark) + 1]
        assert after.startswith("    ") and len(remark) <= 76


async def test_a_lesson_that_is_done_shows_the_end_of_its_run_and_can_be_started_again():
    keep_score(NAME, Score(step=99, done=True, answered={"2": True, "5": False}))
    async with opened((80, 24)) as pilot:
        screen = pilot.app.screen
        assert screen.course.position.now.status == "finished"
        assert "1 of 2 questions right" in text(pilot) and "r starts it again" in text(pilot)
        await pilot.press("r")
        assert screen.course.step == 0 and not screen.course.score.answered
        await pilot.press("enter", "r")
        assert screen.course.step == 1, "anywhere else the key does nothing"
    assert all_scores()[NAME].done


@pytest.mark.screens
async def test_the_letters_of_answers_leave_out_f_and_the_key_of_the_hint():
    lesson = open_lesson(bundled()[0]).lesson
    round_2 = next(number for number, step in enumerate(lesson.steps) if step.foretell == "winner")
    async with opened(step=round_2) as pilot:
        question = pilot.app.screen.course.page.question
        assert "6 candidates, tested in this order" in question.text and len(question.answers) == 7
        assert footer(pilot)[0] == "a b c d e g i answer"
        await pilot.press("f")
        assert pilot.app.screen.course.page.chosen is None
        await pilot.press("i")
        assert pilot.app.screen.course.page.chosen == 6


async def test_a_lesson_goes_on_where_it_was_left():
    async with opened() as pilot:
        await pilot.press("enter", "escape", "enter")
        await pilot.pause()
        assert pilot.app.screen.course.step == 1
        await pilot.press("backspace")
        assert pilot.app.screen.course.step == 0


async def test_any_run_is_stepped_through_forward_and_back():
    async with opened(first=lambda: LessonScreen(LESSONS / "delivery.ddenv")) as pilot:
        course = pilot.app.screen.course
        begin = course.at
        await pilot.press("right", "right", "left", "left")
        assert course.at == begin
        await pilot.press("right_curly_bracket")
        assert "E" in [
            one.name for one in pilot.app.screen.query_one(Variables)._variables if one.changed
        ]
        assert len(course.position.now.environment) == 6
        await pilot.press("left_parenthesis", "right_parenthesis", "right_parenthesis")
        await pilot.press("p")
        assert course.page.question is not None
        asked_at = course.at
        await pilot.press("enter")
        assert course.at == asked_at and course.page.chosen is None, (
            "an open question is not passed over"
        )
        await pilot.press("down", "enter")
        assert course.page.chosen == 0
        await pilot.press("right", "p", "s")
        assert "Skipped" in text(pilot)
        await pilot.press("enter")
        assert course.page.question is None


@pytest.mark.screens
async def test_the_algorithm_is_shown_from_the_step_that_speaks_of_it_on():
    async with opened() as pilot:
        screen = pilot.app.screen
        speaks = next(
            number
            for number, step in enumerate(screen._opened.lesson.steps)
            if "*Algorithm*" in step.text
        )
        assert speaks > 2 and not screen.query_one("#lesson-now").display
    async with opened(step=speaks) as pilot:
        assert pilot.app.screen.query_one("#lesson-now").display


async def test_arrows_choose_an_answer_and_enter_takes_it():
    async with opened(step=2) as pilot:
        course = pilot.app.screen.course
        await pilot.press("down", "down", "up", "down")
        assert "▸ b" in text(pilot)
        await pilot.press("enter")
        assert course.page.chosen == 1 and "▸" not in text(pilot)
