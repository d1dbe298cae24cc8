"""Names, files and hands that mean no good: whatever they are, the screen stands, and the terminal
is not steered.
"""

import html
import io
import json
import os
import random
import sqlite3
import sys
import unicodedata
from types import SimpleNamespace

import fake_moments
import fake_run
import pytest
from attached import Attached
from rich.cells import cell_len

from ddenv.errors import UserError
from ddenv.runfile.fold import apply
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile, recorded
from ddenv.workbench.export import write
from ddenv.workbench.launch import check_terminal
from ddenv.workbench.run.run_screen import RunScreen
from ddenv.workbench.runs.recent_runs import RunsFolder
from ddenv.workbench.runs.runs_table import moment
from ddenv.workbench.setup.files import WorldTree, path_to_open, scenario_path
from tests.tiers import slow

NAMES = [
    "[bold]loud[/bold]",
    "[@click=app.quit]go[/]",
    "over\u202eride\u2066d",
    "escape\u009b31m",
    "字" * 40,
    "👩‍👩‍👧 family",
    "e\u0301\u0302" * 20,
    "n" * 300,
    "Crate",
    "crate",
    "שלום",
    "two\u2028lines\u200b",
]
STEERING = {"Cc", "Cf", "Cs", "Zl", "Zp"}


def steering(app):
    """The lines of the screen that would steer a terminal, or are not as wide as it."""
    lines = [
        "".join(segment.text for segment in strip)
        for strip in app.screen._compositor.render_strips()
    ]
    return [
        line
        for line in lines
        if cell_len(line) != app.size.width
        or any(unicodedata.category(char) in STEERING for char in line)
    ]


@pytest.mark.parametrize("size", slow(pytest.mark.screens, [(120, 36), (80, 24)], but=[(80, 24)]))
@pytest.mark.screens
async def test_no_name_steers_the_terminal(runs, size):
    data = fake_run.scenario(name="evil \x1b]0;title\x07 [bold]\u202e")
    data["description"] = "\x1b[31m\u202e\n[red]"
    run = fake_run.FakeRun(
        runs / "ev[il]\u202e-1.ddenv",
        data,
        fake_run.world_text([html.escape(name) for name in NAMES]),
    )
    fake_moments.guided(run)
    run.hold()
    async with Attached(run, size) as session:
        session.screen.asking._mine = {1: "veto"}
        run.write("command_refused", command=1, why="no \x1b]0;title\x07\u202e")
        await session.look()
        assert "not done" in session.said()
        for key in ("2", "4", "5", "h", "P", "W", "slash", "E", "R", "y", "question_mark"):
            await session.press(key)
            await session.pilot.pause()
            assert steering(session.app) == []
            while not isinstance(session.app.screen, RunScreen):
                session.app.pop_screen()
                await session.pilot.pause()
        assert not any(unicodedata.category(char) in STEERING for char in session.app.title)
    run.close()


def test_files_are_named_without_what_steers():
    assert WorldTree.process_label(None, "a\x1b]0;x\x07\u202e.sdf").plain == "a�]0;x��.sdf"


def test_a_run_is_made_once_and_rounds_go_on(run):
    fake_moments.waiting(run)
    run.start_round(2)
    state = RunState()
    for event in run.file.events():
        state = apply(state, event)
    assert state.waiting_candidate is None
    made = {"scenario": run.data, "elements": ["other"]}
    again = {
        "round": 2,
        "n_partitions": 2,
        "environment": 0,
        "partitions": [[0], [1]],
        "candidates": [],
    }
    for kind, data in (
        ("created", made),
        ("round_started", again),
        ("accept_mode_changed", {"mode": "\x1b"}),
    ):
        with pytest.raises(UserError, match=rf"event 99 \({kind}\)"):
            apply(state, recorded(99, 0.0, kind, json.dumps(data)))


@pytest.mark.parametrize("time", ["9e999", "-5", "1e15"])
def test_times_that_no_calendar_has_are_damage(run, time):
    run.created().close()
    with sqlite3.connect(run.path) as database:
        database.execute(f"UPDATE event SET time = {time} WHERE id = 2")
    with RunFile(run.path) as file, pytest.raises(UserError, match="is not a date"):
        file.events()
    assert RunsFolder(run.path.parent).look()[0].trouble
    assert moment(1e15) == "?"


def test_a_locked_run_is_read_again(run):
    fake_moments.finished(run).close()
    folder = RunsFolder(run.path.parent)
    other = sqlite3.connect(run.path, isolation_level=None)
    other.execute("PRAGMA locking_mode = EXCLUSIVE")
    other.execute("PRAGMA journal_mode = DELETE")
    other.execute("BEGIN EXCLUSIVE")
    before = folder.look()[0]
    other.execute("ROLLBACK")
    other.close()
    assert before.trouble == "" or "lock" in before.trouble
    assert folder.look()[0].status == "finished"


