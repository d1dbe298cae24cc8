"""A finished test played back on the map: the time within it, its speed, frame by frame, alone or over another test."""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Sequence
from typing import ClassVar

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal
from textual.screen import Screen
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.runfile.position import Position
from ddenv.runfile.store import RunFile
from ddenv.runs.playback import FRAME, Played, played
from ddenv.runs.reasons import APART, parted
from ddenv.text import count, plain
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.help.signs import SignsDialog
from ddenv.workbench.map.place import Place, Point, place_of_run
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.playback.beside_dialog import Beside
from ddenv.workbench.playback.met import Met
from ddenv.workbench.playback.moving import Moving, RobotWay, snapshot_with, without
from ddenv.workbench.playback.timeline import ROBOTS, Instant, Timeline
from ddenv.workbench.shared.background import call_if_open

# Simulated seconds in a second.
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
USUAL = 4.0
# One long step, simulated s.
STEP = 1.0
SMALLEST = (64, 18)
# Time between two pictures, s: more would only send more to the terminal.
PERIOD = 0.1


class Playing:
    """At simulated `time`, s, of `length`; it runs at `speed` while `on`."""

    def __init__(self, length: float) -> None:
        self.length, self.time, self.speed, self.on = length, 0.0, USUAL, False

    @property
    def at_end(self) -> bool:
        return self.time >= self.length

    def go(self, time: float) -> None:
        """To an instant, and stops there."""
        self.on = False
        self.time = min(max(0.0, time), self.length)

    def frames(self, number: int) -> None:
        """So many frames on, or back if negative: to the instants at which the run file has a row."""
        frame = round(self.time / FRAME, 6)
        whole = int(frame) if number > 0 else -int(-frame // 1)
        self.go((whole + number) * FRAME)

    def toggle(self) -> None:
        """Plays, or pauses; at the end it begins again."""
        if not self.on and self.at_end:
            self.time = 0.0
        self.on = not self.on and self.length > 0

    def faster(self, steps: int) -> bool:
        """Another of the `SPEEDS`; False if there is none."""
        place = bisect_left(SPEEDS, self.speed) + steps
        if not 0 <= place < len(SPEEDS):
            return False
        self.speed = SPEEDS[place]
        return True

    def advance(self, seconds: float) -> None:
        """So many seconds of real time pass."""
        if self.on:
            self.time = min(self.length, self.time + seconds * self.speed)
            self.on = not self.at_end


def now() -> float:
    """A clock that only goes on, s."""
    return time.monotonic()


def _ids(names: str) -> tuple[str, ...]:
    return tuple(f"playback.{name}" for name in names.split())


def _hidden(key: str, action: str, words: str, name: str, tooltip: str, display: str | None = None) -> Binding:
    return Binding(key, action, words, id=f"playback.{name}", tooltip=tooltip, show=False, key_display=display)


SHOWN = _ids("play back on frame_back frame_on slower faster parting beside swap before next help close")
FIRST = _ids("help close play beside frame_back frame_on parting slower faster swap before next back on")


class Playback(Screen[None]):
    """Plays test number `test` of a run, over test `beside` if that is given; `place` is the run's world, if it is read already."""

    CSS_PATH = "playback.tcss"
    HORIZONTAL_BREAKPOINTS = [(0, "-thin"), (SMALLEST[0], "-narrow"), (110, "-wide")]
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (SMALLEST[1], "-low")]
    AUTO_FOCUS = ""
    BINDINGS: ClassVar = [
        Binding("space", "play", "play", id="playback.play", tooltip="play, or pause; at the end: from the start"),
        _hidden("left", f"step({-STEP})", "1 s back", "back", "one second back"),
        _hidden("right", f"step({STEP})", "1 s on", "on", "one second on"),
        _hidden("comma", "frame(-1)", "frame back", "frame_back", f"one frame ({FRAME:g} s) back, and pause", ","),
        _hidden("full_stop", "frame(1)", "frame on", "frame_on", f"one frame ({FRAME:g} s) on, and pause", "."),
        _hidden("less_than_sign", "speed(-1)", "slower", "slower", "slower", "<"),
        _hidden("greater_than_sign", "speed(1)", "faster", "faster", "faster", ">"),
        _hidden("home", "go(0)", "start", "start", "to the start of the test"),
        _hidden("end", "go(1)", "end", "end", "to the end of the test"),
        _hidden("p", "parting", "they part", "parting", "to the instant at which the ways of the two tests part"),
        _hidden("o", "beside", "two tests", "beside", "play another test over this one, or this one alone again"),
        _hidden("x", "swap", "swap", "swap", "the second test becomes the first one: its models move"),
        _hidden("up", "test(-1)", "test before", "before", "the finished test before this one"),
        _hidden("down", "test(1)", "next test", "next", "the next finished test"),
        _hidden("plus,equals_sign", "zoom(1.25)", "closer", "closer", "map: closer", "+"),
        _hidden("minus", "zoom(0.8)", "farther", "farther", "map: farther away", "-"),
        _hidden("0", "fit", "fit", "fit", "map: show all that matters"),
        _hidden("k", "signs", "signs", "signs", "what the signs and letters on the map mean"),
        Binding("question_mark,f1", "app.help", "help", id="playback.help", tooltip="show every key", key_display="?"),
        Binding(
            "escape,q", "close", "close", id="playback.close", tooltip="back to where it was opened", key_display="esc"
        ),
    ]

    def __init__(self, file: RunFile, position: Position, place: Place, test: int, beside: int | None = None) -> None:
        """Raises UserError if a test is not finished."""
        super().__init__()
        self._file, self._position, self._place = file, position, place
        self._tests: tuple[Played, ...] = ()
        self._ways: tuple[RobotWay, ...] = ()
        self._apart: tuple[str, str] | None = None
        self._legend = Text()
        self._parting: tuple[float, Point] | None = None
        self.playing = Playing(0.0)
        self._ticked = now()
        self.map = WorldMap(id="playback-map")
        self._take([test] if beside is None else [test, beside])

    def compose(self) -> ComposeResult:
        yield Static("", id="playback-header", markup=False)
        with Horizontal(id="playback-body"):
            with Framed("World", id="playback-world", classes="panel"):
                yield self.map
                yield Static("", id="playback-legend", markup=False)
            with Framed("What the robot meets", id="playback-met", classes="panel"):
                yield Met(id="met")
        with Framed("", id="playback-time", classes="panel"):
            yield Timeline(id="timeline")
        yield KeyFooter(SHOWN, FIRST)
        yield Static(f"ddenv needs {SMALLEST[0]} x {SMALLEST[1]}", id="small", markup=False)

    def on_mount(self) -> None:
        self.query_one(Timeline).tooltip = "click or drag: go to that instant; wheel: frame by frame"
        self.set_interval(PERIOD, self._tick)
        self._put()
        if self._place.prints:
            self._placed(self._place, "")
        else:
            self.call_after_refresh(self._read_world)

    # The world is read beside the screen, since it can be large.

    @work(thread=True, group="world", exclusive=True)
    def _read_world(self) -> None:
        try:
            place, notice = place_of_run(self._file.path), ""
        except UserError as error:
            place, notice = Place(), str(error)
        call_if_open(self, self._placed, place, notice)

    def _placed(self, place: Place, notice: str) -> None:
        self._place = place
        self.map.set_place(place, notice)
        self._moving = Moving(place, self._tests[0])
        self._show()

    def on_resize(self) -> None:
        self.call_after_refresh(self._show_legend)

    # The tests.

    def _take(self, numbers: Sequence[int]) -> None:
        """Other tests. Raises UserError, with nothing changed."""
        tests = tuple(played(self._file, self._position, number) for number in numbers)
        self._tests = tests
        names = ["its way"] if len(tests) == 1 else [f"test {one.test.id}" for one in tests]
        self._ways = tuple(RobotWay(one, name) for one, name in zip(tests, names, strict=True))
        self._moving = Moving(self._place, tests[0])
        self._parting = None
        if len(tests) == 2 and all(one.rows for one in tests):
            _, at, place = parted(tests[0].rows, tests[1].rows)
            self._parting = None if at is None or place is None else (at, place)
        speed, self.playing = self.playing.speed, Playing(max(one.length for one in tests))
        self.playing.speed = speed

    def _change(self, numbers: Sequence[int]) -> None:
        at = self.playing.time
        try:
            self._take(numbers)
        except UserError as error:
            self._refuse(str(error))
            return
        self.playing.go(at)
        self._put()

    def _put(self) -> None:
        """Shows the tests."""
        first, state = self._tests[0], self._position.end
        there = [one.models if one.models is not None else state.environment for one in self._tests]
        differ, either = frozenset(there[0]) ^ frozenset(there[-1]), frozenset(there[0]) | frozenset(there[-1])
        both = tuple(name for name in state.elements if name in either)
        self._apart = ("a", "in one of them only") if differ else None
        groups = (tuple(name for name in both if name in differ),) if differ else ()
        self.map.show(snapshot_with(state, both, groups), without(both, differ) if differ else None)
        lacks = dict.fromkeys(line for one in self._tests for line in one.lacks)
        self.query_one(Met).put(tuple(one.test for one in self._tests), tuple(lacks))
        moves = f"{count(len(first.moving), 'model')} that moved" if first.moving else "no model moved"
        self.query_one("#playback-world").border_title = Text(f"World · {moves}" if first.rows else "World")
        lines = [f"test {one.test.id}: {plain(one.words)}, seed {one.test.seed}" for one in self._tests]
        signs = ROBOTS if len(lines) > 1 else ("",)
        header = Text("", no_wrap=True, overflow="ellipsis")
        for sign, words, title in zip(signs, lines, (" Playback", "         "), strict=False):
            header.append("\n" if header else "").append(title, "bold").append(
                f" · {sign} {words}" if sign else f" · {words}"
            )
        self.query_one("#playback-header", Static).update(header)
        self._show()

    # The instant.

    def _tick(self) -> None:
        at = now()
        passed, self._ticked = at - self._ticked, at
        if self.playing.on:
            self.playing.advance(passed)
            self._show()

    def _show(self) -> None:
        """The robots, the models and the slider at the instant."""
        playing, at = self.playing, self.playing.time
        prints = self._moving.at(at)
        place = None if self._parting is None else self._parting[1]
        self.map.show_ways(tuple(way.at(at) for way in self._ways), place, self._apart, prints)
        tests = tuple(one.test for one in self._tests)
        parting = None if self._parting is None else self._parting[0]
        lengths = tuple(one.length for one in self._tests)
        self.query_one(Timeline).show(Instant(at, playing.length, tests, lengths, parting))
        self.query_one(Met).show(at)
        self.query_one("#playback-time").border_title = Text(self._words())
        self._show_legend()

    def _words(self) -> str:
        """The instant in words."""
        playing = self.playing
        if not playing.length:
            return "no way is stored"
        words = f"{'▶' if playing.on else '‖'} {playing.time:.1f} s of {playing.length:.1f} s · {playing.speed:g} × real time"
        ends = [way.place(playing.time) for way in self._ways]
        if len(ends) == 2 and ends[0] is not None and ends[1] is not None:
            away = ((ends[0][0] - ends[1][0]) ** 2 + (ends[0][1] - ends[1][1]) ** 2) ** 0.5
            words += f" · {away:.2f} m apart"
        return words

    def _show_legend(self) -> None:
        legend = self.query_one("#playback-legend", Static)
        words = self.map.legend(legend.size.width)
        if words != self._legend:
            self._legend = words
            legend.update(words)

    @on(Timeline.Moved)
    def _moved(self, event: Timeline.Moved) -> None:
        self.playing.go(event.time)
        self._show()

    @on(Timeline.Turned)
    def _turned(self, event: Timeline.Turned) -> None:
        self.action_frame(event.frames)

    # The keys.

    def action_play(self) -> None:
        self._ticked = now()
        self.playing.toggle()
        self._show()

    def action_step(self, seconds: float) -> None:
        self.playing.go(self.playing.time + seconds)
        self._show()

    def action_frame(self, number: int) -> None:
        self.playing.frames(number)
        self._show()

    def action_go(self, part: int) -> None:
        self.playing.go(part * self.playing.length)
        self._show()

    def action_speed(self, steps: int) -> None:
        if not self.playing.faster(steps):
            self._refuse(f"{SPEEDS[0]:g} to {SPEEDS[-1]:g} × real time")
        self._show()

    def action_parting(self) -> None:
        if self._parting is not None:
            self.playing.go(self._parting[0])
            self._show()
        elif len(self._tests) == 2:
            self._refuse(f"the robots are never {APART:g} m apart")
        else:
            self._refuse("this is one test; o plays another one over it")

    def action_beside(self) -> None:
        first = self._tests[0].test

        def chosen(number: int | None) -> None:
            if number is not None:
                self._change([first.id, number] if number else [first.id])

        self.app.push_screen(Beside(self._position.end, first), chosen)

    def action_swap(self) -> None:
        if len(self._tests) == 2:
            self._change([one.test.id for one in reversed(self._tests)])
        else:
            self._refuse("this is one test; o plays another one over it")

    def action_test(self, by: int) -> None:
        tests, number = self._position.end.tests, self._tests[0].test.id + by
        while 0 < number <= len(tests) and not tests[number - 1].is_finished:
            number += by
        if 0 < number <= len(tests):
            self._change([number])
        else:
            self._refuse("there is no finished test after this one" if by > 0 else "there is no test before this one")

    def action_zoom(self, factor: float) -> None:
        self.map.zoom(factor)

    def action_fit(self) -> None:
        self.map.fit()

    def action_signs(self) -> None:
        self.app.push_screen(SignsDialog())

    def action_close(self) -> None:
        self.dismiss(None)

    def _refuse(self, why: str) -> None:
        self.notify(plain(why), severity="warning", timeout=4, markup=False)
