"""A finished test played back on the map: the time within it, its speed, frame by frame, alone or
over another test.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_left
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import islice
from typing import ClassVar

import numpy as np
from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.screen import Screen
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.runfile.position import Position
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import PersistentTuple, Round, RunState, Split, Test, Trial
from ddenv.runfile.store import RunFile
from ddenv.runfile.tested import purpose
from ddenv.runs.playback import FRAME, Played, played
from ddenv.runs.reasons import APART, parted
from ddenv.text import Names, count, padded, plain, shortened
from ddenv.words.signs import outcome
from ddenv.workbench.help.dialogs import Pick
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.map.map_words import MapLines
from ddenv.workbench.map.place import Limits, MovedPrints, Place, Way, read_world
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.playback.met import Met
from ddenv.workbench.playback.timeline import ROBOTS, Timeline
from ddenv.workbench.shared.background import refuse
from ddenv.workbench.shared.bindings import HELP, MAP_KEYS, ids, keys
from ddenv.world.pose import Point, pose_at

# Simulated seconds in a second.
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
USUAL = 4.0
# One long step, simulated s.
STEP = 1.0
SMALLEST = (64, 18)
# Time between two pictures, s: more would only send more to the terminal.
PERIOD = 0.1
# The maximum number of tests in the list of those to play beside one, and the widths of its
# columns.
LISTED = 200
NUMBER = 7
WORDS = 32
SEED = 12
OUTCOME = 16


class Playing:
    """At simulated `time`, s, of `length`; it runs at `speed` while `on`."""

    def __init__(self, length: float, speed: float = USUAL) -> None:
        self.length = length
        self.time = 0.0
        self.speed = speed
        self.on = False

    def go(self, time: float) -> None:
        self.on = False
        self.time = min(max(0.0, time), self.length)

    def frames(self, number: int) -> None:
        """So many frames on, or back if negative: to the instants at which the run file has a
        row.
        """
        frame = round(self.time / FRAME, 6)
        whole = int(frame) if number > 0 else -int(-frame // 1)
        self.go((whole + number) * FRAME)

    def toggle(self) -> None:
        if not self.on and self.time >= self.length:
            self.time = 0.0
        self.on = not self.on and self.length > 0

    def faster(self, steps: int) -> bool:
        place = bisect_left(SPEEDS, self.speed) + steps
        if not 0 <= place < len(SPEEDS):
            return False
        self.speed = SPEEDS[place]
        return True

    def advance(self, seconds: float) -> None:
        if self.on:
            self.time = min(self.length, self.time + seconds * self.speed)
            self.on = self.time < self.length


def now() -> float:
    return time.monotonic()


FIRST = ids(
    "playback",
    "help close play beside frame_back frame_on parting slower faster swap before next back on",
)


class Playback(Screen[None]):
    """Plays test number `test` of a run, over test `beside` if that is given; `place` is the run's
    world, if it is read already. Runs with a changed number have negative numbers, and `limits`.
    """

    CSS_PATH = "playback.tcss"
    HORIZONTAL_BREAKPOINTS = [(0, "-thin"), (SMALLEST[0], "-narrow"), (110, "-wide")]
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (SMALLEST[1], "-low")]
    AUTO_FOCUS = ""
    BINDINGS: ClassVar = keys(
        "playback",
        ("play", "space", "play", "play", "play, or pause; at the end: from the start"),
        ("back", "left", f"step({-STEP})", "1 s back", "one second back"),
        ("on", "right", f"step({STEP})", "1 s on", "one second on"),
        (
            "frame_back",
            "comma",
            "frame(-1)",
            "frame back",
            f"one frame ({FRAME:g} s) back, and pause",
            ",",
        ),
        (
            "frame_on",
            "full_stop",
            "frame(1)",
            "frame on",
            f"one frame ({FRAME:g} s) on, and pause",
            ".",
        ),
        ("slower", "less_than_sign", "speed(-1)", "slower", "slower", "<"),
        ("faster", "greater_than_sign", "speed(1)", "faster", "faster", ">"),
        ("start", "home", "go(0)", "start", "to the start of the test"),
        ("end", "end", "go(1)", "end", "to the end of the test"),
        (
            "parting",
            "p",
            "parting",
            "paths diverge",
            "to the instant at which the paths of the two tests diverge",
        ),
        (
            "beside",
            "o",
            "beside",
            "two tests",
            "play another test over this one, or this one alone again",
        ),
        ("swap", "x", "swap", "swap", "the second test becomes the first one: its models move"),
        ("before", "up", "test(-1)", "test before", "the finished test before this one"),
        ("next", "down", "test(1)", "next test", "the next finished test"),
        *MAP_KEYS,
        ("signs", "k", "app.signs", "signs", "what the signs and letters on the map mean"),
        HELP,
        ("close", "escape,q", "dismiss", "close", "back to where it was opened", "esc"),
    )

    def __init__(
        self,
        file: RunFile,
        position: Position,
        place: Place,
        test: int,
        beside: int | None = None,
        limits: Limits = (),
    ) -> None:
        """Raises UserError if a test is not finished."""
        super().__init__()
        self._file = file
        self._position = position
        self._place = place
        self._tests: tuple[Played, ...] = ()
        self._apart: tuple[str, str] | None = None
        self._parting: tuple[float, Point] | None = None
        self.playing = Playing(0.0)
        self._ticked = now()
        self.map = WorldMap(id="playback-map")
        self.map.show_limits(limits)
        self._take([test] if beside is None else [test, beside])

    def compose(self) -> ComposeResult:
        yield Static("", id="playback-header", markup=False)
        with Horizontal(id="playback-body"):
            with Framed("World", id="playback-world", classes="panel"):
                yield self.map
                yield MapLines(only_signs=True, id="playback-legend")
            with Framed("What the robot meets", id="playback-met", classes="panel"):
                yield Met(id="met")
        with Framed("", id="playback-time", classes="panel"):
            yield Timeline(self._go, self.action_frame, id="timeline")
        yield KeyFooter(FIRST)
        yield Static(f"ddenv needs {SMALLEST[0]} x {SMALLEST[1]}", id="small", markup=False)

    def on_mount(self) -> None:
        self.query_one(
            Timeline
        ).tooltip = "click or drag: go to that instant; wheel: frame by frame"
        self.set_interval(PERIOD, self._tick)
        self._put()
        if self._place.prints:
            self._placed(self._place, "")
        else:
            read_world(self, self._file.path, self._placed)

    def _placed(self, place: Place, notice: str) -> None:
        self._place = place
        self._prints = MovedPrints(place)
        self.map.set_place(place, notice)
        self._show()

    def _take(self, numbers: Sequence[int]) -> None:
        """Other tests. Raises UserError, with nothing changed."""
        tests = tuple(played(self._file, self._position, number) for number in numbers)
        self._tests = tests
        self._parting = None
        self._ways = tuple(
            way_of(one, called(one) if len(tests) == 2 else "its way") for one in tests
        )
        self._prints = MovedPrints(self._place)
        if len(tests) == 2 and all(one.rows for one in tests):
            _, at, place = parted(tests[0].rows, tests[1].rows)
            self._parting = (at, place) if at is not None and place is not None else None
        self.playing = Playing(max(one.length for one in tests), self.playing.speed)

    def _change(self, numbers: Sequence[int]) -> None:
        at = self.playing.time
        try:
            self._take(numbers)
        except UserError as error:
            refuse(self, str(error))
            return
        self.playing.go(at)
        self._put()

    def _put(self) -> None:
        first = self._tests[0]
        state = self._position.end
        there = [one.models if one.models is not None else state.environment for one in self._tests]
        differ = frozenset(there[0]) ^ frozenset(there[-1])
        either = frozenset(there[0]) | frozenset(there[-1])
        both = tuple(name for name in state.elements if name in either)
        self._apart = ("a", "in only one of them") if differ else None
        groups = (tuple(name for name in both if name in differ),) if differ else ()
        self.map.show(snapshot_with(state, both, groups), without(both, differ) if differ else None)
        lacks = dict.fromkeys(line for one in self._tests for line in one.lacks)
        self.query_one(Met).put(tuple(one.test for one in self._tests), tuple(lacks))
        # Links at joints are no models.
        moved = len(first.moving.keys() & self._place.movable.keys())
        moves = f"{count(moved, 'model')} that moved" if moved else "no model moved"
        self.query_one("#playback-world").border_title = Text(
            f"World · {moves}" if first.rows else "World"
        )
        lines = [f"{called(one)}: {plain(one.words)}, seed {one.test.seed}" for one in self._tests]
        if len(lines) == 2:
            lines = [f"{sign} {line}" for sign, line in zip(ROBOTS, lines, strict=True)]
        titles = (" Playback", "         ")
        header = Text("\n", no_wrap=True, overflow="ellipsis").join(
            Text.assemble((title, "bold"), f" · {line}")
            for title, line in zip(titles, lines, strict=False)
        )
        self.query_one("#playback-header", Static).update(header)
        self._show()

    def _tick(self) -> None:
        at = now()
        passed = at - self._ticked
        self._ticked = at
        if self.playing.on:
            self.playing.advance(passed)
            self._show()

    def _show(self) -> None:
        playing = self.playing
        at = self.playing.time
        moving = self._tests[0].moving
        prints = self._prints.at({name: pose_at(samples, at) for name, samples in moving.items()})
        parting, place = self._parting or (None, None)
        ways = []
        for one, way in zip(self._tests, self._ways, strict=True):
            if (pose := one.pose(at)) is not None:
                gone = int(np.searchsorted(one.robot[:, 0], at, side="right"))
                way = replace(way, robot=(*pose.position[:2], pose.yaw()), gone=gone)
            ways.append(way)
        self.map.show_ways(tuple(ways), place, self._apart, prints)
        self.query_one(Timeline).show(at, self._tests, parting)
        self.query_one(Met).show(at)
        words = (
            f"{'▶' if playing.on else '‖'} {at:.1f} s of {playing.length:.1f} s · "
            f"{playing.speed:g} × real time"
        )
        ends = [way.robot[:2] for way in ways if way.robot is not None]
        if len(ends) == 2:
            words += f" · {math.dist(*ends):.2f} m apart"
        self.query_one("#playback-time").border_title = Text(
            words if playing.length else "no path is stored"
        )
        self.query_one(MapLines).show(self.map.shown)

    def _go(self, time: float) -> None:
        self.playing.go(time)
        self._show()

    def action_play(self) -> None:
        self._ticked = now()
        self.playing.toggle()
        self._show()

    def action_step(self, seconds: float) -> None:
        self._go(self.playing.time + seconds)

    def action_frame(self, number: int) -> None:
        self.playing.frames(number)
        self._show()

    def action_go(self, part: int) -> None:
        self._go(part * self.playing.length)

    def action_speed(self, steps: int) -> None:
        if not self.playing.faster(steps):
            refuse(self, f"{SPEEDS[0]:g} to {SPEEDS[-1]:g} × real time")
        self._show()

    def action_parting(self) -> None:
        if self._parting is not None:
            self._go(self._parting[0])
        elif len(self._tests) == 2:
            refuse(self, f"the robots are never {APART:g} m apart")
        else:
            refuse(self, "this is one test; o plays another one over it")

    def action_beside(self) -> None:
        first = self._tests[0].test
        state = self._position.end
        tests = others(state.tests, first)

        def line(number: str, words: str, seed: str, end: str) -> Text:
            what = padded(shortened(words, WORDS), WORDS)
            return Text(
                f"{number:>{NUMBER}}  {what}{seed:>{SEED}}  {shortened(end, OUTCOME)}", no_wrap=True
            )

        def chosen(row: int | None) -> None:
            if row is not None:
                self._change([first.id, tests[row - 1].id] if row else [first.id])

        lines = [Text(f"test {first.id} alone")]
        for test in tests:
            seed = f"{'= ' if test.seed == first.seed else ''}{test.seed}"
            lines.append(line(str(test.id), purpose(state, test), seed, outcome(test)))
        head = line("test", "of", "seed", "end")
        at = min(1, len(tests))
        self.app.push_screen(
            Pick(f"Play beside test {first.id}", "plays both", lines, head=head, at=at), chosen
        )

    def action_swap(self) -> None:
        if len(self._tests) == 2:
            self._change([one.test.id for one in reversed(self._tests)])
        else:
            refuse(self, "this is one test; o plays another one over it")

    def action_test(self, by: int) -> None:
        tests = self._position.end.tests
        number = self._tests[0].test.id + by
        while 0 < number <= len(tests) and not tests[number - 1].is_finished:
            number += by
        if 0 < number <= len(tests):
            self._change([number])
        else:
            refuse(
                self,
                "there is no finished test after this one"
                if by > 0
                else "there is no test before this one",
            )


def called(one: Played) -> str:
    if one.test.id > 0:
        return f"test {one.test.id}"
    return "changed"


def others(tests: Sequence[Test], one: Test) -> list[Test]:
    """The other finished tests: first those with the same seed, the latest first."""
    finished = (test for test in reversed(tests) if test.is_finished and test.id != one.id)
    # Of very many tests the latest ones are looked at.
    latest = list(islice(finished, 100 * LISTED))
    return sorted(latest, key=lambda test: test.seed != one.seed)[:LISTED]


def way_of(one: Played, name: str) -> Way:
    """The robot's whole way in a test, without the robot."""
    return Way(name, np.ascontiguousarray(one.robot[:, 1:3]))


def snapshot_with(state: RunState, there: Names, groups: tuple[Names, ...]) -> Snapshot:
    """The run as if these models were its environment, and these `groups` the parts of its round,
    each with a letter.
    """
    if groups:
        round = Round(
            number=0,
            n_partitions=len(groups),
            split=Split(environment=there, partitions=groups),
            candidates=PersistentTuple(),
        )
    else:
        round = None
    bare = state.changed(environment=there, round=round, trials=(), pinned=frozenset(), supports=())
    return Snapshot(state=bare, past=True)


def without(there: Names, gone: Collection[str]) -> Trial:
    """What the map takes for a candidate: the others of these models stand back, in small
    letters.
    """
    return Trial(number=0, models=tuple(name for name in there if name not in gone), node=0)