NAMED = (
    "up down left right enter space tab shift+tab escape home end pageup pagedown backspace plus "
    "minus slash"
)
NAMED += " shift+up question_mark left_square_bracket right_square_bracket f1 ctrl+p"
KEYS = [*NAMED.split(), *"abcefghijklnopstuvwxyzACEGLNPSW0123456"]
SIZES = [(20, 5), (1, 1), (64, 18), (80, 24), (120, 36), (300, 100)]


@pytest.mark.fuzz
@pytest.mark.parametrize("watch", [True, False], ids=["watch", "guide"])
async def test_keys_and_clicks_at_random_break_nothing(run, monkeypatch, started, watch):
    monkeypatch.setattr("ddenv.workbench.shared.processes.Scene.start", lambda self: None)
    fake_moments.guided(run)
    run.hold()
    chance = random.Random(20 + watch)
    async with Attached(run, watch=watch) as session:
        app, pilot = session.app, session.pilot
        for step in range(45):
            if step % 15 == 14:
                await pilot.resize_terminal(*chance.choice(SIZES))
            if step % 10 == 9:
                width, height = app.size
                await pilot.click(offset=(chance.randrange(width), chance.randrange(height)))
            if step % 12 == 11:
                run.write(chance.choice(["paused", "resumed"]))
            await pilot.press(chance.choice(KEYS))
            assert app.is_running
        await pilot.resize_terminal(120, 36)
        await pilot.press(*["escape"] * 8)
        assert isinstance(app.screen, RunScreen)
        assert started == []
        assert not watch or session.commands() == []


async def test_an_engine_that_hangs_is_told(run, monkeypatch):
    fake_moments.mid_round(run)
    run.hold()
    async with Attached(run) as session:
        await session.press("space")
        assert "no answer" not in session.screen.asking.waiting_for()
        monkeypatch.setattr("ddenv.workbench.run.command_sender.PATIENCE", 0)
        assert session.screen.asking.waiting_for().startswith("pause: no answer for")


@pytest.mark.parametrize("text", ["~nobody-of-this-name/x", "x" * 5000, "a\0b", "\ud800"])
def test_paths_that_cannot_be(text):
    with pytest.raises(UserError, match="no such file"):
        path_to_open(text)
    for name in (f"{text}/x", ".", "..", "~nobody-of-this-name", " "):
        with pytest.raises(UserError):
            scenario_path(name)


@pytest.mark.parametrize(
    ("terminal", "encoding", "told"),
    [
        ("xterm", "utf-8", ""),
        ("dumb", "utf-8", "TERM=dumb"),
        ("xterm", "iso8859-1", "LANG"),
        ("", "", "needs a terminal"),
    ],
)
def test_what_is_no_terminal_for_a_screen_is_told(monkeypatch, terminal, encoding, told):
    stream = SimpleNamespace(isatty=lambda: bool(encoding), encoding=encoding)
    monkeypatch.setattr(sys, "__stdin__", stream)
    monkeypatch.setattr(sys, "__stderr__", stream)
    monkeypatch.setenv("TERM", terminal)
    monkeypatch.delenv("TEXTUAL_DRIVER", raising=False)
    if not told:
        check_terminal()
        return
    with pytest.raises(UserError, match=told):
        check_terminal()
    monkeypatch.setenv("TEXTUAL_DRIVER", "textual.drivers.web_driver:WebDriver")
    check_terminal()


def test_stderr_may_be_a_file_if_the_output_is_a_terminal(monkeypatch, tmp_path):
    leader, terminal = os.openpty()
    monkeypatch.delenv("TEXTUAL_DRIVER", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    raw = os.fdopen(terminal, "w+b", 0)
    with (
        io.TextIOWrapper(raw, encoding="utf-8") as shown,
        (tmp_path / "log").open("w", encoding="utf-8") as errors,
    ):
        monkeypatch.setattr(sys, "__stdin__", shown)
        monkeypatch.setattr(sys, "__stdout__", shown)
        monkeypatch.setattr(sys, "__stderr__", errors)
        check_terminal()
        # The screen is drawn there.
        assert errors.isatty()
    os.close(leader)


@pytest.mark.parametrize("key", slow(pytest.mark.screens, ["o", "y", "l", "h"], but=["h"]))
@pytest.mark.screens
async def test_dialogs_survive_terminals_without_room(run, key):
    fake_moments.guided(run)
    async with Attached(run) as session:
        await session.press(key)
        for size in ((1, 1), (4, 4), (9, 2)):
            await session.pilot.resize_terminal(*size)
            await session.press("down")
        assert session.app.is_running and not isinstance(session.app.screen, RunScreen)


def test_models_that_the_world_does_not_have_are_told(runs, tmp_path):
    run = fake_run.FakeRun(runs / "crates-1.ddenv")
    run.elements[0] = "nobody"
    run.created().baseline()
    run.start_round(2)
    run.reduce(1, run.elements[6:], run.similar(1))
    run.close()
    with pytest.raises(UserError, match="damaged run file"):
        list(write(run.path, {"world": tmp_path / "world.sdf"}, lambda: False))
