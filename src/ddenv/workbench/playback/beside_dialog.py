"""The finished tests that can be played beside another one: those with the same seed first."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from ddenv.runfile.state import RunState, Test
from ddenv.runfile.tested import purpose
from ddenv.text import padded, shortened
from ddenv.words.signs import outcome
from ddenv.workbench.help.hints import Framed

# The maximum number of tests in the list.
LISTED = 200
NUMBER, WORDS, SEED, OUTCOME = 7, 36, 12, 16


class Beside(ModalScreen[int | None]):
    """Returns the number of the test to play beside `test`; 0 for none, or None if nothing is to change."""

    CSS_PATH = "playback.tcss"
    BINDINGS: ClassVar = [
        Binding("escape,o,q", "dismiss", "close", id="beside.close", tooltip="back to the playback"),
    ]

    def __init__(self, state: RunState, test: Test) -> None:
        super().__init__()
        self._state, self._test = state, test
        self._tests = others(state.tests, test)

    def compose(self) -> ComposeResult:
        with Framed(f"Play beside test {self._test.id}", "enter plays both   escape closes"):
            yield Static(_line("test", "of", "seed", "end"), id="head", markup=False)
            alone = Option(Text(f"test {self._test.id} alone"))
            options = (Option(self._words(test)) for test in self._tests)
            yield OptionList(alone, *options, id="beside", compact=True, markup=False)

    def on_mount(self) -> None:
        options = self.query_one(OptionList)
        options.focus()
        options.highlighted = min(1, len(self._tests))

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        self.dismiss(self._tests[event.option_index - 1].id if event.option_index else 0)

    def _words(self, test: Test) -> Text:
        same = "= " if test.seed == self._test.seed else ""
        return _line(str(test.id), purpose(self._state, test), f"{same}{test.seed}", outcome(test))


def others(tests: Sequence[Test], one: Test) -> list[Test]:
    """The other finished tests: first those with the same seed, the latest first."""
    finished = (test for test in reversed(tests) if test.is_finished and test.id != one.id)
    # Of very many tests the latest ones are looked at.
    latest = list(islice(finished, 100 * LISTED))
    return sorted(latest, key=lambda test: test.seed != one.seed)[:LISTED]


def _line(number: str, words: str, seed: str, end: str) -> Text:
    what = padded(shortened(words, WORDS), WORDS)
    return Text(f"{number:>{NUMBER}}  {what}{seed:>{SEED}}  {shortened(end, OUTCOME)}", no_wrap=True)
