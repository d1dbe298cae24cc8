"""An input for the path of a file: tab completes it, as in a shell."""

from __future__ import annotations

import os
from pathlib import Path
from typing import ClassVar

from textual.binding import Binding
from textual.widgets import Input


class PathEntry(Input):
    """Where there is nothing to complete, tab goes on to the next field."""

    BINDINGS: ClassVar = [
        Binding(
            "tab",
            "complete",
            "complete",
            id="path.complete",
            tooltip="complete the path",
            show=False,
        )
    ]

    def __init__(self, value: str = "", *, id: str, placeholder: str = "") -> None:
        super().__init__(value, id=id, placeholder=placeholder, compact=True)

    def action_complete(self) -> None:
        longer = completed(self.value) if self.cursor_at_end else self.value
        if longer == self.value:
            self.screen.focus_next()
            return
        self.value = longer
        self.cursor_position = len(longer)


def completed(text: str) -> str:
    """A path as far as the names in its folder leave no choice; a folder ends with a slash."""
    folder, _, begin = text.rpartition("/")
    try:
        place = Path(f"{folder}/" if "/" in text else ".").expanduser()
        names = sorted(
            f"{each.name}/" if each.is_dir() else each.name
            for each in place.iterdir()
            if each.name.startswith(begin)
            and (begin.startswith(".") or not each.name.startswith("."))
        )
    except (OSError, ValueError, RuntimeError):
        return text
    # Letter by letter, as a shell does.
    common = os.path.commonprefix(names)  # noqa: RUF071
    if len(common) > len(begin):
        return text[: len(text) - len(begin)] + common
    return text
