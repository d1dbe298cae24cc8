"""The list of all runs: how each stands, and what can be done with it."""

from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import fake_moments
import fake_run
import pytest
from textual import events
from textual.app import App
from textual.widgets import Input, Static

from ddenv.errors import UserError
from ddenv.runs.comparison import compared, differences
from ddenv.runs.recent import Recent
from ddenv.workbench.app import Workbench
from ddenv.workbench.help.dialogs import SideBySide
from ddenv.workbench.run.run_screen import RunScreen
from ddenv.workbench.runs.recent_runs import RunsFolder
from ddenv.workbench.runs.runs_screen import FOLDER, KEPT, RunsScreen, bring_back, delete_run
from ddenv.workbench.runs.runs_table import RunTable
from ddenv.workbench.setup.setup_screen import SetupScreen
from tests.tiers import slow


@pytest.fixture
def several(runs, run):
    """crates-1 runs, done is finished, gone lost its engine, new was never started, broken is no
    run.
    """
    fake_moments.mid_round(run).hold()
    fake_moments.finished(fake_run.FakeRun(runs / "done.ddenv")).close()
    fake_moments.mid_round(fake_run.FakeRun(runs / "gone [b]x.ddenv")).close()
    fake_run.FakeRun(runs / "new.ddenv").close()
    (runs / "broken.ddenv").write_text("no run")
    return run


class Listed:
    """The runs screen above an attached run."""

    def __init__(self, app, pilot):
        self.app, self.pilot = app, pilot

    async def again(self):
        """Opens the screen."""
        self.app.action_runs()
        await self.look()

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
            str(row[0]): [str(cell) for cell in row]
            for row in (table.get_row_at(i) for i in range(table.row_count))
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


@asynccontextmanager
async def listing(run, size=(120, 36)):
    app = Workbench(run.path)
    async with app.run_test(size=size) as pilot:
        await pilot.pause()
        listed = Listed(app, pilot)
        await listed.again()
        yield listed


async def test_every_run_says_how_it_stands(several, runs):
    async with listing(several, (200, 60)) as listed:
        states = {name: row[1:4] for name, row in listed.rows().items()}
        assert states == {
            "crates-1": ["▶ running", "6/11", "10"],
            "done": ["■ minimal", "2/11", "83"],
            "gone [b]x": ["✗ engine is gone", "6/11", "10"],
            "new": ["○ not started", "11/11", "0"],
            "broken": ["✗ cannot be read", "", ""],
        }
        await listed.choose("broken")
        assert "is not a ddenv run file" in listed.about()
        await listed.choose("done")
        assert "2 of 11 models left" in listed.about() and "crate_00" in listed.about()
        # The list follows what happens, and the cursor stays.
        several.test(1, "pass")
        fake_run.FakeRun(runs / "another.ddenv").close()
        await listed.look()
        assert listed.rows()["crates-1"][3] == "11"
        assert "another" in listed.rows()
        assert listed.table.chosen.path.stem == "done"


async def test_while_runs_are_first_read_a_cursor_that_nobody_moved_stays_at_the_newest_run():
    copied, new, old = (
        Recent(path=Path(f"{name}.ddenv"), changed=changed)
        for name, changed in (("a", 9.0), ("b", 8.0), ("c", 7.0))
    )
    app = App()
    async with app.run_test() as pilot:
        await app.mount(table := RunTable(id="runs"))
        table.show([copied, new, old], "changed")
        # The file is a copy: its run is older than the file.
        copied = replace(copied, changed=1.0, status="finished")
        table.show([new, old, copied], "changed")
        assert table.chosen == new
        await pilot.press("down")
        table.show([old, new, copied], "changed")
        assert table.chosen == old


