"""The raw facts of one test, and the dialog with them: its log, contacts, end and seed, and the
command that makes it again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.runfile.position import Position
from ddenv.runfile.state import RunState, Test
from ddenv.runfile.tested import purpose
from ddenv.text import count, first_of, plain
from ddenv.words.signs import metres
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.playback.met import how_it_ended, met
from ddenv.workbench.shared.bindings import keys

# The maximum number of models to name.
NAMED = 12
WIDTH = 11


def facts(position: Position, number: int, command: str) -> tuple[str, Text] | None:
    """A title and the facts of the test with this number, as the run file has them now; None if
    there is no such test.

    `command` makes it again. Raises UserError if the file cannot be read.
    """
    start = position.start_of(number)
    if start is None:
        return None
    state = position.end
    test = position.end.test(number)
    models = state.models_of(test)
    place = ""
    took = ""
    again = f" · re-run {test.run}" if test.phase == "round" and test.run else ""
    if test.end_pose is not None:
        x, y, z = test.end_pose[:3]
        away = metres(test.distance, 2)
        place = f"({x:.2f}, {y:.2f}, {z:.2f}) m{f', {away} from the end of f' if away else ''}"
    if test.implied_by is not None:
        took = (
            f"not simulated: no model that it lacks can have affected test {test.implied_by}, "
            "which implies it"
        )
    elif test.is_finished:
        if test.taken:
            computed = "its result was copied from another run"
        else:
            computed = f"{test.wall_seconds:.1f} s of computing"
        took = f"{test.simulated_seconds:.1f} s simulated, {computed}"
    said = {
        "end": how_it_ended(test),
        "place": place,
        "seed": f"{test.seed} (run {test.run})",
        "time": took,
        "started": time.strftime("%-d %b %Y, %H:%M:%S", time.localtime(start.recorded.time)),
        "models": f"{len(models)} of {count(len(state.elements), 'model')}: {_names(models)}",
        "touched": _names([name for name, _ in test.first_touched]),
        "counts in": _counts(position, state, test),
    }
    title = f"Test {number} of {len(state.tests)} · {purpose(start.after, test)}{again}"
    text = Text()
    for name, words in said.items():
        if words:
            text.append(f"{name:<{WIDTH}}", "dim").append(f"{words}\n")
    text.append("\nlog\n", "bold")
    for at, words in met(test):
        text.append(f"{at:>8.1f} s  ", "dim").append(f"{words}\n")
    return title, text.append("\nto repeat it\n", "bold").append(f"  {command}")


def _names(models: Sequence[str]) -> str:
    return first_of([plain(name) for name in models], NAMED) or "none"


def _counts(position: Position, state: RunState, test: Test) -> str:
    """What the test counts in, with the verdict on that."""
    if test.trial is not None and 0 < test.trial <= len(state.trials):
        trial = state.trials[test.trial - 1]
        return (
            f"{trial.label}: {trial.verdict or 'not judged yet'}, {count(len(trial.tests), 'test')}"
        )
    if test.round is None or test.candidate is None:
        return ""
    ends = (
        each.last
        for each in reversed(position.chapters)
        if each.kind == "round" and each.number == test.round
    )
    round = position.state(next(ends, 0)).round
    if round is None or not 0 <= test.candidate < len(round.candidates):
        return ""
    one = round.candidates[test.candidate]
    numbers = ", ".join(map(str, one.tests[:NAMED]))
    return (
        f"{one.label} of round {round.number}: {one.verdict or 'not judged yet'}, tests {numbers}"
    )


class FactsDialog(ModalScreen[None]):
    """Starts at a test; the arrows go to the tests before and after it."""

    CSS_PATH = "run_dialogs.tcss"
    BINDINGS: ClassVar = keys(
        "facts",
        ("before", "left", "step(-1)", "test before", "the test before this one"),
        ("next", "right", "step(1)", "next test", "the next test"),
        ("play", "p,P", "play", "play", "play this test back on the map"),
        ("copy", "c", "copy", "copy", "copy the command that repeats it (OSC 52)"),
        ("close", "escape,F,q,enter", "dismiss", "close", "back to the run"),
    )

    def __init__(self, position: Position, test: int, run: str, play: Callable[[int], str]) -> None:
        """`run` is what a shell calls the run. `play` plays a test back, or returns why it
        cannot.
        """
        super().__init__()
        self._position = position
        self._test = test
        self._run = run
        self._play = play

    def compose(self) -> ComposeResult:
        hints = "← → other tests   p plays it   c copies the command   escape closes"
        with Framed("", hints, classes="dialog reading"), VerticalScroll():
            yield Static("", id="facts", markup=False)

    def on_mount(self) -> None:
        self._show(self._test)

    def _show(self, test: int) -> None:
        try:
            found = facts(self._position, test, self._command(test))
        except UserError as error:
            self.query_one(Framed).say(plain(str(error)))
            return
        if found is not None:
            self._test = test
            (title, words) = found
            self.query_one(".dialog").border_title = Text(title)
            self.query_one("#facts", Static).update(words)
            self.query_one(VerticalScroll).scroll_home(animate=False)

    def action_step(self, by: int) -> None:
        self._show(self._test + by)

    def action_play(self) -> None:
        if why := self._play(self._test):
            self.query_one(Framed).say(plain(why))

    def action_copy(self) -> None:
        self.app.copy_to_clipboard(self._command(self._test))
        self.query_one(Framed).say("command copied, if the terminal allows it")

    def _command(self, test: int) -> str:
        return f"ddenv test {self._run} --test {test}"
