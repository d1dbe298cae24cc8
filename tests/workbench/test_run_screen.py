"""What the run screen shows and its keys that change nothing, on runs whose engine is a fake."""

import asyncio
import subprocess
import sys
from collections import Counter
from types import SimpleNamespace

import fake_moments
import fake_run
import pytest
from attached import Attached
from test_app import told
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.runs.engine_job import Reduce
from ddenv.schemas import explanation
from ddenv.workbench.app import Workbench
from ddenv.workbench.help.dialogs import Pick, SideBySide
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.shortcuts import Help
from ddenv.workbench.history import History
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.run.change import Change
from ddenv.workbench.run.choose import ChooseModels, Layers
from ddenv.workbench.run.dialogs import Method, Quit, SceneDialog, ssh_line
from ddenv.workbench.run.run_screen import RunScreen
from ddenv.workbench.setup.setup_screen import SetupScreen
from ddenv.workbench.shared.poll import Poll
from ddenv.workbench.widgets.lines import Lines
from ddenv.workbench.widgets.question import Question

URL = "http://127.0.0.1:7012/static/"


async def test_the_cursor_follows_the_run_until_it_is_moved(run):
    fake_moments.mid_round(run).hold()
    async with Attached(run) as session:
        table, world = session.screen.query_one(Candidates), session.screen.query_one(WorldMap)
        assert table.under_cursor.label == world.shown.candidate.label == "without A"
        await session.press("down", "down", "down")
        assert world.shown.candidate.label == "part C"
        run.finish(11, "pass")
        run.finish(12, "similar", 0.1)
        run.start(3)
        await session.look()
        assert table.under_cursor.label == "part C"
        assert table.words(1)["tests"] == "2/4"
        await session.press("escape")
        assert table.under_cursor.label == "without B"
        await session.press("end")
        run.start_round(4, run.elements[:4])
        await session.look()
        assert table.words(7) and not table.words(8)
        assert table.following
        for size in ((80, 24), (50, 12), (20, 5), (120, 36)):
            await session.pilot.resize_terminal(*size)
            await session.pilot.pause()
            small = session.screen.query_one("#small")
            assert small.display == (size[0] < 64)
            assert (
                not small.display
                or f"needs 64 x 18; this terminal has {size[0]} x {size[1]}" in str(small.render())
            )
        assert len(table.columns) == 6


async def test_the_baseline_is_listed_run_by_run(run):
    run.created().hold()
    run.test(None, "failed")
    run.live((run.start(None, 1), 0.5))
    async with Attached(run) as session:
        table = session.screen.query_one(Candidates)
        assert [table.words(row)["verdict"] for row in range(2)] == ["◆ failed", "▶ 22.2/45 s"]
        assert "Baseline" in str(session.screen.query_one("#round").border_title)
        await session.press("v", "w")
        assert "there are no candidates yet" in session.said()


@pytest.mark.screens
async def test_keys_that_only_look(run):
    fake_moments.guided(run).hold()
    async with Attached(run) as session:
        screen, world = session.screen, session.screen.query_one(WorldMap)
        fitted = world.viewport.view
        await session.press("plus")
        assert world.viewport.view.scale < fitted.scale
        await session.press("0")
        assert world.viewport.view == fitted
        await session.press("slash", *"_03", "enter")
        assert world.has_focus
        assert world.model_at_cursor == "crate_03"
        await session.press("enter")
        assert world.selection == {"crate_03"}
        assert "1 selected" in session.text("#map-lines")
        await session.press("l", "down", "space", "escape")
        assert "removed" not in world.shown.layers
        await session.press("y", "enter")
        assert session.app.clipboard.split() == run.elements[:5]
        await session.press("y", "down", "down", "enter")
        assert session.app.clipboard == "ddenv open crates-1"
        await session.press("escape")
        assert not world.selection
        await session.press("E")
        assert type(session.app.screen).__name__ == "ExportScreen"
        await session.press("escape", "question_mark")
        assert isinstance(session.app.screen, Help)
        words = {
            (shortcut.keys, shortcut.words)
            for group in session.app.screen.groups
            for shortcut in group.shortcuts
        }
        keys = {key for each, _ in words for key in each.split()}
        assert keys >= {*"?+-012345/acdeghlmopqrstuvwxy", "space", "shift+s", "shift+r"}
        await session.press("escape", "R")
        assert type(session.app.screen).__name__ == "RunsScreen"
        await session.press("escape")
        assert session.app.screen is screen
        assert session.commands() == []


