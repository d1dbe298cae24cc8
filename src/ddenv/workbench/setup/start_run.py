"""Starts a run from the setup screen's form: its file, its engine, and the command that does the same."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from textual.app import App

from ddenv.errors import UserError
from ddenv.workbench.setup import form
from ddenv.workbench.setup.choice import Choice
from ddenv.workbench.setup.equivalent_command import command, source_of
from ddenv.workbench.setup.file_list import remember
from ddenv.workbench.setup.places import remember_jobs
from ddenv.workbench.shared.processes import Engine

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

NO_COMMAND = "the scenario of a run has no command; f7 saves it as a file, which has one"


@dataclass(frozen=True, slots=True)
class NewRun:
    """A run as described by the form: `scenario` for the `choice`, with `jobs` tests at a time, in the file `path`."""

    choice: Choice
    scenario: Scenario
    jobs: int
    accept_mode: str
    path: Path


@dataclass(frozen=True, slots=True)
class Saved:
    """A scenario that was saved in a file."""

    path: Path
    scenario: Scenario


def ask_trust(app: App[Any], new: NewRun, then: Callable[[bool], None]) -> None:
    """Calls `then` with whether what the run starts is trusted. A run file is never the user's own: somebody may have sent it."""
    from ddenv.runs.trust import trust_own
    from ddenv.workbench.widgets.trust_question import once_trusted

    if not new.choice.run:
        trust_own(new.scenario, new.choice.path)
    once_trusted(app, new.scenario, new.choice.path, then)


def create(new: NewRun, only_baseline: bool) -> Engine:
    """Writes the run file and starts its engine. Raises UserError."""
    from ddenv.runs.creation import create_like, create_run

    engine = Engine(new.path)
    if new.choice.run:
        create_like(new.choice.path, new.scenario, new.path)
    else:
        create_run(new.scenario, new.path)
        remember(new.choice.path)
    engine.start(new.jobs, new.accept_mode)
    remember_jobs(new.jobs)
    if only_baseline:
        _pause_after_baseline(new.path)
    return engine


def command_words(
    choice: Choice, saved: Saved | None, scenario: Scenario, *, jobs: int, reading: Mapping[str, Any], name: str
) -> list[str]:
    """The command that does the same as Start; empty if the scenario has no file."""
    from ddenv.world.load import SCENARIOS

    if not choice.run:
        path, base, standard = choice.path, choice.scenario, choice.settings
    elif saved is not None:
        path, base, standard = saved.path, saved.scenario, saved.scenario
    else:
        return []
    return command(source_of(path, SCENARIOS), base, scenario, standard=standard, jobs=jobs, reading=reading, name=name)


def run_file(scenario_name: str, name: str) -> Path:
    """The path of a new run with this `name` or path. Raises FieldError."""
    from ddenv.runs.folder import run_path

    is_path = len(Path(name).parts) > 1
    try:
        path = run_path(scenario_name, None, Path(name)) if is_path else run_path(scenario_name, name, None)
    except UserError as error:
        what = str(error).partition(": ")[2]
        raise form.FieldError("name", f"run name: {what}") from None
    try:
        exists = path.exists()
    except OSError as error:
        raise form.FieldError("name", f"run name: {path} cannot be written: {error.strerror}") from None
    if exists:
        raise form.FieldError("name", f"run name: {path} exists already; choose another name")
    return path


def _pause_after_baseline(path: Path) -> None:
    """Sends a step of one round, which ends after the baseline. The engine must have started: it ignores older commands."""
    from ddenv.runfile.store import RunFile

    with RunFile(path) as run:
        run.send("step", unit="round")
