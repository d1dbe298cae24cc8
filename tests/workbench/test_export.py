"""The export dialog: writes the chosen files, asks before it replaces any, and says in one line
what is wrong.
"""

from contextlib import asynccontextmanager

import fake_moments
import pytest
from attached import Attached
from textual.app import App
from textual.widgets import Button, Checkbox, Input, Static

from ddenv.errors import UserError
from ddenv.runs.programs import export_mcap
from ddenv.workbench.export import MEANINGS, ExportScreen
from ddenv.workbench.help.shortcuts import Help

NAMES = (
    "crates-1.html",
    "crates-1.minimal.robot.sdf",
    "crates-1.minimal.sdf",
    "crates-1.minimal.yaml",
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where the user is."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


@asynccontextmanager
async def dialog(run, size=(80, 24)):
    """The dialog of an ended run."""
    fake_moments.finished(run)
    app = App()
    async with app.run_test(size=size) as pilot:
        await app.push_screen(ExportScreen(run.path))
        await settled(pilot)
        yield pilot


async def settled(pilot):
    await pilot.pause()
    await pilot.app.workers.wait_for_complete()
    await pilot.pause()


def told(pilot):
    shown = (
        pilot.app.screen.query_one(f"#export-{kind}", Static).render()
        for kind in ("words", "wrong")
    )
    return " ".join(" ".join(map(str, shown)).split())


def names(folder):
    return tuple(sorted(path.name for path in folder.iterdir()))


async def test_enter_writes_all_and_says_where(run, folder):
    async with dialog(run) as pilot:
        left = pilot.app.screen.query_one("#export-left", Static).render()
        assert str(left).startswith("2 of 11 models left: ")
        await pilot.press("enter")
        await settled(pilot)
        assert names(folder) == NAMES
        assert all(f"wrote {folder / name}" in told(pilot) for name in NAMES)
        await pilot.press("escape")
        assert not isinstance(pilot.app.screen, ExportScreen)


async def test_nothing_is_replaced_before_it_is_asked_for(run, folder):
    mine = [folder / name for name in ("crates-1.minimal.robot.sdf", "b.html")]
    for path in mine:
        path.write_text("mine")
    async with dialog(run) as pilot:
        await pilot.press("ctrl+s")
        await settled(pilot)
        assert f"{mine[0].name} exists already" in told(pilot)
        assert str(pilot.app.screen.query_one("#export-write", Button).label) == "Replace"
        # Another name is asked about anew.
        pilot.app.screen.query_one("#export-report-name", Input).value = "b.html"
        await pilot.pause()
        await pilot.press("ctrl+s")
        await settled(pilot)
        assert "b.html exist already" in told(pilot)
        assert len(names(folder)) == 2 and all(path.read_text() == "mine" for path in mine)
        await pilot.press("ctrl+s")
        await settled(pilot)
        assert len(names(folder)) == 4 and all(path.read_text() != "mine" for path in mine)


async def test_a_scenario_goes_with_a_world(run, folder):
    async with dialog(run) as pilot:
        world, scenario = (
            pilot.app.screen.query_one(f"#export-{kind}", Checkbox)
            for kind in ("world", "scenario")
        )
        await pilot.click(world)
        await pilot.pause()
        assert not world.value and not scenario.value and "X" not in str(world.render())
        await pilot.click("#export-write")
        await settled(pilot)
        assert names(folder) == ("crates-1.html",)
        await pilot.click(scenario)
        await pilot.pause()
        assert world.value


async def test_the_dialog_says_what_each_file_is_for_and_has_help(run, folder):
    fake_moments.finished(run)
    async with Attached(run) as session:
        await session.press("E", "down")
        screen = session.app.screen
        meaning = screen.query_one("#export-meaning", Static)
        for kind, words in MEANINGS.items():
            screen.query_one(f"#export-{kind}").focus()
            await session.pilot.pause()
            assert str(meaning.render()) == words
            assert len(words) <= meaning.size.width
        await session.press("question_mark")
        assert isinstance(session.app.screen, Help)


async def test_what_is_wrong_is_said_in_the_dialog(run, folder):
    wrong = (
        ("folder", "/no/such/folder", "/no/such/folder/crates-1.minimal.sdf: cannot be written"),
        ("folder", "~nobody-here/x", "~nobody-here/x/crates-1.minimal.sdf: cannot be written"),
        ("world-name", f"{'n' * 300}.sdf", "cannot be written"),
        ("world-name", "", "world (SDF): give a name that ends in .sdf"),
        ("world-name", "a\x00.sdf", "give a name that ends in .sdf"),
        ("scenario-name", "a.txt", "scenario (YAML): 'a.txt' does not end in .yaml or .yml"),
    )
    async with dialog(run) as pilot:
        for field, value, words in wrong:
            field = pilot.app.screen.query_one(f"#export-{field}", Input)
            right, field.value = field.value, value
            await pilot.press("ctrl+s")
            await settled(pilot)
            assert words in told(pilot)
            field.value = right
        run.path.unlink()
        await pilot.press("ctrl+s")
        await settled(pilot)
        assert "no such run file" in told(pilot)
        assert not names(folder)


async def test_a_bundle_and_a_test_are_written_where_they_are_ticked(run, folder):
    async with dialog(run) as pilot:
        for kind in ("world", "report", "bundle", "test"):
            pilot.app.screen.query_one(f"#export-{kind}", Checkbox).toggle()
        await pilot.pause()
        await pilot.press("ctrl+s")
        await settled(pilot)
        assert names(folder) == ("crates-1.zip", "crates_1.ddenv", "test_crates_1.py")
        # They replace nothing.
        await pilot.press("ctrl+s")
        await settled(pilot)
        assert "crates-1.zip: exists already" in told(pilot)


@pytest.mark.screens
async def test_why_messages_cannot_be_written_is_told(run, folder):
    async with dialog(run) as pilot:
        for kind in ("world", "report", "mcap"):
            pilot.app.screen.query_one(f"#export-{kind}", Checkbox).toggle()
        await pilot.pause()
        await pilot.press("ctrl+s")
        await settled(pilot)
        # Drake makes the runs again, and the robot of this run cannot drive.
        assert (
            told(pilot).startswith("robot 'robot': expected wheels on both sides")
            and names(folder) == ()
        )


def test_messages_that_are_being_written_can_be_stopped(tmp_path, monkeypatch):
    slow = tmp_path / "python"
    slow.write_text("#!/bin/sh\nexec sleep 600\n")
    slow.chmod(0o755)
    monkeypatch.setattr("sys.executable", str(slow))
    looks = iter([False, False, True])
    with pytest.raises(UserError, match="stopped; nothing was written"):
        export_mcap(tmp_path / "a.ddenv", tmp_path / "a.mcap", lambda: next(looks))
