"""Every key of the run screen, on runs whose engine is a fake."""

import subprocess
import sys
from types import SimpleNamespace

import fake_run
import pytest
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.schemas import explanation
from ddenv.workbench.app import Workbench
from ddenv.workbench.poll import Poll
from ddenv.workbench.screens.dialogs import Help, Method, Quit, SceneDialog, ssh_line
from ddenv.workbench.screens.run import RunScreen
from ddenv.workbench.screens.setup import SetupScreen
from ddenv.workbench.widgets.candidates import Candidates
from ddenv.workbench.widgets.map import WorldMap
from ddenv.workbench.widgets.schema import SchemaSelect

URL = "http://127.0.0.1:7012/static/"


class Session:
    """An app on a run, with what tests ask of it."""

    def __init__(self, app, pilot, run):
        self.app, self.pilot, self.run = app, pilot, run

    @property
    def screen(self) -> RunScreen:
        return next(screen for screen in self.app.screen_stack if isinstance(screen, RunScreen))

    async def press(self, *keys):
        for key in keys:
            await self.pilot.press(key)
        await self.pilot.pause()

    async def look(self):
        """Lets the screen see what was written, without waiting for its clock."""
        self.screen._poll._looked = -1e9
        self.screen._look()
        await self.pilot.pause()
        assert not self.screen.snapshot.error or "nonsense" in self.screen.snapshot.error

    def commands(self):
        return [(command.kind, command.data) for command in self.run.file.commands()]

    def notices(self):
        return [notice.message for notice in self.app._notifications]

    def text(self, selector):
        rendered = self.screen.query_one(selector).render()
        return getattr(rendered, "plain", str(rendered))


class Attached:
    def __init__(self, run, size=(120, 36)):
        self.run, self.size = run, size

    async def __aenter__(self):
        app = Workbench(self.run.path)
        self._context = app.run_test(size=self.size)
        pilot = await self._context.__aenter__()
        await app.workers.wait_for_complete()
        await pilot.pause()
        return Session(app, pilot, self.run)

    async def __aexit__(self, *error):
        await self._context.__aexit__(*error)