async def test_the_log_tells_what_happened_and_goes_on(run):
    fake_moments.guided(run).hold()
    async with Attached(run, (80, 24)) as session:
        await session.press("L")
        log = session.screen.query_one("#log", Lines)
        words = [entry.words.strip() for entry in log.items]
        assert log.has_focus
        assert "pinned crate_00" in words
        assert "try 1 (5 models): similar after 1 test (1 stuck)" in words
        assert "adopted try 1: 5 models" in words
        run.write("command_refused", command=1, why="there is no such trial")
        await session.look()
        assert log.items[-1].words == "not done: there is no such trial"
        assert len(log.items) == len(words) + 1
        assert log.render_line(0).text.startswith("22:13:20")


@pytest.mark.screens
async def test_small_terminals_show_one_pane_at_a_time_and_keys_go_through_them(run):
    fake_moments.guided(run).hold()
    seen = {"1": ["#map", "#candidates", "#happening"], "2": ["#candidates", "#happening"]}
    seen |= {"3": ["#chart"], "4": ["#happening"], "5": ["#log"]}
    panes = ("#map", "#candidates", "#chart", "#happening", "#log")
    async with Attached(run, (80, 24)) as session:
        for key, shown in seen.items():
            await session.press(key)
            assert [pane for pane in panes if session.screen.query_one(pane).is_on_screen] == shown
        await session.press("g")
        assert session.screen.query_one(WorldMap).has_focus
        await session.pilot.click("#pane-chart")
        assert session.screen.query_one("#chart").is_on_screen
        await session.press("v")
        assert "2 shows the table" in session.said()
        footer = [key.words for key in session.screen.query_one(KeyFooter).entries]
        assert footer == [
            "pause",
            "step",
            "pins",
            "try without",
            "undo",
            "history",
            "export",
            "help",
            "quit",
        ]
        await session.pilot.resize_terminal(200, 60)
        await session.pilot.pause()
        more = ("#models", "#decisions", *panes)
        assert all(session.screen.query_one(pane).is_on_screen for pane in more)
        names = session.screen.query_one("#models", Lines).items
        assert names == ["crate_04", "crate_03", "crate_02", "crate_01", "crate_00"]
        await session.pilot.click("#models", offset=(2, 1))
        assert session.screen.query_one(WorldMap).model_at_cursor == "crate_03"


def test_every_binding_has_an_id_and_a_tooltip():
    owners = (RunScreen, WorldMap, Workbench, Quit, SceneDialog, Method, SetupScreen, History)
    owners += (SideBySide, Question, ChooseModels, Change, Layers, Pick)
    bindings = [binding for owner in owners for binding in owner.BINDINGS]
    assert all(binding.id and binding.tooltip for binding in bindings)
    assert len({binding.id for binding in bindings}) == len(bindings)


def test_no_two_keys_of_the_run_screen_and_of_what_is_on_it_are_the_same():
    bindings = [binding for owner in (RunScreen, WorldMap, Workbench) for binding in owner.BINDINGS]
    taken = [key for binding in bindings for key in binding.key.split(",")]
    assert [key for key, times in Counter(taken).items() if times > 1] == []


async def test_e_explains_the_method_of_the_run(runs):
    data = fake_run.scenario()
    data["reduction"]["algorithm"] = "splitting"
    run = fake_moments.mid_round(fake_run.FakeRun(runs / "splitting.ddenv", data))
    async with Attached(run, (80, 24)) as session:
        await session.press("e")
        assert isinstance(session.app.screen, Method)
        static = session.app.screen.query_one(Static)
        words = " ".join(told(session.app.screen).split())
        chosen = {
            "algorithm": "splitting",
            "partitioning": "model2model",
            "prioritization": "failure-proximal",
        }
        for kind, name in chosen.items():
            assert f"{kind} {name}" in words
            assert " ".join(explanation(kind, name).split()) in words
        assert words.count("Not used by splitting.") == 1
        assert static.size.height > len(words) // 80
        await session.press("e")
        assert session.app.screen is session.screen
    run.close()


