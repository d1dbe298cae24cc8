"""The files to choose from, bundled or opened before, and the dialogs that open others and save the
settings as a scenario.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.text import Text, TextType
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.message import Message
from textual.screen import ModalScreen, Screen
from textual.widgets import DirectoryTree, Input, OptionList, Static
from textual.widgets.option_list import Option

from ddenv.errors import UserError
from ddenv.runs.preferences import read_state, write_state
from ddenv.text import plain
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.background import call_if_open
from ddenv.workbench.widgets.path_entry import PathEntry
from ddenv.world.access import SDF_ENDINGS, is_file, is_folder, is_world, without_tilde, write_file

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

# The maximum number of recent files: in a longer list files are hard to find.
RECENT = "recent.json"
KEPT = 12
SCENARIO = (".yaml", ".yml")
SUFFIXES = (*SCENARIO, *SDF_ENDINGS)


def recent_files() -> list[Path]:
    return [path for path in _listed() if is_file(path)]


def remember(path: Path) -> None:
    """Puts a file first in the recent ones, if the list can be written; bundled scenarios are
    always listed.
    """
    from ddenv.world.load import SCENARIOS

    if path.parent != SCENARIOS:
        names = dict.fromkeys(str(each) for each in (path.absolute(), *_listed()))
        write_state(RECENT, list(names)[:KEPT])


def _listed() -> list[Path]:
    names = read_state(RECENT)
    if isinstance(names, list):
        return [Path(name) for name in names if isinstance(name, str) and name]
    return []


class FileList(OptionList):
    """Scenarios by their names, worlds by their files' names; a run gives its own scenario and
    world.
    """

    @dataclass
    class Looked(Message):
        """The cursor is on this file."""

        path: Path

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, compact=True, markup=False)
        self._bundled: list[Path] = []
        self._recent: list[Path] = []
        self._like: Path | None = None
        self._looked: str | None = None

    def offer(self, bundled: list[Path], recent: list[Path], like: Path | None = None) -> None:
        self._bundled = bundled
        self._like = like
        self._recent = [path for path in recent if path not in bundled]
        self._fill()
        if self.option_count:
            self.highlighted = 0

    def add(self, path: Path) -> None:
        """Adds a file that was just opened: first of the recent ones, and under the cursor."""
        if path not in self._bundled:
            self._recent = [path, *(each for each in self._recent if each != path)]
        self._looked = None
        self._fill()
        self.highlighted = self.get_option_index(str(path))
        self.focus()

    def _fill(self) -> None:
        like = [] if self._like is None else [_option(self._like, f"as {self._like.stem}", "a run")]
        recent = [
            _option(path, path.name if is_world(path) else path.stem, path.parent.name)
            for path in self._recent
        ]
        line = [None] if recent else []
        self.set_options(
            [*like, *(_option(path, path.stem, "") for path in self._bundled), *line, *recent]
        )

    @on(OptionList.OptionHighlighted)
    def _cursor_moved(self, event: OptionList.OptionHighlighted) -> None:
        event.stop()
        # After the list is filled again, its cursor is where it was.
        if event.option_id is not None and event.option_id != self._looked:
            self._looked = event.option_id
            self.post_message(self.Looked(Path(event.option_id)))


def _option(path: Path, name: str, where: str) -> Option:
    text = Text(plain(name), no_wrap=True, overflow="ellipsis")
    return Option(text.append(f"  {plain(where)}" if where else "", "dim"), id=str(path))


class WorldTree(DirectoryTree):
    """Folders, and files that may hold a scenario or a world."""

    ICON_NODE_EXPANDED = "▾ "
    ICON_NODE = "▸ "
    ICON_FILE = "  "

    def filter_paths(self, paths: Iterable[Path]) -> Iterable[Path]:
        return [
            path
            for path in paths
            if not path.name.startswith(".")
            and (is_folder(path) or path.suffix.lower() in SUFFIXES)
        ]

    def process_label(self, label: TextType) -> Text:
        return Text(plain(label))


@contextmanager
def complaints(dialog: Screen[Any]) -> Iterator[None]:
    """Shows a UserError in the dialog, which stays open."""
    try:
        yield
    except UserError as error:
        complain(dialog, str(error))


def complain(dialog: Screen[Any], words: str) -> None:
    dialog.query_one("#wrong", Static).update(Text(plain(words)))


class OpenFile(ModalScreen[Path | None]):
    """Asks for a scenario or world file."""

    BINDINGS: ClassVar = [
        Binding("escape", "dismiss(None)", "cancel", id="open.cancel", tooltip="choose no file")
    ]

    def compose(self) -> ComposeResult:
        with Framed(
            "Open a scenario (.yaml) or a world (.sdf, .world, .dmd.yaml)",
            "tab completes   enter opens   escape cancels",
        ):
            yield PathEntry(placeholder="path of a file", id="path")
            yield Static("", id="wrong", classes="wrong", markup=False)
            yield WorldTree(Path.cwd(), id="tree")

    @on(DirectoryTree.FileSelected)
    def _chosen(self, event: DirectoryTree.FileSelected) -> None:
        self._take(str(event.path))

    @on(Input.Submitted)
    def _typed(self, event: Input.Submitted) -> None:
        self._take(event.value)

    def _take(self, text: str) -> None:
        with complaints(self):
            self.dismiss(path_to_open(text))


def path_to_open(text: str) -> Path:
    """The path of a scenario or world file. Raises UserError."""
    path = without_tilde(text.strip())
    if path == Path():
        raise UserError("give the path of a file")
    if is_folder(path):
        raise UserError(f"{path}: is a folder; expected a file")
    if not is_file(path):
        raise UserError(f"{path}: no such file")
    if path.suffix.lower() not in SUFFIXES:
        raise UserError(f"{path.name}: expected a name that ends in {', '.join(SUFFIXES)}")
    return path


def scenario_path(text: str) -> Path:
    """The path of a file name, with .yaml if it has no ending. Raises UserError for an invalid
    name.
    """
    text = text.strip()
    if not text.strip("./") or text.endswith("/") or "\0" in text:
        raise UserError("give the name of a file, such as my-world.yaml")
    path = without_tilde(text)
    if path.parts[0].startswith("~"):
        raise UserError(f"{text}: unknown user")
    path = path if path.suffix.lower() in SCENARIO else path.with_name(f"{path.name}.yaml")
    if is_folder(path):
        raise UserError(f"{path}: is a folder; give the name of a file")
    if not is_folder(path.parent):
        raise UserError(f"{path}: there is no folder {path.parent}")
    return path


def save_scenario(scenario: Scenario, path: Path) -> None:
    """Writes `scenario` as YAML, and replaces an existing file. Raises UserError, with nothing
    written.

    Files in the folder of `path` are named relative to it, so that the folder can be moved.
    """
    from ddenv.runs.export import keys_in
    from ddenv.runs.trust import scenario_text

    for each in (scenario.world, scenario.robot.model):
        if not each.is_file():
            raise UserError(
                f"{each}: no longer exists, so a scenario cannot refer to it; 'ddenv export' "
                "writes the world of a run"
            )
    write_file(path, scenario_text(keys_in(path.resolve().parent, scenario), scenario))


class SaveScenario(ModalScreen[Path | None]):
    """Returns the file that was written, or None. An existing file is only replaced after a second
    enter.
    """

    BINDINGS: ClassVar = [
        Binding("escape", "dismiss(None)", "cancel", id="save.cancel", tooltip="write nothing")
    ]

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        self._scenario = scenario
        self._replace: Path | None = None

    def compose(self) -> ComposeResult:
        stem = "".join(
            char if char.isalnum() or char in "-_" else "-" for char in self._scenario.name
        )
        with Framed("Save as a scenario", "enter saves   escape cancels"):
            yield Static(
                "A YAML file with all of these settings, for 'ddenv run' and for this list.",
                markup=False,
            )
            yield PathEntry(f"{stem[:60]}.yaml", placeholder="name of a file", id="path")
            yield Static("", id="wrong", classes="wrong", markup=False)

    @on(Input.Changed)
    def _changed(self) -> None:
        self._replace = None
        complain(self, "")

    @on(Input.Submitted)
    def _typed(self, event: Input.Submitted) -> None:
        with complaints(self):
            path = scenario_path(event.value)
            if is_file(path) and path != self._replace:
                self._replace = path
                raise UserError(
                    f"{path} exists already: enter again replaces it, or type another name"
                )
            self._write(path)

    @work(thread=True, group="save", exclusive=True)
    def _write(self, path: Path) -> None:
        try:
            save_scenario(self._scenario, path)
        except UserError as error:
            call_if_open(self, complain, self, str(error))
            return
        call_if_open(self, self.dismiss, path)
