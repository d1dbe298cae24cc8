"""What several commands share: types of values, options, and what the shell completes after a
tab.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from ddenv.runs import processor
from ddenv.runs.folder import SUFFIX, runs_folder
from ddenv.settings import FARTHEST, IGNORABLE, JOBS, MESH_READINGS, OPTIONS, SETTINGS, Setting

# Endings of files that a command can open.
OPENED = (".ddenv", ".yaml", ".yml", ".sdf", ".world", ".urdf")

Complete = Callable[[click.Context, click.Parameter | None, str], list[CompletionItem]]
Command = Callable[..., Any]
Option = Callable[[Command], Command]


def _offering(*, runs: bool = False, scenarios: bool = False) -> Complete:
    """Offers names of these, and files of this folder; if none of them fits, the shell looks for a
    path by itself.
    """

    def complete(
        context: click.Context, parameter: click.Parameter | None, begun: str
    ) -> list[CompletionItem]:
        known: set[str] = set()
        if runs:
            known.update(path.stem for path in runs_folder().glob(f"*{SUFFIX}"))
        if scenarios:
            from ddenv.world.load import bundled_names

            known.update(bundled_names())
        if begun:
            with suppress(OSError):
                known.update(
                    path.name for path in Path().iterdir() if path.suffix.lower() in OPENED
                )
        found = sorted(name for name in known if name.startswith(begun))
        return [CompletionItem(name) for name in found] or [CompletionItem(begun, type="file")]

    return complete


runs = _offering(runs=True)
scenarios = _offering(scenarios=True)
runs_and_scenarios = _offering(runs=True, scenarios=True)
run_argument = click.argument("run", shell_complete=runs)


# Types of values.


class Numbers(click.ParamType):  # type: ignore[type-arg]  # not generic in every click
    """Comma-separated numbers of a place, m and rad, with a minimum and a maximum number of
    them.
    """

    def __init__(self, name: str, fewest: int, most: int) -> None:
        self.name = name
        self.fewest = fewest
        self.most = most

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, ...]:
        try:
            numbers = tuple(map(float, value.split(",")))
        except ValueError:
            numbers = ()
        if any(not abs(number) <= FARTHEST for number in numbers):
            self.fail(
                f"no number may exceed {FARTHEST:g} in magnitude; found '{value}'", param, ctx
            )
        if not self.fewest <= len(numbers) <= self.most:
            self.fail(
                f"expected {self.name}, such as {','.join(['1.5'] * self.most)}; found '{value}'",
                param,
                ctx,
            )
        return numbers


class Whole(click.IntRange):
    """A whole number, which the help calls as any number."""

    name = "whole number"

    def get_metavar(self, *_: Any, **__: Any) -> str:
        return "NUMBER"


# Options.


def together(*options: Option) -> Option:
    def add(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return add


def setting_options(*, only: Iterable[str] = (), without: Iterable[str] = ()) -> Option:
    """An option for each setting that has one, which replaces the scenario's value."""
    found = []
    for one in OPTIONS:
        if (only and one.name not in only) or one.name in without:
            continue
        words = f"{_sentence(one)}{'; 0: no limit' if one.none else ''}."
        if one.kind is bool:
            found.append(
                click.option(f"{one.option}/--no-{one.option[2:]}", default=None, help=words)
            )
            continue
        # The range is checked with the scenario, which says what else is allowed; 0 takes back a
        # limit.
        kind = Whole(0) if one.none else one.kind
        shape = None if one.kind is str else "NUMBER"
        words += f" {one.more}" if one.shown == "method" else ""
        found.append(
            click.option(one.option, type=kind, metavar="|".join(one.choices) or shape, help=words)
        )
    return together(*found)


def _sentence(one: Setting) -> str:
    return f"{one.summary[:1].upper()}{one.summary[1:]}"


def jobs_option(what: str = "Tests") -> Option:
    words = f"{what} at the same time."
    return click.option(
        "--jobs",
        type=Whole(1, int(JOBS.most or 1)),
        default=processor.usable_cores(),
        show_default=True,
        help=words,
    )


# Where the tests of a run that is there are made from now on.
_CLUSTER = SETTINGS["cluster"]
cluster_option = click.option(_CLUSTER.option, help=f"{_sentence(_CLUSTER)}; unchanged by default.")

json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print one summary object at the end."
)

trust_option = click.option(
    "--trust", is_flag=True, help="Start the controller or simulator that comes with the scenario."
)

# For commands that start an engine on a run that is there.
engine_options = together(jobs_option(), cluster_option, trust_option, json_option)

remembered_option = click.option(
    "--no-remembered",
    "remembered",
    is_flag=True,
    default=True,
    flag_value=False,
    help="Ignore the stand-ins that you chose in the workbench for missing files.",
)

# For commands that take a scenario.
scenario_options = together(
    click.option(
        "--spawn",
        type=Numbers("x,y,z,yaw", 3, 4),
        help="Where the robot starts, m and rad (for an SDF world).",
    ),
    click.option(
        "--goal", type=Numbers("x,y", 2, 2), help="The robot's goal, m (for an SDF world)."
    ),
    click.option("--world", type=Path, help="An SDF world to use instead of the scenario's."),
    remembered_option,
)

# For commands that read an SDF world with references to other files.
reading_options = together(
    click.option(
        "--model-path",
        type=Path,
        multiple=True,
        help="A folder of models, searched first; may be repeated.",
    ),
    click.option(
        "--stand-in",
        multiple=True,
        metavar="URI=SHAPE|auto",
        help="A shape for a missing model or mesh, such as model://barrel=cylinder:0.3,1.0, or "
        "auto: guess all that are missing; "
        "may be repeated.",
    ),
    click.option(
        "--ignore",
        multiple=True,
        type=click.Choice(IGNORABLE),
        help="Skip these elements instead of refusing the file; may be repeated.",
    ),
    click.option(
        "--inside",
        is_flag=True,
        default=None,
        help=(
            "Remove single parts of models that never move, such as the walls of a house, "
            "instead of whole models."
        ),
    ),
    click.option(
        "--mesh",
        type=click.Choice(MESH_READINGS),
        help=(
            "What collides in place of a mesh that is not convex: its convex pieces, or its "
            "hull.  [default: pieces]"
        ),
    ),
)


def _fetching(_: Any, __: Any, is_set: bool) -> Any:
    """What downloads the files that a world lacks, with a bar on the terminal; None if the user did
    not ask for it.
    """
    if not is_set:
        return None
    from ddenv.cli.fetch import fetch_with_bar

    return fetch_with_bar


# For commands that read a given world. Its value is a `Fetch`, or None.
fetch_option = click.option(
    "--fetch",
    is_flag=True,
    callback=_fetching,
    help=(
        "Download models that are missing and that the world names by their address in Gazebo "
        "Fuel, into Gazebo's own cache."
    ),
)


def given_reading(reading: Mapping[str, Any]) -> Mapping[str, Any]:
    """The options for reading worlds, checked before a screen opens. Raises UserError."""
    if any(reading.values()):
        from ddenv.runs.experiment import reading_of

        reading_of(**reading)
    return reading