async def test_space_pauses_and_resumes(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("space")
        assert session.commands() == [("pause", {})]
        assert "… pause" in session.text("#status")
        run.write("paused")
        run.write("command_handled", command=1)
        await session.look()
        assert "‖ paused" in session.text("#status")
        assert "… pause" not in session.text("#status")
        await session.press("space")
        assert session.commands()[1:] == [("resume", {})]


async def test_s_steps_a_test_and_shift_s_a_round(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("s", "S")
        assert session.commands() == [("step", {"unit": "test"}), ("step", {"unit": "round"})]


@pytest.mark.parametrize(("key", "kind"), [("a", "accept"), ("x", "reject")])
async def test_a_and_x_decide_on_the_reduction_that_waits(run, key, kind):
    fake_run.waiting(run).hold()
    async with Attached(run) as session:
        assert "? waiting" in session.text("#status")
        await session.press("s")
        assert "a reduction waits" in session.notices()[-1]
        await session.press(key)
        assert session.commands() == [(kind, {"round": 1, "candidate": 0})]


async def test_a_does_nothing_when_nothing_waits(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("a", "x")
        assert session.commands() == []
        assert session.notices() == ["nothing waits for accept", "nothing waits for reject"]


async def test_v_vetoes_what_is_under_the_cursor(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("down", "down", "v")
        assert session.commands() == [("veto", {"round": 2, "candidate": 3})]
        run.write("vetoed", candidate=3, verdict="vetoed")
        await session.look()
        await session.press("v")
        assert "without B is vetoed already" in session.notices()[-1]
        await session.press("home", "v")
        assert len(session.commands()) == 1
        assert "part A is dissimilar already" in session.notices()[-1]


async def test_v_before_the_first_round(run):
    run.created().hold()
    async with Attached(run) as session:
        await session.press("v")
        assert session.notices() == ["there are no candidates yet"]


async def test_v_after_the_last_round(run):
    fake_run.confirming(run).hold()
    async with Attached(run) as session:
        await session.press("v")
        assert (session.notices(), session.commands()) == (["the rounds are over"], [])


async def test_t_switches_between_automatic_and_ask(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("t")
        run.write("accept_mode", mode="ask")
        run.write("command_handled", command=1)
        await session.look()
        assert "accept: ask" in session.text("#status")
        await session.press("t")
        assert session.commands() == [("accept_mode", {"mode": "ask"}), ("accept_mode", {"mode": "automatic"})]


async def test_the_cursor_follows_the_run_until_it_is_moved(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        table = session.screen.query_one(Candidates)
        assert table.cursor_row == 1
        assert session.screen.query_one(WorldMap).candidate.label == "without A"
        await session.press("down", "down", "down")
        assert session.screen.query_one(WorldMap).candidate.label == "part C"
        run.finish(11, "pass")
        run.finish(12, "similar", 0.1)
        await session.look()
        assert table.cursor_row == 4
        assert table.get_cell("1", "tests").plain == "2/4"
        run.start(3)
        await session.look()
        await session.press("escape")
        await session.look()
        assert table.cursor_row == 3


async def test_a_new_round_is_followed_again(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("end")
        run.start_round(4, run.elements[:4])
        await session.look()
        table = session.screen.query_one(Candidates)
        assert table.row_count == 8
        assert table.following


async def test_the_baseline_is_listed_run_by_run(run):
    run.created().hold()
    run.test(None, "failed")
    run.live((run.start(None, 1), 0.5))
    async with Attached(run) as session:
        table = session.screen.query_one(Candidates)
        assert [table.get_row_at(row)[-1].plain.strip() for row in range(2)] == ["◆ failed", "▶ 22.2 s"]
        assert "Baseline" in str(session.screen.query_one("#round").border_title)


async def test_zoom_and_fit(run):
    fake_run.mid_round(run)
    async with Attached(run) as session:
        world = session.screen.query_one(WorldMap)
        fitted = world._view
        await session.press("plus")
        assert world._view.scale == pytest.approx(fitted.scale / 1.25)
        world.focus()
        await session.press("minus", "right", "up")
        assert world._view.x > fitted.x
        assert world._view.y > fitted.y
        await session.press("0")
        assert world._view == fitted


async def test_question_mark_names_every_key(run):
    fake_run.mid_round(run)
    async with Attached(run) as session:
        await session.press("question_mark")
        assert isinstance(session.app.screen, Help)
        words = session.app.screen.query_one(Static).render().plain
        for key in ("space", "shift+s", "e", "escape", "ctrl+z", "+", "0"):
            assert f"{key}   " in words
        await session.press("escape")
        assert session.app.screen is session.screen


def test_every_binding_has_an_id_and_a_tooltip():
    bindings = [*RunScreen.BINDINGS, *WorldMap.BINDINGS, *Workbench.BINDINGS, *Quit.BINDINGS, *SceneDialog.BINDINGS]
    bindings += [*Method.BINDINGS, *SetupScreen.BINDINGS, *SchemaSelect.BINDINGS]
    assert all(binding.id and binding.tooltip for binding in bindings)
    assert len({binding.id for binding in bindings}) == len(bindings)


async def test_e_explains_the_method_of_the_run(runs):
    run = run_by("splitting", runs)
    fake_run.mid_round(run)
    async with Attached(run, (80, 24)) as session:
        await session.press("e")
        assert isinstance(session.app.screen, Method)
        static = session.app.screen.query_one(Static)
        words = static.render().plain
        for kind, name in (
            ("algorithm", "splitting"),
            ("partitioning", "model2model"),
            ("prioritization", "failure-proximal"),
        ):
            assert f"{kind} {name}" in words
            assert explanation(kind, name) in words
        assert words.count("Not used: splitting does not look at the partitioning.") == 1
        assert static.size.height > len(words) // 80
        await session.press("e")
        assert session.app.screen is session.screen
    run.close()


def run_by(algorithm, runs):
    data = fake_run.scenario()
    data["reduction"]["algorithm"] = algorithm
    return fake_run.FakeRun(runs / f"{algorithm}.ddenv", data)


HEADERS = {
    "ddenv": ("crates · model2model/failure-proximal ", "crates · model2model/fa… "),
    "ddmin": ("crates · ddmin ", "crates · ddmin "),
    "probdd": ("crates · probdd ", "crates · probdd "),
    "splitting": ("crates · splitting · failure-proximal ", "crates · splitting "),
    "theirs": ("crates · theirs · model2model/failure-proximal ", "crates · theirs "),
}


@pytest.mark.parametrize("algorithm", HEADERS)
async def test_the_header_names_what_the_run_is_reduced_by_as_it_fits(runs, algorithm):
    run = run_by(algorithm, runs)
    fake_run.mid_round(run)
    wide, narrow = HEADERS[algorithm]
    async with Attached(run) as session:
        assert wide in session.text("#header")
        assert ("n 3" in session.text("#header")) == (algorithm not in ("probdd", "splitting"))
    left_out = algorithm in ("probdd", "splitting")
    async with Attached(run, (74 if left_out else 80, 24)) as session:
        assert narrow in session.text("#header")
    run.close()


@pytest.mark.parametrize(
    ("key", "commands", "words"), [("s", [("stop", {})], "ddenv resume crates-1"), ("l", [], "ddenv open crates-1")]
)
async def test_q_asks_what_becomes_of_the_engine(run, key, commands, words):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("q")
        assert isinstance(session.app.screen, Quit)
        await session.press(key)
        assert session.commands() == commands
        assert words in session.app._exit_renderables[0].plain
        assert session.app.return_value == 0


async def test_q_can_be_cancelled(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("q", "escape")
        assert session.app.screen is session.screen
        await session.pilot.press("q")
        await session.pilot.click("#cancel")
        assert session.app.screen is session.screen
        assert not session.app._exit


async def test_q_without_an_engine_just_leaves(run):
    fake_run.finished(run)
    async with Attached(run) as session:
        await session.press("q")
        assert session.app._exit


@pytest.mark.parametrize("key", ["d", "ctrl+q"])
async def test_leaving_tells_how_to_come_back(run, key):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press(key)
        assert session.app._exit_renderables[0].plain == "The engine works on. Attach again with: ddenv open crates-1"
        assert session.commands() == []


async def test_r_starts_the_engine_of_a_run_that_has_none(run, monkeypatch):
    started = []

    def start_engine(path, jobs, **options):
        started.append((path, jobs, options))
        return SimpleNamespace(poll=lambda: None)

    monkeypatch.setattr("ddenv.launch.programs.start_engine", start_engine)
    fake_run.mid_round(run)
    async with Attached(run) as session:
        assert "engine is gone" in session.text("#status")
        await session.press("space")
        assert "r resumes" in session.notices()[-1]
        await session.press("r")
        assert started == [(run.path, 2, {"accept_mode": "automatic"})]
        await session.look()
        assert "engine starts" in session.text("#status")
        run.hold()
        await session.look()
        assert "▶ running" in session.text("#status")
        await session.press("r")
        assert "running already" in session.notices()[-1]


async def test_an_engine_that_ends_at_once_is_told_with_its_log(run, monkeypatch):
    monkeypatch.setattr("ddenv.launch.programs.start_engine", lambda *_, **__: SimpleNamespace(poll=lambda: 3))
    fake_run.mid_round(run)
    run.path.with_name("crates-1.ddenv.log").write_text(
        "ddenv engine: started\nModuleNotFoundError: No module named 'x'\n"
    )
    async with Attached(run) as session:
        await session.press("r")
        await session.look()
        assert "crashed: ModuleNotFoundError: No module named 'x'" in session.text("#happening")


async def test_a_finished_run_is_not_resumed(run):
    fake_run.finished(run)
    async with Attached(run) as session:
        await session.press("r", "space")
        assert session.notices() == ["the run is finished"] * 2
        assert "2 of 11 models" in session.text("#header")
        assert "82 % smaller" in session.text("#header")


def scene_program(code):
    words = [sys.executable, "-c", code]
    return lambda run: subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


async def test_m_shows_where_the_scene_is(run, monkeypatch):
    program = f"import time; print({URL!r}, flush=True); time.sleep(60)"
    monkeypatch.setattr("ddenv.launch.programs.start_scene", scene_program(program))
    monkeypatch.setattr("getpass.getuser", lambda: "ada")
    monkeypatch.setattr("socket.gethostname", lambda: "lab")
    fake_run.finished(run)
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
        assert any(span.style.link == URL for span in session.screen.query_one("#status").render().spans if span.style)
        process = session.screen.scene._process
        await session.press("m", "x")
        assert process.poll() is not None
        assert not session.screen.scene.on


async def test_a_scene_that_does_not_start_is_told(run, monkeypatch):
    monkeypatch.setattr("ddenv.launch.programs.start_scene", scene_program("pass"))
    run.path.with_name("crates-1.ddenv.scene.log").write_text("no port is free\n")
    fake_run.finished(run)
    async with Attached(run) as session:
        await session.press("m")
        await session.app.workers.wait_for_complete()
        await session.pilot.pause()
        assert "no port is free" in session.app.screen.query_one("#address", Static).render().plain
        await session.press("c")
        assert "no address yet" in session.notices()[-1]


async def test_the_scene_ends_with_the_workbench(run, monkeypatch):
    monkeypatch.setattr(
        "ddenv.launch.programs.start_scene", scene_program(f"import time; print({URL!r}, flush=True); time.sleep(60)")
    )
    fake_run.finished(run)
    async with Attached(run) as session:
        await session.press("m")
        await session.app.workers.wait_for_complete()
        process = session.screen.scene._process
    assert process.poll() is not None


async def test_g_shows_the_chart_where_there_is_little_room(run):
    fake_run.finished(run)
    async with Attached(run, (80, 24)) as session:
        assert not session.screen.query_one("#left").display
        await session.press("g")
        assert session.screen.query_one("#left").display
        assert not session.screen.query_one("#now").display


async def test_resizing_keeps_the_selection(run):
    fake_run.mid_round(run).hold()
    async with Attached(run) as session:
        await session.press("end")
        for size in ((80, 24), (50, 12), (120, 36)):
            await session.pilot.resize_terminal(*size)
            await session.pilot.pause()
            assert session.screen.query_one("#small").display == (size == (50, 12))
        assert session.screen.query_one(Candidates).cursor_row == 5
        assert len(session.screen.query_one(Candidates).columns) == 6


async def test_a_damaged_run_is_told_and_nothing_breaks(run):
    fake_run.mid_round(run).write("nonsense")
    async with Attached(run) as session:
        assert "unknown kind 'nonsense'" in session.text("#happening")
        await session.press("space", "r", "v", "plus", "down")


@pytest.mark.parametrize("pose", ['"x"', "[1, 2]", "{}", "[null, 0, 0, 1, 0, 0, 0]", "[NaN, 0, 0, 1, 0, 0, 0]"])
def test_live_poses_that_make_no_sense_do_no_harm(run, pose):
    fake_run.mid_round(run).hold()
    run.file._db.execute("UPDATE live SET pose = ?", (pose,))
    poll = Poll(run.path)
    snapshot = poll.look()
    poll.close()
    assert snapshot.live == ()


async def test_a_world_that_cannot_be_read_is_told_on_the_map(run):
    fake_run.mid_round(run)
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
    run.write("finished", minimal=True, reason="no candidate showed f")
    async with Attached(run) as session:
        assert "[bold]x[/]" in session.text("#happening")
        assert "[link=file:///]y" in session.text("#happening")
        assert "[red]crates[/]" in session.text("#header")
    run.close()
