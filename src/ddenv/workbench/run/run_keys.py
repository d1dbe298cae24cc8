"""The keys of the run screen, and which of them the footer shows first.

A key that guides the run has the action `guide`, with its name in
`ddenv.guiding.key_offers.ACTIONS`.
"""

from __future__ import annotations

from textual.binding import Binding, BindingType

from ddenv.workbench.shared.bindings import HELP, MAP_KEYS, ids, keys

# The footer's keys by priority; the last ones fit on wide screens only.
FIRST = ids(
    "run",
    "help quit pause accept reject leave_out step veto pin without undo history export why "
    "change only isolate"
    " signs facts play rounds find layers copy scene runs",
)
# What comes next when the run has ended.
ENDED = ids(
    "run",
    (
        "why isolate export play quit help inside leave_out history change pin without only undo "
        "find scene runs"
    ),
)
# While an earlier moment is shown, while the map has the focus, and on a screen that only watches.
BROWSING = ids("run", "back on round_before next_round rounds facts follow help quit play signs")
ON_MAP = ids(
    "run",
    (
        "help quit pause accept reject leave_out map.pick map.next step pin without only undo "
        "history export why find layers fit"
    ),
)
LOOKING = ids("run", "help quit history rounds facts play why export find copy layers signs")
# These ask for models if none are selected. A pin always asks: it ends the search.
TITLES = {
    "pin": "Pin or unpin models (+): pinned ones stay; a new search begins",
    "without": "Try without these models",
    "only": "Try only these models",
}


# The keys that guide the run: key, name of the offer, word in the footer, what the help says.
_GUIDES = (
    (
        "space",
        "pause",
        "pause",
        "pause: start no new test; again to resume; starts an engine if none is running",
    ),
    ("s", "step", "step", "run one test, then pause"),
    ("S", "step_round", "round", "run to the end of the round, then pause"),
    (
        "a",
        "accept",
        "accept",
        (
            "accept the reduction that waits, or adopt a try that shows f, or count another "
            "failure as f"
        ),
    ),
    ("x", "reject", "reject", "reject the reduction that waits, and go on with the round"),
    ("v", "veto", "veto", "leave out the candidate under the cursor; again takes that back"),
    (
        "p",
        "pin",
        "pins",
        (
            "choose the models that always stay; the selected ones are marked, pinned ones are "
            "unpinned"
        ),
    ),
    (
        "w",
        "without",
        "try without",
        "try by hand: test the environment without the selected models, or those you name",
    ),
    ("o", "only", "try only", "try by hand: test the selected models alone, or those you name"),
    (
        "H",
        "leave_out",
        "leave out",
        "leave out the model that only helps, as certified; a new search begins",
    ),
    ("u", "undo", "undo", "undo: take back the last reduction; it is not made again"),
    (
        "c",
        "change",
        "settings",
        "change pair, algorithm, iterations or budget, from the next round on",
    ),
    ("t", "mode", "ask", "accept reductions automatically, or ask before each one"),
    (
        "i",
        "isolate",
        "world that passes",
        "find a nearest world in which the robot reaches its goal; again: stop that",
    ),
    ("r", "resume", "resume", "start the engine again"),
)
# Their bindings, by these names.
GUIDING = {
    action: Binding(
        key, f"guide('{action}')", word, tooltip=words, id=f"run.{action.removeprefix('step_')}"
    )
    for key, action, word, words in _GUIDES
}
KEYS: list[BindingType] = [
    *GUIDING.values(),
    *keys(
        "run",
        (
            "history",
            "h",
            "open('history')",
            "history",
            "the tree of reductions: go back, branch, compare two",
        ),
        (
            "export",
            "E",
            "open('export')",
            "export",
            "the world that is left, a scenario that runs it, the report",
        ),
        (
            "inside",
            "I",
            "open('inside')",
            "inside",
            "begin a run inside the models that are left: remove their single parts",
        ),
        (
            "why",
            "W",
            "open('why')",
            "why",
            "why the robot fails: what happens without each model that is left",
        ),
        HELP,
        ("quit", "q", "open('quit')", "quit", "leave; asks whether to stop the engine"),
        (
            "failures",
            "f",
            "open('failures')",
            "failures",
            "other failures that the tests met; reduce one in a branch",
        ),
        (
            "find",
            "slash",
            "open('find')",
            "find",
            "find a model by its name, and show it on the map",
            "/",
        ),
        ("layers", "l", "open('layers')", "layers", "choose what the map shows"),
        (
            "copy",
            "y",
            "open('copy')",
            "copy",
            "copy the names of the models left, or the command to come back",
        ),
        ("scene", "m", "open('scene')", "scene", "start the 3-D scene and show its address"),
        ("method", "e", "open('method')", "explain", "explain how this run is reduced"),
        ("map", "1", "pane('map')", "map", "the map"),
        ("table", "2", "pane('round')", "round", "the table of candidates and tries"),
        ("chart", "3", "pane('chart')", "chart", "the chart of models left by test"),
        ("now", "4", "pane('now')", "what is happening", "what is happening, in words"),
        ("log", "5,L", "pane('log')", "log", "the log: what happened so far, with the time of day"),
        ("next_pane", "g", "next_pane", "next pane", "the next pane"),
        (
            "follow",
            "escape",
            "follow",
            "follow",
            "back to now; select nothing; cursor and map follow the run again",
        ),
        *MAP_KEYS,
        (
            "back",
            "comma",
            "browse('moment', -1)",
            "back",
            "back in the run: to the moment before this one",
            ",",
        ),
        (
            "on",
            "full_stop",
            "browse('moment', 1)",
            "on",
            "on to the next moment; after the last one, back to now",
            ".",
        ),
        (
            "round_before",
            "<",
            "browse('round', -1)",
            "round before",
            "to the end of the round before",
            "<",
        ),
        (
            "next_round",
            ">",
            "browse('round', 1)",
            "next round",
            "to the end of this or the next round",
            ">",
        ),
        (
            "decision_before",
            "(",
            "browse('decision', -1)",
            "",
            "to the verdict or decision before",
            "(",
        ),
        ("next_decision", ")", "browse('decision', 1)", "", "to the next verdict or decision", ")"),
        ("reduction_before", "{", "browse('reduction', -1)", "", "to the reduction before", "{"),
        ("next_reduction", "}", "browse('reduction', 1)", "", "to the next reduction", "}"),
        (
            "rounds",
            "b",
            "open('rounds')",
            "rounds",
            "the list of all rounds so far: go to the end of any",
        ),
        (
            "facts",
            "F",
            "open('facts')",
            "facts",
            "the raw facts of a test, and the command that repeats it",
        ),
        (
            "play",
            "P",
            "open('play')",
            "play",
            "play a finished test of the row under the cursor back on the map",
        ),
        ("signs", "k", "app.signs", "signs", "what the signs and letters on this screen mean"),
        ("runs", "R", "app.runs", "runs", "the list of all runs"),
        ("detach", "d", "detach", "detach", "leave the workbench; the engine goes on"),
    ),
]