@pytest.mark.screens
async def test_at_80_columns_the_run_under_the_cursor_is_whole_below_the_list(several, runs):
    name = "a run whose name takes more than the list has room for"
    fake_moments.finished(fake_run.FakeRun(runs / f"{name}.ddenv")).close()
    async with listing(several, (80, 24)) as listed:
        await listed.choose(name)
        assert name in listed.about() and "model2model/failure-proximal" in listed.about()
        assert listed.app.screen.query_one("#preview").region.height >= 5
        for size in ((64, 12), (20, 5)):
            await listed.pilot.resize_terminal(*size)
            assert listed.app.screen.query_one("#small").display == (size == (20, 5))


@pytest.mark.screens
async def test_enter_opens_a_run_w_watches_it_and_n_makes_one_like_it(several, scenarios):
    async with listing(several) as listed:
        await listed.choose("done")
        await listed.press("enter")
        assert isinstance(listed.app.screen, RunScreen) and listed.app.screen.run.stem == "done"
        assert sum(isinstance(screen, RunScreen) for screen in listed.app.screen_stack) == 1
        await listed.again()
        await listed.choose("crates-1")
        await listed.press("w")
        assert listed.app.screen.run.stem == "crates-1"
        await listed.again()
        await listed.choose("done")
        await listed.press("n")
        assert isinstance(listed.app.screen, SetupScreen)
        await listed.app.workers.wait_for_complete()


@pytest.mark.screens
async def test_what_cannot_be_done_says_why(several):
    async with listing(several) as listed:
        await listed.choose("broken")
        for key in ("enter", "w", "n"):
            await listed.press(key)
            assert isinstance(listed.app.screen, RunsScreen)
        assert "is not a ddenv run file" in listed.notices()[-1]
        await listed.choose("crates-1")
        await listed.press("d")
        assert isinstance(listed.app.screen, RunsScreen)
        assert "its engine is running" in listed.notices()[-1]
    with pytest.raises(UserError, match="another engine is working"):
        delete_run(several.path)
    assert several.path.exists()


@pytest.mark.screens
async def test_d_deletes_and_u_brings_back(several, runs):
    (runs / "done.ddenv.log").write_text("its log")
    content = (runs / "done.ddenv").read_bytes()
    async with listing(several) as listed:
        await listed.choose("done")
        # What SQLite leaves after a kill would come back in the next run of this name.
        (runs / "done.ddenv-journal").touch()
        await listed.press("d")
        assert not list(runs.glob("done.ddenv*"))
        assert "done" not in listed.rows()
        await listed.press("u")
        assert "done" in listed.rows()
        assert (runs / "done.ddenv").read_bytes() == content
        assert (runs / "done.ddenv.log").read_text() == "its log"
        await listed.press("u")
        assert "no deleted run" in listed.notices()[-1]


def test_a_deleted_run_is_kept_for_a_week_and_replaces_none(several, runs, monkeypatch):
    delete_run(runs / "done.ddenv")
    fake_run.FakeRun(runs / "done.ddenv").close()
    with pytest.raises(UserError, match="there is a new run of this name"):
        bring_back(runs)
    delete_run(runs / "new.ddenv")
    assert bring_back(runs) == runs / "new.ddenv"
    (place,) = (runs / FOLDER).iterdir()
    place.rename(place.with_name(str(int(place.name) - int((KEPT + 60) * 1e9))))
    delete_run(runs / "done.ddenv")
    assert len(list((runs / FOLDER).iterdir())) == 1


async def test_the_list_is_sorted_by_any_column_and_filtered_by_state(several):
    async with listing(several, (200, 60)) as listed:
        while listed.app.screen._order != "tests":
            await listed.press("s")
        assert next(iter(listed.rows())) == "done"
        assert "▾tests" in str(listed.table.ordered_columns[3].label)
        assert listed.rows()["done"][4] == "166 s"
        await listed.press("slash", *"gone")
        assert set(listed.rows()) == {"gone [b]x"}


