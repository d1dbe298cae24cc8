"""The dialog that opens a scenario or world file."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import ClassVar

from rich.text import Text, TextType
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widgets import DirectoryTree, Input, Static

from ddenv.errors import UserError
from ddenv.text import plain
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.setup.file_list import is_file
from ddenv.workbench.widgets.path_entry import PathEntry

SUFFIXES = (".yaml", ".yml", ".sdf", ".world")


class WorldTree(DirectoryTree):
    """Folders, and files that may hold a scenario or a world."""

    ICON_NODE_EXPANDED = "▾ "
    ICON_NODE = "▸ "
    ICON_FILE = "  "

    def filter_paths(self, paths: Iterable[Path]) -> Iterable[Path]:
        return [path for path in paths if not path.name.startswith(".") and (_is_folder(path) or _fits(path))]

    def process_label(self, label: TextType) -> Text:
        return Text(plain(label))


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:
        return False


def _fits(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES


class OpenFile(ModalScreen[Path | None]):
    """Asks for a scenario or world file."""

    BINDINGS: ClassVar = [Binding("escape", "cancel", "cancel", id="open.cancel", tooltip="choose no file")]

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder

    def compose(self) -> ComposeResult:
        with Framed(
            "Open a scenario (.yaml) or a world (.sdf, .world)", "tab completes   enter opens   escape cancels"
        ):
            yield PathEntry(placeholder="path of a file", id="path")
            yield Static("", id="wrong", classes="wrong", markup=False)
            yield WorldTree(self._folder, id="tree")

    @on(DirectoryTree.FileSelected)
    def _chosen(self, event: DirectoryTree.FileSelected) -> None:
        self._take(event.path)

    @on(Input.Submitted)
    def _typed(self, event: Input.Submitted) -> None:
        path = Path(event.value.strip())
        with suppress(RuntimeError):
            # The home of ~user may be unknown; then the path itself does not exist.
            path = path.expanduser()
        self._take(path)

    def _take(self, path: Path) -> None:
        wrong = complain_about(path)
        self.query_one("#wrong", Static).update(Text(str(UserError(wrong))))
        if not wrong:
            self.dismiss(path)

    def action_cancel(self) -> None:
        self.dismiss(None)


def complain_about(path: Path) -> str:
    """Why a path cannot be opened, or nothing."""
    if not str(path) or path == Path():
        return "give the path of a file"
    if _is_folder(path):
        return f"{path}: is a folder; expected a file"
    if not is_file(path):
        return f"{path}: no such file"
    return "" if _fits(path) else f"{path.name}: expected a name that ends in {', '.join(SUFFIXES)}"
