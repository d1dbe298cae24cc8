"""`ddenv world ...`: looks at SDF worlds, and writes clean or settled ones."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ddenv.cli.options import (
    Numbers,
    fetch_option,
    reading_options,
    remembered_option,
    scenarios,
    together,
)
from ddenv.cli.terminal import announce, say_written, terminal_columns, wrapped
from ddenv.errors import UserError
from ddenv.runs.folder import find_run
from ddenv.text import Data, count, first_of, printable, shortened
from ddenv.world.access import is_directives
from ddenv.world.pose import Point

if TYPE_CHECKING:
    from ddenv.runs.experiment import Fetch
    from ddenv.world.model import Model, Note, World
    from ddenv.world.scenario import Reading

# A line names so many models.
MOST_NAMES = 5
LONGEST_NAME = 34
LONGEST_URI = 80
HEADER = ("model", "kind", "links", "shapes", "size, m", "centre x, y, z, m", "yaw", "notes")
TO_THE_RIGHT = ("links", "yaw")
# The columns that are left out first where not all fit; the width where all do.
SPARE = ("links", "shapes", "yaw")
WIDEST = 10_000

# A world, as it is read.
world_argument = together(
    click.argument(
        "file",
        metavar="FILE_OR_SCENARIO",
        type=click.Path(path_type=Path),
        shell_complete=scenarios,
    ),
    reading_options,
    fetch_option,
    remembered_option,
)


@click.group("world")
def world_command() -> None:
    """Shows how SDF worlds are read, draws their maps, and writes clean or settled worlds."""


def _read(file: Path, options: Data) -> tuple[World, Reading]:
    """The world of an SDF file, or of a scenario, and how it was read by the options of
    `world_argument`. Raises UserError.
    """
    from ddenv.runs.experiment import reading_of, with_remembered, world_of
    from ddenv.world.sdf.read import parse_world, read_world

    file, own = world_of(file)
    fetch: Fetch | None = options.pop("fetch")
    reads_remembered = options.pop("remembered")
    read_as = reading_of(own, **options)
    if fetch is not None:
        fetch(file, read_as, parse_world)
    if reads_remembered:
        read_as = with_remembered(file, read_as, announce)
    return read_world(file, read_as), read_as


# How a world was read: a table for people, plain data for programs.


@world_command.command()
@world_argument
@click.option("--json", "as_json", is_flag=True, help="Print one object with everything.")
def check(file: Path, as_json: bool, **reading: Any) -> int:
    """Shows how FILE is read: each model, what was replaced or ignored, and why."""
    world, _ = _read(file, reading)
    print(
        json.dumps(world_report(world))
        if as_json
        else "\n".join(world_lines(world, terminal_columns()))
    )
    return 0


def world_report(world: World) -> Data:
    """Everything of the table and more; lengths in m, angles in rad."""
    from ddenv.world.extent import model_bounds
    from ddenv.world.files.floor_error import floor_errors
    from ddenv.world.placement import inside
    from ddenv.world.sdf.official import refused

    removable = frozenset(world.elements())
    ground = world.ground
    models = []
    for model in world.models:
        box = model_bounds(model)
        links = [
            {"name": link.name, "pose": [*link.pose.position, *link.pose.quaternion]}
            for link in model.links
        ]
        models.append(
            {
                "name": model.name,
                "kind": _kind(model, ground),
                "removable": model.name in removable,
                "line": model.line,
                "pose": [*model.pose.position, *model.pose.quaternion],
                "links": links,
                "joints": [{"name": joint.name, "kind": joint.kind} for joint in model.joints],
                "shapes": dict(_shapes(model)),
                "low": None if box is None else box[0].tolist(),
                "high": None if box is None else box[1].tolist(),
                "friction": sorted({collision.mu for collision in model.collisions}),
                "mass": sum(link.inertia.mass for link in model.links if link.inertia is not None)
                or None,
                "notes": _notes(world, model.name),
            }
        )
    return {
        "file": str(world.path),
        "version": world.version,
        "world": world.name,
        "gravity": list(world.gravity),
        "models": models,
        "notes": _notes(
            world, *({note.model for note in world.notes} - {model.name for model in world.models})
        ),
        "inside": [
            {"model": one.name, "other": one.other, "depth": one.depth} for one in inside(world)
        ],
        "pieces": [asdict(error) for error in floor_errors(world.models)],
        "refused": [{"why": why, "place": place} for why, place in refused(world)],
        "files": [
            {"uri": file.uri, "path": str(file.path), "from": file.source} for file in world.found
        ],
        "absent": list(world.absent),
    }


def _notes(world: World, *models: str) -> list[dict[str, str]]:
    return [
        {
            "kind": note.kind,
            "what": note.what,
            "why": note.why,
            "detail": note.detail,
            "place": note.place,
        }
        for note in world.notes
        if note.model in models
    ]


def _kind(model: Model, ground: frozenset[str]) -> str:
    if model.name in ground:
        return "ground"
    if model.static:
        return "static"
    return "dynamic"


def _shapes(model: Model) -> Counter[str]:
    """How many shapes of each kind; a mesh is simulated as its hull."""
    kinds = (type(collision.shape).__name__.lower() for collision in model.collisions)
    return Counter("hull" if kind == "mesh" else kind for kind in kinds)


def world_lines(world: World, columns: int | None = None) -> list[str]:
    """The table: a line for each model, then the notes by number, then the totals.

    No line is wider than `columns`: first some columns go, then cells have more lines, or less
    words.
    """
    from ddenv.world.files.floor_error import note_pieces
    from ddenv.world.placement import note_inside, note_unseen
    from ddenv.world.sdf.official import refused

    by_kind: dict[str, list[Note]] = {}
    for note in world.notes:
        by_kind.setdefault(_kind_of(note), []).append(note)
    by_model: dict[str, dict[str, None]] = {}
    notes: list[str] = []
    for number, alike in enumerate(by_kind.values(), start=1):
        notes += wrapped(_text(alike), columns, f"{number:4}  ")
        for note in alike:
            detail = printable(note.detail.removesuffix(" away"))
            words = f"{number} ({detail})" if detail else str(number)
            by_model.setdefault(note.model, {})[words] = None
    below = ["", "notes", *notes] if notes else []
    places: dict[str, list[str]] = {}
    for why, place in refused(world):
        places.setdefault(why, []).append(place)
    remarks = (
        *note_inside(world),
        *note_unseen(world, world.elements()),
        *note_pieces(world, world.names),
    )
    wrong = [words for _, words in remarks]
    for why, at in places.items():
        more = f", and {len(at) - 1} more" if len(at) > 1 else ""
        wrong.append(printable(f"the official checker (ign sdf -k) refuses {why}: {at[0]}{more}"))
    gravity = " ".join(f"{part:g}" for part in world.gravity)
    what = world.version if is_directives(world.path) else f"SDF {world.version}"
    title = printable(f"{world.path}: {what}, world '{world.name}', gravity {gravity} m/s^2")
    return [
        *wrapped(title, columns),
        "",
        *_table(world, by_model, columns),
        *below,
        *_files(world, columns),
        "",
        *(line for words in (_totals(world), *wrong) for line in wrapped(words, columns)),
    ]


def _files(world: World, columns: int | None) -> list[str]:
    """Where the world's other files were found, and which were not."""
    from ddenv.world.files.resources import how_to_fetch

    found: dict[str, dict[str, None]] = {}
    for file in world.found:
        named = f"{file.source}, {file.root}" if file.source else str(file.root)
        found.setdefault(named, {})[file.uri] = None
    lines = [f"{len(uris)} in {where}: {_named(uris)}" for where, uris in found.items()]
    if world.absent:
        lines.append(
            f"{len(world.absent)} not found: {_named(world.absent)}{how_to_fetch(world.absent)}"
        )
    titled = ["", "files"] if lines else []
    return [*titled, *(line for each in lines for line in wrapped(printable(each), columns, "   "))]


