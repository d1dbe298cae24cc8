"""The chosen world on the setup screen: its map, picking places on it, and its description."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.message import Message
from textual.widgets import Static
from textual.worker import get_current_worker

from ddenv.errors import UserError
from ddenv.map.raster import arrow
from ddenv.text import plain, shortened
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.map.place import Place, place_of
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.setup import form
from ddenv.workbench.setup.choice import Choice, read_choice, spawn_height
from ddenv.workbench.setup.costs import Past, past_of
from ddenv.workbench.setup.fields import OptionsForm
from ddenv.workbench.setup.file_list import remember
from ddenv.workbench.setup.missing_list import MissingList
from ddenv.workbench.setup.places import places_of, remember_places
from ddenv.workbench.setup.remedies import remember_remedies
from ddenv.workbench.shared.background import call_if_open

# What to do about each kind of note; it comes first, since the end of a line may not fit.
REMEDIES = {"drop": "lower the spawn's z", "inside": "move one model, or make both static"}
KEYS = {"start": "s", "heading": "h", "goal": "g"}
ASKS = {
    "start": "the start: move the crosshair and press enter, or click",
    "heading": "the heading: pick a place for the robot to look at",
    "goal": "the goal: move the crosshair and press enter, or click",
}
# The same while the focus is elsewhere, where the arrows and enter mean something else.
ASKS_FROM_AFAR = "the {what} comes next: {key} goes to the map, or click there"
MORE = " …"


class StartNotes(Static):
    """Hidden while nothing is wrong. The first note is a line; the tooltip has all of them."""

    def __init__(self, *, id: str) -> None:
        super().__init__("", id=id, markup=False)
        self.display = False
        self._choice: Choice | None = None
        self._spawn: tuple[float, ...] | None = None

    def look(self, choice: Choice | None, spawn: tuple[float, ...] | None) -> None:
        """Looks in a thread at a robot that starts at `spawn`: x, y, z in m, yaw in rad. None is not known yet."""
        if choice is self._choice and spawn == self._spawn:
            return
        self._choice, self._spawn = choice, spawn
        if choice is None:
            self._show(())
        else:
            self._look(choice, spawn)

    @work(thread=True, group="notes", exclusive=True)
    def _look(self, choice: Choice, spawn: tuple[float, ...] | None) -> None:
        found = notes(choice, spawn)
        if not get_current_worker().is_cancelled:
            call_if_open(self, self._show, found)

    def _show(self, found: tuple[tuple[str, str], ...]) -> None:
        self.display = bool(found)
        if found:
            about, words = found[0]
            more = f" (+{len(found) - 1})" if len(found) > 1 else ""
            todo = REMEDIES[about]
            said = plain(words.removesuffix(f"; {todo}"))
            self.update(Text(f"▲ {todo}{more}: {said}"))
            self.tooltip = Text("\n".join(f"{plain(words)}." for _, words in found))


def notes(choice: Choice, spawn: tuple[float, ...] | None) -> tuple[tuple[str, str], ...]:
    """What is wrong with the start, as the run would note it: a word and a sentence for each."""
    from ddenv.world.placement import note_inside, notes_on_start
    from ddenv.world.scenario import Spawn

    try:
        robot = choice.robot
    except UserError:
        # Start then reports the file's error.
        robot = None
    if robot is None or spawn is None:
        return tuple(note_inside(choice.world))
    x, y, z, yaw = spawn
    return tuple(notes_on_start(choice.world, robot, Spawn(x=x, y=y, z=z, yaw=yaw)))


class Preview(Vertical):
    """The panel with the world. `choice` is the last one read, None while reading or after an error."""

    @dataclass
    class Read(Message):
        """The choice was read; `free_name` is the name that its next run gets. `again`: only its remedies changed."""

        choice: Choice
        free_name: str
        again: bool = False

    @dataclass
    class Failed(Message):
        """It cannot be read: the map says why."""

    @dataclass
    class PastRead(Message):
        """The cost of earlier runs of the choice was read, too."""

        choice: Choice
        past: Past

    def __init__(self, form: OptionsForm, reading: Mapping[str, Any], *, id: str) -> None:
        """`reading` holds the command line's options for reading worlds."""
        super().__init__(id=id, classes="panel")
        self._reading = reading
        self.map = WorldMap(id="map")
        self.missing = MissingList(id="missing")
        self.picker = PlacePicker(self.map, form, id="picking")
        self.choice: Choice | None = None
        self.border_title = "World"

    @property
    def asks(self) -> bool:
        """Whether the chosen world has no start yet."""
        return self.choice is not None and self.choice.scenario is None and self.picker.spawn is None

    def show_places(self) -> None:
        """Shows the form's start and goal, and what is wrong with the start."""
        self.picker.show_places()
        spawn = form.place("spawn", self.picker.form.texts)
        known = bool(spawn) and all(map(math.isfinite, spawn or ()))
        self.query_one(StartNotes).look(self.choice, spawn if known else None)

    def places_for(self, keep: bool) -> dict[str, str]:
        """Start and goal of a world without a scenario: as the last time, or as they are if the user wants to `keep` them."""
        texts = self.picker.form.texts
        now = {field.id: texts[field.id] if keep else "" for field in form.PLACES}
        return now if self.choice is None else places_of(self.choice.path) or now

    def ask_again(self) -> None:
        """Back to the map, where a place is picked next, once each missing file has its remedy."""
        missing = () if self.choice is None else self.choice.missing
        if self.picker.picked_next and self.missing.has_focus and all(row.remedy for row in missing):
            self.map.focus()

    def remember_places(self) -> None:
        """For the next time that this world is chosen."""
        choice, picker = self.choice, self.picker
        if choice is not None and choice.scenario is None and picker.spawn is not None and picker.goal is not None:
            remember_places(choice.path, picker.form.texts)

    def compose(self) -> ComposeResult:
        yield self.map
        yield self.missing
        yield self.picker
        yield StartNotes(id="start-notes")
        yield About(id="about")

    def read(self, path: Path, *, opened: bool) -> None:
        """Reads a scenario, a world or a run in a thread. A file that the user `opened` is remembered."""
        self.show_nothing("reading the world ...")
        self._title(path.name)
        self._read(path, opened)

    def show_nothing(self, why: str) -> None:
        """Shows `why` the world cannot be shown."""
        self._choose(None)
        self.picker.pick("")
        self.query_one(About).show("")
        self.missing.show(())
        self.query_one(StartNotes).look(None, None)
        self.map.set_place(Place(), why)

    def _choose(self, choice: Choice | None) -> None:
        self.choice = self.picker.choice = choice

    def _title(self, name: str) -> None:
        self.border_title, self.border_subtitle = Text(shortened(plain(name), 40)), ""

    @work(thread=True, group="world", exclusive=True)
    def _read(self, path: Path, opened: bool, again: bool = False) -> None:
        from textual.worker import get_current_worker

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
        self.post_message(self.Failed())

    def _show(self, choice: Choice, place: Place, name: str, again: bool) -> None:
        self._choose(choice)
        self._title(choice.name)
        self.map.set_place(place)
        self.missing.show(choice.missing)
        self.query_one(About).show(choice.about)
        self.post_message(self.Read(choice, name, again))

    @on(MissingList.Chosen)
    def _remedies_chosen(self, event: MissingList.Chosen) -> None:
        """Remembers them, and reads the world again; until then the map stays."""
        event.stop()
        if self.choice is not None:
            remember_remedies(event.remedies)
            self._read(self.choice.path, False, again=True)

    @on(WorldMap.PlacePicked)
    def _place_picked(self, event: WorldMap.PlacePicked) -> None:
        self.picker.take(event.x, event.y)
        # The user may quit before a run begins.
        self.remember_places()


