"""A run from the setup screen's form: what it will cost, the command that does the same, its file
and its engine.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from statistics import mean, median
from typing import TYPE_CHECKING

from ddenv.errors import UserError
from ddenv.runs import processor
from ddenv.runs.folder import run_path
from ddenv.settings import OPTIONS, PRINTED, number_text, read
from ddenv.text import Data, about, between, count, rounded
from ddenv.workbench.setup import form
from ddenv.workbench.setup.choice import Choice
from ddenv.workbench.setup.files import remember

if TYPE_CHECKING:
    from ddenv.runfile.store import Recorded
    from ddenv.workbench.shared.processes import Engine
    from ddenv.world.scenario import Scenario

NO_COMMAND = "there is no command for the scenario of a run; save it as a file first (f7)"
# The maximum number of runs to read, and how many of the same scenario are enough.
LOOKED_AT = 30
ENOUGH = 3


@dataclass(frozen=True, slots=True)
class Past:
    """From earlier runs of a scenario: the median time of a test, real `seconds`, and the `rate` of
    f in their baselines.
    """

    seconds: float | None = None
    rate: float | None = None


def past_of(scenario: Scenario, folder: Path) -> Past:
    """The cost in the newest runs in `folder` with the same name, timeout and files, in any
    folder.
    """
    from ddenv.runfile.events import BaselineFinished, TestFinished

    try:
        paths = sorted(folder.glob("*.ddenv"), key=lambda path: -path.stat().st_mtime)
    except OSError:
        return Past()
    found = filter(None, (_events_of(path, scenario) for path in paths[:LOOKED_AT]))
    events = [one.event for each in islice(found, ENOUGH) for one in each]
    times = [event.wall_seconds for event in events if isinstance(event, TestFinished)]
    seconds = [time for time in times if 0 < time < 1e7]
    rates = [event.rate for event in events if isinstance(event, BaselineFinished) and event.rate]
    return Past(median(seconds) if seconds else None, mean(rates) if rates else None)


def _events_of(path: Path, scenario: Scenario) -> list[Recorded]:
    """The events of a run of that scenario; none of another scenario's run, or of a damaged one."""
    from ddenv.runfile.store import RunFile

    asked = scenario.name, scenario.world.name, scenario.robot.model.name, scenario.failure.timeout
    try:
        with RunFile(path) as run:
            data = json.loads(run.document("scenario"))
            files = (Path(each).name for each in (data["world"], data["robot"]["model"]))
            timeout = data.get("failure", {}).get("timeout", scenario.failure.timeout)
            if (data["name"], *files, timeout) == asked:
                return run.events()
            return []
    except (UserError, ValueError, RecursionError, KeyError, TypeError, AttributeError):
        return []


def whole_cost(scenario: Scenario, models: int, jobs: int, past: Past) -> str:
    from ddenv.runs.tests_left import rough_run

    reduction = scenario.reduction
    # Another simulator does not say which models affected a run.
    rough = rough_run(models, reduction, past.rate, slices=scenario.oracle is None)
    low, middle, high = rough.tests
    budget = getattr(reduction, "budget", None)
    if budget is not None:
        low, middle, high = (min(each, budget) for each in (low, middle, high))
    words = f"about {count(rounded(middle), 'test')} ({between(low, high)})"
    baseline = reduction.baseline_runs
    search = rounded(rough.search[1])
    certificate = rounded(rough.certificate[1])
    parts = (
        f"{baseline} for the baseline, {search} for the search, {certificate} for the certificate"
    )
    if budget is not None and middle >= budget:
        # The certificate may not be reached.
        words = f"{count(budget, 'test')} at most"
        parts = f"{baseline} for the baseline, then the search"
    rare = "; more if the failure is rare" if past.rate is None else ""
    if past.seconds is None:
        return f"{words}: {parts}{rare}"
    spent = about(*(each * past.seconds / jobs for each in (middle, low, high)))
    return (
        f"{words}: {parts}{rare}; {spent} with {count(jobs, 'job')} at {past.seconds:.1f} s a "
        "test, as before"
    )


def command_words(choice: Choice, asked: Scenario, jobs: int, name: str = "") -> list[str]:
    """The words of the command that runs `asked` as Start does, to be joined by `shlex.join`.

    `name` is the run's name if it is not the next free one.
    """
    from ddenv.world.load import SCENARIOS

    before = choice.settings.model_dump(mode="json")
    after = asked.model_dump(mode="json")
    bundled = choice.path.parent == SCENARIOS and choice.path.suffix == ".yaml"
    words = ["ddenv", "run", choice.path.stem if bundled else str(choice.path.absolute())]
    own = form.places_of(choice.settings)
    places = form.places_of(asked)
    for option, fields in (("spawn", form.SPAWN), ("goal", form.GOAL)):
        if choice.bare or any(places[one.name] != own[one.name] for one in fields):
            words.append(f"--{option}={','.join(number_text(places[one.name]) for one in fields)}")
    words += _setting_words(before, after)
    words += _reading_words(choice)
    if jobs != processor.usable_cores():
        words += ["--jobs", str(jobs)]
    if len(Path(name).parts) > 1:
        return [*words, "--output", str(Path(name).absolute())]
    if name:
        return [*words, "--name", name]
    return words


def _setting_words(before: Data, after: Data) -> list[str]:
    """The options for the settings that differ."""
    words: list[str] = []
    changed = [one for one in OPTIONS if read(after, one) != read(before, one)]
    # As printed sets the others.
    others = PRINTED if any(one.name == "as_printed" for one in changed) else {}
    for one in changed:
        if one.name not in others:
            words += one.words(read(after, one))
    return words


def _reading_words(choice: Choice) -> list[str]:
    """The options for how the world is read."""
    words: list[str] = []
    for option, values in choice.options.items():
        if option == "inside":
            words += ["--inside"] if values else []
            continue
        given = [values] if isinstance(values, str) else values or ()
        for value in given:
            words += [
                f"--{option.replace('_', '-')}",
                str(value.absolute()) if isinstance(value, Path) else str(value),
            ]
    return words


def create(
    choice: Choice, scenario: Scenario, path: Path, jobs: int, accept_mode: str, only_baseline: bool
) -> Engine:
    """Writes the run file `path` and starts its engine, with `jobs` tests at a time. Raises
    UserError.
    """
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
        # A step of one round ends after the baseline. The engine has started: it ignores older
        # commands.
        with RunFile(path) as run:
            run.send("step", unit="round")
    return engine


def run_file(scenario_name: str, name: str) -> Path:
    """The path of a new run with this `name` or path. Raises FieldError."""
    is_path = len(Path(name).parts) > 1
    try:
        if is_path:
            path = run_path(scenario_name, None, Path(name))
        else:
            path = run_path(scenario_name, name, None)
        wrong = f"{path} exists already; choose another name" if path.exists() else ""
    except UserError as error:
        wrong = str(error).partition(": ")[2]
    except OSError as error:
        wrong = f"{name} cannot be written: {error.strerror}"
    if wrong:
        raise form.FieldError({form.NAME.name: wrong})
    return path
