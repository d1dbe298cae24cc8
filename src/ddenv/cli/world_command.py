"""`ddenv world ...`: looks at SDF worlds, and writes clean or settled ones."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ddenv.cli.completing import scenarios
from ddenv.cli.options import Numbers, announce, reading_options
from ddenv.errors import UserError, printable

if TYPE_CHECKING:
    from ddenv.world.model import World
    from ddenv.world.scenario import Reading


@click.group("world")
def world_group() -> None:
    """Shows how SDF worlds are read, draws their maps, and writes clean or settled worlds."""


@world_group.command()
@click.argument("file", metavar="FILE_OR_SCENARIO", type=click.Path(path_type=Path), shell_complete=scenarios)
@reading_options
@click.option("--json", "as_json", is_flag=True, help="Print one object with everything.")
def check(file: Path, as_json: bool, **reading: Any) -> int:
    """Shows how FILE is read: each model, what was replaced or ignored, and why."""
    from ddenv.cli.world_check import lines, report

    world = _read(file, reading)
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    print(json.dumps(report(world)) if as_json else "\n".join(lines(world, columns)))
    return 0


@world_group.command()
@click.argument("file", metavar="FILE_OR_SCENARIO", type=click.Path(path_type=Path), shell_complete=scenarios)
@reading_options
@click.option("--spawn", type=Numbers("x,y,yaw", 2, 3), help="Mark the robot's start, m and rad.")
@click.option("--goal", type=Numbers("x,y", 2, 2), help="Mark the robot's goal, m.")
@click.option("--svg", type=Path, help="Write the map to this file instead.")
@click.option("--took-part", is_flag=True, help="FILE is a run: show what took part in its runs of the whole world.")
@click.option("--passes", is_flag=True, help="FILE is a run: show the nearest world that passes, and what it lacks.")
def show(
    file: Path,
    spawn: tuple[float, ...] | None,
    goal: tuple[float, float] | None,
    svg: Path | None,
    took_part: bool,
    passes: bool,
    **reading: Any,
) -> int:
    """Draws the map of FILE, from above."""
    from ddenv.cli.world_show import terminal_map
    from ddenv.map.svg import svg_map
    from ddenv.world.access import write_file

    columns, rows = shutil.get_terminal_size((100, 36))
    color = sys.stdout.isatty() and not os.environ.get("NO_COLOR")
    if took_part or passes:
        from ddenv.cli.world_took_part import passing_map, took_part_map
        from ddenv.runs.folder import find_run

        option, drawn = ("--took-part", took_part_map) if took_part else ("--passes", passing_map)
        if spawn is not None or goal is not None or svg is not None or (took_part and passes):
            raise UserError(f"{option}: --spawn, --goal, --svg and other views of a run do not go with it")
        print(drawn(find_run(str(file)), columns, rows - 1, color=color))
        return 0
    world = _read(file, reading)
    start = None if spawn is None else (spawn[0], spawn[1], spawn[2] if len(spawn) > 2 else 0.0)
    if svg is not None:
        write_file(svg, svg_map(world, spawn=start, goal=goal).encode())
        print(printable(f"wrote {svg}"))
        return 0
    print(terminal_map(world, columns, rows - 1, color=color, spawn=start, goal=goal))
    return 0


@world_group.command()
@click.argument("file", metavar="FILE_OR_SCENARIO", type=click.Path(path_type=Path), shell_complete=scenarios)
@reading_options
@click.option(
    "-o", "--output", type=Path, required=True, help="The SDF file to write; meshes go to a folder beside it."
)
def convert(file: Path, output: Path, **reading: Any) -> int:
    """Writes FILE as clean SDF 1.9 that Drake's own parser loads."""
    from ddenv.world.write import write_converted

    for path in write_converted(_read(file, reading), output):
        print(printable(f"wrote {path}"))
    return 0


@world_group.command()
@click.argument("file", metavar="FILE_OR_SCENARIO", type=click.Path(path_type=Path), shell_complete=scenarios)
@reading_options
@click.option("-o", "--output", type=Path, required=True, help="The SDF file to write.")
def settle(file: Path, output: Path, **reading: Any) -> int:
    """Lets the models of FILE come to rest, and writes it with their new poses; nothing else changes."""
    from ddenv.cli.world_settle import settle_world

    print("\n".join(map(printable, settle_world(*_read_as(file, reading), output))))
    return 0


def _read(file: Path, reading: dict[str, Any]) -> World:
    """The world of an SDF file, or of a scenario. Raises UserError."""
    return _read_as(file, reading)[0]


def _read_as(file: Path, reading: dict[str, Any]) -> tuple[World, Reading]:
    """The same, and how it was read."""
    from ddenv.runs.scenarios import reading_of
    from ddenv.world.load import bundled_names, find_scenario, load_scenario
    from ddenv.world.sdf.read import read_world

    if file.suffix.lower() in (".yaml", ".yml") or (str(file) in bundled_names() and not file.exists()):
        scenario = load_scenario(find_scenario(str(file)))
        file, read_as = scenario.world, reading_of(scenario.reading, **reading)
    else:
        read_as = reading_of(**reading)
    return read_world(file, read_as, announce), read_as
