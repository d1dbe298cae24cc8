"""`ddenv world ...`: looks at SDF worlds, and writes clean or settled ones."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ddenv.cli.options import Numbers, reading_options, scenarios, together
from ddenv.cli.terminal import announce, announced, say_written, terminal_columns
from ddenv.errors import UserError
from ddenv.runs.folder import find_run
from ddenv.text import count, first_of, printable

if TYPE_CHECKING:
    from ddenv.world.model import World
    from ddenv.world.scenario import Reading


# A line names so many models.
MOST_NAMES = 5

# A world, as it is read.
world_argument = together(
    click.argument("file", metavar="FILE_OR_SCENARIO", type=click.Path(path_type=Path), shell_complete=scenarios),
    reading_options,
)


@click.group("world")
def world_group() -> None:
    """Shows how SDF worlds are read, draws their maps, and writes clean or settled worlds."""


@world_group.command()
@world_argument
@click.option("--json", "as_json", is_flag=True, help="Print one object with everything.")
def check(file: Path, as_json: bool, **reading: Any) -> int:
    """Shows how FILE is read: each model, what was replaced or ignored, and why."""
    from ddenv.cli.world_check import lines, report

    world, _ = _read(file, reading)
    print(json.dumps(report(world)) if as_json else "\n".join(lines(world, terminal_columns())))
    return 0


@world_group.command()
@world_argument
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
    from ddenv.map.svg import svg_map
    from ddenv.world.access import write_file

    if took_part or passes:
        if spawn is not None or goal is not None or svg is not None or (took_part and passes):
            option = "--took-part" if took_part else "--passes"
            raise UserError(f"{option}: --spawn, --goal, --svg and other views of a run do not go with it")
        world, dim, below = _of_run(str(file), passes)
        print("\n".join([_map(world, dim=dim), *below]))
        return 0
    world, _ = _read(file, reading)
    start = None if spawn is None else (spawn[0], spawn[1], spawn[2] if len(spawn) > 2 else 0.0)
    if svg is not None:
        write_file(svg, svg_map(world, spawn=start, goal=goal).encode())
        say_written([svg])
    else:
        print(_map(world, spawn=start, goal=goal))
    return 0


def _map(world: World, **marks: Any) -> str:
    from ddenv.cli.world_show import terminal_map

    columns, rows = shutil.get_terminal_size((100, 36))
    color = sys.stdout.isatty() and not os.environ.get("NO_COLOR")
    return terminal_map(world, columns, rows - 1, color=color, **marks)


def _of_run(name: str, passes: bool) -> tuple[World, frozenset[str], list[str]]:
    """The world of a run; the models that are drawn faint: what the nearest world that `passes` lacks, or what did not affect the
    runs of the whole world; and lines that say it, the most frequent first. Raises UserError where it is not known.
    """
    from ddenv.evidence.took_part import in_whole_world
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.nearest import removed_in_passing
    from ddenv.runs.subject import read_parts

    path = find_run(name)
    with RunFile(path) as run:
        world, state = read_parts(run)[1], fold(run.events())
    if passes:
        gone = removed_in_passing(state, path)
        head = f"the nearest world that passes lacks {count(len(gone), 'model')} of {len(state.elements)}:"
        return world, frozenset(gone), [head, *(f"  {printable(model)}" for model in gone)]
    times, runs = in_whole_world(state)
    if not times or state.baseline is None:
        raise UserError(f"{path}: it is not recorded what took part in its runs of the whole world; make a new run")
    head = f"{count(len(times), 'model')} of {len(state.elements)} took part in the runs of the whole world:"
    lines = [f"  {printable(model)}: {number} of {count(runs, 'run')}" for model, number in times.most_common()]
    return world, frozenset(model.name for model in world.models) - times.keys(), [head, *lines]


@world_group.command()
@world_argument
@click.option(
    "-o", "--output", type=Path, required=True, help="The SDF file to write; meshes go to a folder beside it."
)
def convert(file: Path, output: Path, **reading: Any) -> int:
    """Writes FILE as clean SDF 1.9 that Drake's own parser loads."""
    from ddenv.world.write import write_converted

    say_written(write_converted(_read(file, reading)[0], output))
    return 0


@world_group.command()
@world_argument
@click.option("-o", "--output", type=Path, required=True, help="The SDF file to write.")
def settle(file: Path, output: Path, **reading: Any) -> int:
    """Lets the models of FILE come to rest, and writes it with their new poses; nothing else changes."""
    world, read_as = _read(file, reading)
    print("\n".join(map(printable, _settle(world, read_as, output))))
    return 0


def _settle(world: World, reading: Reading, output: Path) -> list[str]:
    """Writes the settled `world`, which was read as `reading` says; returns what to say of it. Raises UserError."""
    from ddenv.robot import check_drake

    check_drake()
    from ddenv.robot.settled import moved, notes_on
    from ddenv.robot.simulation.template import Variants
    from ddenv.runs.subject import scenario_for_world
    from ddenv.world.access import write_file
    from ddenv.world.placement import note_inside
    from ddenv.world.sdf.moved import with_places
    from ddenv.world.sdf.read import read_model

    if output.resolve() == world.path.resolve():
        raise UserError(f"{output}: is the world itself; choose another file")
    able = sum(bool(model.links) and not model.static for model in world.models)
    # Drake's plant needs a robot; piles settle as if there were none.
    scenario = scenario_for_world(world.path, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0))
    with announced(f"settling {count(able, 'model')} that can move"):
        settled = Variants(world, read_model(scenario.robot.model), scenario).settled()
    for about, words in (*note_inside(world), *notes_on(world, settled)):
        if about != "unrest":
            announce(words)
    places = {name: links for name, links in settled.places.items() if name not in settled.fallen}
    text, stay = with_places(world, places, reading)
    write_file(output, text)
    ways = {name: way for name, way in moved(world, settled).items() if name not in stay and way > 0}
    farthest = max(ways, key=lambda name: ways[name], default="")
    far = f", {farthest} farthest, by {ways[farthest]:.3f} m" if farthest else ""
    lines = [f"wrote {output}: {count(len(ways), 'model')} moved within {settled.seconds:.1f} s{far}"]
    if stay:
        lines.append(
            f"not moved: {first_of(stay, MOST_NAMES)}: their parts move, or others are placed relative to them"
        )
    return lines


def _read(file: Path, reading: dict[str, Any]) -> tuple[World, Reading]:
    """The world of an SDF file, or of a scenario, and how it was read. Raises UserError."""
    from ddenv.runs.subject import named_file, reading_of
    from ddenv.world.load import load_scenario
    from ddenv.world.scenario import PLAIN
    from ddenv.world.sdf.read import read_world

    kind, path = named_file(str(file)) or ("world", file)
    scenario = load_scenario(path) if kind == "scenario" else None
    file, own = (path, PLAIN) if scenario is None else (scenario.world, scenario.reading)
    read_as = reading_of(own, **reading)
    return read_world(file, read_as, announce), read_as
