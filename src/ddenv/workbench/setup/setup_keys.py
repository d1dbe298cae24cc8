"""The keys of the setup screen."""

from __future__ import annotations

from textual.binding import Binding, BindingType
from textual.widget import Widget

KEYS: list[BindingType] = [
    Binding("ctrl+s,f5", "start", "start", id="setup.start", tooltip="start the reduction", key_display="^s"),
    Binding(
        "f6,ctrl+b",
        "baseline",
        "baseline",
        id="setup.baseline",
        tooltip="start, and pause after the baseline: it shows how often the whole world fails",
        key_display="f6",
    ),
    Binding("f7,ctrl+g", "save", "save", id="setup.save", tooltip="save as a scenario file", key_display="f7"),
    Binding(
        "f8,ctrl+y",
        "copy",
        "copy",
        id="setup.copy",
        tooltip="copy the ddenv run command that does the same",
        key_display="f8",
    ),
    Binding("f9", "more", "more", id="setup.more", tooltip="show or hide the rarely used settings", show=False),
    Binding("ctrl+o", "open", "open", id="setup.open", tooltip="choose a scenario or world file"),
    Binding("s", "pick('start')", "start", id="setup.pick_start", tooltip="set the start on the map", show=False),
    Binding(
        "h", "pick('heading')", "heading", id="setup.pick_heading", tooltip="set the heading on the map", show=False
    ),
    Binding("g", "pick('goal')", "goal", id="setup.pick_goal", tooltip="set the goal on the map", show=False),
    Binding(
        "m", "missing", "missing", id="setup.missing", tooltip="to the missing files and their remedies", show=False
    ),
    Binding("plus,equals_sign", "zoom(1.25)", "closer", id="setup.closer", tooltip="map: closer", show=False),
    Binding("minus", "zoom(0.8)", "farther", id="setup.farther", tooltip="map: farther away", show=False),
    Binding("0", "fit", "fit", id="setup.fit", tooltip="map: show all of it", show=False),
    Binding(
        "f2", "pane('choose')", "choose", id="setup.choose", tooltip="to the scenarios, worlds and runs", show=False
    ),
    Binding("f3", "pane('map')", "map", id="setup.map", tooltip="to the map", show=False),
    Binding("f4", "pane('settings')", "settings", id="setup.settings", tooltip="to the settings", show=False),
    Binding("R", "app.runs", "runs", id="setup.runs", tooltip="the list of all runs", show=False),
    Binding("L", "app.lessons", "lessons", id="setup.lessons", tooltip="lessons on delta debugging", show=False),
    Binding("f1,question_mark", "app.help", "help", id="setup.help", tooltip="show every key", key_display="?"),
    Binding("escape", "home", "back", id="setup.home", tooltip="stop picking; back to the list of files", show=False),
    Binding("q", "app.leave", "quit", id="setup.quit", tooltip="leave"),
]
# In the footer.
SHOWN = tuple(each.id or "" for each in KEYS if isinstance(each, Binding) and each.show)


def keys_at(focused: Widget | None) -> tuple[str, ...]:
    """The ids of the keys in the footer: those of what has the focus come first."""
    bindings = () if focused is None else Binding.make_bindings(focused.BINDINGS)
    return (*dict.fromkeys(each.id for each in bindings if each.show and each.id), *SHOWN)