STOPS = "The engine stops. Go on later with: ddenv resume crates-1"
GOES_ON = "The engine goes on. Attach again with: ddenv open crates-1"


@pytest.mark.parametrize(
    ("keys", "commands", "words"),
    [(["q", "s"], [("stop", {})], STOPS), (["q", "l"], [], GOES_ON), (["ctrl+q"], [], GOES_ON)],
)
async def test_q_asks_what_becomes_of_the_engine(run, keys, commands, words):
    fake_moments.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("q")
        assert isinstance(session.app.screen, Quit)
        await session.press("escape")
        assert session.app.screen is session.screen
        await session.press(*keys)
        assert session.commands() == commands
        assert session.app._exit_renderables[0].plain == words
        assert session.app.return_value == 0


async def test_space_or_r_starts_the_engine_of_a_run_that_has_none(run, started):
    fake_moments.mid_round(run)
    async with Attached(run) as session:
        assert "engine is gone" in session.text("#status")
        assert "r resumes" in session.text("#happening")
        assert session.screen.query_one(KeyFooter).entries[0].words == "resume"
        await session.press("s")
        assert "space starts one" in session.said()
        await session.press("space")
        assert started == [(run.path.name, fake_run.attended(2), Reduce())]
        await session.look()
        assert "engine starts" in session.text("#status")
        await session.press("r")
        assert "starting already" in session.said()
        run.hold()
        await session.look()
        assert "▶ running" in session.text("#status")
        await session.press("r")
        assert "running already" in session.said()
        assert session.commands() == []


async def test_an_engine_that_ends_at_once_is_told_with_its_log(run, monkeypatch):
    monkeypatch.setattr(
        "ddenv.runs.programs.start_engine", lambda *_, **__: SimpleNamespace(poll=lambda: 3)
    )
    fake_moments.mid_round(run)
    run.path.with_name("crates-1.ddenv.log").write_text(
        "ddenv engine: started\nModuleNotFoundError: No module named 'x'\n"
    )
    async with Attached(run) as session:
        await session.press("r")
        await session.look()
        assert "crashed: ModuleNotFoundError: No module named 'x'" in session.text("#happening")


def scene_program(code):
    words = [sys.executable, "-c", code]
    return lambda run: subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )


async def test_m_shows_where_the_scene_is_and_the_scene_ends_with_the_workbench(run, monkeypatch):
    program = f"import time; print({URL!r}, flush=True); time.sleep(60)"
    monkeypatch.setattr("ddenv.runs.programs.start_scene", scene_program(program))
    monkeypatch.setattr("getpass.getuser", lambda: "ada")
    monkeypatch.setattr("socket.gethostname", lambda: "lab")
    fake_moments.finished(run)
    async with Attached(run) as session:
        await session.press("m")
        await session.app.workers.wait_for_complete()
        await session.pilot.pause()
        dialog = session.app.screen
        assert isinstance(dialog, SceneDialog)
        words = dialog.query_one("#address", Static).render().plain
        assert URL in words
        assert "ssh -L 7012:127.0.0.1:7012 ada@lab" in words
        await session.press("c")
        assert session.app.clipboard == URL
        await session.press("s")
        assert session.app.clipboard == ssh_line(URL)
        await session.press("escape")
        await session.look()
        assert URL in session.text("#status")
        assert any(
            span.style.link == URL
            for span in session.screen.query_one("#status").render().spans
            if span.style
        )
        process = session.screen.scene._process
        await session.press("m", "x")
        assert process.poll() is not None
        assert not session.screen.scene.on
        await session.press("m")
        await session.app.workers.wait_for_complete()
        process = session.screen.scene._process
    assert process.poll() is not None


async def test_a_scene_that_does_not_start_is_told(run, monkeypatch):
    monkeypatch.setattr("ddenv.runs.programs.start_scene", scene_program("pass"))
    run.path.with_name("crates-1.ddenv.scene.log").write_text("no port is free\n")
    fake_moments.finished(run)
    async with Attached(run) as session:
        await session.press("m")
        await session.app.workers.wait_for_complete()
        await session.pilot.pause()
        assert "no port is free" in session.app.screen.query_one("#address", Static).render().plain
        await session.press("c")
        assert "no address yet" in str(session.app.screen.query_one(".dialog").border_subtitle)


