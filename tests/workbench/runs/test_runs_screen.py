"""The list of all runs: how each stands, and what can be done with it."""

import fake_run
import pytest
from textual.widgets import Input, Static

from ddenv.errors import UserError
from ddenv.workbench.app import Workbench
from ddenv.workbench.run.run_screen import RunScreen
from ddenv.workbench.runs.recent_runs import RunsFolder, delete_run
from ddenv.workbench.runs.runs_screen import RunsScreen
from ddenv.workbench.runs.runs_table import RunTable
from ddenv.workbench.setup.setup_screen import SetupScreen
from ddenv.workbench.widgets.question import Question


@pytest.fixture
def several(runs, run):
    """crates-1 runs, done is finished, gone lost its engine, new was never started, broken is no run."""
    fake_run.mid_round(run).hold()
    fake_run.finished(fake_run.FakeRun(runs / "done.ddenv")).close()
    fake_run.mid_round(fake_run.FakeRun(runs / "gone [b]x.ddenv")).close()
    fake_run.FakeRun(runs / "new.ddenv").close()
    (runs / "broken.ddenv").write_text("no run")
    return run


class Listed:
    """The runs screen above an attached run."""

    def __init__(self, run, size=(120, 36)):
        self.app, self.size = Workbench(run.path), size

    async def __aenter__(self):
        self._context = self.app.run_test(size=self.size)
        self.pilot = await self._context.__aenter__()
        await self.pilot.pause()
        self.app.action_runs()
        await self.look()
        return self

    async def __aexit__(self, *error):
        await self._context.__aexit__(*error)

    async def look(self):
        await self.pilot.pause()
        await self.app.workers.wait_for_complete()
        if isinstance(self.app.screen, RunsScreen):
            self.app.screen._look()
            await self.app.workers.wait_for_complete()
        await self.pilot.pause()

    @property
    def table(self):
        return self.app.screen.query_one(RunTable)

    def rows(self):
        table = self.table
        return {
            str(row[0]): [str(cell) for cell in row] for row in (table.get_row_at(i) for i in range(table.row_count))
        }

    async def choose(self, stem):
        """Puts the cursor on a run."""
        names = [run.path.stem for run in self.table._runs]
        self.table.move_cursor(row=names.index(stem))
        await self.pilot.pause()

    async def press(self, *keys):
        await self.pilot.press(*keys)
        await self.look()

    def about(self):
        return str(self.app.screen.query_one("#about", Static).render())

    def notices(self):
        return [notice.message for notice in self.app._notifications]


async def test_every_run_says_how_it_stands(several):
    async with Listed(several, (200, 60)) as listed:
        states = {name: row[1:4] for name, row in listed.rows().items()}
        assert states == {
            "crates-1": ["▶ running", "6 of 11", "10"],
            "done": ["■ minimal", "2 of 11", "83"],
            "gone [b]x": ["✗ engine is gone", "6 of 11", "10"],
            "new": ["○ not started", "11 of 11", "0"],
            "broken": ["✗ cannot be read", "", ""],
        }
        await listed.choose("broken")
        assert "is not a ddenv run file" in listed.about()
        await listed.choose("done")
        assert "2 of 11 models left" in listed.about() and "crate_00" in listed.about()


@pytest.mark.screens
async def test_the_list_follows_what_happens(several, runs):
    async with Listed(several) as listed:
        await listed.choose("new")
        several.test(1, "pass")
        fake_run.FakeRun(runs / "another.ddenv").close()
        await listed.look()
        assert listed.rows()["crates-1"][3] == "11"
        assert "another" in listed.rows()
        assert listed.table.chosen.path.stem == "new"


@pytest.mark.screens
@pytest.mark.parametrize("size", [(64, 12), (20, 5)], ids=str)
async def test_small_terminals_show_what_there_is_room_for(several, size):
    async with Listed(several, size) as listed:
        assert listed.app.screen.query_one("#small").display == (size == (20, 5))
        if size != (20, 5):
            assert all(len(row) >= 5 for row in listed.rows().values())


async def test_enter_opens_a_run_and_w_watches_it(several):
    async with Listed(several) as listed:
        await listed.choose("done")
        await listed.press("enter")
        assert isinstance(listed.app.screen, RunScreen) and listed.app.screen.run.stem == "done"
        assert sum(isinstance(screen, RunScreen) for screen in listed.app.screen_stack) == 1
        listed.app.action_runs()
        await listed.look()
        await listed.choose("crates-1")
        await listed.press("w")
        assert listed.app.screen.run.stem == "crates-1"


@pytest.mark.screens
async def test_c_opens_the_setup_screen_with_its_settings(several, scenarios):
    async with Listed(several) as listed:
        await listed.choose("done")
        await listed.press("c")
        assert isinstance(listed.app.screen, SetupScreen)
        await listed.app.workers.wait_for_complete()


@pytest.mark.screens
async def test_what_cannot_be_done_says_why(several):
    async with Listed(several) as listed:
        await listed.choose("broken")
        for key in ("enter", "w", "c"):
            await listed.press(key)
            assert isinstance(listed.app.screen, RunsScreen)
        assert "is not a ddenv run file" in listed.notices()[-1]
        await listed.choose("crates-1")
        await listed.press("d")
        assert isinstance(listed.app.screen, RunsScreen)
        assert "at work" in listed.notices()[-1]
    with pytest.raises(UserError, match="another engine is working"):
        delete_run(several.path)
    assert several.path.exists()


@pytest.mark.screens
async def test_d_deletes_after_a_question(several, runs):
    (runs / "done.ddenv.log").touch()
    async with Listed(several) as listed:
        await listed.choose("done")
        await listed.press("d")
        assert isinstance(listed.app.screen, Question)
        await listed.press("n")
        assert (runs / "done.ddenv").exists()
        # What SQLite leaves after a kill would come back in the next run of this name.
        (runs / "done.ddenv-journal").touch()
        await listed.press("d")
        await listed.press("y")
        assert not list(runs.glob("done.ddenv*"))
        assert "done" not in listed.rows()


@pytest.mark.screens
async def test_slash_filters_and_escape_goes_back(several):
    async with Listed(several) as listed:
        await listed.press("slash", *"NE")
        assert set(listed.rows()) == {"done", "gone [b]x", "new"}
        await listed.press("enter")
        assert listed.app.focused is listed.table
        await listed.press("escape")
        assert len(listed.rows()) == 5 and listed.app.screen.query_one("#filter", Input).value == ""
        await listed.press("escape")
        assert isinstance(listed.app.screen, RunScreen)


async def test_no_runs_say_how_to_make_one(run, tmp_path, monkeypatch):
    async with Listed(run) as listed:
        await listed.press("escape")
        monkeypatch.setenv("DDENV_HOME", str(tmp_path / "elsewhere"))
        listed.app.action_runs()
        await listed.look()
        assert "ddenv run ditch" in str(listed.app.screen.query_one("#empty", Static).render())
        await listed.press("enter", "d")
        assert isinstance(listed.app.screen, RunsScreen)


def test_only_files_that_changed_are_read_again(several, runs, monkeypatch):
    folder = RunsFolder(runs)
    first = folder.look()
    opened = []
    monkeypatch.setattr("ddenv.workbench.runs.recent_runs.Observed", lambda path: opened.append(path))
    assert folder.look() == first and opened == []


def test_a_look_without_time_tells_the_names(several, runs):
    assert {run.status for run in RunsFolder(runs).look(patience=-1.0)} == {""}
