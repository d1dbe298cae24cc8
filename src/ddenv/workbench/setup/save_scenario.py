"""Saves the setup screen's scenario as a file, and the dialog that asks for its name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widgets import Input, Static

from ddenv.errors import UserError
from ddenv.text import plain
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.background import call_if_open
from ddenv.workbench.widgets.path_entry import PathEntry

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

SUFFIXES = (".yaml", ".yml")


def scenario_path(text: str) -> Path:
    """The path of a file name, with .yaml if it has no ending. Raises UserError for an invalid name."""
    from ddenv.world.access import is_folder, without_tilde

    text = text.strip()
    if not text.strip("./") or text.endswith("/") or "\0" in text:
        raise UserError("give the name of a file, such as my-world.yaml")
    path = without_tilde(text)
    if path.parts[0].startswith("~"):
        raise UserError(f"{text}: unknown user")
    path = path if path.suffix.lower() in SUFFIXES else path.with_name(f"{path.name}.yaml")
    if is_folder(path):
        raise UserError(f"{path}: is a folder; give the name of a file")
    if not is_folder(path.parent):
        raise UserError(f"{path}: there is no folder {path.parent}")
    return path


def save_scenario(scenario: Scenario, path: Path) -> None:
    """Writes `scenario` as YAML, and replaces an existing file. Raises UserError, with nothing written.

    Files in the folder of `path` are named relative to it, so that the folder can be moved.
    """
    from ddenv.runs.export import keys_in
    from ddenv.runs.trust import scenario_text
    from ddenv.world.access import write_file

    for each in (scenario.world, scenario.robot.model):
        if not each.is_file():
            raise UserError(
                f"{each}: no longer exists, so a scenario cannot refer to it; 'ddenv export' writes the world of a run"
            )
    write_file(path, scenario_text(keys_in(path.resolve().parent, scenario), scenario))


class SaveScenario(ModalScreen[Path | None]):
    """Returns the file that was written, or None. An existing file is only replaced after a second enter."""

    BINDINGS: ClassVar = [Binding("escape", "dismiss(None)", "cancel", id="save.cancel", tooltip="write nothing")]

    def __init__(self, scenario: Scenario) -> None:
        super().__init__()
        self._scenario = scenario
        self._replace: Path | None = None

    def compose(self) -> ComposeResult:
        with Framed("Save as a scenario", "enter saves   escape cancels"):
            yield Static("A YAML file with all of these settings, for 'ddenv run' and for this list.", markup=False)
            yield PathEntry(_suggested(self._scenario.name), placeholder="name of a file", id="path")
            yield Static("", id="wrong", classes="wrong", markup=False)

    @on(Input.Changed)
    def _changed(self) -> None:
        self._replace = None
        self._show_error("")

    @on(Input.Submitted)
    def _submitted(self, event: Input.Submitted) -> None:
        from ddenv.world.access import is_file

        try:
            path = scenario_path(event.value)
        except UserError as error:
            self._show_error(str(error))
            return
        if is_file(path) and path != self._replace:
            self._replace = path
            self._show_error(f"{path} exists already: enter again replaces it, or type another name")
            return
        self._write(path)

    @work(thread=True, group="save", exclusive=True)
    def _write(self, path: Path) -> None:
        try:
            save_scenario(self._scenario, path)
        except UserError as error:
            call_if_open(self, self._show_error, str(error))
            return
        call_if_open(self, self.dismiss, path)

    def _show_error(self, words: str) -> None:
        self.query_one("#wrong", Static).update(Text(plain(words)))


def _suggested(name: str) -> str:
    stem = "".join(char if char.isalnum() or char in "-_" else "-" for char in name)
    return f"{stem[:60]}.yaml"
