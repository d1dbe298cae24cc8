"""The line on the setup screen that says what is wrong with the start of a world, and what to do about it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text
from textual import work
from textual.widgets import Static
from textual.worker import get_current_worker

from ddenv.errors import UserError
from ddenv.text import plain
from ddenv.workbench.shared.background import call_if_open

if TYPE_CHECKING:
    from ddenv.workbench.setup.choice import Choice

# What to do about each kind of note; it comes first, since the end of a line may not fit.
REMEDIES = {"drop": "lower the spawn's z", "inside": "move one model, or make both static"}


class StartNotes(Static):
    """Hidden while nothing is wrong. The first note is a line; the tooltip has all of them."""

    def __init__(self, *, id: str) -> None:
        super().__init__("", id=id, markup=False)
        self.display = False
        self._choice: Choice | None = None
        self._spawn: tuple[float, ...] | None = None

    def look(self, choice: Choice | None, spawn: tuple[float, ...] | None) -> None:
        """Looks in a thread at a robot that starts at `spawn`: x, y, z in m, yaw in rad. None is not known yet."""
        if choice is self._choice and spawn == self._spawn:
            return
        self._choice, self._spawn = choice, spawn
        if choice is None:
            self._show(())
        else:
            self._look(choice, spawn)

    @work(thread=True, group="notes", exclusive=True)
    def _look(self, choice: Choice, spawn: tuple[float, ...] | None) -> None:
        found = notes(choice, spawn)
        if not get_current_worker().is_cancelled:
            call_if_open(self, self._show, found)

    def _show(self, found: tuple[tuple[str, str], ...]) -> None:
        self.display = bool(found)
        if found:
            about, words = found[0]
            more = f" (+{len(found) - 1})" if len(found) > 1 else ""
            todo = REMEDIES[about]
            said = plain(words.removesuffix(f"; {todo}"))
            self.update(Text(f"▲ {todo}{more}: {said}"))
            self.tooltip = Text("\n".join(f"{plain(words)}." for _, words in found))


def notes(choice: Choice, spawn: tuple[float, ...] | None) -> tuple[tuple[str, str], ...]:
    """What is wrong with the start, as the run would note it: a word and a sentence for each."""
    from ddenv.world.inside import note_inside, notes_on_start
    from ddenv.world.scenario import Spawn

    try:
        robot = choice.robot
    except UserError:
        # Start then reports the file's error.
        robot = None
    if robot is None or spawn is None:
        return tuple(note_inside(choice.world))
    x, y, z, yaw = spawn
    return tuple(notes_on_start(choice.world, robot, Spawn(x=x, y=y, z=z, yaw=yaw)))