class PlacePicker(Static):
    """The line below the map: which place is picked next, or where start and goal are and the keys to pick others.

    The numbers themselves are in the form; the map shows them, and has the crosshair to pick with. `picked_next` is "start",
    "heading", "goal", or "" for nothing.
    """

    def __init__(self, world: WorldMap, form: OptionsForm, *, id: str) -> None:
        super().__init__("", id=id, markup=False)
        self._map, self.form = world, form
        self.choice: Choice | None = None
        self.picked_next = ""

    def pick(self, what: str) -> None:
        """Starts picking "start", "heading" or "goal" on the map; "" ends it."""
        if what == "heading" and self.spawn is None:
            what = "start"
        self.picked_next = what
        self._map.picking = bool(what)
        for footer in self.screen.query(KeyFooter) if self.is_attached else ():
            # Here enter picks a place, and nothing else.
            footer.say("map.pick", "set here" if what else "")
        self._show_words()

    def take(self, x: float, y: float) -> None:
        """A place on the map was picked, m: fills in the form, and continues with the next missing place."""
        if self.choice is None or not self.picked_next:
            return
        if self.picked_next == "start":
            texts, then = self._start(self.choice, x, y), "heading"
        elif self.picked_next == "heading":
            texts, then = self._heading(x, y), "goal" if self.goal is None else ""
        else:
            texts, then = {"goal_x": _metres(x), "goal_y": _metres(y)}, ""
        if texts:
            self.form.set_texts(texts)
            self.pick(then)

    def _start(self, choice: Choice, x: float, y: float) -> dict[str, str]:
        z = spawn_height(choice.world, choice.clearance, x, y)
        texts = {"spawn_x": _metres(x), "spawn_y": _metres(y)}
        if z is not None:
            texts["spawn_z"] = _metres(z)
        if not self.form.texts["spawn_yaw"].strip():
            texts["spawn_yaw"] = "0"
        return texts

    def _heading(self, x: float, y: float) -> dict[str, str]:
        spawn = self.spawn
        if spawn is None or math.hypot(x - spawn[0], y - spawn[1]) < 0.01:
            return {}
        return {"spawn_yaw": form.text_of(round(math.atan2(y - spawn[1], x - spawn[0]), 3))}

    @property
    def spawn(self) -> tuple[float, float, float] | None:
        """x and y, m, and yaw, rad, from the form; None while one of them is not a number."""
        numbers = form.place("spawn", self.form.texts)
        return (numbers[0], numbers[1], numbers[3]) if numbers and all(map(math.isfinite, numbers)) else None

    @property
    def goal(self) -> tuple[float, float] | None:
        """x and y, m, from the form; None while one of them is not a number."""
        numbers = form.place("goal", self.form.texts)
        return (numbers[0], numbers[1]) if numbers and all(map(math.isfinite, numbers)) else None

    def show_places(self) -> None:
        """Shows the form's start and goal, on the map and in words."""
        if self.choice is not None:
            self._map.set_marks(self.spawn, self.goal)
            self._show_words()

    def on_mount(self) -> None:
        self.watch(self.screen, "focused", self._focus_moved, init=False)

    def _focus_moved(self) -> None:
        if self.picked_next:
            self._show_words()

    def on_resize(self) -> None:
        self._show_words()

    def _show_words(self) -> None:
        """Where start and goal are, in the longest words that fit."""
        self.set_class(bool(self.picked_next), "-on")
        if self.picked_next:
            what = self.picked_next
            here = self.screen.focused is self._map
            asked = ASKS[what] if here else ASKS_FROM_AFAR.format(what=what, key=KEYS[what])
            words = Text("▶ ", "bold", no_wrap=True, overflow="ellipsis").append(asked)
            self.update(words.append("   escape stops", "dim"))
            return
        if self.choice is None:
            self.update("")
            return
        spawn, goal = self.spawn, self.goal
        if spawn is None and goal is None and self.choice is not None and self.choice.scenario is None:
            words = Text("no start and goal yet: ", no_wrap=True, overflow="ellipsis")
            self.update(words.append("s", "bold").append(" sets them on the map"))
            return
        heading = f"{arrow(spawn[2])} {math.degrees(spawn[2]):.0f}°" if spawn else "?"
        where = {"start": _point(spawn), "heading": heading, "goal": _point(goal)}
        forms = [_places(where, where), _places(where, ("start", "goal"), "  "), _places(where, (), "  ")]
        self.update(next((form for form in forms if form.cell_len <= self.content_size.width), forms[-1]))


