"""The keys of the run screen, and which of them the footer shows first.

A key that guides the run has the action `guide`, with its name in `ddenv.guiding.offers.ACTIONS`.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import TYPE_CHECKING

from textual.binding import Binding, BindingType

from ddenv.guiding.offers import Offer, Pointed, offer
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.run.snapshot import NOT_NOW

if TYPE_CHECKING:
    from ddenv.workbench.run.run_screen import RunScreen


def _ids(names: str) -> tuple[str, ...]:
    return tuple(name if "." in name else f"run.{name}" for name in names.split())


# The footer's keys in the order of the screen, then by priority; `MORE` of them fit on wide screens only.
MORE = _ids("signs facts play rounds find layers copy scene runs")
SHOWN = (
    *_ids("pause step accept reject veto pin without only leave_out undo history change export why isolate"),
    *MORE,
    *_ids("help quit"),
)
FIRST = (
    *_ids("help quit pause accept reject leave_out step veto pin without undo history export why change only"),
    *MORE,
)
# What comes next when the run has ended.
ENDED = _ids("why isolate export play quit help leave_out history change pin without only undo find scene runs")
# While an earlier moment is shown, while the map has the focus, and on a screen that only watches.
BROWSING = _ids("back on round_before next_round rounds facts follow help quit play signs")
ON_MAP = _ids(
    "help quit pause accept reject leave_out map.pick map.next step pin without only undo history export why find layers fit"
)
LOOKING = _ids("history rounds facts play why export find copy layers signs help quit")
# What the pointer shows over the parts that take no keys, by their ids.
TOOLTIPS = {
    "header": "scenario and method; the round, and how many models are left",
    "status": "the state of the run, its tests by outcome, how often f shows, time, and what is left",
    "map-lines": "the signs on the map; k explains all of them",
    "chart": "how many models were left after each test; the dashed line: how many seem to be needed",
}
# These ask for models if none are selected. A pin always asks: it ends the search.
TITLES = {
    "pin": "Pin or unpin models (+): pinned ones stay; a new search begins",
    "without": "Try without these models",
    "only": "Try only these models",
}


def _key(keys: str, action: str, words: str, name: str, tooltip: str, display: str | None = None) -> Binding:
    return Binding(keys, action, words, id=f"run.{name}", tooltip=tooltip, show=False, key_display=display)


def _guide(key: str, action: str, words: str, tooltip: str, name: str = "") -> Binding:
    return _key(key, f"guide('{action}')", words, name or action, tooltip)


_KEYS = [
    _guide("space", "pause", "pause", "pause: start no new test; again to go on; starts an engine if none is running"),
    _guide("s", "step", "step", "run one test, then pause"),
    _guide(
        "a",
        "accept",
        "accept",
        "accept the reduction that waits; or adopt the try under the cursor that shows f; or count another failure of "
        "the candidate or try under the cursor as f, too",
    ),
    _guide("x", "reject", "reject", "reject the reduction that waits, and go on with the round"),
    _guide("v", "veto", "veto", "leave out the candidate under the cursor; again takes that back"),
    _guide(
        "p",
        "pin",
        "pins",
        "choose the models that always stay, from a list in which the selected ones are marked; pinned ones are unpinned",
    ),
    _guide(
        "w",
        "without",
        "try without",
        "try by hand: test the environment without the selected models; asks for their names if none is selected",
    ),
    _guide("o", "only", "try only", "try by hand: test the selected models alone, or those you name"),
    _guide(
        "H",
        "leave_out",
        "leave out",
        "leave out the model that only helps, by the certificate: without it f is a little rarer; a new search begins",
    ),
    _guide("u", "undo", "undo", "undo: take back the last reduction; it is not made again"),
    _key(
        "h",
        "open('history')",
        "history",
        "history",
        "history: the tree of reductions; go back to any, branch from there, compare two",
    ),
    _guide("c", "change", "settings", "change pair, algorithm, iterations or budget, from the next round on"),
    _key(
        "E", "open('export')", "export", "export", "export: the world that is left, a scenario that runs it, the report"
    ),
    _key(
        "W",
        "open('why')",
        "why",
        "why",
        "why the robot fails: what happens without each model that is left, in words and on the map",
    ),
    _key("question_mark,f1", "app.help", "help", "help", "show every key", "?"),
    _key("q", "quit", "quit", "quit", "leave; asks whether to stop the engine"),
    _guide("S", "step_round", "round", "run to the end of the round, then pause", "round"),
    _guide("t", "mode", "ask", "accept reductions automatically, or ask before each one"),
    _key(
        "f",
        "open('failures')",
        "failures",
        "failures",
        "other failures that the tests met: each with its smallest environment; reduce one in a branch",
    ),
    _key("slash", "open('find')", "find", "find", "find a model by its name, and show it on the map", "/"),
    _key("l", "open('layers')", "layers", "layers", "choose what the map shows"),
    _key("y", "open('copy')", "copy", "copy", "copy the names of the models left, or the command to come back"),
    _key("m", "open('scene')", "scene", "scene", "start the 3-D scene and show its address"),
    _key("e", "open('method')", "explain", "method", "explain how this run is reduced"),
    _key("1", "pane('map')", "map", "map", "the map"),
    _key("2", "pane('round')", "round", "table", "the table of candidates and tries"),
    _key("3", "pane('chart')", "chart", "chart", "the chart of models left by test"),
    _key("4", "pane('now')", "what is happening", "now", "what is happening, in words"),
    _key("5,L", "pane('log')", "log", "log", "the log: what happened so far, with the time of day"),
    _key("g", "next_pane", "next pane", "next_pane", "the next pane"),
    _key("escape", "follow", "follow", "follow", "back to now; select nothing; cursor and map follow the run again"),
    _key("plus,equals_sign", "zoom(1.25)", "closer", "closer", "map: closer", "+"),
    _key("minus", "zoom(0.8)", "farther", "farther", "map: farther away", "-"),
    _key("0", "fit", "fit", "fit", "map: show all that matters"),
    _key("comma", "browse('moment', -1)", "back", "back", "back in the run: to the moment before this one", ","),
    _key("full_stop", "browse('moment', 1)", "on", "on", "on to the next moment; after the last one comes now", "."),
    _key(
        "less_than_sign", "browse('round', -1)", "round before", "round_before", "to the end of the round before", "<"
    ),
    _key(
        "greater_than_sign",
        "browse('round', 1)",
        "next round",
        "next_round",
        "to the end of this or the next round",
        ">",
    ),
    _key("left_parenthesis", "browse('decision', -1)", "", "decision_before", "to the verdict or decision before", "("),
    _key("right_parenthesis", "browse('decision', 1)", "", "next_decision", "to the next verdict or decision", ")"),
    _key("left_curly_bracket", "browse('reduction', -1)", "", "reduction_before", "to the reduction before", "{"),
    _key("right_curly_bracket", "browse('reduction', 1)", "", "next_reduction", "to the next reduction", "}"),
    _key("b", "open('rounds')", "rounds", "rounds", "the list of all rounds so far: go to the end of any"),
    _guide(
        "i",
        "isolate",
        "world that passes",
        "find a nearest world that passes, in which the robot reaches its goal; while that goes on: stop it",
    ),
    _key("F", "open('facts')", "facts", "facts", "the raw facts of a test, and the command that makes it again"),
    _key("P", "open('play')", "play", "play", "play a finished test of the row under the cursor back on the map"),
    _key("k", "open('signs')", "signs", "signs", "what the signs and letters on this screen mean"),
    _guide("r", "resume", "resume", "start the engine again"),
    _key("R", "app.runs", "runs", "runs", "the list of all runs"),
    _key("d", "detach", "detach", "detach", "leave the workbench; the engine goes on"),
]
KEYS: list[BindingType] = [*_KEYS]


def _name(binding: Binding) -> str:
    """The name of what a key does to guide the run, or ""."""
    return binding.action[7:-2] if binding.action.startswith("guide(") else ""


# The bindings that guide the run, by these names.
GUIDING = {_name(each): each for each in _KEYS if _name(each)}


class KeyOffers:
    """The keys by the names in `ddenv.guiding.offers.ACTIONS`, for what the user points at in the table and on the map."""

    def __init__(self, screen: RunScreen) -> None:
        self._screen = screen

    def offer(self, name: str) -> Offer:
        """What a key does now."""
        if self._screen.browsing.is_past:
            return Offer(why_not=NOT_NOW)
        return offer(name, self._screen.asking.situation, self.pointed)

    @property
    def pointed(self) -> Pointed:
        """The row under the cursor, if it is in sight, and the selected models in the order of the world."""
        names, elements, table = self._selection(), self._screen.poll.snapshot.state.elements, self._screen.table
        known = tuple(name for name in elements if name in names) if names else ()
        row = table.under_cursor if table.is_attached and table.is_on_screen else None
        return Pointed(row, table.following, (*known, *sorted(names.difference(known))))

    def _selection(self) -> frozenset[str]:
        """The models that were selected by hand, or the one that the crosshair is on."""
        world = self._screen.world
        if world.selection:
            return frozenset(world.selection)
        name = world.model_at_cursor if world.has_focus else None
        return frozenset() if name is None else frozenset((name,))

    def show(self, footer: KeyFooter) -> None:
        """Shows in the footer what is possible."""
        now, pointed = self._screen.asking.situation, self.pointed
        for name, binding in GUIDING.items():
            offered = offer(name, now, pointed)
            footer.say(binding.id or "", "" if offered.why_not else offered.words or binding.description)

    def pressed(self, key: str) -> None:
        """Shows why a key does nothing, if it guides the run and is not possible now."""
        # To list what all keys do now takes longer than most keys take.
        if any(each in GUIDING.values() for each in self._screen._bindings.key_to_bindings.get(key, ())):
            active = self._screen.active_bindings.get(key)
            if active is not None and not active.enabled and active.node is self._screen:
                self._screen.asking.refuse(self.offer(_name(active.binding)).why_not)

    def use(self, name: str) -> None:
        """Does what a key means now; it asks for models if none are selected but some are needed, and always for pins."""
        offered, asking, opening = self.offer(name), self._screen.asking, self._screen.opening
        if self._screen.browsing.is_past:
            asking.refuse(offered.why_not)
        elif offered.command is not None and name != "pin":
            asking.ask(offered.command)
        elif name == "change":
            opening.change()
        elif name in TITLES:
            environment = self._screen.poll.snapshot.state.environment
            opening.choose(TITLES[name], environment, True, partial(self._chosen, name), self.pointed.models)

    def _chosen(self, name: str, models: Collection[str]) -> None:
        now = offer(name, self._screen.asking.situation, Pointed(models=tuple(models)))
        if now.command is None:
            self._screen.asking.refuse(now.why_not)
        else:
            self._screen.asking.ask(now.command)
