"""The run screen: watches one run file and asks its engine for things."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical
from textual.reactive import Reactive
from textual.screen import Screen
from textual.widget import Widget
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.guiding.key_offers import KeyOffer, Pointed, offer
from ddenv.runfile.position import Step
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import Candidate, RunState, Trial
from ddenv.runfile.tested import Wanted
from ddenv.text import Names, plain
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.map.map_words import MapLines
from ddenv.workbench.map.place import Place, read_world
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.candidate_rows import round_title
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.run.command_sender import CommandSender
from ddenv.workbench.run.explanation_panel import Happening
from ddenv.workbench.run.models import Chart, ModelsLeft
from ddenv.workbench.run.run_keys import (
    BROWSING,
    ENDED,
    FIRST,
    GUIDING,
    KEYS,
    LOOKING,
    ON_MAP,
    TITLES,
)
from ddenv.workbench.run.snapshot import NOT_NOW, Browsing
from ddenv.workbench.run.status import Header, Status, title, worth_a_look
from ddenv.workbench.shared.log import NOTHING_DECIDED, Log, as_it_is, decision_lines
from ddenv.workbench.shared.messages import Attention
from ddenv.workbench.shared.poll import Poll
from ddenv.workbench.shared.processes import Engine, Scene
from ddenv.workbench.widgets.lines import Lines
from ddenv.workbench.widgets.panes import Panes

if TYPE_CHECKING:
    from ddenv.workbench.run.run_dialogs import Dialogs

SMALLEST = (64, 18)
WATCHING = "watching only: no key changes anything"
# The panes and their words, in the order of the keys 1 to 5.
PANES = {"map": "map", "round": "round", "chart": "chart", "now": "what is happening", "log": "log"}
# How often the run file is read, s. While it catches up with a long run: the time to the next look,
# and between two updates.
PERIOD = 0.1
AT_ONCE = 0.002
CATCHING_UP = 0.5
# The map stays with a candidate for at least this time, s.
CALM = 4.0
# Where map, table and chart stand side by side, and where models and decisions do too.
WIDE = 110
HUGE = 170


class RunScreen(Screen[None]):
    """Attached to one run. Leaving it never touches the engine, unless the user asks to stop it."""

    CSS_PATH = "run.tcss"
    HORIZONTAL_BREAKPOINTS = [
        (0, "-thin"),
        (SMALLEST[0], "-narrow"),
        (WIDE, "-wide"),
        (HUGE, "-huge"),
    ]
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (SMALLEST[1], "-low"), (23, "-short"), (30, "-tall")]
    BINDINGS: ClassVar = KEYS
    AUTO_FOCUS = "#candidates"
    # What the focus changes is drawn again by the widgets themselves: the whole screen need not be.
    focused: Reactive[Widget | None] = Reactive(None, repaint=False)

    def __init__(
        self, run: Path, engine: Engine | None = None, watch: bool = False, classes: str = ""
    ) -> None:
        """`engine` is the one that was just started on this run. With `watch` nothing is ever sent.
        `classes` fit the size.

        Raises UserError for a file that is no run file.
        """
        super().__init__(classes=f"-pane-map {classes}")
        self.run = run
        self.engine = engine or Engine(run)
        self.scene = Scene(run)
        self._log = Log()
        self.poll = Poll(
            run, starting=lambda: self.engine.starting, watch=watch, on_event=self._note
        )
        self.browsing = Browsing(self.poll)
        self.table = Candidates(self._row_chosen, id="candidates")
        self.world = WorldMap(id="map")
        self._legend = MapLines(id="map-lines")
        self._footer = KeyFooter(LOOKING if watch else FIRST, self._keys_here)
        self.asking = CommandSender(self, self.poll, self.engine, self._show_asked)
        self._pane = "map"
        # Whether something is not shown yet, whether the next look comes soon, and when the run was
        # shown last.
        self._stale = False
        self._coming = False
        self._shown_at = time.monotonic()
        # The round and the candidate that the map stays with, and until when.
        self._stays: tuple[tuple[int, int] | None, int, float] = (None, 0, 0.0)

    @cached_property
    def opening(self) -> Dialogs:
        # All dialogs are loaded with the first one: the screen is shown before.
        from ddenv.workbench.run.run_dialogs import Dialogs

        return Dialogs(self)

    @property
    def snapshot(self) -> Snapshot:
        return self.browsing.snapshot

    def compose(self) -> ComposeResult:
        yield Header(id="header")
        yield Panes(
            {name: f"{key} {words}" for key, (name, words) in enumerate(PANES.items(), 1)},
            id="run-panes",
        )
        with Horizontal(id="run-body"):
            with Vertical(id="run-main"):
                with Horizontal(id="top"):
                    with _panel("world", "World"):
                        yield self.world
                        yield self._legend
                    with _panel("round", "Round"):
                        yield self.table
                with Horizontal(id="bottom"):
                    with _panel("left", "Models left by test"):
                        yield Chart(id="chart")
                    with _panel("log-panel", "Log"):
                        yield Lines(
                            as_it_is,
                            nothing="nothing happened yet",
                            tail=True,
                            parts=Log.parts,
                            id="log",
                        )
                    with _panel("now", "What is happening", "e explains the method"):
                        yield Happening(id="happening")
            with Vertical(id="run-more"):
                yield ModelsLeft(self.find, id="models-panel")
                with _panel("decisions-panel", "What you decided"):
                    yield Lines(
                        as_it_is,
                        nothing=NOTHING_DECIDED,
                        tail=True,
                        parts=decision_lines,
                        id="decisions",
                    )
        if self.poll.watch:
            yield Static(WATCHING, id="watching", markup=False)
        yield Status(id="status")
        yield self._footer
        yield Static("", id="small", markup=False)

    def on_mount(self) -> None:
        self.query_one(Panes).mark(self._pane)
        # The first picture does not wait for what reads a run to be loaded.
        self.call_after_refresh(self.look)
        self.call_after_refresh(self.set_interval, PERIOD, self.look)
        read_world(self, self.run, self._placed)

    def on_unmount(self) -> None:
        self.scene.stop()
        self.asking.close()
        self.poll.close()

    def on_resize(self) -> None:
        width, height = self.size
        words = f"ddenv needs {SMALLEST[0]} x {SMALLEST[1]}; this terminal has {width} x {height}"
        self.query_one("#small", Static).update(words)
        self.call_after_refresh(self._show_models)

    def _placed(self, place: Place, notice: str) -> None:
        self.world.set_place(place, notice)
        self._show_models()

    # From the run file to the screen.

    def look(self) -> None:
        """Shows what is new; while it catches up with a long run, whose events are old, only now
        and then.
        """
        poll = self.poll
        before = self.poll.snapshot
        live = not self.poll.catching_up
        if poll.look() is not None:
            self._stale = True
            if poll.snapshot.engine == "alive":
                self.engine.seen_at_work()
            self.asking.show_refusal(before)
            if live and (why := worth_a_look(before, poll.snapshot)):
                self.post_message(Attention(plain(self.run.stem), why))
        if poll.catching_up and not self._coming:
            # Soon, but after the keys that were pressed meanwhile.
            self._coming = True
            self.set_timer(AT_ONCE, self._look_on)
        if not poll.catching_up or time.monotonic() - self._shown_at >= CATCHING_UP:
            changed = self._stale
            self._stale = False
            if changed:
                self._shown_at = time.monotonic()
            self._show(changed)

    def _look_on(self) -> None:
        self._coming = False
        self.look()

    def _focus(self) -> Candidate | None:
        """The candidate to show. However fast the current one changes, it stays for `CALM` seconds,
        so that it can be read.
        """
        snapshot = self.snapshot
        moment = time.monotonic()
        state = snapshot.state
        focus = snapshot.focus
        if snapshot.past:
            return focus
        round, index, until = self._stays
        now = (state.node, state.round.number) if state.round and not state.round.done else None
        waits = state.waiting_candidate is not None
        if (
            state.round
            and now == round
            and moment < until
            and not waits
            and snapshot.engine == "alive"
        ):
            return state.round.candidates[index]
        if focus is not None and (now, focus.index) != (round, index):
            self._stays = now, focus.index, moment + CALM
        return focus

    def _show(self, changed: bool) -> None:
        if changed:
            self._show_run()
            self.asking.go_on()
        snapshot = self.snapshot
        well = snapshot.past or snapshot.engine == "alive"
        self.query_one(Happening).show(snapshot, "" if well else self.engine.trouble)
        self._show_asked()

    def _show_run(self) -> None:
        snapshot = self.snapshot
        self.table.show(snapshot)
        self.query_one(Chart).show(snapshot)
        self.query_one(Header).show(snapshot)
        self._show_map()
        self._show_models()
        panel = self.query_one("#round")
        for each in (panel, self.query_one("#now")):
            # Its rows are wider than those of candidates. As a class of the screen it would compute
            # all styles again.
            each.set_class(snapshot.state.certificate is not None, "-certificate")
        panel.border_title, panel.border_subtitle = round_title(snapshot.state)
        log = self.query_one("#log", Lines)
        entries = self._log.until(self.browsing.position.at)
        if len(entries) != len(log.items):
            log.show(entries)
        decisions = self.query_one("#decisions", Lines)
        if decisions.items != snapshot.state.decisions:
            decisions.show(snapshot.state.decisions)
        self.app.title = title(self.poll.snapshot)

    def _show_asked(self) -> None:
        place = self.browsing.position.place if self.browsing.is_past else None
        scene = self.scene.url if self.scene.on else ""
        self.query_one(Status).show(self.snapshot, scene, self.asking.waiting_for(), place)
        self._show_keys()

    def _show_map(self) -> None:
        snapshot = self.snapshot
        focus = self._focus()
        self.world.show(snapshot, self.table.chosen or focus)
        self.show_legend()
        at = self.browsing.position.at
        round = snapshot.state.round
        row = self.table.chosen or (focus if snapshot.past else None)
        wanted = Wanted(at)
        if isinstance(row, Trial):
            wanted = Wanted(at, trial=row.number)
        elif row is not None and round is not None:
            wanted = Wanted(at, round.number, row.index)
        self.scene.show(wanted)

    def show_legend(self) -> None:
        self._legend.show(self.world.shown)

    def _show_models(self) -> None:
        self.query_one(ModelsLeft).show(self.snapshot.state, self.world.place.prints)

    # The keys that guide the run.

    @property
    def pointed(self) -> Pointed:
        """The row under the cursor, if it is in sight, and the selected models in the order of the
        world.
        """
        names = self.world.selection
        if not names and self.world.has_focus and (name := self.world.model_at_cursor) is not None:
            names = frozenset((name,))
        if names:
            known = tuple(name for name in self.poll.snapshot.state.elements if name in names)
        else:
            known = ()
        if self.table.is_attached and self.table.is_on_screen:
            row = self.table.under_cursor
        else:
            row = None
        return Pointed(row, self.table.following, (*known, *sorted(names.difference(known))))

    def _offer(self, name: str) -> KeyOffer:
        """What a key does now, by its name in `ddenv.guiding.key_offers.ACTIONS`."""
        if self.browsing.is_past:
            return KeyOffer(why_not=NOT_NOW)
        return offer(name, self.asking.situation, self.pointed)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        if action != "guide":
            return True
        if self._offer(str(parameters[0])).why_not:
            return None
        return True

    def action_guide(self, name: str) -> None:
        """Does what a key means now; it asks for models if none are selected but some are needed,
        and always for pins.
        """
        offered = self._offer(name)
        if self.browsing.is_past:
            self.asking.refuse(offered.why_not)
        elif offered.command is not None and name != "pin":
            self.asking.ask(offered.command)
        elif name == "change":
            self.opening.change()
        elif name in TITLES:

            def chosen(models: Names) -> None:
                now = offer(name, self.asking.situation, Pointed(models=models))
                self.asking.refuse(now.why_not) if now.command is None else self.asking.ask(
                    now.command
                )

            self.opening.choose(
                TITLES[name],
                self.poll.snapshot.state.environment,
                True,
                chosen,
                self.pointed.models,
            )

    def on_key(self, event: events.Key) -> None:
        """Says why a key does nothing."""
        # To list what all keys do now takes longer than most keys take.
        if any(
            each in GUIDING.values() for each in self._bindings.key_to_bindings.get(event.key, ())
        ):
            active = self.active_bindings.get(event.key)
            if active is not None and not active.enabled and active.node is self:
                name = next(name for name, each in GUIDING.items() if each.id == active.binding.id)
                self.asking.refuse(self._offer(name).why_not)

    @on(WorldMap.Pointed)
    def _show_keys(self) -> None:
        if self.poll.watch or not self._footer.is_attached:
            return
        now = self.asking.situation
        pointed = self.pointed
        for name, binding in GUIDING.items():
            offered = offer(name, now, pointed)
            self._footer.say(
                binding.id or "", "" if offered.why_not else offered.words or binding.description
            )

    def _keys_here(self) -> Names:
        if self.browsing.is_past:
            return BROWSING
        if self.snapshot.state.status == "finished" and not self.poll.watch:
            return ENDED
        if self.world.has_focus:
            return ON_MAP
        return ()

    # Earlier moments of the run.

    def _note(self, kind: str, before: RunState, after: RunState) -> None:
        self._log.add(kind, before, after)
        self.browsing.position.note(kind, before, after)

    def action_browse(self, what: Step, by: int) -> None:
        self._browse(lambda: self.browsing.step(what, by))

    def go(self, id: int | None) -> None:
        self._browse(lambda: self.browsing.position.go(id))

    def _browse(self, move: Callable[[], str | None]) -> None:
        try:
            if why := move():
                self.asking.refuse(why)
                return
            self.browsing.snapshot  # noqa: B018  (it is read here, where an error has somewhere to go)
        except UserError as error:
            self.browsing.position.go(None)
            self.asking.refuse(str(error))
        self.table.follow()
        self._show(True)
        self._footer.say("run.follow", "now" if self.browsing.is_past else "follow")
        self._footer.renew()

    # Dialogs and other screens.

    def action_open(self, what: str) -> None:
        getattr(self.opening, what)()

    def action_detach(self) -> None:
        self.opening.detach()

    # Panes and the map.

    def _row_chosen(self) -> None:
        self._show_map()
        self._show_keys()

    @on(WorldMap.SelectionChanged)
    def _selected(self) -> None:
        self.show_legend()
        self._show_keys()

    def find(self, name: str) -> None:
        self.action_pane("map")
        self.world.go_to(name)
        self.world.focus()

    @on(Panes.Chosen)
    def _pane_clicked(self, event: Panes.Chosen) -> None:
        self.action_pane(event.pane)

    def action_pane(self, pane: str) -> None:
        if pane != self._pane:
            self.remove_class(f"-pane-{self._pane}")
            self.add_class(f"-pane-{pane}")
        self._pane = pane
        self.query_one(Panes).mark(pane)
        focus = {"map": "#map", "log": "#log"}.get(pane, "#candidates")
        self.query_one(focus).focus()
        self.call_after_refresh(self._show_keys)

    def action_next_pane(self) -> None:
        self.action_pane([*PANES, *PANES][list(PANES).index(self._pane) + 1])

    def action_follow(self) -> None:
        if self.browsing.is_past:
            self.go(None)
            return
        self.world.select(())
        self.table.follow()
        self.table.show(self.snapshot)


def _panel(id: str, title: str, hints: str = "") -> Framed:
    return Framed(title, hints, id=id, classes="panel")