class About(Static):
    """A text of at most `max-height` lines; an ellipsis marks a longer text, and the tooltip has all of it."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__("", id=id, markup=False)
        self._words = ""

    def show(self, words: str) -> None:
        self._words, self.tooltip = words, words or None
        self.on_resize()

    def on_resize(self) -> None:
        width, most = self.content_size.width, self.styles.max_height
        lines = Text(self._words).wrap(self.app.console, max(1, width))
        if most is None or most.cells is None or len(lines) <= most.cells:
            self.update(Text(self._words))
            return
        *shown, last = (line.plain.rstrip() for line in lines[: most.cells])
        if len(last) + len(MORE) > width:
            last = last.rpartition(" ")[0]
        self.update(Text("\n".join([*shown, f"{last}{MORE}"])))


def _places(where: Mapping[str, str], named: Collection[str], gap: str = "   ") -> Text:
    """The keys that pick a place, with where it is; the `named` ones with what it is."""
    text = Text(no_wrap=True, overflow="ellipsis")
    for what, at in where.items():
        text.append(gap if text else "").append(KEYS[what], "bold").append(
            f" {what} {at}" if what in named else f" {at}"
        )
    return text


def _metres(value: float) -> str:
    return form.text_of(round(value, 3) + 0.0)


def _point(place: tuple[float, ...] | None) -> str:
    return f"({place[0]:.2f}, {place[1]:.2f}) m" if place else "not set"


def _free_name(scenario_name: str) -> str:
    """The name that the next run of a scenario gets."""
    from ddenv.runs.folder import free_run_path

    try:
        return free_run_path(scenario_name).stem
    except OSError:
        return "run"
