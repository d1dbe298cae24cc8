"""Asks where to save a scenario, and saves it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Input, Static

from ddenv.errors import UserError
from ddenv.workbench.beside import tell
from ddenv.workbench.save_scenario import save_scenario, scenario_path
from ddenv.workbench.wording import plain

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario


class SaveScenario(ModalScreen[Path | None]):
    """The file that was written, or None. What is there is only replaced after a second enter."""

    CSS_PATH = "dialogs.tcss"
    CSS = """
    SaveScenario { align: center middle; }
    SaveScenario .dialog { width: 80; }
    SaveScenario .dialog Static, SaveScenario .dialog Input { width: 100%; }
    SaveScenario .dialog Input { background: $panel; }
    SaveScenario .dialog #wrong { color: $text-warning; }
    """
    BINDINGS: ClassVar = [Binding("escape", "cancel", "cancel", id="save.cancel", tooltip="write nothing")]

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        self._scenario = scenario
        self._replace: Path | None = None

    def compose(self) -> ComposeResult:
        with Vertical(classes="dialog") as dialog:
            dialog.border_title = "Save as a scenario"
            dialog.border_subtitle = "enter saves   escape cancels"
            yield Static("A YAML file with all of these settings, for 'ddenv run' and for this list.", markup=False)
            yield Input(_suggested(self._scenario.name), placeholder="name of a file", id="path", compact=True)
            yield Static("", id="wrong", markup=False)

    @on(Input.Changed)
    def _changed(self) -> None:
        self._replace = None
        self._tell("")

    @on(Input.Submitted)
    def _submitted(self, event: Input.Submitted) -> None:
        try:
            path = scenario_path(event.value)
        except UserError as error:
            self._tell(str(error))
            return
        if path.exists() and path != self._replace:
            self._replace = path
            self._tell(f"{path} exists already: enter again replaces it, or type another name")
            return
        self._write(path)

    @work(thread=True, group="save", exclusive=True)
    def _write(self, path: Path) -> None:
        try:
            save_scenario(self._scenario, path)
        except UserError as error:
            tell(self, self._tell, str(error))
            return
        tell(self, self.dismiss, path)

    def _tell(self, words: str) -> None:
        self.query_one("#wrong", Static).update(Text(plain(words)))

    def action_cancel(self) -> None:
        self.dismiss(None)


def _suggested(name: str) -> str:
    stem = "".join(char if char.isalnum() or char in "-_" else "-" for char in name)
    return f"{stem[:60]}.yaml"
