"""Messages from a screen to the app: show another screen in its place, or get the user's
attention.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from textual.message import Message

if TYPE_CHECKING:
    from ddenv.workbench.shared.processes import Engine


@dataclass
class ShowRun(Message):
    """Attach to `run`; only `watch` it, without guiding it. `engine` has just been started on
    it.
    """

    run: Path
    watch: bool = False
    engine: Engine | None = None


@dataclass
class ShowSetup(Message):
    """The setup screen, with the settings of the run `like` filled in, or with a scenario's or a
    world's `file` chosen.
    """

    like: Path | None = None
    file: Path | None = None


@dataclass
class Attention(Message):
    """The user should look at `run`: `why`."""

    run: str
    why: str
