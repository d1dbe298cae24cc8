"""A scenario as a file of its own, which loads to the same scenario."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ddenv.errors import UserError

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

SUFFIXES = (".yaml", ".yml")


def scenario_path(text: str) -> Path:
    """The file that a user names, with .yaml where he left it out. Raises UserError for what cannot be one."""
    text = text.strip()
    if not text.strip("./") or text.endswith("/") or "\0" in text:
        raise UserError("give the name of a file, such as my-world.yaml")
    path = Path(text)
    try:
        path = path.expanduser()
    except RuntimeError:
        raise UserError(f"{path}: there is no such user here") from None
    path = path if path.suffix.lower() in SUFFIXES else path.with_name(f"{path.name}.yaml")
    try:
        if path.is_dir():
            raise UserError(f"{path}: is a folder; give the name of a file")
        if not path.parent.is_dir():
            raise UserError(f"{path}: there is no folder {path.parent}")
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror}") from None
    return path


def save_scenario(scenario: Scenario, path: Path) -> None:
    """Writes `scenario` as YAML, in place of what is there. Raises UserError, with nothing written.

    Files in the folder of `path` are named relative to it, so that the folder can be moved.
    """
    import yaml

    from ddenv.world.files.whole import write_file

    for each in (scenario.world, scenario.robot.model):
        if not each.is_file():
            raise UserError(
                f"{each}: is not there any more, so that no scenario could name it; "
                "'ddenv export' writes the world of a run"
            )
    data = scenario.model_dump(mode="json")
    folder = path.resolve().parent
    data["world"], data["robot"]["model"] = _name(scenario.world, folder), _name(scenario.robot.model, folder)
    data["reading"]["model_path"] = [_name(each, folder) for each in scenario.reading.model_path]
    # Only programs of the user's own are searched there.
    if scenario.oracle is None and ":" not in scenario.controller.use:
        del data["folder"]
    else:
        data["folder"] = _name(scenario.folder, folder)
    write_file(path, yaml.safe_dump(data, sort_keys=False, allow_unicode=True).encode())


def _name(path: Path, folder: Path) -> str:
    """What `path` is called in a scenario of `folder`: relative if it goes along when that folder is moved."""
    path = path.resolve()
    return str(path.relative_to(folder) if path.is_relative_to(folder) else path)
