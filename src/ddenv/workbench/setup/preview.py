"""The chosen world on the setup screen: its map, picking places on it, and its description."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.message import Message
from textual.widgets import Static
from textual.worker import get_current_worker

from ddenv.errors import UserError
from ddenv.runs.remedies import remember_remedies
from ddenv.text import plain, shortened
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.map.place import Place, Point, place_of
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.setup import form
from ddenv.workbench.setup.choice import Choice, read_choice, spawn_height
from ddenv.workbench.setup.costs import Past, past_of
from ddenv.workbench.setup.fields import OptionsForm
from ddenv.workbench.setup.files import remember
from ddenv.workbench.setup.missing_files import MissingList
from ddenv.workbench.shared.background import call_if_open

# What to do about each kind of note; it comes first, since the end of a line may not fit.
REMEDIES = {
    "start": "s moves it to a free place",
    "drop": "lower the spawn's z",
    "goal": "move the goal",
    "inside": "move one model, or make both static",
}
KEYS = {"start": "s", "heading": "h", "goal": "g"}
ASKS = {
    "start": "the start: move the crosshair and press enter, or click",
    "heading": "the heading: pick a place for the robot to look at",
    "goal": "the goal: move the crosshair and press enter, or click",
}


class Preview(Vertical):
    """The panel with the world. `choice` is the last one read, None while reading or after an error.

    `picked_next` is "start", "heading" or "goal", what is picked on the map next, or "" for nothing. The numbers are in the form.
    """

    @dataclass
    class Read(Message):
        """The choice was read; `free_name` is the name that its next run gets. `again`: only its remedies changed.

        Without a choice, it cannot be read: the map says why.
        """

        choice: Choice | None
        free_name: str = ""
        again: bool = False

    @dataclass
    class PastRead(Message):
        """The cost of earlier runs of the choice was read, too."""

        choice: Choice
        past: Past

    def __init__(self, form: OptionsForm, reading: Mapping[str, Any], *, id: str) -> None:
        """`reading` holds the command line's options for reading worlds."""
        super().__init__(id=id, classes="panel")
        self._form, self._reading = form, reading
        self.map = WorldMap(id="map")
        self.missing = MissingList(id="missing")
        self.choice: Choice | None = None
        self.picked_next = ""
        # Where the robot has room, m, if it stands inside a model.
        self._free: Point | None = None
        # The spawn's z as the ground gave it: it follows x and y until the user types another one.
        self._ground_z = ""
        self.border_title = "World"

    def compose(self) -> ComposeResult:
        yield self.map
        yield self.missing
        for id in ("picking", "start-notes", "about"):
            yield Static("", id=id, markup=False)

    def on_mount(self) -> None:
        self.query_one("#start-notes").display = False

    def on_resize(self) -> None:
        self._show_picking()
        self.call_after_refresh(self._show_about)

    def read(self, path: Path, *, opened: bool) -> None:
        """Reads a scenario, a world or a run in a thread. A file that the user `opened` is remembered."""
        self.show_nothing("reading the world ...")
        self._title(path.name)
        self._read(path, opened)

    def show_nothing(self, why: str) -> None:
        self.choice = None
        self.pick("")
        self.workers.cancel_group(self, "notes")
        self._show_about()
        self._show_notes((), None)
        self.missing.show(())
        self.map.set_place(Place(), why)

    def _title(self, name: str) -> None:
        self.border_title, self.border_subtitle = Text(shortened(plain(name), 40)), ""

    @work(thread=True, group="world", exclusive=True)
    def _read(self, path: Path, opened: bool, again: bool = False) -> None:
        from ddenv.runs.folder import runs_folder

        worker = get_current_worker()
        try:
            choice = read_choice(path, self._reading)
            place, name = place_of(choice.world, choice.scenario), _free_name(choice.settings.name)
        except UserError as error:
            if not worker.is_cancelled:
                call_if_open(self, self._fail, str(error))
            return
        if worker.is_cancelled:
            return
        call_if_open(self, self._show, choice, place, name, again)
        if opened:
            remember(path)
        past = past_of(choice.settings, runs_folder())
        if not worker.is_cancelled:
            call_if_open(self, self.post_message, self.PastRead(choice, past))

    def _fail(self, why: str) -> None:
        self.show_nothing(why)
        self.post_message(self.Read(None))

    def _show(self, choice: Choice, place: Place, name: str, again: bool) -> None:
        self.choice = choice
        self._title(choice.name)
        self.map.set_place(place)
        self.missing.show(choice.missing, choice.world.notes)
        self._show_about()
        self.post_message(self.Read(choice, name, again))

    @on(MissingList.Chosen)
    def _remedies_chosen(self, event: MissingList.Chosen) -> None:
        """Remembers them, and reads the world again; until then the map stays."""
        event.stop()
        if self.choice is not None:
            remember_remedies(event.remedies)
            self._read(self.choice.path, False, again=True)

    @property
    def spawn(self) -> tuple[float, ...] | None:
        """The form's start: x, y, z, m, and yaw, rad."""
        return form.numbers(form.SPAWN, self._form.texts)

    @property
    def goal(self) -> tuple[float, ...] | None:
        """The form's goal: x, y, m."""
        return form.numbers(form.GOAL, self._form.texts)

    @property
    def asks(self) -> bool:
        return self.choice is not None and self.choice.scenario is None and self.spawn is None

    def show_places(self) -> None:
        if self.choice is not None:
            self._fill_z(self.choice)
            spawn, goal = self.spawn, self.goal
            start = (spawn[0], spawn[1], spawn[3]) if spawn else None
            self.map.set_marks(start, (goal[0], goal[1]) if goal else None)
            self._show_picking()
            self._look_at_start(self.choice, spawn, goal)

    def _fill_z(self, choice: Choice) -> None:
        texts = self._form.texts
        at = form.numbers(form.SPAWN[:2], texts)
        if choice.scenario is not None or at is None or texts["spawn_z"] not in ("", self._ground_z):
            return
        z = spawn_height(choice.world, choice.clearance, *at)
        self._ground_z = "" if z is None else _metres(z)
        self._form.set_texts({"spawn_z": self._ground_z, "spawn_yaw": texts["spawn_yaw"] or "0"})

    def pick(self, what: str) -> None:
        """Starts picking "start", "heading" or "goal" on the map; "" ends it."""
        if what == "heading" and self.spawn is None:
            what = "start"
        if what == "start" and self._free is not None:
            self.map.aim_at(*self._free)
        self.picked_next = what
        self.map.picking = bool(what)
        for footer in self.screen.query(KeyFooter):
            # Here enter picks a place, and nothing else.
            footer.say("map.pick", "set here" if what else "")
        self._show_picking()

    def ask_again(self) -> None:
        """Back to the map, where a place is picked next, once each missing file has its remedy."""
        missing = () if self.choice is None else self.choice.missing
        if self.picked_next and self.missing.has_focus and all(row.remedy for row in missing):
            self.map.focus()

    @on(WorldMap.PlacePicked)
    def _place_picked(self, event: WorldMap.PlacePicked) -> None:
        if self.choice is None or not self.picked_next:
            return
        if self.picked_next == "start":
            texts, then = self._start(self.choice, event.x, event.y), "heading"
        elif self.picked_next == "heading":
            texts, then = self._heading(event.x, event.y), "goal" if self.goal is None else ""
        else:
            texts, then = {"goal_x": _metres(event.x), "goal_y": _metres(event.y)}, ""
        if texts:
            self._form.set_texts(texts)
            self.pick(then)

    def _start(self, choice: Choice, x: float, y: float) -> dict[str, str]:
        z = spawn_height(choice.world, choice.clearance, x, y)
        texts = {"spawn_x": _metres(x), "spawn_y": _metres(y)}
        if z is not None:
            texts["spawn_z"] = _metres(z)
        if not self._form.texts["spawn_yaw"].strip():
            texts["spawn_yaw"] = "0"
        return texts

    def _heading(self, x: float, y: float) -> dict[str, str]:
        spawn = self.spawn
        if spawn is None or math.hypot(x - spawn[0], y - spawn[1]) < 0.01:
            return {}
        return {"spawn_yaw": form.text_of(round(math.atan2(y - spawn[1], x - spawn[0]), 3))}

    def _show_picking(self) -> None:
        from ddenv.map.raster import arrow

        line, what = self.query_one("#picking", Static), self.picked_next
        line.set_class(bool(what), "-on")
        text = Text(no_wrap=True, overflow="ellipsis")
        if what:
            line.update(text.append("▶ ", "bold").append(ASKS[what]).append("   escape stops", "dim"))
            return
        spawn, goal = self.spawn, self.goal
        if self.choice is None:
            line.update("")
        elif spawn is None and goal is None and self.choice.scenario is None:
            line.update(text.append("no start and goal yet: ").append("s", "bold").append(" sets them on the map"))
        else:
            heading = f"{arrow(spawn[3])} {math.degrees(spawn[3]):.0f}°" if spawn else "?"
            where = {"start": _point(spawn), "heading": heading, "goal": _point(goal)}
            forms = [_places(where, where), _places(where, ("start", "goal"), "  "), _places(where, (), "  ")]
            line.update(next((form for form in forms if form.cell_len <= line.content_size.width), forms[-1]))

    @work(thread=True, group="notes", exclusive=True)
    def _look_at_start(self, choice: Choice, spawn: tuple[float, ...] | None, goal: tuple[float, ...] | None) -> None:
        found, free = notes(choice, spawn, goal)
        if not get_current_worker().is_cancelled:
            call_if_open(self, self._show_notes, found, free)

    def _show_notes(self, found: tuple[tuple[str, str], ...], free: Point | None) -> None:
        """The first note is a line, hidden while there is none; the tooltip has all of them."""
        self._free = free
        line = self.query_one("#start-notes", Static)
        line.display = bool(found)
        if found:
            about, words = found[0]
            more = f" (+{len(found) - 1})" if len(found) > 1 else ""
            todo = REMEDIES[about]
            line.update(Text(f"▲ {todo}{more}: {plain(words.removesuffix(f'; {todo}'))}"))
            line.tooltip = Text("\n".join(f"{plain(words)}." for _, words in found))

    def _show_about(self) -> None:
        line, words = self.query_one("#about", Static), "" if self.choice is None else self.choice.about
        most = line.styles.max_height
        lines = wrap(words, max(3, line.content_size.width), max_lines=most and most.cells, placeholder=" …")
        line.update(Text("\n".join(lines) if lines and lines[-1].endswith(" …") else words))
        line.tooltip = words or None


