"""The keys of the run screen, and which of them the footer shows first.

A key that guides the run has the action `guide`, with its name in `ddenv.guiding.offers.ACTIONS`.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import Any

from textual.binding import Binding, BindingType
from textual.screen import Screen

from ddenv.guiding.offers import Offer, Pointed, offer
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.asking import Asking
from ddenv.workbench.run.browsing import NOT_NOW, Browsing
from ddenv.workbench.run.candidates import Candidates
from ddenv.workbench.run.opening import Opening
from ddenv.workbench.shared.poll import Poll

# The footer's keys in the order of the screen, then by priority; `MORE` of them fit on wide screens only.
MORE = (
    "run.signs",
    "run.facts",
    "run.play",
    "run.rounds",
    "run.find",
    "run.layers",
    "run.copy",
    "run.scene",
    "run.runs",
)
FIRST = (
    "run.help",
    "run.quit",
    "run.pause",
    "run.accept",
    "run.reject",
    "run.leave_out",
    "run.step",
    "run.veto",
    "run.pin",
    "run.without",
    "run.undo",
    "run.history",
    "run.export",
    "run.why",
    "run.change",
    "run.only",
    *MORE,
)
# While an earlier moment is shown, and while the map has the focus.
BROWSING = (
    *("run.back", "run.on", "run.round_before", "run.next_round", "run.rounds", "run.facts", "run.follow", "run.help"),
    *("run.quit", "run.play", "run.signs"),
)
ON_MAP = (
    *("run.help", "map.pick", "map.next", "run.closer", "run.farther", "run.fit", "run.find", "run.layers", "run.pin"),
    *("run.without", "run.only", "run.signs", "run.pause", "run.quit"),
)
# The footer of a screen that only watches.
LOOKING = (
    *(
        "run.history",
        "run.rounds",
        "run.facts",
        "run.play",
        "run.why",
        "run.export",
        "run.find",
        "run.copy",
        "run.layers",
        "run.signs",
        "run.help",
    ),
    "run.quit",
)
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


def _hidden(key: str, action: str, words: str, id: str, tooltip: str, display: str | None = None) -> Binding:
    return Binding(key, action, words, id=id, tooltip=tooltip, show=False, key_display=display)


_KEYS = [
    Binding(
        "space",
        "guide('pause')",
        "pause",
        id="run.pause",
        tooltip="pause: start no new test; again to go on; starts an engine if none is running",
    ),
    Binding("s", "guide('step')", "step", id="run.step", tooltip="run one test, then pause"),
    Binding(
        "a",
        "guide('accept')",
        "accept",
        id="run.accept",
        tooltip="accept the reduction that waits; or adopt the try under the cursor that shows f; or count another failure of the "
        "candidate or try under the cursor as f, too",
    ),
    Binding(
        "x",
        "guide('reject')",
        "reject",
        id="run.reject",
        tooltip="reject the reduction that waits, and go on with the round",
    ),
    Binding(
        "v",
        "guide('veto')",
        "veto",
        id="run.veto",
        tooltip="leave out the candidate under the cursor; again takes that back",
    ),
    Binding(
        "p",
        "guide('pin')",
        "pins",
        id="run.pin",
        tooltip="choose the models that always stay, from a list in which the selected ones are marked; pinned ones are unpinned",
    ),
    Binding(
        "w",
        "guide('without')",
        "try without",
        id="run.without",
        tooltip="try by hand: test the environment without the selected models; asks for their names if none is selected",
    ),
    Binding(
        "o",
        "guide('only')",
        "try only",
        id="run.only",
        tooltip="try by hand: test the selected models alone, or those you name",
    ),
    Binding(
        "H",
        "guide('leave_out')",
        "leave out",
        id="run.leave_out",
        tooltip="leave out the model that only helps, by the certificate: without it f is a little rarer; a new search begins",
    ),
    Binding(
        "u", "guide('undo')", "undo", id="run.undo", tooltip="undo: take back the last reduction; it is not made again"
    ),
    Binding(
        "h",
        "open('history')",
        "history",
        id="run.history",
        tooltip="history: the tree of reductions; go back to any, branch from there, compare two",
    ),
    Binding(
        "c",
        "guide('change')",
        "settings",
        id="run.change",
        tooltip="change pair, algorithm, iterations or budget, from the next round on",
    ),
    Binding(
        "E",
        "open('export')",
        "export",
        id="run.export",
        tooltip="export: the world that is left, a scenario that runs it, the report",
    ),
    Binding(
        "W",
        "why",
        "why",
        id="run.why",
        tooltip="why the robot fails: what happens without each model that is left, in words and on the map",
    ),
    Binding("question_mark,f1", "app.help", "help", id="run.help", tooltip="show every key", key_display="?"),
    Binding("q", "quit", "quit", id="run.quit", tooltip="leave; asks whether to stop the engine"),
    _hidden("S", "guide('step_round')", "round", "run.round", "run to the end of the round, then pause"),
    _hidden("t", "guide('mode')", "ask", "run.mode", "accept reductions automatically, or ask before each one"),
    _hidden(
        "f",
        "open('failures')",
        "failures",
        "run.failures",
        "other failures that the tests met: each with its smallest environment; reduce one in a branch",
    ),
    _hidden("slash", "find", "find", "run.find", "find a model by its name, and show it on the map", "/"),
    _hidden("l", "layers", "layers", "run.layers", "choose what the map shows"),
    _hidden("y", "copy", "copy", "run.copy", "copy the names of the models left, or the command to come back"),
    _hidden("m", "open('scene')", "scene", "run.scene", "start the 3-D scene and show its address"),
    _hidden("e", "open('method')", "explain", "run.method", "explain how this run is reduced"),
    _hidden("1", "pane('map')", "map", "run.map", "the map"),
    _hidden("2", "pane('round')", "round", "run.table", "the table of candidates and tries"),
    _hidden("3", "pane('chart')", "chart", "run.chart", "the chart of models left by test"),
    _hidden("4", "pane('now')", "what is happening", "run.now", "what is happening, in words"),
    _hidden("5,L", "pane('log')", "log", "run.log", "the log: what happened so far, with the time of day"),
    _hidden("g", "next_pane", "next pane", "run.next_pane", "the next pane"),
    _hidden(
        "escape", "follow", "follow", "run.follow", "back to now; select nothing; cursor and map follow the run again"
    ),
    _hidden("plus,equals_sign", "zoom(1.25)", "closer", "run.closer", "map: closer", "+"),
    _hidden("minus", "zoom(0.8)", "farther", "run.farther", "map: farther away", "-"),
    _hidden("0", "fit", "fit", "run.fit", "map: show all that matters"),
    _hidden("comma", "browse('moment', -1)", "back", "run.back", "back in the run: to the moment before this one", ","),
    _hidden(
        "full_stop", "browse('moment', 1)", "on", "run.on", "on to the next moment; after the last one comes now", "."
    ),
    _hidden(
        "less_than_sign",
        "browse('round', -1)",
        "round before",
        "run.round_before",
        "to the end of the round before",
        "<",
    ),
    _hidden(
        "greater_than_sign",
        "browse('round', 1)",
        "next round",
        "run.next_round",
        "to the end of this or the next round",
        ">",
    ),
    _hidden(
        "left_parenthesis",
        "browse('decision', -1)",
        "",
        "run.decision_before",
        "to the verdict or decision before",
        "(",
    ),
    _hidden(
        "right_parenthesis", "browse('decision', 1)", "", "run.next_decision", "to the next verdict or decision", ")"
    ),
    _hidden(
        "left_curly_bracket", "browse('reduction', -1)", "", "run.reduction_before", "to the reduction before", "{"
    ),
    _hidden("right_curly_bracket", "browse('reduction', 1)", "", "run.next_reduction", "to the next reduction", "}"),
    _hidden("b", "rounds", "rounds", "run.rounds", "the list of all rounds so far: go to the end of any"),
    _hidden("i", "facts", "facts", "run.facts", "the raw facts of a test, and the command that makes it again"),
    _hidden("P", "play", "play", "run.play", "play a finished test of the row under the cursor back on the map"),
    _hidden("k", "open('signs')", "signs", "run.signs", "what the signs and letters on this screen mean"),
    _hidden("r", "guide('resume')", "resume", "run.resume", "start the engine again"),
    _hidden("R", "app.runs", "runs", "run.runs", "the list of all runs"),
    _hidden("d", "detach", "detach", "run.detach", "leave the workbench; the engine goes on"),
]
KEYS: list[BindingType] = [*_KEYS]
# The names of the actions that guide the run, and their bindings by these names.
GUIDES = {each.action: each.action[7:-2] for each in _KEYS if each.action.startswith("guide(")}
GUIDING = {GUIDES[each.action]: each for each in _KEYS if each.action in GUIDES}
SHOWN = tuple(
    id
    for binding in _KEYS
    if binding.show
    for id in ((*MORE, "run.help") if binding.id == "run.help" else (binding.id or "",))
)


class KeyOffers:
    """The keys by the names in `ddenv.guiding.offers.ACTIONS`, for what the user points at in `table` and `world`."""

    def __init__(
        self, browsing: Browsing, poll: Poll, table: Candidates, world: WorldMap, asking: Asking, opening: Opening
    ) -> None:
        self._browsing = browsing
        self._poll, self._table, self._world, self._asking, self._opening = poll, table, world, asking, opening

    def offer(self, name: str) -> Offer:
        """What a key does now."""
        return Offer(why_not=NOT_NOW) if self._browsing.is_past else offer(name, self._asking.situation, self.pointed)

    @property
    def pointed(self) -> Pointed:
        """The row under the cursor, if it is in sight, and the selected models in the order of the world."""
        names, elements = self._selection(), self._poll.snapshot.state.elements
        known = tuple(name for name in elements if name in names) if names else ()
        models = (*known, *sorted(names.difference(known)))
        row = self._table.under_cursor if self._table.is_attached and self._table.is_on_screen else None
        return Pointed(row, self._table.following, models)

    def _selection(self) -> frozenset[str]:
        """The models that were selected by hand, or the one that the crosshair is on."""
        if self._world.selection:
            return frozenset(self._world.selection)
        name = self._world.model_at_cursor if self._world.has_focus else None
        return frozenset() if name is None else frozenset((name,))

    def show(self, footer: KeyFooter) -> None:
        """Shows in the footer what is possible."""
        now, pointed = self._asking.situation, self.pointed
        for name, binding in GUIDING.items():
            offered = offer(name, now, pointed)
            footer.say(binding.id or "", "" if offered.why_not else offered.words or binding.description)

    def pressed(self, screen: Screen[Any], key: str) -> None:
        """Shows why a key does nothing, if it guides the run on `screen` and is not possible now."""
        # To list what all keys do now takes longer than most keys take.
        if any(each.action in GUIDES for each in screen._bindings.key_to_bindings.get(key, ())):
            active = screen.active_bindings.get(key)
            if active is not None and not active.enabled and active.node is screen:
                self._asking.refuse(self.offer(GUIDES[active.binding.action]).why_not)

    def use(self, name: str) -> None:
        """Does what a key means now; it asks for models if none are selected but some are needed, and always for pins."""
        if self._browsing.is_past:
            self._asking.refuse(NOT_NOW)
            return
        command = self.offer(name).command
        if command is not None and name != "pin":
            self._asking.ask(command)
        elif name == "change":
            self._opening.change()
        elif name in TITLES:
            environment = self._poll.snapshot.state.environment
            self._opening.choose(TITLES[name], environment, True, partial(self._chosen, name), self.pointed.models)

    def _chosen(self, name: str, models: Collection[str]) -> None:
        now = offer(name, self._asking.situation, Pointed(models=tuple(models)))
        if now.command is None:
            self._asking.refuse(now.why_not)
        else:
            self._asking.ask(now.command)
