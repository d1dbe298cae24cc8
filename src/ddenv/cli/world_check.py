"""How a world was read: a table for people, plain data for programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rich.text import Text

from ddenv.cli.terminal import wrapped
from ddenv.text import count, first_of, padded, printable, shortened, width
from ddenv.world.extent import center, model_bounds
from ddenv.world.model import Mesh, Model, Note, World, is_ground
from ddenv.world.placement import inside, note_inside

LONGEST_NAME, SHORTEST_NAME = 34, 10
GAP = "  "
# A row has the notes of a model twice: with details, and as numbers only.
HEADER = ("model", "kind", "links", "shapes", "size, m", "centre x, y, z, m", "yaw", "notes", "notes")
TO_THE_RIGHT = (2, 6)
# Which columns are shown, from wide terminals to narrow ones.
CHOICES = (
    (0, 1, 2, 3, 4, 5, 6, 7),
    (0, 1, 2, 3, 4, 5, 6, 8),
    (0, 1, 3, 4, 5, 6, 8),
    (0, 1, 4, 5, 6, 8),
    (0, 1, 4, 5, 8),
)
# The maximum number of models that must stay to be named.
MOST_ANCHORS = 5


def report(world: World) -> dict[str, Any]:
    """Everything of the table and more; lengths in m, angles in rad."""
    elements = set(world.elements())
    return {
        "file": str(world.path),
        "version": world.version,
        "world": world.name,
        "gravity": list(world.gravity),
        "models": [_described(model, model.name in elements, world.notes) for model in world.models],
        "notes": [_note(note) for note in world.notes if not note.model],
        "inside": [{"model": one.name, "other": one.other, "depth": one.depth} for one in inside(world)],
    }


def _described(model: Model, removable: bool, notes: Iterable[Note]) -> dict[str, Any]:
    box = model_bounds(model)
    return {
        "name": model.name,
        "kind": kind(model),
        "removable": removable,
        "line": model.line,
        "pose": [*model.pose.position, *model.pose.quaternion],
        "links": [{"name": link.name, "pose": [*link.pose.position, *link.pose.quaternion]} for link in model.links],
        "joints": [{"name": joint.name, "kind": joint.kind} for joint in model.joints],
        "shapes": dict(_shapes(model)),
        "low": None if box is None else box[0].tolist(),
        "high": None if box is None else box[1].tolist(),
        "friction": sorted({collision.mu for collision in model.collisions}),
        "mass": sum(link.inertia.mass for link in model.links if link.inertia is not None) or None,
        "notes": [_note(note) for note in notes if note.model == model.name],
    }


def _note(note: Note) -> dict[str, str]:
    return {"kind": note.kind, "what": note.what, "why": note.why, "detail": note.detail, "place": note.place}


def kind(model: Model) -> str:
    """ground, static or dynamic."""
    if is_ground(model):
        return "ground"
    return "static" if model.static else "dynamic"


def lines(world: World, columns: int | None = None) -> list[str]:
    """The table: a line for each model, then the notes by number, then the totals.

    No line is wider than `columns`, so the table leaves out the least important columns; with None it has all.
    """
    numbers = {text: number for number, text in enumerate(dict.fromkeys(map(_text, world.notes)), start=1)}
    by_model: dict[str, dict[str, str]] = {}
    for note in sorted(world.notes, key=lambda note: numbers[_text(note)]):
        number = str(numbers[_text(note)])
        detail = printable(note.detail.removesuffix(" away"))
        by_model.setdefault(note.model, {})[f"{number} ({detail})" if detail else number] = number
    table = _table([HEADER, *(_row(model, by_model.get(model.name, {})) for model in world.models)], columns)
    notes = [line for text, number in numbers.items() for line in wrapped(text, columns, f"{number:4}  ")]
    below = ["", "notes", *notes] if notes else []
    wrong = [line for _, words in note_inside(world) for line in wrapped(words, columns)]
    return [*wrapped(_title(world), columns), "", *table, *below, "", *wrapped(_totals(world), columns), *wrong]


def _table(rows: Sequence[tuple[str, ...]], columns: int | None) -> list[str]:
    """The rows, with as many columns as fit, and names shortened if needed."""
    widths = [max(map(width, column)) for column in zip(*rows, strict=True)]
    wide = [sum(widths[i] for i in choice) + len(GAP) * (len(choice) - 1) for choice in CHOICES]
    fitting = (choice for choice, each in zip(CHOICES, wide, strict=True) if columns is None or each <= columns)
    shown = next(fitting, None)
    if shown is None and columns is not None:
        widths[0] = max(SHORTEST_NAME, widths[0] - (wide[-1] - columns))
    shown = shown or CHOICES[-1]
    lines = [Text(GAP.join(_cell(row[i], widths[i], i) for i in shown).rstrip()) for row in rows]
    for line in lines:
        line.truncate(line.cell_len if columns is None else columns, overflow="ellipsis")
    return [line.plain for line in lines]


def _title(world: World) -> str:
    gravity = " ".join(f"{part:g}" for part in world.gravity)
    return printable(f"{world.path}: SDF {world.version}, world '{world.name}', gravity {gravity} m/s^2")


def _totals(world: World) -> str:
    counts = {which: sum(note.kind == which for note in world.notes) for which in ("replaced", "ignored")}
    said = ", ".join(f"{number} {which}" for which, number in counts.items() if number)
    models = f"{count(len(world.models), 'model')}, {len(world.elements())} can be removed"
    return f"{models}{_staying(world)}; {said or 'nothing was replaced or ignored'}"


def _staying(world: World) -> str:
    names = [shortened(model.name, LONGEST_NAME) for model in world.models if model.name in world.anchors]
    if not names:
        return ""
    they, them = ("1 stays", "it") if len(names) == 1 else (f"{len(names)} stay", "them")
    return f"; {they} since others are placed relative to {them}: {first_of(names, MOST_ANCHORS)}"


def _text(note: Note) -> str:
    return printable(f"{note.kind}: {note.what} {note.why}")


def _row(model: Model, notes: Mapping[str, str]) -> tuple[str, ...]:
    """A cell for each of HEADER; `notes` are those with details, and the number of each."""
    box = model_bounds(model)
    size = "" if box is None else " x ".join(f"{part:.2f}" for part in box[1] - box[0])
    return (
        shortened(model.name, LONGEST_NAME),
        kind(model),
        str(len(model.links)),
        ", ".join(f"{number} {shape}" for shape, number in _shapes(model).items()) or "none",
        size,
        ", ".join(f"{part:.2f}" for part in center(model)),
        f"{model.links[0].pose.yaw():.2f}",
        ", ".join(notes),
        ", ".join(dict.fromkeys(notes.values())),
    )


def _shapes(model: Model) -> Counter[str]:
    """How many shapes of each kind; a mesh is simulated as its hull."""
    shapes = [collision.shape for collision in model.collisions]
    return Counter("hull" if isinstance(shape, Mesh) else type(shape).__name__.lower() for shape in shapes)


def _cell(text: str, columns: int, which: int) -> str:
    text = shortened(text, columns)
    return f"{' ' * (columns - width(text))}{text}" if which in TO_THE_RIGHT else padded(text, columns)
