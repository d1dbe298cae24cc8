"""From what the setup screen's form says to a run: what it will cost, the command that does the same, start, baseline, save."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from textual import on, work
from textual.widgets import Button, Input

from ddenv.errors import UserError
from ddenv.workbench.background import tell
from ddenv.workbench.run.processes import Engine
from ddenv.workbench.setup import form
from ddenv.workbench.setup.beginnings import remember
from ddenv.workbench.setup.chosen import Chosen
from ddenv.workbench.setup.command_line import command, source_of
from ddenv.workbench.setup.costs import Past, whole_cost
from ddenv.workbench.setup.fields import OptionsForm
from ddenv.workbench.setup.picking import Picking
from ddenv.workbench.setup.save_scenario import SaveScenario
from ddenv.workbench.wording import plain

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

NO_COMMAND = "a run's own scenario has no command; f7 saves it as a file that has one"


@dataclass(frozen=True)
class Asked:
    """A run as the form has it: its scenario for what is `chosen`, tests at a time, accept mode and file."""

    chosen: Chosen
    scenario: Scenario
    jobs: int
    accept_mode: str
    path: Path


class Starting(Picking):
    """Nothing is written before the user starts, and then only if everything fits."""

    past = Past()
    _busy = False
    # Whether what was chosen is still being read; so is the first file when the screen opens.
    _awaited = True
    _saved: tuple[Path, Scenario] | None = None
    _reading: Mapping[str, Any] = {}

    # What the settings come to.

    @on(OptionsForm.Edited)
    def _settings_edited(self) -> None:
        self.tell_outcome()

    def tell_outcome(self) -> None:
        """The cost and the command of what the form says now, or what is wrong with it."""
        self.workers.cancel_group(self, "cost")
        if self.chosen is None:
            self.form.tell_cost("")
            self.form.tell_command("")
            return
        try:
            asked, jobs = self._scenario(), form.jobs(self.form.texts["jobs"])
        except UserError as error:
            self.form.tell_cost(f"not ready: {error}")
            self.form.tell_command("")
            return
        words = self._words(asked, jobs)
        self.form.tell_command(shlex.join(words) or NO_COMMAND, typed=bool(words))
        self._reckon(asked, self.chosen.models, jobs, self.past)

    @work(thread=True, group="cost", exclusive=True)
    def _reckon(self, asked: Scenario, models: int, jobs: int, past: Past) -> None:
        from textual.worker import get_current_worker

        worker = get_current_worker()
        cost = whole_cost(asked, models, jobs, past)
        if not worker.is_cancelled:
            tell(self, self.form.tell_cost, cost)

    def _scenario(self) -> Scenario:
        """The scenario that the form describes. Raises UserError."""
        if self.chosen is None:
            if self._awaited:
                raise UserError("the world is still being read: try again in a moment")
            raise UserError("choose a scenario or a world that can be read first")
        pair, algorithm = self.form.method
        return form.asked_of(self.chosen.settings, self.form.texts, pair, algorithm)

    def _words(self, asked: Scenario, jobs: int) -> list[str]:
        """The command that does what Start does; none where the scenario is in no file."""
        from ddenv.world.load import SCENARIOS

        chosen = self.chosen
        how = {"jobs": jobs, "reading": self._reading, "name": self.form.own_name}
        if not chosen.run:
            return command(source_of(chosen.path, SCENARIOS), chosen.scenario, asked, standard=chosen.settings, **how)
        if self._saved is None:
            return []
        path, saved = self._saved
        return command(source_of(path, SCENARIOS), saved, asked, standard=saved, **how)

    def action_copy(self) -> None:
        """The whole command to the clipboard (OSC 52)."""
        try:
            words = self._words(self._scenario(), form.jobs(self.form.texts["jobs"]))
        except UserError as error:
            self.complain(error)
            return
        if not words:
            self.notify(NO_COMMAND, severity="warning", timeout=4)
            return
        self.app.copy_to_clipboard(shlex.join(words))
        self.notify("command copied, if the terminal allows it", timeout=3)

    # Start.

    @on(Button.Pressed, "#start")
    @on(Input.Submitted)
    def action_start(self) -> None:
        self._begin(only_baseline=False)

    def action_baseline(self) -> None:
        self._begin(only_baseline=True)

    def _begin(self, only_baseline: bool) -> None:
        if self._busy:
            return
        try:
            asked = self._asked_for()
        except UserError as error:
            self.complain(error)
            return
        self._busy = True
        self.form.tell("checking ...")
        self._create(asked, only_baseline)

    def _asked_for(self) -> Asked:
        """What the form says. Raises UserError."""
        texts = self.form.texts
        scenario = self._scenario()
        path = _run_file(scenario.name, str(form.value(form.NAME, texts["name"])))
        return Asked(self.chosen, scenario, form.jobs(texts["jobs"]), texts["accept"], path)

    @work(thread=True, group="start", exclusive=True)
    def _create(self, asked: Asked, only_baseline: bool) -> None:
        from ddenv.runs.creation import create_like, create_run

        chosen, engine = asked.chosen, Engine(asked.path)
        try:
            if chosen.run:
                create_like(chosen.path, asked.scenario, asked.path)
            else:
                create_run(asked.scenario, asked.path)
                self._remember(chosen.path)
            engine.start(asked.jobs, asked.accept_mode)
            if only_baseline:
                _pause_after_baseline(asked.path)
        except UserError as error:
            tell(self, self.complain, error)
            return
        tell(self, self._started, asked.path, engine)

    def _remember(self, path: Path) -> None:
        """Puts a file on the list of recent ones; bundled scenarios are on the screen anyway."""
        from ddenv.world.load import SCENARIOS

        if path.parent != SCENARIOS:
            remember(path)

    def _started(self, path: Path, engine: Engine) -> None:
        from ddenv.workbench.run.run_screen import RunScreen

        self.app.switch_screen(RunScreen(path, engine))

    def complain(self, error: UserError) -> None:
        """Tells what is wrong beside the field that it is about."""
        self._busy = False
        self.form.complain(error)

    # Save as scenario.

    def action_save(self) -> None:
        try:
            scenario = self._scenario()
        except UserError as error:
            self.complain(error)
            return
        self.app.push_screen(SaveScenario(scenario), self._written)

    def _written(self, path: Path | None) -> None:
        if path is None:
            return
        self.notify(plain(f"wrote {path}"), timeout=5, markup=False)
        self._load_saved(path)

    @work(thread=True, group="recent", exclusive=True)
    def _load_saved(self, path: Path) -> None:
        from ddenv.world.load import load_scenario

        self._remember(path)
        try:
            saved = load_scenario(path)
        except UserError as error:
            tell(self, self.complain, error)
            return
        tell(self, self._keep_saved, path, saved)

    def _keep_saved(self, path: Path, saved: Scenario) -> None:
        self._saved = path, saved
        self.tell_outcome()


def _run_file(scenario_name: str, name: str) -> Path:
    """Where the run called `name`, or the file of that path, will be. Raises FieldError."""
    from ddenv.runs.folder import run_path

    file = len(Path(name).parts) > 1
    try:
        path = run_path(scenario_name, None, Path(name)) if file else run_path(scenario_name, name, None)
    except UserError as error:
        what = str(error).partition(": ")[2]
        raise form.FieldError("name", f"run name: {what}") from None
    if _exists(path):
        raise form.FieldError("name", f"run name: {path} exists already; choose another name")
    return path


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError as error:
        raise form.FieldError("name", f"run name: {path} cannot be written: {error.strerror}") from None


def _pause_after_baseline(path: Path) -> None:
    """A round's step ends after the baseline. It is sent after the engine was started, which forgets what is older."""
    from ddenv.runfile.store import RunFile

    with RunFile(path) as run:
        run.send("step", unit="round")
