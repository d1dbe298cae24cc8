"""The keys of the run screen, and which of them the footer has room for."""

from __future__ import annotations

from textual.binding import Binding

from ddenv.errors import UserError
from ddenv.runfile.state import Candidate, Trial
from ddenv.workbench.run import guiding
from ddenv.workbench.run.poll import Snapshot


def _hidden(key: str, action: str, words: str, id: str, tooltip: str, display: str | None = None) -> Binding:
    return Binding(key, action, words, id=id, tooltip=tooltip, show=False, key_display=display)


KEYS = [
    Binding(
        "space",
        "pause",
        "pause",
        id="run.pause",
        tooltip="pause: no new test is started; again to go on; starts the engine where none works",
    ),
    Binding("s", "step('test')", "step", id="run.step", tooltip="run one test, then pause"),
    Binding(
        "a",
        "accept",
        "accept",
        id="run.accept",
        tooltip="accept the reduction that waits; or adopt the try under the cursor that shows f; or take another failure of the "
        "candidate or try under the cursor for as good as f",
    ),
    Binding(
        "x", "reject", "reject", id="run.reject", tooltip="reject the reduction that waits, and go on with the round"
    ),
    Binding(
        "v", "veto", "veto", id="run.veto", tooltip="leave out the candidate under the cursor; again takes that back"
    ),
    Binding(
        "p", "pin", "pin", id="run.pin", tooltip="pin the selected models, so that they always stay; again unpins them"
    ),
    Binding(
        "w",
        "without",
        "try without",
        id="run.without",
        tooltip="try by hand: test the environment without the selected models; asks for their names if none is selected",
    ),
    Binding(
        "o", "only", "try only", id="run.only", tooltip="try by hand: test the selected models alone, or those you name"
    ),
    Binding("u", "undo", "undo", id="run.undo", tooltip="undo: take back the last reduction; it is not made again"),
    Binding(
        "h",
        "history",
        "history",
        id="run.history",
        tooltip="history: the tree of reductions; go back to any, branch from there, compare two",
    ),
    Binding(
        "c", "change", "settings", id="run.change", tooltip="change pair, algorithm, iterations or budget from here on"
    ),
    Binding(
        "E",
        "export",
        "export",
        id="run.export",
        tooltip="export: the world that is left, a scenario that runs it, the report",
    ),
    Binding("question_mark,f1", "app.help", "help", id="run.help", tooltip="show every key", key_display="?"),
    Binding("q", "quit", "quit", id="run.quit", tooltip="leave; asks what becomes of the engine"),
    _hidden("S", "step('round')", "round", "run.round", "run to the end of the round, then pause"),
    _hidden("t", "mode", "ask", "run.mode", "accept reductions automatically, or ask before each one"),
    _hidden("slash", "find", "find", "run.find", "find a model by its name, and show it on the map", "/"),
    _hidden("l", "layers", "layers", "run.layers", "choose what the map shows"),
    _hidden("y", "copy", "copy", "run.copy", "copy the names of the models left, or the command to come back"),
    _hidden("m", "scene", "scene", "run.scene", "start the 3-D scene and show its address"),
    _hidden("e", "method", "explain", "run.method", "explain how this run is reduced"),
    _hidden("1", "pane('map')", "map", "run.map", "the map"),
    _hidden("2", "pane('round')", "round", "run.table", "the table of candidates and tries"),
    _hidden("3", "pane('chart')", "chart", "run.chart", "the chart of models left by test"),
    _hidden("4", "pane('now')", "what is happening", "run.now", "what is happening, in words"),
    _hidden("5,L", "pane('log')", "log", "run.log", "the log: what happened so far, with the time of day"),
    _hidden("g", "next_pane", "next pane", "run.next_pane", "the next of these panes"),
    _hidden("escape", "follow", "follow", "run.follow", "nothing is selected, and cursor and map follow the run again"),
    _hidden("plus,equals_sign", "zoom(1.25)", "closer", "run.closer", "map: closer", "+"),
    _hidden("minus", "zoom(0.8)", "farther", "run.farther", "map: farther away", "-"),
    _hidden("0", "fit", "fit", "run.fit", "map: show all that matters"),
    _hidden("r", "resume", "resume", "run.resume", "start the engine again"),
    _hidden("R", "app.runs", "runs", "run.runs", "the list of all runs"),
    _hidden("d", "detach", "detach", "run.detach", "leave the workbench; the engine goes on"),
]
# In the order of the screen, and in the order in which they are given room: on wide screens there is some for more.
MORE = ("run.find", "run.layers", "run.copy", "run.scene", "run.runs")
SHOWN = tuple(
    id
    for binding in KEYS
    if binding.show
    for id in ((*MORE, binding.id) if binding.id == "run.help" else (binding.id,))
)
FIRST = (
    "run.help",
    "run.quit",
    "run.pause",
    "run.accept",
    "run.reject",
    "run.step",
    "run.veto",
    "run.pin",
    "run.without",
    "run.undo",
    "run.history",
    "run.export",
    "run.change",
    "run.only",
    *MORE,
)
# What is left in the footer for who only looks.
LOOKING = ("run.history", "run.export", "run.find", "run.copy", "run.layers", "run.help", "run.quit")


Row = Candidate | Trial | None
ACCEPT = {"accept": "accept", "adopt": "adopt", "accept_other": "take as f"}


def footer_words(snapshot: Snapshot, row: Row, follows: bool) -> dict[str, str]:
    """The words for the keys by id, "" for a key that is not shown. `row` is under the cursor, which `follows` the run."""
    state = snapshot.state
    known, waits = state.baseline is not None, state.waiting_candidate is not None
    here = state.here
    return {
        "run.pause": _pause(snapshot),
        "run.step": "step" if snapshot.engine == "alive" and not waits and snapshot.status != "finished" else "",
        "run.accept": _accept(snapshot, row, follows),
        "run.reject": "reject" if waits else "",
        "run.veto": _veto(snapshot, row),
        "run.without": "try without" if known else "",
        "run.only": "try only" if known else "",
        "run.undo": "undo" if here is not None and here.parent is not None else "",
    }


def _pause(snapshot: Snapshot) -> str:
    if snapshot.status == "finished":
        return ""
    if snapshot.engine == "absent":
        return "start"
    return "resume" if snapshot.state.paused else "pause"


def _accept(snapshot: Snapshot, row: Row, follows: bool) -> str:
    """While the cursor follows the run, other failures come and go: they are offered where somebody looks at them."""
    state = snapshot.state
    if state.waiting_candidate is None and follows and not (isinstance(row, Trial) or state.paused):
        return ""
    try:
        return ACCEPT[guiding.accept(state, row).kind]
    except UserError:
        return ""


def _veto(snapshot: Snapshot, row: Row) -> str:
    current = snapshot.state.round
    over = current is not None and current.done and snapshot.state.paused
    if current is None or over or snapshot.status == "finished":
        return ""
    return "take back" if isinstance(row, Candidate) and row.verdict in ("vetoed", "rejected") else "veto"
