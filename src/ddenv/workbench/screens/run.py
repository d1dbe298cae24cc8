"""The run screen: watches one run file and asks its engine for things."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual import work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.widgets import Footer, Static

from ddenv.errors import UserError
from ddenv.runfile.state import Candidate
from ddenv.workbench.place import place_of_run
from ddenv.workbench.poll import Poll, Snapshot
from ddenv.workbench.processes import Engine, Scene
from ddenv.workbench.screens.controls import Controls
from ddenv.workbench.screens.dialogs import Help, Method, Quit, SceneDialog
from ddenv.workbench.settings import settings
from ddenv.workbench.widgets.candidates import Candidates
from ddenv.workbench.widgets.chart import Chart
from ddenv.workbench.widgets.happening import Happening
from ddenv.workbench.widgets.map import Place, WorldMap, legend
from ddenv.workbench.widgets.status import Header, Status
from ddenv.workbench.wording import count, plain, shorten

# How often the run file is read, s.
PERIOD = 0.1


class RunScreen(Controls):
    """Attached to one run. Leaving it never touches the engine, unless the user asks to stop it."""

    CSS_PATH = "run.tcss"
    HORIZONTAL_BREAKPOINTS: ClassVar = [(0, "-thin"), (64, "-narrow"), (110, "-wide")]
    VERTICAL_BREAKPOINTS: ClassVar = [(0, "-flat"), (18, "-short"), (30, "-tall")]
    BINDINGS: ClassVar = [
        Binding("space", "pause", "pause", id="run.pause", tooltip="pause: no new test is started; again to resume"),
        Binding("s", "step('test')", "step", id="run.step", tooltip="run one test, then pause"),
        Binding(
            "S", "step('round')", "round", id="run.round", tooltip="run to the end of the round, then pause", show=False
        ),
        Binding("a", "decide('accept')", "accept", id="run.accept", tooltip="accept the reduction that waits"),
        Binding("x", "decide('reject')", "reject", id="run.reject", tooltip="reject it, and go on with the round"),
        Binding("v", "veto", "veto", id="run.veto", tooltip="leave out the candidate under the cursor"),
        Binding("t", "mode", "ask", id="run.mode", tooltip="accept reductions automatically, or ask before each one"),
        Binding("m", "scene", "scene", id="run.scene", tooltip="start the 3-D scene and show its address"),
        Binding("e", "method", "explain", id="run.method", tooltip="explain how this run is reduced", show=False),
        Binding("question_mark,f1", "help", "help", id="run.help", tooltip="show every key", key_display="?"),
        Binding("d", "detach", "detach", id="run.detach", tooltip="leave this screen; the engine goes on"),
        Binding("q", "quit", "quit", id="run.quit", tooltip="leave; asks what becomes of the engine"),
        Binding("r", "resume", "resume", id="run.resume", tooltip="start the engine again", show=False),
        Binding("g", "chart", "chart", id="run.chart", tooltip="small terminals: chart or explanation", show=False),
        Binding(
            "escape", "follow", "follow", id="run.follow", tooltip="cursor and map follow the run again", show=False
        ),
        Binding(
            "plus,equals_sign",
            "zoom(1.25)",
            "closer",
            id="run.closer",
            tooltip="map: closer",
            show=False,
            key_display="+",
        ),
        Binding(
            "minus", "zoom(0.8)", "farther", id="run.farther", tooltip="map: farther away", show=False, key_display="-"
        ),
        Binding("0", "fit", "fit", id="run.fit", tooltip="map: show all that matters", show=False),
    ]

    def __init__(self, run: Path, engine: Engine | None = None) -> None:
        """`engine` is the one that was just started on this run. Raises UserError for what is no run file."""
        super().__init__()
        self.run = run
        self.engine = engine or Engine(run)
        self.scene = Scene(run)
        self.snapshot = Snapshot()
        self._poll = Poll(run, starting=lambda: self.engine.starting)
        self.file = self._poll.file
        self._shown: Candidate | None = None

    def compose(self) -> ComposeResult:
        yield Header(id="header")
        with Horizontal(id="top"):
            with Vertical(id="world", classes="panel") as panel:
                panel.border_title = "World"
                yield WorldMap(id="map")
                yield Static("", id="legend", markup=False)
            with Vertical(id="round", classes="panel") as panel:
                panel.border_title = "Round"
                yield Candidates(id="candidates")
        with Horizontal(id="bottom"):
            with Vertical(id="left", classes="panel") as panel:
                panel.border_title = "Models left by test"
                yield Chart(id="chart")
            with Vertical(id="now", classes="panel") as panel:
                panel.border_title = "What is happening"
                panel.border_subtitle = "e explains the method"
                yield Happening(id="happening")
        yield Status(id="status")
        yield Footer(compact=True, show_command_palette=False)
        yield Static("Please make the terminal larger: at least 64 x 18.", id="small", markup=False)

    def on_mount(self) -> None:
        self.query_one(Candidates).focus()
        self._look()
        self.set_interval(PERIOD, self._look)
        self._read_world()

    def on_unmount(self) -> None:
        self.scene.stop()
        self._poll.close()

    def on_resize(self) -> None:
        self.query_one(Candidates).set_narrow(self.size.width < 110)
        self.call_after_refresh(self._describe_map)

    # The world is read beside the screen, since it can be large.

    @work(thread=True, group="world", exclusive=True)
    def _read_world(self) -> None:
        try:
            place, notice = place_of_run(self.run), ""
        except UserError as error:
            place, notice = Place(), str(error)
        self.app.call_from_thread(self._placed, place, notice)

    def _placed(self, place: Place, notice: str) -> None:
        if self.is_attached:
            self.query_one(WorldMap).set_place(place, notice)

    # From the run file to the screen.

    def _look(self) -> None:
        snapshot = self._poll.look()
        if snapshot is not None:
            self.snapshot = snapshot
            if snapshot.engine == "alive":
                self.engine.seen_at_work()
            self.query_one(Candidates).show(snapshot)
            self.query_one(Chart).show(snapshot)
            self.query_one(Header).show(snapshot)
            self._show_map()
            self._tell_round()
            self.app.title = f"ddenv {shorten(plain(snapshot.state.scenario.get('name', '')), 60)}"
        self.query_one(Happening).show(self.snapshot, "" if self.snapshot.engine == "alive" else self.engine.trouble)
        self.show_status()

    def show_status(self) -> None:
        self.query_one(Status).show(self.snapshot, self.scene.url if self.scene.on else "", self.waiting_for())

    def _show_map(self) -> None:
        self._shown = self.query_one(Candidates).chosen or self.snapshot.focus
        self.query_one(WorldMap).show(self.snapshot, self._shown)
        self._describe_map()

    def _describe_map(self) -> None:
        static = self.query_one("#legend", Static)
        width = static.size.width
        if self._shown is not None:
            words = f"{self._shown.label}: {count(self._shown.size, 'model')}"
            text = Text(words, "bold", no_wrap=True).append(
                "  others in small letters  " if width > 44 else "  ", "dim"
            )
            text.append_text(legend(width - text.cell_len))
        else:
            text = legend(width)
        if text != self._legend:
            self._legend = text
            static.update(text)

    _legend: Text | None = None

    def _tell_round(self) -> None:
        state = self.snapshot.state
        panel = self.query_one("#round")
        if state.confirming and not state.ended:
            panel.border_title = "Full runs of what is left"
            panel.border_subtitle = f"{sum(test.is_finished for test in state.confirm_tests)} made"
            return
        panel.border_title = "Baseline: the whole world" if state.round is None else f"Round {state.round.number}"
        judged = (
            ""
            if state.round is None
            else f"{sum(bool(c.verdict) for c in state.round.candidates)} of {len(state.round.candidates)} judged"
        )
        panel.border_subtitle = judged

    def on_candidates_chosen(self) -> None:
        self._show_map()

    # Things that concern this screen alone.

    def action_follow(self) -> None:
        table = self.query_one(Candidates)
        table.follow()
        table.show(self.snapshot)

    def action_zoom(self, factor: float) -> None:
        self.query_one(WorldMap).zoom(factor)

    def action_fit(self) -> None:
        self.query_one(WorldMap).fit()

    def action_chart(self) -> None:
        if self.size.width >= 110:
            self.refuse("chart and explanation are both on the screen")
        else:
            self.toggle_class("-chart")

    def action_scene(self) -> None:
        dialog = SceneDialog(self.scene)
        if not self.scene.on:
            self.scene.start()
            self._await_scene(dialog)
        self.app.push_screen(dialog)

    @work(thread=True, group="scene")
    def _await_scene(self, dialog: SceneDialog) -> None:
        self.scene.wait()
        self.app.call_from_thread(self._scene_answered, dialog)

    def _scene_answered(self, dialog: SceneDialog) -> None:
        if dialog.is_attached:
            dialog.refresh_address()
        elif self.scene.trouble:
            self.notify(self.scene.trouble, severity="error", markup=False)

    def action_method(self) -> None:
        options = settings(self.snapshot.state)
        self.app.push_screen(Method(options.algorithm, options.pair))

    def action_help(self) -> None:
        keys = [(self._key(binding), binding.tooltip) for binding in self.BINDINGS]
        more = [
            ("↑ ↓", "choose a candidate: the map shows its models"),
            ("tab", "between table and map; on the map the arrow keys move it"),
            ("ctrl+p", "commands: themes, screenshot"),
            ("ctrl+z", "suspend; fg comes back"),
        ]
        self.app.push_screen(Help(keys + more))

    @staticmethod
    def _key(binding: Binding) -> str:
        if binding.key == "S":
            return "shift+s"
        return binding.key_display or binding.key

    def action_detach(self) -> None:
        """Leaves the workbench and says how to come back."""
        works = "The engine works on" if self.snapshot.engine != "absent" else "No engine is running"
        self.app.exit(0, message=Text(f"{works}. Attach again with: ddenv open {attach_name(self.run)}"))

    def action_quit(self) -> None:
        if self.snapshot.engine == "absent":
            self.app.exit(0)
        else:
            self.app.push_screen(Quit(), self._quit)

    def _quit(self, answer: str | None) -> None:
        if answer == "leave":
            self.action_detach()
        elif answer == "stop":
            self.send("stop")
            self.app.exit(0, message=Text(f"The engine stops. Go on later with: ddenv resume {attach_name(self.run)}"))


def attach_name(run: Path) -> str:
    """What to type for this run: its name if it lies in the runs folder, else its path, quoted for a shell."""
    import shlex

    from ddenv.launch.runs import find_run

    name = run.stem if find_run(run.stem) == run else str(run)
    return shlex.quote(plain(name))
