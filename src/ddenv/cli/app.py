"""The commands, and what their exits mean.

Exit codes: 0 done (for a reduction: minimal), 1 stopped before that, 2 wrong input, 130 interrupted.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import click

from ddenv.cli.config_command import config_command
from ddenv.cli.options import JOBS, method_options, reading_options, scenario_options, search_options
from ddenv.cli.schemas_command import schemas_command
from ddenv.cli.serve_command import serve_command
from ddenv.cli.study_command import study_command
from ddenv.cli.world_command import world_group
from ddenv.errors import UserError, printable
from ddenv.version import __version__

# Of one URI so many columns are told.
LONGEST_URI = 80


@click.group(invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
@reading_options
@click.pass_context
def app(context: click.Context, **reading) -> None:
    """Finds the few models of a world that make a robot fail. Without a command: the workbench.

    The options are on how the workbench reads worlds; commands that read worlds have them, too.
    """
    if context.invoked_subcommand is None:
        from ddenv.workbench.launch import run_workbench

        if any(reading.values()):
            from ddenv.runs.scenarios import reading_of

            # What is wrong with them is told before the screen is taken.
            reading_of(**reading)
        context.exit(run_workbench(reading=reading))
    if any(reading.values()):
        raise UserError(f"options on how to read worlds go behind the command: ddenv {context.invoked_subcommand} ...")


@app.command()
@click.argument("scenario")
@scenario_options
@reading_options
@method_options
@search_options
@click.option("--jobs", type=click.IntRange(1, 1024), default=JOBS, show_default=True, help="Tests at the same time.")
@click.option("--name", help="Name of the run.")
@click.option(
    "--output", type=Path, help="A .ddenv file or a folder for the run; or a .sdf file for the minimal world."
)
@click.option("--json", "as_json", is_flag=True, help="Print one summary object at the end.")
def run(
    scenario, spawn, goal, world, timeout, model_path, stand_in, ignore, name, output, jobs, as_json, **options
) -> int:
    """Reduces SCENARIO (a bundled name, a YAML file or an SDF world) without a screen."""
    from ddenv.runs.creation import create_run
    from ddenv.runs.folder import run_path
    from ddenv.runs.programs import start_engine
    from ddenv.runs.scenarios import with_options

    reading = {"model_path": model_path, "stand_in": stand_in, "ignore": ignore}
    chosen = with_options(_scenario(scenario, spawn, goal, world, timeout, reading), **options)
    path = run_path(chosen.name, name, output)
    sdf = output if output is not None and output.suffix in (".sdf", ".world") else None
    read = create_run(chosen, path, _tell)
    _tell_notes(read, as_json)
    return _follow(path, start_engine(path, jobs), as_json, sdf)


@app.command()
@click.argument("run")
@click.option("--jobs", type=click.IntRange(1, 1024), default=JOBS, show_default=True, help="Tests at the same time.")
@click.option("--json", "as_json", is_flag=True, help="Print one summary object at the end.")
def resume(run: str, jobs: int, as_json: bool) -> int:
    """Goes on with RUN (a name or a file) without a screen; no finished test is made again."""
    from ddenv.runfile.fold import fold
    from ddenv.runfile.lock import engine_lock
    from ddenv.runfile.store import RunFile
    from ddenv.runs.folder import find_run
    from ddenv.runs.programs import start_engine

    path = find_run(run)
    with RunFile(path) as file, engine_lock(path):
        # A way back that was asked for while no engine worked ends in a pause, in which nobody would be there to go on.
        waits = any(command.kind == "go_back" for command in file.commands(fold(file.events()).last_command))
        if waits:
            file.send("resume")
    # Nobody is there to ask.
    return _follow(path, start_engine(path, jobs, accept_mode="automatic"), as_json, None)


@app.command("open")
@click.argument("run")
@click.option(
    "--watch", is_flag=True, help="Only look: nothing is changed, and nothing is written, not even beside RUN."
)
def open_run(run: str, watch: bool) -> int:
    """Attaches the workbench to RUN (a name or a file)."""
    from ddenv.runs.folder import find_run
    from ddenv.workbench.launch import run_workbench

    return run_workbench(find_run(run), watch=watch)


@app.command()
def runs() -> int:
    """Lists the runs."""
    from ddenv.cli.runs_list import run_lines
    from ddenv.runs.folder import runs_folder

    lines = run_lines(runs_folder())
    print("\n".join(lines) if lines else f"no runs yet in {runs_folder()}; 'ddenv run ditch' makes one")
    return 0


@app.command()
@click.argument("subject", metavar="SCENARIO_OR_RUN")
@scenario_options
@reading_options
@click.option("--keep", help="Only these models, by name, separated by commas.")
@click.option("--minimal", is_flag=True, help="Only the models that the run has left.")
@click.option("--leave-out", multiple=True, metavar="MODEL", help="Leave this model out as well; may be repeated.")
@click.option("--leave-each-out", is_flag=True, help="Then leave out each of the models in turn.")
@click.option("--seed", type=click.IntRange(0, 2**31), help="Seed of the first run; the next ones count up.")
@click.option("--repeat", type=click.IntRange(1, 100_000), default=1, show_default=True, help="Runs of each.")
@click.option("--jobs", type=click.IntRange(1, 1024), default=JOBS, show_default=True, help="Runs at the same time.")
@click.option("--json", "as_json", is_flag=True, help="Print one object with all runs at the end.")
def test(
    subject, spawn, goal, world, timeout, model_path, stand_in, ignore, keep, jobs, as_json, leave_out, **options
) -> int:
    """Runs the robot in a scenario, or in a run's world, and prints each run's outcome."""
    from ddenv.engine.single_test import plan, run_trials

    reading = {"model_path": model_path, "stand_in": stand_in, "ignore": ignore}
    what = _subject(subject, spawn, goal, world, timeout, reading)
    names = None if keep is None else [name.strip() for name in keep.split(",") if name.strip()]
    trials = plan(what, keep=names, leave_out=list(leave_out), **options)
    told = []
    for result in run_trials(what, trials, jobs):
        told.append(result)
        if not as_json:
            print(printable(_trial_line(result)), flush=True)
    if as_json:
        print(json.dumps({"runs": told}))
    return 0


@app.command()
@click.argument("run")
@click.option("--sdf", type=Path, help="Write the environment that is left as an SDF world.")
@click.option("--scenario", type=Path, help="Write a scenario (YAML) that runs the robot in that world; needs --sdf.")
def export(run: str, sdf: Path | None, scenario: Path | None) -> int:
    """Writes the world that RUN has left."""
    from ddenv.runs.export import export_world
    from ddenv.runs.folder import find_run

    if sdf is None:
        raise UserError("nothing to export: give --sdf FILE")
    exported = export_world(find_run(run), sdf, scenario)
    for path in exported.files:
        print(f"wrote {path}")
    _tell_needs(sdf, exported.needs)
    return 0


@app.command()
@click.argument("run")
@click.option(
    "-o",
    "--output",
    "file",
    type=Path,
    required=True,
    metavar="FILE",
    help="A .html page, or a .md file with its pictures beside it.",
)
@click.option("--force", is_flag=True, help="Replace files that exist.")
def report(run: str, file: Path, force: bool) -> int:
    """Writes what RUN came to as one page: to read, to print, to mail."""
    from ddenv.report.report import write_report
    from ddenv.runs.folder import find_run

    for path in write_report(find_run(run), file, force):
        print(f"wrote {path}")
    return 0


def _scenario(name, spawn, goal, world, timeout, reading):
    """The scenario that a command line asks for."""
    from ddenv.runs.scenarios import reading_of, scenario_for_world, with_options
    from ddenv.world.load import find_scenario, load_scenario

    if Path(name).suffix.lower() in (".sdf", ".world"):
        if spawn is None or goal is None:
            raise UserError(f"{name}: an SDF world needs --spawn x,y,z,yaw and --goal x,y")
        if world is not None:
            raise UserError(f"--world: goes with a scenario; {name} is a world already")
        scenario = scenario_for_world(Path(name), (*spawn, 0.0)[:4], goal)
        return with_options(scenario, timeout=timeout, reading=reading_of(**reading))
    scenario = load_scenario(find_scenario(name))
    chosen = reading_of(scenario.reading, **reading)
    return with_options(scenario, timeout=timeout, spawn=spawn, goal=goal, world=world, reading=chosen)


def _subject(name, spawn, goal, world, timeout, reading):
    """What `ddenv test` tries: a run where there is one of that name, else a scenario."""
    from ddenv.engine.single_test import Subject, subject_of_run
    from ddenv.runfile.store import RunFile
    from ddenv.runs.folder import find_run
    from ddenv.runs.scenarios import load_parts

    path = find_run(name)
    if (path.is_file() and path.suffix not in (".yaml", ".yml", ".sdf", ".world")) or name.endswith(".ddenv"):
        if any(option is not None for option in (spawn, goal, world, timeout)) or any(reading.values()):
            raise UserError(
                "--spawn, --goal, --world, --timeout, --model-path, --stand-in and --ignore go with a scenario; "
                "a run keeps its own"
            )
        with RunFile(path) as file:
            return subject_of_run(file)
    scenario = _scenario(name, spawn, goal, world, timeout, reading)
    return Subject(scenario, *load_parts(scenario, _tell))


def _tell(line: str) -> None:
    """Says that something takes longer, without disturbing what is printed for programs."""
    print(printable(line), file=sys.stderr, flush=True)


def _tell_notes(world: Any, as_json: bool) -> None:
    from ddenv.words import count

    if world.notes:
        were = f"{count(len(world.notes), 'part')} of {world.path} {'was' if len(world.notes) == 1 else 'were'}"
        line = f"{were} replaced or ignored; 'ddenv world check' tells which and why"
        print(printable(line), file=sys.stderr if as_json else sys.stdout, flush=True)


def _tell_needs(sdf: Path, uris: list[str]) -> None:
    """A written world keeps its text, and with it what that names of other files."""
    from ddenv.map.names import shortened
    from ddenv.words import first_of

    if uris:
        _tell(f"{sdf} still needs {first_of([shortened(uri, LONGEST_URI) for uri in uris], 3)}")


def _follow(path: Path, engine: Any, as_json: bool, sdf: Path | None) -> int:
    from ddenv.cli.follow import Interrupted, follow
    from ddenv.cli.summary import lines, summary
    from ddenv.runs.export import export_world

    code = 0
    try:
        state = follow(path, engine, sys.stderr if as_json else sys.stdout)
        code = 0 if state.minimal else 1
    except Interrupted as interrupted:
        # It may have ended just then.
        state, code = interrupted.state, 0 if interrupted.state.minimal else 130
    print(json.dumps(summary(state, path)) if as_json else "\n".join(lines(state, path)), flush=True)
    if sdf is not None and state.baseline is not None:
        _tell_needs(sdf, export_world(path, sdf, None).needs)
    if code == 130:
        print(f"interrupted; go on with: ddenv resume {path}", file=sys.stderr)
    return code


def _trial_line(result: dict[str, Any]) -> str:
    without = f"  without {result['without']}" if result["without"] else ""
    if result["end_pose"] is None:
        return f"seed {result['seed']:<4} {result['outcome']:<8} {result['failure']}{without}"
    x, y, z = result["end_pose"][:3]
    distance = "" if result["distance"] is None else f"  {result['distance']:.2f} m from f"
    failure = f"  {result['failure']}" if result["failure"] else ""
    return (
        f"seed {result['seed']:<4} {result['outcome']:<8} ended at ({x:.2f}, {y:.2f}, {z:.2f}) m "
        f"after {result['simulated_seconds']:.1f} s{failure}{distance}{without}"
    )


def _cannot_print(error: OSError) -> int:
    """Whoever reads our output may be gone (as with `| head`), or its disk full. Raises anything else again."""
    if not isinstance(error, BrokenPipeError) and error.filename is not None:
        raise error
    # What could not be written would be tried again at the end of the program.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if isinstance(error, BrokenPipeError):
        return 1
    print(f"ddenv: cannot print: {error.strerror}", file=sys.stderr)
    return 2


app.add_command(world_group)
app.add_command(schemas_command)
app.add_command(config_command)
app.add_command(serve_command)
app.add_command(study_command)


def main() -> None:
    # A terminal that lacks a letter of a model's name shows its number instead.
    for stream in filter(None, (sys.stdout, sys.stderr)):
        stream.reconfigure(errors="backslashreplace")
    try:
        code = app(standalone_mode=False)
        sys.stdout.flush()
    except UserError as error:
        print(f"ddenv: {error}", file=sys.stderr)
        code = 2
    except OSError as error:
        code = _cannot_print(error)
    except click.exceptions.Abort:
        code = 130
    except KeyboardInterrupt:
        code = 130
    except click.ClickException as error:
        print(f"ddenv: {error.format_message().rstrip('.')}; see 'ddenv --help'", file=sys.stderr)
        code = 2
    sys.exit(code)