async def test_two_runs_are_compared(several, runs):
    data = fake_run.as_printed()
    data["reduction"]["iterations"] = 7
    fake_moments.guided(fake_run.FakeRun(runs / "other.ddenv", data)).close()
    async with listing(several) as listed:
        await listed.press("c")
        assert "mark a run first" in listed.notices()[-1]
        await listed.choose("done")
        await listed.press("m", "c")
        assert "this is the marked run" in listed.notices()[-1]
        marked = listed.table.chosen
        await listed.choose("other")
        await listed.press("c")
        assert isinstance(listed.app.screen, SideBySide)
        other = next(run for run in RunsFolder(runs).look() if run.path.stem == "other")
    said = {name: values for name, *values in compared(marked, other)}
    assert said["models left"] == ["2 of 11 models", "5 of 11 models"]
    assert said["in both"][0] == "2: crate_00, crate_01"
    assert said["only in this one"] == ["none", "3: crate_02, crate_03, crate_04"]
    assert said["reduction.iterations"] == ["3", "7"]
    one, other = {"a": {"b": 1}, "name": "x"}, {"a": {"b": 1, "c": [2]}, "name": "y"}
    assert list(differences(one, other)) == [("a.c", "none", "[2]")]


@pytest.mark.parametrize(
    "how",
    slow(pytest.mark.screens, ["typed", "completed", "pasted", "quoted", "url"], but=["pasted"]),
)
async def test_a_run_of_elsewhere_is_opened_by_its_path(run, tmp_path, how):
    folder = tmp_path / "from a robot"
    folder.mkdir()
    path = folder / "far.ddenv"
    fake_moments.finished(fake_run.FakeRun(path)).close()
    text = {"quoted": f"'{path}' ", "url": path.as_uri()}.get(how, str(path))
    async with listing(run) as listed:
        if how == "typed":
            await listed.press("o")
            listed.app.screen.query_one("#path", Input).value = text
            await listed.press("enter")
        elif how == "completed":
            await listed.press("o")
            listed.app.screen.query_one("#path", Input).value = f"{folder}/f"
            await listed.press("end", "tab", "enter")
        else:
            listed.app.post_message(events.Paste("no run at all"))
            listed.app.post_message(events.Paste(text))
            await listed.look()
        assert isinstance(listed.app.screen, RunScreen) and listed.app.screen.run == path


async def test_a_path_that_is_no_run_says_so(run):
    async with listing(run) as listed:
        await listed.press("o", *"nowhere", "enter")
        assert "nowhere.ddenv: no such run file" in listed.notices()[-1]
        await listed.press("escape")
        assert listed.app.focused is listed.table


@pytest.mark.screens
async def test_slash_filters_and_escape_goes_back(several):
    async with listing(several) as listed:
        await listed.press("slash", *"ONE")
        assert set(listed.rows()) == {"done", "gone [b]x"}
        await listed.press("enter")
        assert listed.app.focused is listed.table
        await listed.press("escape")
        assert len(listed.rows()) == 5 and listed.app.screen.query_one("#filter", Input).value == ""
        await listed.press("slash", "enter")
        assert (
            not listed.app.screen.query_one("#filter").display
            and listed.app.focused is listed.table
        )
        await listed.press("escape")
        assert isinstance(listed.app.screen, RunScreen)


async def test_no_runs_say_how_to_make_one(run, tmp_path, monkeypatch):
    async with listing(run) as listed:
        await listed.press("escape")
        monkeypatch.setenv("DDENV_HOME", str(tmp_path / "elsewhere"))
        await listed.again()
        assert "ddenv run ditch" in str(listed.app.screen.query_one("#empty", Static).render())
        await listed.press("enter", "d")
        assert isinstance(listed.app.screen, RunsScreen)


def test_only_files_that_changed_are_read_again(several, runs, monkeypatch):
    folder = RunsFolder(runs)
    first = folder.look()
    opened = []
    monkeypatch.setattr(
        "ddenv.workbench.shared.observed.Observed", lambda path: opened.append(path)
    )
    assert folder.look() == first and opened == []
    # A look without time tells the names.
    assert {run.status for run in RunsFolder(runs).look(patience=-1.0)} == {""}
