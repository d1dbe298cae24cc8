"""Picking the robot's start, its heading and its goal on the map of the setup screen."""

from __future__ import annotations

import math
from typing import Any

from rich.text import Text
from textual import on
from textual.screen import Screen
from textual.widgets import Static

from ddenv.map.raster import arrow
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.setup import form
from ddenv.workbench.setup.chosen import Chosen, spawn_height
from ddenv.workbench.setup.fields import OptionsForm

KEYS = {"start": "s", "heading": "h", "goal": "g"}
ASKS = {
    "start": "the start: move the crosshair and press enter, or click",
    "heading": "the heading: pick a place that the robot looks at",
    "goal": "the goal: move the crosshair and press enter, or click",
}


class Picking(Screen[None]):
    """What the next place that is picked on the map stands for, "" for nothing; and the line that tells it."""

    picked_next = ""
    chosen: Chosen | None = None

    @property
    def form(self) -> OptionsForm:
        return self.query_one(OptionsForm)

    def pick(self, what: str) -> None:
        """The next place on the map is "start", "heading" or "goal"; "" ends that."""
        if what == "heading" and self._place("spawn") is None:
            what = "start"
        self.picked_next = what
        self.query_one(WorldMap).picking = bool(what)
        self.tell_places()

    def action_pick(self, what: str) -> None:
        if self.chosen is None:
            self.notify("there is no world to pick a place in yet", severity="warning", timeout=3)
            return
        self.show_map()
        self.pick(what)

    def show_map(self) -> None:
        """Brings the map into sight, with the cursor on it."""
        self.query_one(WorldMap).focus()

    def on_world_map_place_picked(self, event: Any) -> None:
        """A place in m, by the crosshair or by the mouse."""
        event.stop()
        if self.chosen is None or not self.picked_next:
            return
        texts = getattr(self, f"_texts_of_{self.picked_next}")(event.x, event.y)
        if texts is None:
            return
        self.form.set_texts(texts)
        self.pick(self._next())

    def _next(self) -> str:
        """What is still to be placed, in the order in which it is thought of."""
        if self.picked_next == "start":
            return "heading"
        return "goal" if self._place("goal") is None else ""

    def _texts_of_start(self, x: float, y: float) -> dict[str, str]:
        z = spawn_height(self.chosen.world, self.chosen.clear, x, y)
        texts = {"spawn_x": _metres(x), "spawn_y": _metres(y)}
        if z is not None:
            texts["spawn_z"] = _metres(z)
        if not self.form.texts["spawn_yaw"].strip():
            texts["spawn_yaw"] = "0"
        return texts

    def _texts_of_heading(self, x: float, y: float) -> dict[str, str] | None:
        spawn = self._place("spawn")
        if spawn is None or math.hypot(x - spawn[0], y - spawn[1]) < 0.01:
            return None
        return {"spawn_yaw": form.text_of(round(math.atan2(y - spawn[1], x - spawn[0]), 3))}

    def _texts_of_goal(self, x: float, y: float) -> dict[str, str]:
        return {"goal_x": _metres(x), "goal_y": _metres(y)}

    def _place(self, what: str) -> tuple[float, ...] | None:
        numbers = form.place(what, self.form.texts)
        return numbers if numbers and all(map(math.isfinite, numbers)) else None

    @on(OptionsForm.Edited)
    def _places_edited(self, event: OptionsForm.Edited) -> None:
        if event.place:
            self.mark_places()

    def mark_places(self) -> None:
        """Shows spawn and goal on the map as the numbers have them."""
        if self.chosen is None:
            return
        spawn, goal = self._place("spawn"), self._place("goal")
        self.query_one(WorldMap).set_marks(spawn and (spawn[0], spawn[1], spawn[3]), goal and (goal[0], goal[1]))
        self.tell_places()

    def tell_places(self) -> None:
        """The line below the map: what is being picked, or where start and goal are and the keys to pick others."""
        line = self.query_one("#picking", Static)
        line.set_class(bool(self.picked_next), "-on")
        if self.picked_next:
            words = Text("▶ ", "bold", no_wrap=True, overflow="ellipsis").append(ASKS[self.picked_next])
            line.update(words.append("   escape leaves it", "dim"))
            return
        spawn, goal = self._place("spawn"), self._place("goal")
        heading = f"{arrow(spawn[3])} {math.degrees(spawn[3]):.0f}°" if spawn else "?"
        words = {"start": _point(spawn), "heading": heading, "goal": _point(goal)}
        text = Text(no_wrap=True, overflow="ellipsis")
        for what, where in words.items():
            text.append(KEYS[what], "bold").append(f" {what} {where}   ")
        line.update(text)


def _metres(value: float) -> str:
    return form.text_of(round(value, 3) + 0.0)


def _point(place: tuple[float, ...] | None) -> str:
    return f"({place[0]:.2f}, {place[1]:.2f}) m" if place else "not set"
