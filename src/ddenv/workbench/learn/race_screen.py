"""Searches of one world side by side, test by test; at the end, who needed the fewest tests, and
why.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Container, Vertical, VerticalScroll
from textual.widgets import Static

from ddenv.learn.race import Play, Race, plays_of_runs, result, spent
from ddenv.learn.variables import SIGNS
from ddenv.runfile.position import position_in
from ddenv.runfile.snapshot import Snapshot
from ddenv.text import Names, count, plain, shortened, truncated
from ddenv.workbench.learn.learn_screen import LearnScreen, snapshot_of
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.snapshot import Moments
from ddenv.workbench.shared.bindings import HELP, keys
from ddenv.workbench.shared.observed import Observed

IN = "■"
OUT = "□"
GONE = "·"
# Time between two tests while the race runs, s.
PACE = 0.7
# Rows: a racer without a map, the fewest with one, the panel below besides its line for each racer,
# header and footer.
BARE = 5
WITH_MAP = 11
SAID = 6
AROUND = 2
LEGEND = "■ there  □ left out  · gone   ● f  ◇ other  ○ goal   ✓ done"
# What the tests were good for; the rest is rare.
COLUMNS = {
    "f showed": "f showed",
    "part without f": "part alone",
    "rest without f": "without a part",
    "again": "again",
}
LONGEST_NAME = 24


class RacerPane(Vertical):
    """The search `play`, drawn over the run of `base`."""

    def __init__(self, play: Play, base: Snapshot) -> None:
        super().__init__(classes="panel")
        self.play = play
        self._base = base
        self.map = WorldMap()
        self.map.can_focus = False
        self._said = Static("", markup=False)

    def compose(self) -> ComposeResult:
        yield self.map
        yield self._said

    def show(self, race: Race) -> None:
        play = self.play
        turn = race.now(self.play)
        tests = min(race.at, self.play.tests)
        left = play.after(tests)
        room = max(8, self.size.width - 2)
        # The map says itself what a panel's lower border has, so the figures stand above.
        done = race.is_done(play)
        stopped = done and not play.ended
        ended = done and play.ended
        has_stopped = ", stopped" if stopped else ""
        sign = " ✓" if ended else ""
        figures = f" · {count(tests, 'test')}{has_stopped} · {len(left)} left{sign}"
        # As text: a name may look like markup.
        self.border_title = Text(
            shortened(plain(play.name), max(6, room - 4 - len(figures))) + figures
        )
        self.map.show(snapshot_of(self._base, left, turn), None if turn is None else turn.candidate)
        there = frozenset(left if turn is None else turn.candidate.models)
        signs = "".join(SIGNS.get(each.outcome, "?") for each in play.turns[:tests])
        what = plain(play.method) or f"{count(len(play.begins), 'model')}, no test yet"
        if turn is not None:
            candidate = turn.candidate
            again = ", again" if turn.again else ""
            what = (
                f"{candidate.label}{again}: {count(candidate.size, 'model')} "
                f"{SIGNS.get(turn.outcome, '?')}"
            )
        last = signs if len(signs) <= room else f"…{signs[-(room - 1) :]}"
        bar = _bar(play.begins, frozenset(left), there, room)
        self._said.update(Text(f"{truncated(what, room)}\n{bar}\n{last}"))


def _bar(models: Names, left: frozenset[str], there: frozenset[str], room: int) -> str:
    """A cell for each model in the world's order; of more models than there is room, by their
    shares.
    """
    if len(models) <= room:
        signs = dict.fromkeys(left, OUT) | dict.fromkeys(left & there, IN)
        return "".join(signs.get(name, GONE) for name in models)
    kept = max(bool(left), round(room * len(left) / len(models)))
    tested = min(kept, max(bool(there & left), round(room * len(there & left) / len(models))))
    return IN * tested + OUT * (kept - tested) + GONE * (room - kept)


class RaceScreen(LearnScreen[None]):
    """The race of `plays`, each drawn over its own of the `bases`, in the world of `run`."""

    AUTO_FOCUS = ""
    NAME = "race"
    FIRST = "help close run on back end begin"
    BINDINGS: ClassVar = keys(
        "race",
        ("run", "space", "run", "run/pause", "run the race, or pause it"),
        ("back", "left", "move(-1)", "back", "one test back in each"),
        ("on", "right,enter", "move(1)", "one test on", "one test on in each", "→"),
        ("begin", "home", "go(0)", "start", "to the beginning"),
        ("end", "end", "go(-1)", "result", "to the end: who needed the fewest tests, and why"),
        HELP,
        ("close", "escape,q", "close", "leave", "back, or leave", "esc"),
    )

    def __init__(self, plays: Sequence[Play], bases: Sequence[Snapshot], run: Path) -> None:
        super().__init__()
        self.race = Race(tuple(plays))
        self._run = run
        self._panes = [RacerPane(play, base) for play, base in zip(plays, bases, strict=True)]

    def body(self) -> ComposeResult:
        with Container(id="race-body"):
            yield from self._panes
        with VerticalScroll(id="race-panel", classes="panel", can_focus=False):
            yield Static("", id="race-said", markup=False)

    def on_mount(self) -> None:
        def tick() -> None:
            if not self.race.go(self.race.at + 1) or self.race.over:
                self._pause()
            self._show()

        self._clock = self.set_interval(PACE, tick, pause=True)
        self._runs_on = False
        self._arrange()
        self._show()
        self.read_world(self._run, [pane.map for pane in self._panes])

    def on_resize(self) -> None:
        self._arrange()
        self.call_after_refresh(self._show)

    def _arrange(self) -> None:
        """Up to three racers beside each other; their maps where there is room for them."""
        width, height = self.size
        columns = 3 if len(self._panes) == 3 and width >= 110 else 2
        rows = -(-len(self._panes) // columns)
        each = (height - AROUND - SAID - len(self._panes)) // rows
        maps = each >= WITH_MAP
        body = self.query_one("#race-body")
        body.styles.grid_size_columns = columns
        body.styles.grid_size_rows = rows
        body.styles.height = rows * (each if maps else BARE)
        for pane in self._panes:
            pane.map.display = maps

    def _show(self) -> None:
        race = self.race
        for pane in self._panes:
            pane.show(race)
        if race.over:
            state = "over"
        elif self._runs_on:
            state = "runs: space pauses it"
        else:
            state = "space runs it"
        header = Text(" Race", "bold", no_wrap=True, overflow="ellipsis").append(
            f" · {state}", "not bold"
        )
        header.append(f" · test {race.at}" if race.at else "", "not bold")
        self.query_one("#race-header", Static).update(header)
        panel = self.query_one("#race-panel", VerticalScroll)
        if race.over:
            panel.border_title = "Who won, and why"
        else:
            panel.border_title = "Tests that showed f, and tests that did not"
        panel.border_subtitle = LEGEND
        # A line for each search: its tests so far, those that showed f, and those that did not, by
        # kind.
        width = min(LONGEST_NAME, max(len(play.name) for play in race.plays))
        heads = {kind: f"  {head}" for kind, head in COLUMNS.items()}
        said = Text(f"{'':<{width}}{'tests':>7}{''.join(heads.values())}", "dim", no_wrap=True)
        for play in race.plays:
            numbers = spent(play, race.at)
            name = shortened(plain(play.name), width)
            cells = "".join(f"{numbers[kind] or '':>{len(head)}}" for kind, head in heads.items())
            said.append(f"\n{name:<{width}}{min(race.at, play.tests):>7}{cells}", "not dim")
        if race.over:
            said.append("\n").append("\n".join(map(plain, result(race.plays))), "bold not dim")
        self.query_one("#race-said", Static).update(said)

    def _pause(self) -> None:
        self._runs_on = False
        self._clock.pause()

    def action_run(self) -> None:
        if self._runs_on:
            self._pause()
        else:
            if self.race.over:
                self.race.go(0)
            self._runs_on = True
            self._clock.resume()
        self._show()

    def action_move(self, by: int) -> None:
        self._pause()
        if self.race.go(self.race.at + by):
            self._show()
        else:
            self.say("the race is over: esc leaves" if by > 0 else "the race begins here")

    def action_go(self, at: int) -> None:
        self._pause()
        self.race.go(at if at >= 0 else self.race.longest)
        self._show()


def race_of_runs(runs: Sequence[Path]) -> RaceScreen:
    """The searches of two to four run files. Raises UserError, also if they are not of one
    world.
    """
    plays = plays_of_runs(runs)
    bases = []
    for run in runs:
        with Observed(run) as file:
            position = position_in(file.events())
            baseline = position.moment(position.chapters[0].last)
            bases.append(Snapshot() if baseline is None else Moments(file).of(baseline, ""))
    return RaceScreen(plays, bases, runs[0])
