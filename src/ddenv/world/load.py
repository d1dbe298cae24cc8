"""Loads a scenario from YAML, with complaints that name the file, the key, the value and what is
allowed.
"""

from __future__ import annotations

import re
import reprlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

import yaml
from pydantic import BaseModel, ValidationError

from ddenv import schemas
from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.settings import SETTINGS
from ddenv.text import Data
from ddenv.world.access import is_folder, not_yaml, read_bytes, resolved
from ddenv.world.scenario import Oracle, Scenario

_PACKAGE = Path(__file__).resolve().parents[1]
_ROOT = _PACKAGE / "data" if (_PACKAGE / "data").is_dir() else _PACKAGE.parents[1]
SCENARIOS = _ROOT / "scenarios"
SDF = _ROOT / "sdf"


def bundled_names() -> list[str]:
    """Names of the bundled scenarios, sorted."""
    return sorted(path.stem for path in SCENARIOS.glob("*.yaml"))


# What pydantic's words for its errors would not tell a user.
PLAINLY = {
    "tuple_type": "should be a list",
    "too_short": "should have at least one entry",
    "path_type": "should be a file name",
}


def find_scenario(name: str) -> Path:
    """The file of a bundled scenario, or the path itself. Raises UserError, with the nearest name
    for a typo.
    """
    path = Path(name)
    if is_folder(path):
        raise UserError(f"{name}: is a folder; expected a scenario's name or file")
    if path.suffix.lower() in (".yaml", ".yml") or path.is_file():
        return path
    bundled = SCENARIOS / f"{name}.yaml"
    if re.fullmatch(r"[\w-]+", name) and bundled.is_file():
        return bundled
    names = bundled_names()
    raise UserError(
        f"no scenario '{name}'{nearest(name, names)}; bundled are {', '.join(names)}; or give a "
        "YAML file"
    )


def load_scenario(path: Path) -> Scenario:
    """The scenario in the YAML file `path`, with its file names made absolute. Raises UserError."""
    scenario = validate(_data(path, "name, world, robot and goal"), str(path))
    folder = resolved(path).parent
    robot = scenario.robot.model_copy(update={"model": folder / scenario.robot.model})
    model_path = tuple(folder / each for each in scenario.reading.model_path)
    reading = scenario.reading.model_copy(update={"model_path": model_path})
    places: Data = {"world": folder / scenario.world, "folder": folder / scenario.folder}
    if scenario.oracle is not None and scenario.oracle.folder is not None:
        places["oracle"] = scenario.oracle.model_copy(
            update={"folder": folder / scenario.oracle.folder}
        )
    return scenario.model_copy(update={**places, "robot": robot, "reading": reading})


def load_simulator(path: Path) -> Oracle:
    """The simulator in the YAML file `path`, which has the keys of a scenario's `oracle`; it starts
    in the file's folder.

    Raises UserError.
    """
    try:
        oracle = Oracle.model_validate(_data(path, "name, and command or use"))
    except ValidationError as error:
        raise _wrong(str(path), *complaint(error.errors()[0], Oracle), {}) from None
    folder = path.resolve().parent
    return oracle.model_copy(update={"folder": folder / (oracle.folder or "")})


def _data(path: Path, expected: str) -> Data:
    """The keys of the YAML file `path`, such as those `expected`. Raises UserError."""
    data = read_yaml(path)
    if not isinstance(data, dict):
        raise UserError(f"{path}: expected keys such as {expected}; found {_shown(data)}")
    return data


def read_yaml(path: Path) -> Any:
    """What the YAML file `path` says. Raises UserError."""
    content = read_bytes(path)
    try:
        return yaml.safe_load(content)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise not_yaml(path, error) from None


def validate(data: Data, where: str, named: Mapping[str, str] = {}) -> Scenario:
    """`data` as a scenario. Raises UserError with the first wrong key.

    `where` names its file; `named` has what the user calls some of the keys, such as an option.
    """
    try:
        scenario = Scenario.model_validate(data)
    except ValidationError as error:
        raise _wrong(where, *complaint(error.errors()[0], Scenario), named) from None
    # Not the model's own matter: a run is shown also where the package that brought its schemas is
    # missing.
    known = {
        kind: list(schemas.names(kind)) for kind in ("algorithm", "partitioning", "prioritization")
    }
    pairs = (
        f"{', '.join(known['partitioning'])}, then '/', then one of "
        f"{', '.join(known['prioritization'])}"
    )
    for key, value, names, allowed in (
        (
            "algorithm",
            scenario.reduction.algorithm,
            known["algorithm"],
            ", ".join(known["algorithm"]),
        ),
        ("pair", scenario.reduction.pair, list(schemas.pairs()), pairs),
    ):
        if value not in names:
            words = f"{_shown(value)} is not allowed{nearest(value, names)}; use one of {allowed}"
            raise _wrong(where, f"reduction.{key}", words, named)
    return scenario


def _wrong(where: str, key: str, words: str, named: Mapping[str, str]) -> UserError:
    return UserError(f"{named[key]}: {words}" if key in named else f"{where}: {key}: {words}")


def complaint(error: Any, model: type[BaseModel]) -> tuple[str, str]:
    """One of pydantic's errors in our words: the key; then what is wrong with its value, and what
    is allowed.
    """
    location = [str(part) for part in error["loc"]]
    key = ".".join(location)
    kind = error["type"]
    found = _shown(error["input"])
    if kind == "extra_forbidden":
        shorthands = [
            one.name
            for one in SETTINGS.values()
            if not one.stored and [one.section] == location[:-1]
        ]
        known = sorted([*_section(model, location[:-1]).model_fields, *shorthands])
        return key, f"unknown key{nearest(location[-1], known)}; allowed are {', '.join(known)}"
    if kind == "as_printed":
        return f"{key}.as_printed", str(error["msg"])
    if kind == "missing":
        return key, "is missing"
    if kind == "literal_error":
        allowed = error["ctx"]["expected"].replace("'", "").replace(" or ", ", ")
        return (
            key,
            (
                f"{found} is not allowed{nearest(str(error['input']), allowed.split(', '))}; use "
                f"one of {allowed}"
            ),
        )
    if kind == "string_pattern_mismatch" and key == "controller.use":
        return key, f"expected straight, costmap or module:Class, found {found}"
    plain = error["msg"][:1].lower() + error["msg"][1:].replace("Input should", "should")
    return key, f"{PLAINLY.get(kind, plain.replace('input should', 'should'))}, found {found}"


def _section(model: type[BaseModel], location: list[str]) -> type[BaseModel]:
    # Keys of a mapping to sections are no fields.
    for part in (each for each in location if each in model.model_fields):
        hint = model.model_fields[part].annotation
        # A section that may be missing is a union with None.
        model = next(
            each
            for each in (hint, *get_args(hint))
            if isinstance(each, type) and issubclass(each, BaseModel)
        )
    return model


def _shown(value: Any) -> str:
    # A short YAML file can hold a value that is endless when written out.
    text = reprlib.repr(value)
    if len(text) <= 60:
        return text
    return f"{text[:57]}..."
