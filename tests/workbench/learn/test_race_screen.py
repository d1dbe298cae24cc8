"""A race on the screen: test by test, back, run and paused, to the end; in a lesson, and of run
files.
"""

import shutil
import sqlite3

import pytest
from textual.widgets import Static

from ddenv.learn.catalog import LESSONS, bundled, open_lesson
from ddenv.workbench.learn.kept_scores import all_scores
from ddenv.workbench.learn.race_screen import RacerPane, RaceScreen, race_of_runs
from tests.command import in_process
from tests.tiers import slow
from tests.waiting import eventually
from tests.workbench.learn.opened import NAME, opened

SIZES = slow(pytest.mark.screens, [(80, 24), (120, 36)], but=[(80, 24)])
STEP = next(
    number for number, step in enumerate(open_lesson(bundled()[0]).lesson.steps) if step.race
)


def said(pilot, name="race-said"):
    return str(pilot.app.screen.query_one(f"#{name}", Static).content)


def titles(pilot):
    return [str(pane.border_title) for pane in pilot.app.screen.query(RacerPane)]


@pytest.mark.parametrize("size", SIZES, ids=str)
async def test_a_race_in_a_lesson(size):
    async with opened(size, STEP) as pilot:
        course = pilot.app.screen.course
        right = course.page.question.right
        await pilot.press("abcde"[right], "enter")
        await pilot.pause()
        screen = pilot.app.screen
        assert isinstance(screen, RaceScreen)
        await pilot.press("right", "right", "left")
        await pilot.pause()
        assert screen.race.at == 1 and titles(pilot)[0] == "ddmin · 1 test · 4 left"
        maps = [pane.map for pane in screen.query(RacerPane)]
        await eventually(lambda: all(each.picture is not None or not each.display for each in maps))
        assert all(each.display == (size == (120, 36)) for each in maps)
        await pilot.press("end")
        await pilot.pause()
        assert "splitting needed the fewest tests: 7. ddenv needed the most: 14." in said(pilot)
        assert "lost f" in said(pilot) and all(
            title.endswith("2 left ✓") for title in titles(pilot)
        )
        await pilot.press("home")
        assert screen.race.at == 0 and "fewest" not in said(pilot)
        await pilot.press("escape")
        await pilot.pause()
        assert not course.due and "splitting needed the fewest" in said(pilot, "lesson-text")
        await pilot.press("enter")
        assert course.step == STEP + 1
    assert all_scores()[NAME].answered[str(STEP)] is True


@pytest.fixture
def two_runs(tmp_path):
    """The run of the first lesson, and one that was stopped in the middle."""
    whole, half = (
        LESSONS / "delivery.ddenv",
        tmp_path / "a-run-with-quite-a-long-name-that-was-stopped.ddenv",
    )
    shutil.copy(whole, half)
    with sqlite3.connect(half) as database:
        ends = database.execute(
            "SELECT id FROM event WHERE kind = 'test_finished' ORDER BY id"
        ).fetchall()
        database.execute("DELETE FROM event WHERE id >= ?", ends[19])
    return whole, half


@pytest.mark.parametrize("size", SIZES, ids=str)
async def test_runs_race_by_themselves_to_the_end(two_runs, size, monkeypatch):
    monkeypatch.setattr("ddenv.workbench.learn.race_screen.PACE", 0.01)
    async with opened(size, first=lambda: race_of_runs(two_runs)) as pilot:
        screen = pilot.app.screen
        assert "ddenv model2model/" in str(screen.query(RacerPane).first()._said.content)
        await pilot.press("space")
        await eventually(lambda: screen.race.over)
        await pilot.pause()
        assert titles(pilot)[0] == "delivery · 38 tests · 3 left ✓"
        assert "16 tests, stopped · 6 left" in titles(pilot)[1] and (
            size == (120, 36) or "…" in titles(pilot)[1]
        )
        assert "did not finish" in said(pilot) and "no winner" in said(pilot)


async def test_a_race_is_paused(two_runs, monkeypatch):
    # The next test would come in an hour.
    monkeypatch.setattr("ddenv.workbench.learn.race_screen.PACE", 3600.0)
    async with opened((80, 24), first=lambda: race_of_runs(two_runs)) as pilot:
        for key, words in (
            ("space", "runs"),
            ("space", "space runs it"),
            ("space", "runs"),
            ("right", "space runs it"),
        ):
            await pilot.press(key)
            assert said(pilot, "race-header").strip().split(" · ")[1].startswith(words)
        assert pilot.app.screen.race.at == 1


@pytest.mark.parametrize(
    ("runs", "words"),
    [
        (["delivery"], "--race: expected 2 to 4 runs, found 1"),
        (["delivery", "ditch"], "its world is not that of"),
        (["delivery", "nothing"], "no such run file"),
        (["delivery"] * 5, "found 5"),
    ],
)
def test_runs_that_cannot_race_are_one_line(runs, words, monkeypatch, capsys):
    said = in_process(
        monkeypatch, capsys, "learn", "--race", *(LESSONS / f"{name}.ddenv" for name in runs)
    )
    assert said.returncode == 2 and words in said.stderr and said.stderr.count("\n") == 1
