"""What was understood of a world: a table for people, plain data for programs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ddenv.errors import printable
from ddenv.world.extent import center, model_bounds
from ddenv.world.model import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Mesh,
    Model,
    Note,
    Plane,
    Shape,
    Sphere,
    World,
    is_ground,
)

NAMES: dict[type, str] = {
    Box: "box",
    Capsule: "capsule",
    Cylinder: "cylinder",
    Ellipsoid: "ellipsoid",
    Mesh: "hull",
    Plane: "plane",
    Sphere: "sphere",
}
LONGEST_NAME = 34
HEADER = ("model", "kind", "links", "shapes", "size, m", "centre x, y, z, m", "yaw", "notes")
TO_THE_RIGHT = (2, 6)


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


def lines(world: World) -> list[str]:
    """The table: a line for each model, then the notes by number, then the totals."""
    numbers = {text: number for number, text in enumerate(dict.fromkeys(map(_text, world.notes)), start=1)}
    by_model: dict[str, dict[str, None]] = {}
    for note in world.notes:
        number = f"{numbers[_text(note)]}"
        said = f"{number} ({printable(note.detail)})" if note.detail else number
        by_model.setdefault(note.model, {})[said] = None
    rows = [HEADER, *(_row(model, by_model.get(model.name, {})) for model in world.models)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADER))]
    table = [
        "  ".join(_cell(row[i], widths[i], i in TO_THE_RIGHT) for i in range(len(HEADER))).rstrip() for row in rows
    ]
    notes = [f"{number:4}  {text}" for text, number in numbers.items()]
    return [_title(world), "", *table, *(["", "notes", *notes] if notes else []), "", _totals(world)]


def _title(world: World) -> str:
    gravity = " ".join(f"{part:g}" for part in world.gravity)
    return printable(f"{world.path}: SDF {world.version}, world '{world.name}', gravity {gravity} m/s^2")


def _totals(world: World) -> str:
    elements, models = len(world.elements()), len(world.models)
    counts = {which: sum(note.kind == which for note in world.notes) for which in ("replaced", "ignored")}
    kept = "" if not world.anchors else f"; {len(world.anchors)} stay since others are placed relative to them"
    said = ", ".join(f"{number} {which}" for which, number in counts.items() if number)
    return f"{models} models, {elements} can be removed{kept}; {said or 'everything was taken as it is written'}"


def _text(note: Note) -> str:
    return printable(f"{note.kind}: {note.what} {note.why}")


def _row(model: Model, notes: Iterable[str]) -> tuple[str, ...]:
    name = printable(model.name)
    box = model_bounds(model)
    size = "" if box is None else " x ".join(f"{part:.2f}" for part in box[1] - box[0])
    return (
        _shortened(name),
        kind(model),
        str(len(model.links)),
        ", ".join(f"{number} {shape}" for shape, number in _shapes(model)) or "none",
        size,
        ", ".join(f"{part:.2f}" for part in center(model)),
        f"{model.links[0].pose.yaw():.2f}",
        ", ".join(notes),
    )


def _shapes(model: Model) -> list[tuple[str, int]]:
    shapes: list[Shape] = [collision.shape for collision in model.collisions]
    found = [NAMES[type(shape)] for shape in shapes]
    return [(name, found.count(name)) for name in dict.fromkeys(found)]


def _shortened(name: str) -> str:
    """Names of many copies of one model differ at their ends."""
    if len(name) <= LONGEST_NAME:
        return name
    half = (LONGEST_NAME - 3) // 2
    return f"{name[:half]}...{name[-(LONGEST_NAME - 3 - half) :]}"


def _cell(text: str, width: int, right: bool) -> str:
    return text.rjust(width) if right else text.ljust(width)