def notes(
    choice: Choice, spawn: tuple[float, ...] | None, goal: tuple[float, ...] | None
) -> tuple[tuple[tuple[str, str], ...], Point | None]:
    """What is wrong with the start, as the run would note it: a word and a sentence for each; and where it had better be, m."""
    from ddenv.world.placement import note_inside, notes_on_start, stands_inside
    from ddenv.world.scenario import Spawn

    try:
        robot = choice.robot
    except UserError:
        # Start then reports the file's error.
        robot = None
    if robot is None or spawn is None:
        return tuple(note_inside(choice.world)), None
    x, y, z, yaw = spawn
    start = Spawn(x=x, y=y, z=z, yaw=yaw)
    others = tuple(notes_on_start(choice.world, robot, start, (goal[0], goal[1]) if goal else None))
    if (inside := stands_inside(choice.world, robot, start)) is None:
        return others, None
    why, place = inside
    return (("start", why), *others), None if place is None else (place.x, place.y)


def _places(where: Mapping[str, str], named: Collection[str], gap: str = "   ") -> Text:
    """The keys that pick a place, with where it is; the `named` ones with what it is."""
    text = Text(no_wrap=True, overflow="ellipsis")
    for what, at in where.items():
        said = f" {what} {at}" if what in named else f" {at}"
        text.append(gap if text else "").append(KEYS[what], "bold").append(said)
    return text


def _metres(value: float) -> str:
    return form.text_of(round(value, 3) + 0.0)


def _point(place: tuple[float, ...] | None) -> str:
    return f"({place[0]:.2f}, {place[1]:.2f}) m" if place else "not set"


def _free_name(scenario_name: str) -> str:
    from ddenv.runs.folder import free_run_path

    try:
        return free_run_path(scenario_name).stem
    except OSError:
        return "run"
