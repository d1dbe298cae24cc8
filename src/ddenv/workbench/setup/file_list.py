"""The list of scenarios and worlds to choose from: the bundled ones, and the files that were opened before."""

from __future__ import annotations

from pathlib import Path

from rich.text import Text
from textual import on
from textual.message import Message
from textual.widgets import OptionList
from textual.widgets.option_list import Option

from ddenv.runs.remembered import read_state, write_state
from ddenv.text import plain

# The maximum number of recent files: in a longer list files are hard to find.
KEPT = 12


RECENT = "recent.json"


def recent_files() -> list[Path]:
    """The recent files that still exist; none if the list is missing or damaged."""
    return [path for path in _listed() if is_file(path)]


def remember(path: Path) -> None:
    """Puts a file first in the recent ones, if the list can be written; bundled scenarios are always listed."""
    from ddenv.world.load import SCENARIOS

    if path.parent == SCENARIOS:
        return
    path = path.absolute()
    names = [path, *(each for each in _listed() if each != path)][:KEPT]
    write_state(RECENT, [str(each) for each in names])


def _listed() -> list[Path]:
    names = read_state(RECENT)
    if not isinstance(names, list):
        return []
    return [Path(name) for name in names if isinstance(name, str) and name][:KEPT]


def is_file(path: Path) -> bool:
    """Whether the file exists and can be read."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


class FileList(OptionList):
    """Scenarios by their names, worlds by their files' names; a run gives its own scenario and world."""

    class Looked(Message):
        """The cursor is on this file."""

        def __init__(self, path: Path) -> None:
            super().__init__()
            self.path = path

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, compact=True, markup=False)
        self._bundled: list[Path] = []
        self._recent: list[Path] = []
        self._like: Path | None = None
        self._looked: str | None = None

    def offer(self, bundled: list[Path], recent: list[Path], like: Path | None = None) -> None:
        """Shows all choices; the cursor is on `like`, a run, or else on the first."""
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
        self.clear_options()
        if self._like is not None:
            self.add_option(_option(self._like, f"as {self._like.stem}", "a run"))
        self.add_options(_option(path, path.stem, "") for path in self._bundled)
        if self._recent:
            self.add_option(None)
        for path in self._recent:
            name = path.stem if path.suffix.lower() in (".yaml", ".yml") else path.name
            self.add_option(_option(path, name, path.parent.name))

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