async def test_a_damaged_run_is_told_and_nothing_breaks(run):
    fake_moments.mid_round(run).write("nonsense")
    async with Attached(run) as session:
        assert "unknown kind 'nonsense'" in session.text("#happening")
        await session.press("space", "r", "v", "p", "w", "u", "plus", "down")
        assert "cannot be read" in session.said()
        assert session.commands() == []


@pytest.mark.parametrize(
    "pose", ['"x"', "[1, 2]", "{}", "[null, 0, 0, 1, 0, 0, 0]", "[NaN, 0, 0, 1, 0, 0, 0]"]
)
def test_live_poses_that_make_no_sense_do_no_harm(run, pose):
    fake_moments.mid_round(run).hold()
    run.file._db.execute("UPDATE live SET pose = ?", (pose,))
    poll = Poll(run.path)
    snapshot = poll.look()
    poll.close()
    assert snapshot.live == ()


async def test_a_world_that_cannot_be_read_is_told_on_the_map(run):
    fake_moments.mid_round(run)
    run.file._db.execute("UPDATE document SET content = ? WHERE name = 'world'", (b"no xml",))
    async with Attached(run) as session:
        assert "crates.sdf" in session.screen.query_one(WorldMap).notice


def test_no_run_file_is_one_line(tmp_path):
    (tmp_path / "x.ddenv").write_text("no run")
    for name in ("x.ddenv", "missing.ddenv"):
        with pytest.raises(UserError):
            Workbench(tmp_path / name)


async def test_names_are_text_and_never_markup(runs):
    names = ["[bold]x[/]", "[link=file:///]y", "a" * 300, *[f"crate_{n}" for n in range(8)]]
    world = fake_run.world_text(names)
    run = fake_run.FakeRun(runs / "markup.ddenv", fake_run.scenario(name="[red]crates[/]"), world)
    run.created().baseline()
    run.pin(*run.elements[:2])
    run.write("finished", minimal=True, reason="no candidate showed f")
    async with Attached(run, (200, 60)) as session:
        assert "[bold]x[/]" in session.text("#happening")
        assert "[link=file:///]y" in session.text("#happening")
        assert "[red]crates[/]" in session.text("#header")
        shown = [
            strip.text
            for strip in map(session.screen.query_one("#models", Lines).render_line, range(11))
        ]
        assert any("[bold]x[/]" in line for line in shown)
        assert "[bold]x[/]" in session.screen.query_one("#decisions", Lines).render_line(0).text
        await session.press("w", *"[bo", "tab", "enter")
        assert "without [bold]x[/]" in session.said()
    run.close()


async def test_all_that_a_key_changes_is_drawn_at_once(run):
    fake_moments.uncertified(run)
    async with Attached(run) as session:
        drawn, display = [], session.app._display
        session.app._display = lambda screen, update: (
            drawn.append(update) or display(screen, update)
        )
        for key in ("down", "up", "tab", "shift+tab"):
            await asyncio.sleep(0.1)
            await session.pilot.pause()
            drawn.clear()
            await session.press(key)
            await asyncio.sleep(0.1)
            await session.pilot.pause()
            assert len([each for each in drawn if each is not None]) == 1, key


@pytest.mark.screens
async def test_the_footer_keeps_to_its_width(run):
    fake_moments.finished(run)
    async with Attached(run, (64, 18)) as session:
        for width in (64, 80, 120, 200):
            await session.pilot.resize_terminal(width, 36)
            await session.pilot.pause()
            footer = session.screen.query_one(KeyFooter)
            assert len(footer.render().plain) <= width
            # What comes next, and nothing that is left to be stepped, accepted or vetoed.
            shown = [key.words for key in footer.entries]
            assert shown[:3] == ["why", "world that passes", "export"] and shown[-2:] == [
                "quit",
                "help",
            ]
            assert not {*shown} & {"pause", "step", "accept", "reject", "veto"}
