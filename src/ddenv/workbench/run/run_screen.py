"""The run screen: watches one run file and asks its engine for things."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from typing import ClassVar

from textual import on, work
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical
from textual.reactive import Reactive
from textual.widget import Widget
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.runfile.state import Candidate, RunState
from ddenv.workbench.background import tell
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.map.map_words import MapLines
from ddenv.workbench.map.place import Place, place_of_run
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run import models_left
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.run.happening import Happening
from ddenv.workbench.run.leaving import Leaving
from ddenv.workbench.run.log import Log, decision_line
from ddenv.workbench.run.models_chart import Chart
from ddenv.workbench.run.poll import Poll, Snapshot
from ddenv.workbench.run.processes import Engine, Scene
from ddenv.workbench.run.run_keys import FIRST, KEYS, LOOKING, SHOWN, footer_words
from ddenv.workbench.run.status import Header, Status
from ddenv.workbench.widgets.lines import Lines
from ddenv.workbench.widgets.panes import Panes
from ddenv.workbench.wording import plain, shorten

# How often the run file is read, s.
PERIOD = 0.1
# While a long run is caught up with, the next look comes after so long, and so often one of them is shown, s.
AT_ONCE, CATCHING_UP = 0.002, 0.5
# So long the map stays at least with a candidate, s.
CALM = 4.0
# So long it takes until all that has the focus, or had it, asked to be drawn, s.
TOGETHER = 0.004
SMALLEST = (64, 18)
# The panes and their words, in the order of the keys 1 to 5.
PANES = {"map": "map", "round": "round", "chart": "chart", "now": "what is happening", "log": "log"}
# Where map, table and chart stand side by side, and where models and decisions do too.
WIDE, HUGE = 110, 170


class RunScreen(Leaving):
    """Attached to one run. Leaving it never touches the engine, unless the user asks to stop it."""

    CSS_PATH: ClassVar = ["run.tcss"]
    HORIZONTAL_BREAKPOINTS = [(0, "-thin"), (SMALLEST[0], "-narrow"), (WIDE, "-wide"), (HUGE, "-huge")]
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (SMALLEST[1], "-low"), (23, "-short"), (30, "-tall")]
    BINDINGS: ClassVar = KEYS
    AUTO_FOCUS = "#candidates"
    # What the focus changes is drawn again by the widgets themselves: the whole screen need not be.
    focused: Reactive[Widget | None] = Reactive(None, repaint=False)

    def __init__(self, run: Path, engine: Engine | None = None, watch: bool = False) -> None:
        """`engine` is the one that was just started on this run. With `watch` nothing is ever sent.

        Raises UserError for what is no run file.
        """
        super().__init__()
        self.run, self.watch = run, watch
        self.engine = engine or Engine(run)
        self.scene = Scene(run)
        self.snapshot = Snapshot()
        self.log_lines = Log()
        self.poll = Poll(run, starting=lambda: self.engine.starting, watch=watch, told=self.log_lines.add)
        self._pane = "map"
        self._modelled: tuple = ()
        self._titled: tuple = ()
        self._following: tuple[tuple[int, int] | None, int, float] = (None, 0, 0.0)
        self._stale, self._coming = False, False
        self._shown = time.monotonic()

    def compose(self) -> ComposeResult:
        yield Header(id="header")
        yield Panes({name: f"{key} {words}" for key, (name, words) in enumerate(PANES.items(), 1)}, id="run-panes")
        with Horizontal(id="run-body"):
            with Vertical(id="run-main"):
                with Horizontal(id="top"):
                    with _panel("world", "World"):
                        yield WorldMap(id="map")
                        yield MapLines(id="map-lines")
                    with _panel("round", "Round"):
                        yield Candidates(id="candidates")
                with Horizontal(id="bottom"):
                    with _panel("left", "Models left by test"):
                        yield Chart(id="chart")
                    with _panel("log-panel", "Log"):
                        yield Lines(self.log_lines.line, nothing="nothing happened yet", tail=True, id="log")
                    with _panel("now", "What is happening") as panel:
                        panel.border_subtitle = "e explains the method"
                        yield Happening(id="happening")
            with Vertical(id="run-more"):
                with _panel("models-panel", "Models left"):
                    yield Static("", id="models-heading", markup=False)
                    yield Lines(models_left.line, nothing="none", id="models")
                with _panel("decisions-panel", "What you decided"):
                    yield Lines(decision_line, nothing="nothing was decided by hand yet", tail=True, id="decisions")
        if self.watch:
            yield Static("watching only: no key changes anything in this run", id="watching", markup=False)
        yield Status(id="status")
        yield KeyFooter(LOOKING, LOOKING) if self.watch else KeyFooter(SHOWN, FIRST)
        yield Static("", id="small", markup=False)

    def on_mount(self) -> None:
        self.add_class(f"-pane-{self._pane}")
        self.query_one(Panes).mark(self._pane)
        self._look()
        self.set_interval(PERIOD, self._look)
        # What it needs takes long to load: the first paint comes before.
        self.call_after_refresh(self._read_world)

    def on_unmount(self) -> None:
        self.scene.stop()
        self.poll.close()

    def on_resize(self) -> None:
        width, height = self.size
        words = f"ddenv needs {SMALLEST[0]} x {SMALLEST[1]}; this terminal has {width} x {height}"
        self.query_one("#small", Static).update(words)
        self.query_one(Candidates).set_narrow(width < WIDE and self._pane != "round")
        self.call_after_refresh(self._show_models)

    # The world is read beside the screen, since it can be large.

    @work(thread=True, group="world", exclusive=True)
    def _read_world(self) -> None:
        try:
            place, notice = place_of_run(self.run), ""
        except UserError as error:
            place, notice = Place(), str(error)
        tell(self, self._placed, place, notice)

    def _placed(self, place: Place, notice: str) -> None:
        self.query_one(WorldMap).set_place(place, notice)
        self._show_models()

    def set_focus(self, widget: Widget | None, scroll_visible: bool = True, from_app_focus: bool = False) -> None:
        self.run_worker(self._draw_together(), group="focus")
        super().set_focus(widget, scroll_visible, from_app_focus)

    async def _draw_together(self) -> None:
        """What is in the panels would be drawn a frame before their borders: the focus moves in one."""
        with self.app.batch_update():
            await asyncio.sleep(TOGETHER)
        self.check_idle()

    # From the run file to the screen.

    def _look(self) -> None:
        before, caught_up = self.snapshot, not self.poll.catching_up
        snapshot = self.poll.look()
        if snapshot is not None:
            self.snapshot, self._stale = snapshot, True
            if snapshot.engine == "alive":
                self.engine.seen_at_work()
            self.told_refusal(before)
            if caught_up:
                self.tell_trials(before)
        if self.poll.catching_up and not self._coming:
            # Soon, but after the keys that were pressed meanwhile.
            self._coming = True
            self.set_timer(AT_ONCE, self._look_on)
        if not self.poll.catching_up or time.monotonic() - self._shown >= CATCHING_UP:
            self._show_look()

    def _look_on(self) -> None:
        self._coming = False
        self._look()

    def _show_look(self) -> None:
        """Shows the last look; of those that only catch up, not each one is."""
        if self._stale:
            self._stale, self._shown = False, time.monotonic()
            self._show(self.snapshot)
            self.go_on()
        self.query_one(Happening).show(self.snapshot, "" if self.snapshot.engine == "alive" else self.engine.trouble)
        self.show_status()

    def _show(self, snapshot: Snapshot) -> None:
        state = snapshot.state
        self.query_one(Candidates).show(snapshot)
        self.query_one(Chart).show(snapshot)
        self.query_one(Header).show(snapshot)
        self._show_map()
        self._tell_round()
        self._show_models()
        if self.log_lines.changed():
            self.query_one("#log", Lines).show(self.log_lines.entries)
        if self.query_one("#decisions", Lines).items != state.decisions:
            self.query_one("#decisions", Lines).show(state.decisions)
        self._tell_keys()
        self.app.title = f"ddenv {shorten(plain(state.scenario.get('name', '')), 60)}"

    def _tell_keys(self) -> None:
        if self.watch:
            return
        table, footer = self.query_one(Candidates), self.query_one(KeyFooter)
        for id, words in footer_words(self.snapshot, table.under_cursor, table.following).items():
            footer.say(id, words)

    def show_status(self) -> None:
        self.query_one(Status).show(self.snapshot, self.scene.url if self.scene.on else "", self.waiting_for())

    def _show_map(self) -> None:
        self.query_one(WorldMap).show(self.snapshot, self.query_one(Candidates).chosen or self._followed())
        self.show_legend()

    def _followed(self) -> Candidate | None:
        """The candidate that all is about. Where they take turns fast the map stays with one for a while, to be looked at."""
        state, focus, moment = self.snapshot.state, self.snapshot.focus, time.monotonic()
        round, index, until = self._following
        now = (state.node, state.round.number) if state.round and not state.round.done else None
        waits = state.waiting_candidate is not None
        if now is not None and now == round and moment < until and not waits and self.snapshot.engine == "alive":
            return state.round.candidates[index]
        if focus is not None and (now, focus.index) != (round, index):
            self._following = now, focus.index, moment + CALM
        return focus

    def show_legend(self) -> None:
        """The lines below the map."""
        world = self.query_one(WorldMap)
        self.query_one(MapLines).show(len(world.selection), world.candidate, world.legend)

    def _show_models(self) -> None:
        """The list of models; where it is not in sight it is not made."""
        state, prints = self.snapshot.state, self.query_one(WorldMap).place.prints
        split = None if state.round is None or state.round.done else state.round.split
        made_of = (state.environment, split, state.pinned, state.evidence_test, state.baseline, prints)
        lines = self.query_one("#models", Lines)
        same = bool(self._modelled) and all(a is b for a, b in zip(made_of, self._modelled, strict=True))
        if same or not lines.size.width:
            return
        self._modelled = made_of
        self.query_one("#models-heading", Static).update(models_left.heading(lines.size.width))
        lines.show(models_left.rows(state, prints))

    def _tell_round(self) -> None:
        state = self.snapshot.state
        panel = self.query_one("#round")
        if state.confirming and not state.ended:
            title = "Full runs of what is left", f"{sum(test.is_finished for test in state.confirm_tests)} made"
        else:
            title = _round_words(state), _judged_words(state)
        # Even the same words would have the panel drawn again, with all that is in it.
        if title != self._titled:
            self._titled = panel.border_title, panel.border_subtitle = title

    @on(Candidates.Chosen)
    def _row_chosen(self) -> None:
        self._show_map()
        self._tell_keys()

    @on(WorldMap.SelectionChanged)
    def _selected(self) -> None:
        self.show_legend()

    @on(Lines.Clicked, "#models")
    def _model_clicked(self, event: Lines.Clicked) -> None:
        self.find(event.item.name)

    # Panes and the map.

    @on(Panes.Chosen)
    def _pane_clicked(self, event: Panes.Chosen) -> None:
        self.show_pane(event.pane)

    def action_pane(self, pane: str) -> None:
        self.show_pane(pane)

    def show_pane(self, pane: str) -> None:
        """Brings a pane into sight, and the keys to it."""
        if pane != self._pane:
            self.remove_class(f"-pane-{self._pane}")
            self.add_class(f"-pane-{pane}")
        self._pane = pane
        self.query_one(Panes).mark(pane)
        self.query_one(Candidates).set_narrow(self.size.width < WIDE and pane != "round")
        focus = {"map": "#map", "log": "#log"}.get(pane, "#candidates")
        self.query_one(focus).focus()

    def action_next_pane(self) -> None:
        names = list(PANES)
        self.show_pane(names[(names.index(self._pane) + 1) % len(names)])

    def action_follow(self) -> None:
        self.query_one(WorldMap).clear_selection()
        table = self.query_one(Candidates)
        table.follow()
        table.show(self.snapshot)

    def action_zoom(self, factor: float) -> None:
        self.query_one(WorldMap).zoom(factor)

    def action_fit(self) -> None:
        self.query_one(WorldMap).fit()


def _round_words(state: RunState) -> str:
    if state.round is None:
        return "Baseline: the whole world"
    return f"Round {state.round.number}{', over' if state.round.done and not state.ended else ''}"


def _judged_words(state: RunState) -> str:
    if state.round is None:
        return ""
    candidates = state.round.candidates
    vetoed = sum(each.verdict == "vetoed" for each in candidates)
    judged = sum(bool(each.verdict) for each in candidates) - vetoed
    return f"{judged} of {len(candidates)} judged{f', {vetoed} vetoed' if vetoed else ''}"


def _panel(id: str, title: str) -> Vertical:
    panel = Vertical(id=id, classes="panel")
    panel.border_title = title
    return panel
