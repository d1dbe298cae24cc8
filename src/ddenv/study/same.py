"""Whether a run file is of a cell: made of the same scenario, the same world and the same robot."""

from __future__ import annotations

import json

from ddenv.errors import UserError
from ddenv.runfile.store import RunFile
from ddenv.study.plan import Cell
from ddenv.world.files.whole import read_bytes


def difference(file: RunFile, cell: Cell) -> str:
    """What it was made of that the cell has not, "" if nothing. Raises UserError where that cannot be read."""
    first = next(iter(file.events(most=1)), None)
    if first is None:
        raise UserError(f"{file.path}: damaged run file: it has no events")
    asked = json.loads(cell.scenario.model_dump_json())
    if _told(first.data.get("scenario")) != _told(asked):
        return "another scenario, or with other options"
    if file.document("world") != read_bytes(cell.scenario.world):
        return "another world"
    return "" if file.document("robot") == read_bytes(cell.scenario.robot.model) else "another robot"


def _told(scenario: object) -> object:
    """A scenario without its words, and without where its files are: a study may go on in another place."""
    if not isinstance(scenario, dict):
        return None
    kept = {key: value for key, value in scenario.items() if key not in ("description", "world", "folder")}
    for part, key in (("robot", "model"), ("reading", "model_path")):
        if isinstance(kept.get(part), dict):
            kept[part] = {name: value for name, value in kept[part].items() if name != key}
    return kept
