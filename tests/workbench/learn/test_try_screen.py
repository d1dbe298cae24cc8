"""A student's own search on the screen: by keys and by mouse, right, wrong, skipped, and gone back
to.
"""

import pytest
from textual.widgets import Static

from ddenv.learn.catalog import bundled, open_lesson
from ddenv.workbench.learn.kept_scores import all_scores
from ddenv.workbench.learn.lesson_screen import LessonScreen
from ddenv.workbench.learn.try_screen import TryScreen
from ddenv.workbench.map.world_map import WorldMap
from tests.tiers import slow
from tests.waiting import eventually
from tests.workbench.learn.opened import NAME, opened

SIZES = slow(pytest.mark.screens, [(80, 24), (120, 36)], but=[(80, 24)])
STEP = next(
    number for number, step in enumerate(open_lesson(bundled()[0]).lesson.steps) if step.budget
)


async def begin(pilot):
    assert isinstance(pilot.app.screen, LessonScreen)
    await pilot.press("enter")
    screen = pilot.app.screen
    assert isinstance(screen, TryScreen)
    await eventually(lambda: screen.query_one(WorldMap).picture is not None)
    return screen


def said(pilot, name="try-said"):
    return str(pilot.app.screen.query_one(f"#{name}", Static).content)


async def without(pilot, *names):
    pilot.app.screen.query_one(WorldMap).select(names)
    await pilot.pause()
    await pilot.press("w")
    await pilot.pause()


@pytest.mark.parametrize("size", SIZES, ids=str)
async def test_a_search_by_keys_that_finds_a_minimal_set(size):
    async with opened(size, STEP) as pilot:
        screen = await begin(pilot)
        # The first model and the third.
        await pilot.press(
            *[
                "right_square_bracket",
                "enter",
                "right_square_bracket",
                "right_square_bracket",
                "space",
            ]
        )
        await pilot.pause()
        assert "*bench" in said(pilot) and "*plant" in said(pilot) and "2 marked" in said(pilot)
        await pilot.press("w")
        await pilot.pause()
        assert len(screen.attempt.held) == 6 and "f again without bench, plant" in said(pilot)
        assert "without bench, plant" in said(pilot, "try-table") and "6 of 8 models kept" in said(
            pilot, "try-header"
        )
        await without(pilot, "sign")
        assert "another failure" in said(pilot) and len(screen.attempt.held) == 6
        screen.query_one(WorldMap).select(["sign", "crate"])
        await pilot.pause()
        await pilot.press("o")
        await pilot.pause()
        assert screen.attempt.held == ("sign", "crate") and "17 of 20 tests left" in said(
            pilot, "try-header"
        )
        await pilot.press("m")
        assert not screen.attempt.ended and "Sure that no single one of 2 models" in said(pilot)
        await pilot.press("m")
        await pilot.pause()
        assert "✓ No single one can go" in said(pilot) and "No smaller set shows f" in said(pilot)
        # The race of this lesson is still to come.
        assert "splitting" not in said(pilot, "try-table") and "minimum" in said(pilot, "try-table")
        await pilot.press("escape")
        await pilot.pause()
        course = pilot.app.screen.course
        assert not course.due and "No smaller set shows f" in said(pilot, "lesson-text")
        await pilot.press("enter")
        assert course.step == STEP + 1
    assert all_scores()[NAME].answered[str(STEP)] is True


async def test_a_wrong_claim_is_said_to_be_wrong_and_can_be_tried_again():
    async with opened((80, 24), STEP) as pilot:
        screen = await begin(pilot)
        await pilot.press("w")
        assert not screen.attempt.tried, "nothing is marked"
        await without(pilot, "bin")
        await pilot.press("m", "escape")
        assert pilot.app.screen is screen and "Sure" not in said(pilot), (
            "escape takes back the claim, not the search"
        )
        await pilot.press("m")
        assert not screen.attempt.ended, "the claim is asked for again"
        await pilot.press("m")
        await pilot.pause()
        assert "✗ More can go: f also shows without any one of bench, plant" in said(pilot)
        await pilot.press("n")
        await pilot.pause()
        assert not screen.attempt.moves and "8 of 8" in said(pilot, "try-header")
        await without(pilot, "pallet")
        await pilot.press("u", "escape")
        await pilot.pause()
        assert "`" not in said(pilot, "lesson-text") and "t continues it" in said(
            pilot, "lesson-text"
        )
        await pilot.press("t")
        await pilot.pause()
        assert [each.out for each in pilot.app.screen.attempt.tried] == [("pallet",)]
        assert len(pilot.app.screen.attempt.held) == 8
    kept = all_scores()[NAME]
    assert str(STEP) not in kept.answered and kept.moves[str(STEP)][-1] == "back"


async def test_a_search_is_skipped_and_gone_back_to():
    async with opened((80, 24), STEP) as pilot:
        course = pilot.app.screen.course
        await pilot.press("s", "enter")
        assert course.step == STEP + 1 and not course.score.answered
        await pilot.press("backspace")
        assert course.due
        await pilot.press("enter")
        await pilot.pause()
        assert isinstance(pilot.app.screen, TryScreen)


async def test_models_are_marked_by_mouse_on_the_map_and_in_the_list():
    async with opened((120, 36), STEP) as pilot:
        screen = await begin(pilot)
        world = screen.query_one(WorldMap)
        world.go_to("pallet")
        row, column = world.viewport.cursor
        world.go_to("bench")
        await pilot.click(WorldMap, offset=(column, row))
        assert world.selection == {"pallet"}
        column = said(pilot).splitlines()[1].index("sign")
        await pilot.click("#try-said", offset=(column + 1, 1))
        assert world.selection == {"pallet", "sign"}
        await pilot.click("#try-said", offset=(column + 1, 1))
        assert world.selection == {"pallet"}
