"""The files to choose from: the bundled scenarios, those that were opened before, and the dialog that opens others."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from rich.text import Text, TextType
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding
from textual.message import Message
from textual.screen import ModalScreen
from textual.widgets import DirectoryTree, Input, OptionList, Static
from textual.widgets.option_list import Option

from ddenv.runs.remembered import read_state, write_state
from ddenv.text import plain
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.widgets.path_entry import PathEntry
from ddenv.world.access import SDF_ENDINGS, is_world

# The maximum number of recent files: in a longer list files are hard to find.
RECENT, KEPT = "recent.json", 12
SCENARIO = (".yaml", ".yml")
SUFFIXES = (*SCENARIO, *SDF_ENDINGS)


def recent_files() -> list[Path]:
    from ddenv.world.access import is_file

    return [path for path in _listed() if is_file(path)]


def remember(path: Path) -> None:
    """Puts a file first in the recent ones, if the list can be written; bundled scenarios are always listed."""
    from ddenv.world.load import SCENARIOS

    if path.parent != SCENARIOS:
        names = dict.fromkeys(str(each) for each in (path.absolute(), *_listed()))
        write_state(RECENT, list(names)[:KEPT])


def _listed() -> list[Path]:
    names = read_state(RECENT)
    return [Path(name) for name in names if isinstance(name, str) and name] if isinstance(names, list) else []


class FileList(OptionList):
    """Scenarios by their names, worlds by their files' names; a run gives its own scenario and world."""

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
        self._bundled, self._like = bundled, like
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
        recent = [_option(path, _name(path), path.parent.name) for path in self._recent]
        line = [None] if recent else []
        self.set_options([*like, *(_option(path, path.stem, "") for path in self._bundled), *line, *recent])

    @on(OptionList.OptionHighlighted)
    def _cursor_moved(self, event: OptionList.OptionHighlighted) -> None:
        event.stop()
        # After the list is filled again, its cursor is where it was.
        if event.option_id is not None and event.option_id != self._looked:
            self._looked = event.option_id
            self.post_message(self.Looked(Path(event.option_id)))


def _name(path: Path) -> str:
    return path.name if is_world(path) else path.stem


def _option(path: Path, name: str, where: str) -> Option:
    text = Text(plain(name), no_wrap=True, overflow="ellipsis")
    return Option(text.append(f"  {plain(where)}" if where else "", "dim"), id=str(path))


class WorldTree(DirectoryTree):
    """Folders, and files that may hold a scenario or a world."""

    ICON_NODE_EXPANDED = "▾ "
    ICON_NODE = "▸ "
    ICON_FILE = "  "

    def filter_paths(self, paths: Iterable[Path]) -> Iterable[Path]:
        from ddenv.world.access import is_folder

        return [path for path in paths if not path.name.startswith(".") and (is_folder(path) or _fits(path))]

    def process_label(self, label: TextType) -> Text:
        return Text(plain(label))


class OpenFile(ModalScreen[Path | None]):
    """Asks for a scenario or world file."""

    BINDINGS: ClassVar = [Binding("escape", "dismiss(None)", "cancel", id="open.cancel", tooltip="choose no file")]

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder

    def compose(self) -> ComposeResult:
        with Framed(
            "Open a scenario (.yaml) or a world (.sdf, .world, .dmd.yaml)",
            "tab completes   enter opens   escape cancels",
        ):
            yield PathEntry(placeholder="path of a file", id="path")
            yield Static("", id="wrong", classes="wrong", markup=False)
            yield WorldTree(self._folder, id="tree")

    @on(DirectoryTree.FileSelected)
    def _chosen(self, event: DirectoryTree.FileSelected) -> None:
        self._take(event.path)

    @on(Input.Submitted)
    def _typed(self, event: Input.Submitted) -> None:
        from ddenv.world.access import without_tilde

        self._take(without_tilde(event.value.strip()))

    def _take(self, path: Path) -> None:
        wrong = complain_about(path)
        self.query_one("#wrong", Static).update(Text(plain(wrong)))
        if not wrong:
            self.dismiss(path)


def _fits(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES


def complain_about(path: Path) -> str:
    from ddenv.world.access import is_file, is_folder

    if path == Path():
        return "give the path of a file"
    if is_folder(path):
        return f"{path}: is a folder; expected a file"
    if not is_file(path):
        return f"{path}: no such file"
    return "" if _fits(path) else f"{path.name}: expected a name that ends in {', '.join(SUFFIXES)}"
