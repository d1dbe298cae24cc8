"""Controllers by name: those of ddenv, and anyone's own, imported from the scenario's folder or from what is installed."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from ddenv.errors import UserError
from ddenv.robot.deadline import TooLate, call_within
from ddenv.robot.guard import ControllerFailed, Guarded, first_on_path, told
from ddenv.robot.protocol import Drives, Setup
from ddenv.schemas import nearest
from ddenv.world.scenario import Controller

__all__ = ["ControllerFailed", "Guarded", "controllers", "load"]

BUILT_IN = {
    "straight": "ddenv.robot.navigation.straight:Straight",
    "costmap": "ddenv.robot.navigation.navigate:Navigator",
}
# The longest that an import may take, real s: some load whole frameworks.
LONGEST_IMPORT = 60.0

# The modules of the folder that a controller was last loaded from, which another folder may have too.
_brought: set[str] = set()


def controllers(settings: Controller, folder: Path) -> Callable[[Setup], Drives]:
    """What makes a controller for each run. Raises UserError as `load` does; an own one raises ControllerFailed in `step`."""
    make = load(settings.use, folder)
    if settings.use in BUILT_IN:
        return make
    return partial(Guarded, make, folder=folder.resolve(), answer_within=settings.answer_within)


def load(use: str, folder: Path) -> Callable[[Setup], Any]:
    """The class that `use` names: `straight`, `costmap`, or `module:Class` with the module in `folder` or installed.

    Raises UserError if there is none, or if its module cannot be imported.
    """
    name, _, attribute = BUILT_IN.get(use, use).partition(":")
    module = importlib.import_module(name) if use in BUILT_IN else _import(name, folder.resolve())
    found = getattr(module, attribute, None)
    if not callable(found):
        classes = [each for each, value in vars(module).items() if isinstance(value, type) and each[0] != "_"]
        raise UserError(f"controller.use: module '{name}' has no class '{attribute}'{nearest(attribute, classes)}")
    if isinstance(found, type) and not callable(getattr(found, "step", None)):
        raise UserError(f"controller.use: class '{attribute}' of module '{name}' has no method step(reading)")
    return found


def _import(name: str, folder: Path) -> ModuleType:
    """The module `name`, of `folder` if it has one of that name. Raises UserError."""
    while _brought:
        sys.modules.pop(_brought.pop(), None)
    top = name.partition(".")[0]
    if _has(folder, top):
        _check_name(top, folder)
    before = set(sys.modules)
    # Those written a moment ago are to be seen.
    importlib.invalidate_caches()
    try:
        with first_on_path(folder), redirect_stdout(sys.stderr):
            call_within(LONGEST_IMPORT, __import__, name)
            return sys.modules[name]
    except TooLate:
        raise UserError(f"controller.use: importing '{name}' took longer than {LONGEST_IMPORT:g} s") from None
    # A module may also exit, or interrupt itself.
    except BaseException as error:
        if isinstance(error, ModuleNotFoundError) and error.name and f"{name}.".startswith(f"{error.name}."):
            hint = nearest(name, [file.stem for file in folder.glob("*.py")])
            raise UserError(f"controller.use: there is no module '{name}' in {folder}, nor installed{hint}") from None
        raise UserError(f"controller.use: importing '{name}' raised {told(error)}") from None
    finally:
        _brought.update(each for each in set(sys.modules) - before if _has(folder, each.partition(".")[0]))


def _has(folder: Path, top: str) -> bool:
    return (folder / f"{top}.py").is_file() or (folder / top).is_dir()


def _check_name(top: str, folder: Path) -> None:
    """Raises UserError where a file of `folder` has the name of a module that others need."""
    loaded = sys.modules.get(top)
    places = [] if loaded is None else [getattr(loaded, "__file__", None), *getattr(loaded, "__path__", ())]
    elsewhere = loaded is not None and not any(place and Path(place).is_relative_to(folder) for place in places)
    if elsewhere or top in sys.stdlib_module_names:
        raise UserError(f"controller.use: '{top}' in {folder} has the name of another module; rename it")