def _named(uris: Iterable[str]) -> str:
    return first_of([shortened(uri, LONGEST_URI) for uri in uris], MOST_NAMES)


def _kind_of(note: Note) -> str:
    """What notes have in common that differ only in the names that they quote."""
    return re.sub(r"'[^']*'", "''", f"{note.kind}: {note.what} {note.why}")


def _text(alike: list[Note]) -> str:
    """The first of notes of one kind, and how many there are."""
    first, *others = dict.fromkeys(f"{note.kind}: {note.what} {note.why}" for note in alike)
    more = f"; and {count(len(others), 'other')} like it" if others else ""
    times = f" ({len(alike)} times)" if len(alike) > 1 else ""
    return printable(f"{first}{more}{times}")


def _table(world: World, notes: Mapping[str, Iterable[str]], columns: int | None) -> list[str]:
    """A line for each model, with the cells of HEADER; `notes` are the last of them."""
    from rich.console import Console
    from rich.measure import Measurement
    from rich.table import Table
    from rich.text import Text

    from ddenv.world.extent import center, model_bounds

    ground = world.ground
    found = []
    for model in world.models:
        box = model_bounds(model)
        cells = (
            shortened(model.name, LONGEST_NAME),
            _kind(model, ground),
            str(len(model.links)),
            ", ".join(f"{number} {shape}" for shape, number in _shapes(model).items()) or "none",
            "" if box is None else " x ".join(f"{part:.2f}" for part in box[1] - box[0]),
            ", ".join(f"{part:.2f}" for part in center(model)),
            f"{model.links[0].pose.yaw():.2f}",
            ", ".join(notes.get(model.name, ())),
        )
        found.append(cells)
    titles = list(HEADER)
    console = Console(width=columns or WIDEST, color_system=None)
    for spare in (*SPARE, ""):
        table = Table(box=None, pad_edge=False, header_style="")
        for title in titles:
            table.add_column(title, justify="right" if title in TO_THE_RIGHT else "left")
        for row in found:
            table.add_row(
                *(Text(cell) for title, cell in zip(HEADER, row, strict=True) if title in titles)
            )
        if (
            not spare
            or Measurement.get(console, console.options.update(width=WIDEST), table).maximum
            <= console.width
        ):
            break
        titles.remove(spare)
    with console.capture() as printed:
        console.print(table)
    return [line.rstrip() for line in printed.get().splitlines()]


