"""The `ddenv run` command that does what the setup screen's Start would do. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddenv.runs import processor
from ddenv.settings import OPTIONS, PRINTED, number_text, read
from ddenv.workbench.setup.form import read_key

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

PLACES = {
    "spawn": ("robot.spawn.x", "robot.spawn.y", "robot.spawn.z", "robot.spawn.yaw"),
    "goal": ("goal.x", "goal.y"),
}


def command(
    source: str,
    own: Scenario | None,
    asked: Scenario,
    *,
    standard: Scenario,
    jobs: int,
    reading: Mapping[str, Sequence[Any]],
    name: str = "",
) -> list[str]:
    """The words of the command, to be joined by `shlex.join`.

    `source` is a scenario's name or file, or a world; `own` is the scenario in it, None for a world, which starts with `standard`.
    `reading` are the options for reading worlds, `name` is the run's name if it is not the next free one.
    """
    before, after = (own or standard).model_dump(mode="json"), asked.model_dump(mode="json")
    words = ["ddenv", "run", source]
    for place, keys in PLACES.items():
        numbers = [read_key(after, key) for key in keys]
        if own is None or numbers != [read_key(before, key) for key in keys]:
            words.append(f"--{place}={','.join(map(number_text, numbers))}")
    changed = [one for one in OPTIONS if read(after, one) != read(before, one)]
    # As printed sets the others.
    others = PRINTED if any(one.name == "as_printed" for one in changed) else {}
    for one in changed:
        if one.name not in others:
            words += one.words(read(after, one))
    for option, values in reading.items():
        for value in values:
            words += [f"--{option.replace('_', '-')}", _path(value) if isinstance(value, Path) else str(value)]
    if jobs != processor.usable_cores():
        words += ["--jobs", str(jobs)]
    return words + _name(name)


def source_of(path: Path, bundled: Path) -> str:
    """A file as an argument of `ddenv run`: the name of a bundled scenario, or the whole path."""
    if path.parent == bundled and path.suffix == ".yaml":
        return path.stem
    return _path(path)


def _path(path: Path) -> str:
    return str(path.absolute())


def _name(name: str) -> list[str]:
    if not name:
        return []
    return ["--output", str(Path(name).absolute())] if len(Path(name).parts) > 1 else ["--name", name]
