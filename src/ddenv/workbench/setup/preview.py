"""The chosen world on the setup screen: its map, picking places on it, and its description."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from textwrap import wrap
from threading import Thread, current_thread
from typing import Any, ClassVar

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.message import Message
from textual.widgets import Static
from textual.worker import Worker, get_current_worker

from ddenv.errors import UserError
from ddenv.runs.folder import free_run_path, runs_folder
from ddenv.runs.remedies import remember_remedies
from ddenv.text import plain, shortened
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.map.place import Place, place_of
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.setup import form
from ddenv.workbench.setup.choice import Choice, read_choice
from ddenv.workbench.setup.fields import OptionsForm
from ddenv.workbench.setup.files import remember
from ddenv.workbench.setup.missing_files import MissingList
from ddenv.workbench.setup.start_run import Past, past_of
from ddenv.workbench.shared.background import call_if_open
from ddenv.workbench.shared.bindings import keys
from ddenv.world.files.watch import watched
from ddenv.world.pose import Point

# What to do about each kind of note; it comes first, since the end of a line may not fit.
REMEDIES = {
    "start": "s moves it to a free place",
    "drop": "lower the spawn's z",
    "goal": "move the goal",
    "inside": "move one model, or make both static",
    "gravity": "let it point down",
    "wheels": "see where its wheels are",
    "passage": "move the start or the goal",
}
KEYS = {"start": "s", "heading": "h", "goal": "g"}
ASKS = {
    "start": "the start: move the crosshair and press enter, or click",
    "heading": "the heading: pick a place for the robot to look at",
    "goal": "the goal: move the crosshair and press enter, or click",
}


class Preview(Vertical):
    """The panel with the world. `choice` is the last one read, None while reading (`awaited`) or
    after an error.

    `picked_next` is "start", "heading" or "goal", what is picked on the map next, or "" for
    nothing. The settings and the places are in the form, which it fills in. `past` is what earlier
    runs of the choice say of its cost.
    """

    BINDINGS: ClassVar = keys(
        "missing",
        ("fetch", "f", "fetch", "fetch", "download what is missing from Gazebo Fuel; again: stop"),
    )

    @dataclass
    class Read(Message):
        """The choice was read; or it cannot be read, and the map says why. `opened`: the user
        opened its file just now.
        """

        opened: bool = False

    class PastRead(Message):
        """`past` was read, too."""

    def __init__(self, form: OptionsForm, reading: Mapping[str, Any], *, id: str) -> None:
        """`reading` holds the command line's options for reading worlds."""
        super().__init__(id=id, classes="panel")
        self._form = form
        self._reading = reading
        self.map = WorldMap(id="map")
        self.missing = MissingList(id="missing")
        self.choice: Choice | None = None
        self.awaited = True
        self.past = Past()
        self.picked_next = ""
        # While models come from Fuel.
        self._fetching: Thread | None = None
        # Whether the places in the form are of no scenario: another bare world keeps them.
        self._keeps_places = False
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

    def on_unmount(self) -> None:
        self._fetching = None

    def on_resize(self) -> None:
        self._show_picking()
        self.call_after_refresh(self._show_about)

    def read(self, path: Path, *, opened: bool) -> None:
        """Reads a scenario, a world or a run in a thread. A file that the user `opened` is
        remembered.
        """
        self._keeps_places = self.choice is not None and self.choice.bare
        self.awaited = True
        self.past = Past()
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
        self.border_title = Text(shortened(plain(name), 40))
        self.border_subtitle = ""

    @work(thread=True, group="world", exclusive=True)
    def _read(self, path: Path, opened: bool, again: bool = False) -> None:
        worker = get_current_worker()

        def tell(callback: Callable[..., object], *words: object) -> None:
            if not worker.is_cancelled:
                call_if_open(self, callback, *words)

        try:
            with watched(partial(self._watch, worker)):
                choice = read_choice(path, self._reading)
            place = place_of(choice.world, None if choice.bare else choice.settings)
        except UserError as error:
            tell(self._fail, str(error))
            return
        name = "run"
        with suppress(OSError):
            name = free_run_path(choice.settings.name).stem
        tell(self._show, choice, place, name, opened, again)
        if opened and not worker.is_cancelled:
            remember(path)
        tell(self._show_past, past_of(choice.settings, runs_folder()))

    def _watch(self, worker: Worker[None], words: str) -> None:
        """Says how far the cutting of meshes is; where the user looks at something else by now, it
        stops.
        """
        if worker.is_cancelled:
            raise UserError("stopped")
        if words:
            # Waits for no answer: the app may just be ending.
            self.call_later(setattr, self, "border_subtitle", words)

    def _fail(self, why: str) -> None:
        self.awaited = False
        self.show_nothing(why)
        self._form.suggest_name("")
        self._form.set_texts({one.name: "" for one in form.PLACES})
        self.post_message(self.Read())

    def _show(self, choice: Choice, place: Place, name: str, opened: bool, again: bool) -> None:
        """Shows what was read; `again` if only its remedies changed."""
        self.choice = choice
        self.awaited = False
        self._title(choice.name)
        self.map.set_place(place)
        self.missing.show(choice.missing, choice.world.notes)
        self._show_about()
        self._form.suggest_name(name)
        if again:
            self.show_places()
            if (
                self.picked_next
                and self.missing.has_focus
                and all(row.remedy for row in choice.missing)
            ):
                # A place is picked next.
                self.map.focus()
        else:
            texts = self._form.texts if self._keeps_places else {}
            if choice.bare:
                places = {one.name: texts.get(one.name, "") for one in form.PLACES}
            else:
                places = {}
            self._form.show_settings(choice.settings, places)
        self.post_message(self.Read(opened and not again))

    def _show_past(self, past: Past) -> None:
        self.past = past
        self.post_message(self.PastRead())

    @on(MissingList.Chosen)
    def _remedies_chosen(self, event: MissingList.Chosen) -> None:
        event.stop()
        remember_remedies(event.remedies)
        self._read_again()

    def _read_again(self) -> None:
        """Reads the world with other remedies or files; until then the map stays."""
        if self.choice:
            self._read(self.choice.path, False, again=True)

    def action_fetch(self) -> None:
        if self._fetching:
            self._fetching = None
            self._read_again()
        elif self.choice:
            # Where a server hangs, this thread does not hold up the end of the workbench.
            self._fetching = Thread(target=self._fetch, args=(self.choice,), daemon=True)
            self._fetching.start()

    def _fetch(self, choice: Choice) -> None:
        """Downloads from Fuel what a world lacks; the user may look at others meanwhile."""
        from ddenv.runs.fetching import fetch_missing
        from ddenv.world.sdf.read import parse_world

        needs = choice.settings

        def arrived(name: str, received: int, total: int | None) -> None:
            if self._fetching is not current_thread():
                # Ends the thread, and leaves nothing behind.
                raise SystemExit
            whole = f" of {total / 1e6:.1f}" if total else ""
            words = f"{name}: {received / 1e6:.1f}{whole} MB; f stops"
            call_if_open(self, setattr, self.missing, "border_title", Text(plain(words)))

        def tell(words: str) -> None:
            call_if_open(self, partial(self.notify, timeout=10, markup=False), plain(words))

        try:
            fetch_missing(
                needs.world,
                needs.reading,
                parse_world,
                show=lambda model: partial(arrived, model.name),
                tell=tell,
                advice="w leaves it out",
            )
        except UserError as error:
            tell(str(error))
        self._fetching = None
        call_if_open(self, self._read_again)

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
        return self.choice is not None and self.choice.bare and self.spawn is None

    def show_places(self) -> None:
        if (choice := self.choice) is None:
            return
        texts = self._form.texts
        at = form.numbers(form.SPAWN[:2], texts)
        if choice.bare and at is not None and texts["spawn_z"] in ("", self._ground_z):
            z = choice.spawn_height(*at)
            self._ground_z = "" if z is None else _metres(z)
            self._form.set_texts({"spawn_z": self._ground_z, "yaw": texts["yaw"] or "0"})
        spawn = self.spawn
        goal = self.goal
        self.map.set_marks(
            (spawn[0], spawn[1], spawn[3]) if spawn else None, (goal[0], goal[1]) if goal else None
        )
        self._show_picking()
        self._look_at_start(choice, spawn, goal)

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

    @on(WorldMap.PlacePicked)
    def _place_picked(self, event: WorldMap.PlacePicked) -> None:
        x = event.x
        y = event.y
        spawn = self.spawn
        then = ""
        if self.choice is None or not self.picked_next:
            return
        if self.picked_next == "start":
            yaw = self._form.texts["yaw"].strip() or "0"
            z = self.choice.spawn_height(x, y)
            texts = {"spawn_x": _metres(x), "spawn_y": _metres(y), "yaw": yaw}
            texts |= {} if z is None else {"spawn_z": _metres(z)}
            then = "heading"
        elif self.picked_next == "goal":
            texts = {"goal_x": _metres(x), "goal_y": _metres(y)}
        elif spawn is None or math.hypot(x - spawn[0], y - spawn[1]) < 0.01:
            return
        else:
            texts = {"yaw": form.text_of(round(math.atan2(y - spawn[1], x - spawn[0]), 3))}
            then = "goal" if self.goal is None else ""
        self._form.set_texts(texts)
        self.pick(then)

    def _show_picking(self) -> None:
        from ddenv.map.raster import arrow

        line = self.query_one("#picking", Static)
        what = self.picked_next
        line.set_class(bool(what), "-on")
        text = Text(no_wrap=True, overflow="ellipsis")
        if what:
            line.update(
                text.append("▶ ", "bold").append(ASKS[what]).append("   escape stops", "dim")
            )
            return
        spawn = self.spawn
        goal = self.goal
        if self.choice is None:
            line.update("")
        elif spawn is None and goal is None and self.choice.bare:
            line.update(
                text.append("no start and goal yet: ")
                .append("s", "bold")
                .append(" sets them on the map")
            )
        else:
            heading = f"{arrow(spawn[3])} {math.degrees(spawn[3]):.0f}°" if spawn else "?"
            where = {"start": _point(spawn), "heading": heading, "goal": _point(goal)}
            forms = [
                _places(where, where),
                _places(where, ("start", "goal"), "  "),
                _places(where, (), "  "),
            ]
            line.update(
                next(
                    (form for form in forms if form.cell_len <= line.content_size.width), forms[-1]
                )
            )

    @work(thread=True, group="notes", exclusive=True)
    def _look_at_start(
        self, choice: Choice, spawn: tuple[float, ...] | None, goal: tuple[float, ...] | None
    ) -> None:
        """Shows what is wrong with the start, as the run would note it, and where it had better
        be.
        """
        from ddenv.world.placement import note_inside, notes_on_start, stands_inside
        from ddenv.world.scenario import Spawn

        worker = get_current_worker()
        free = None
        found = tuple(note_inside(choice.world))
        # Start then reports the error of a robot's file.
        with suppress(UserError), watched(partial(self._watch, worker)):
            if spawn is not None and (robot := choice.robot):
                start = Spawn(x=spawn[0], y=spawn[1], z=spawn[2], yaw=spawn[3])
                if goal:
                    end = choice.settings.goal.model_copy(update={"x": goal[0], "y": goal[1]})
                else:
                    end = None
                found = tuple(notes_on_start(choice.world, robot, start, end))
                if (inside := stands_inside(choice.world, robot, start, end)) is not None:
                    why, place = inside
                    found = (("start", why), *found)
                    free = None if place is None else (place.x, place.y)
        if not worker.is_cancelled:
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
        line = self.query_one("#about", Static)
        words = "" if self.choice is None else self.choice.about
        most = line.styles.max_height
        lines = wrap(
            words, max(3, line.content_size.width), max_lines=most and most.cells, placeholder=" …"
        )
        line.update(Text("\n".join(lines) if lines and lines[-1].endswith(" …") else words))
        line.tooltip = words or None


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
    if place:
        return f"({place[0]:.2f}, {place[1]:.2f}) m"
    return "not set"