def _totals(world: World) -> str:
    kinds = Counter(note.kind for note in world.notes)
    said = [f"{kinds[kind]} {kind}" for kind in ("replaced", "ignored") if kinds[kind]]
    stay = [
        shortened(model.name, LONGEST_NAME) for model in world.models if model.name in world.anchors
    ]
    they, them = ("1 stays", "it") if len(stay) == 1 else (f"{len(stay)} stay", "them")
    why = f"; {they} because others depend on {them}: {first_of(stay, MOST_NAMES)}" if stay else ""
    welds = [
        f"{shortened(one, LONGEST_NAME)} to {shortened(other, LONGEST_NAME)}"
        for one, other in world.ties
    ]
    why += f"; welded, so they are removed together: {first_of(welds, MOST_NAMES)}" if welds else ""
    models = f"{count(len(world.models), 'model')}, {len(world.elements())} can be removed{why}"
    return f"{models}; {', '.join(said) or 'nothing was replaced or ignored'}"


# Its map.


@world_command.command()
@world_argument
@click.option("--spawn", type=Numbers("x,y,z,yaw", 2, 4), help="Mark the robot's start, m and rad.")
@click.option("--goal", type=Numbers("x,y", 2, 2), help="Mark the robot's goal, m.")
@click.option("--svg", type=Path, help="Write the map to this file instead.")
@click.option(
    "--took-part",
    is_flag=True,
    help="FILE is a run: show what may have affected runs of the whole world.",
)
@click.option(
    "--passes",
    is_flag=True,
    help="FILE is a run: show the nearest world that passes, and what it lacks.",
)
def show(
    file: Path,
    spawn: tuple[float, ...] | None,
    goal: Point | None,
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
            raise UserError(
                f"{option}: --spawn, --goal, --svg and other views of a run cannot be combined "
                "with it"
            )
        world, dim, below = _of_run(str(file), passes)
        print("\n".join([_map(world, dim=dim), *below]))
        return 0
    world, _ = _read(file, reading)
    # As for 'ddenv run', the third number is the height.
    start = None
    if spawn is not None:
        start = (spawn[0], spawn[1], spawn[3] if len(spawn) > 3 else 0.0)
    if svg is not None:
        write_file(svg, svg_map(world, spawn=start, goal=goal).encode())
        say_written([svg])
    else:
        print(_map(world, spawn=start, goal=goal))
    return 0


def _map(world: World, **marks: Any) -> str:
    from ddenv.cli.world_map import terminal_map

    columns, rows = shutil.get_terminal_size((100, 36))
    color = sys.stdout.isatty() and not os.environ.get("NO_COLOR")
    return terminal_map(world, columns, rows - 1, color=color, **marks)


def _of_run(name: str, passes: bool) -> tuple[World, frozenset[str], list[str]]:
    """The world of a run; the models that are drawn faint: what the nearest world that `passes`
    lacks, or what did not affect the runs of the whole world; and lines that say it, the most
    frequent first. Raises UserError where it is not known.
    """
    from ddenv.evidence.slices import in_whole_world
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.experiment import read_parts
    from ddenv.runs.reasons import removed_in_passing

    path = find_run(name)
    with RunFile(path) as run:
        world = read_parts(run)[1]
        state = fold(run.events())
    if passes:
        gone = removed_in_passing(state, path)
        head = (
            f"the nearest world that passes lacks {count(len(gone), 'model')} of "
            f"{len(state.elements)}:"
        )
        return world, frozenset(gone), [head, *(f"  {printable(model)}" for model in gone)]
    times, runs = in_whole_world(state)
    if not times or state.baseline is None:
        raise UserError(
            f"{path}: does not record which models affected its runs of the whole world; make a "
            "new run"
        )
    head = (
        f"{count(len(times), 'model')} of {len(state.elements)} may have affected the runs of "
        "the whole world:"
    )
    lines = [
        f"  {printable(model)}: {number} of {count(runs, 'run')}"
        for model, number in times.most_common()
    ]
    return world, frozenset(world.names) - times.keys(), [head, *lines]


# Other worlds made from it.


@world_command.command()
@world_argument
@click.option(
    "-o",
    "--output",
    type=Path,
    required=True,
    help="The SDF file to write; meshes go to a folder beside it.",
)
def convert(file: Path, output: Path, **reading: Any) -> int:
    """Writes FILE as clean SDF 1.9 that Drake's own parser loads."""
    from ddenv.world.write import write_converted

    say_written(write_converted(_read(file, reading)[0], output))
    return 0


@world_command.command()
@world_argument
@click.option("-o", "--output", type=Path, required=True, help="The SDF file to write.")
def settle(file: Path, output: Path, **reading: Any) -> int:
    """Lets the models of FILE come to rest, and writes it with their new poses; nothing else
    changes.
    """
    from ddenv.robot import check_drake

    world, read_as = _read(file, reading)
    if is_directives(world.path):
        raise UserError(
            f"{world.path}: only SDF worlds can be written settled; 'ddenv world convert' makes one"
        )
    check_drake()
    from ddenv.robot.settled import moved, notes_on
    from ddenv.robot.simulation.plant_cache import PlantCache
    from ddenv.runs.experiment import scenario_for_world
    from ddenv.world.access import write_file
    from ddenv.world.placement import note_inside
    from ddenv.world.sdf.moved import with_places
    from ddenv.world.sdf.read import read_model

    if output.resolve() == world.path.resolve():
        raise UserError(f"{output}: is the world itself; choose another file")
    able = sum(bool(model.links) and not model.static for model in world.models)
    # Drake's plant needs a robot; piles settle as if there were none.
    scenario = scenario_for_world(world.path, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0))
    announce(f"settling {count(able, 'model')} that can move")
    settled = PlantCache(world, read_model(scenario.robot.model), scenario).settled()
    for about, words in (*note_inside(world), *notes_on(world, settled)):
        if about != "unrest":
            announce(words)
    places = {name: links for name, links in settled.places.items() if name not in settled.fallen}
    text, stay = with_places(world, places, read_as)
    write_file(output, text)
    ways = {
        name: way for name, way in moved(world, settled).items() if name not in stay and way > 0
    }
    farthest = max(ways, key=lambda name: ways[name], default="")
    far = f", {farthest} farthest, by {ways[farthest]:.3f} m" if farthest else ""
    print(
        printable(
            f"wrote {output}: {count(len(ways), 'model')} moved within {settled.seconds:.1f} s{far}"
        )
    )
    if stay:
        why = "their parts move, or others depend on them"
        print(printable(f"not moved: {first_of(stay, MOST_NAMES)}: {why}"))
    return 0
