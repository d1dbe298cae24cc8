"""Starts a run from the setup screen's form: its file, its engine, and the command that does the same."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError
from ddenv.runs import processor
from ddenv.settings import OPTIONS, PRINTED, number_text, read
from ddenv.workbench.setup import form
from ddenv.workbench.setup.choice import Choice
from ddenv.workbench.setup.files import remember
from ddenv.workbench.setup.form import read_key

if TYPE_CHECKING:
    from ddenv.workbench.shared.processes import Engine
    from ddenv.world.scenario import Scenario

NO_COMMAND = "there is no command for the scenario of a run; save it as a file first (f7)"


def command_words(
    source: Path,
    own: Scenario,
    asked: Scenario,
    *,
    bare: bool = False,
    jobs: int,
    reading: Mapping[str, Any],
    name: str = "",
) -> list[str]:
    """The words of the command that runs `asked` as Start does, to be joined by `shlex.join`.

    `own` is the scenario in the file `source`, or the defaults for a `bare` world. `reading` are the options for reading worlds,
    `name` is the run's name if it is not the next free one.
    """
    from ddenv.world.load import SCENARIOS

    before, after = own.model_dump(mode="json"), asked.model_dump(mode="json")
    bundled = source.parent == SCENARIOS and source.suffix == ".yaml"
    words = ["ddenv", "run", source.stem if bundled else str(source.absolute())]
    for place, fields in (("spawn", form.SPAWN), ("goal", form.GOAL)):
        numbers = [read_key(after, field.key) for field in fields]
        if bare or numbers != [read_key(before, field.key) for field in fields]:
            words.append(f"--{place}={','.join(map(number_text, numbers))}")
    changed = [one for one in OPTIONS if read(after, one) != read(before, one)]
    # As printed sets the others.
    others = PRINTED if any(one.name == "as_printed" for one in changed) else {}
    for one in changed:
        if one.name not in others:
            words += one.words(read(after, one))
    words += ["--inside"] if reading.get("inside") else []
    for option, values in reading.items():
        for value in values if option != "inside" else ():
            words += [f"--{option.replace('_', '-')}", str(value.absolute()) if isinstance(value, Path) else str(value)]
    if jobs != processor.usable_cores():
        words += ["--jobs", str(jobs)]
    if not name:
        return words
    return [*words, "--output", str(Path(name).absolute())] if len(Path(name).parts) > 1 else [*words, "--name", name]


def create(
    choice: Choice, scenario: Scenario, path: Path, *, jobs: int, accept_mode: str, only_baseline: bool
) -> Engine:
    """Writes the run file `path` and starts its engine, with `jobs` tests at a time. Raises UserError."""
    from ddenv.runfile.store import RunFile
    from ddenv.runs.creation import create_like, create_run
    from ddenv.workbench.shared.processes import Engine

    engine = Engine(path)
    if choice.run:
        create_like(choice.path, scenario, path)
    else:
        create_run(scenario, path)
        remember(choice.path)
    engine.start(jobs, accept_mode)
    if only_baseline:
        # A step of one round ends after the baseline. The engine has started: it ignores older commands.
        with RunFile(path) as run:
            run.send("step", unit="round")
    return engine


def run_file(scenario_name: str, name: str) -> Path:
    """The path of a new run with this `name` or path. Raises FieldError."""
    from ddenv.runs.folder import run_path

    is_path = len(Path(name).parts) > 1
    try:
        path = run_path(scenario_name, None, Path(name)) if is_path else run_path(scenario_name, name, None)
    except UserError as error:
        raise form.FieldError({"name": str(error).partition(": ")[2]}) from None
    try:
        exists = path.exists()
    except OSError as error:
        raise form.FieldError({"name": f"{path} cannot be written: {error.strerror}"}) from None
    if exists:
        raise form.FieldError({"name": f"{path} exists already; choose another name"})
    return path
