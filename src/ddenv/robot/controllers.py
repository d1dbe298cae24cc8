"""The controller of a run: one of our own, or a class of the user's.

Whatever a user's controller does wrong only ends the run, with the reason.
"""

from __future__ import annotations

import copy
import importlib
import random
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from functools import partial
from math import isfinite
from numbers import Real
from pathlib import Path
from traceback import walk_tb
from types import ModuleType
from typing import Any, Protocol, TypeVar, cast

import numpy as np

from ddenv.errors import UserError
from ddenv.robot.deadline import TooLate, call_within
from ddenv.robot.protocol import Drives, Reading, Setup, Twist, WheelSpeeds
from ddenv.schemas import nearest
from ddenv.text import plain
from ddenv.world.scenario import Controller

BUILT_IN = {
    "straight": "ddenv.robot.navigation.navigate:Straight",
    "costmap": "ddenv.robot.navigation.navigate:Navigator",
}
LONGEST_IMPORT = (
    60.0  # the maximum time that an import may take, real s: some load whole frameworks
)

Answer = TypeVar("Answer")
# Modules loaded from the folder of the last user's controller; another folder may have modules of
# the same names.
_brought: set[str] = set()


def controllers(settings: Controller, folder: Path) -> Callable[[Setup], Drives]:
    """A function that makes the controller of a run.

    Raises UserError as `load` does. A user's controller is guarded: its `step` raises only BadCode.
    """
    make = load(settings.use, folder)
    if settings.use in BUILT_IN:
        return make
    return partial(Guarded, make, folder=folder.resolve(), answer_within=settings.answer_within)


def load(
    use: str, folder: Path, key: str = "controller.use", method: str = "step(reading)"
) -> Callable[[Any], Any]:
    """The class that `use` names: `straight`, `costmap`, or `module:Class` with the module in
    `folder` or installed.

    Raises UserError, which names the scenario's `key`, if there is no such class with this
    `method`, or if its module cannot be imported.
    """
    name, _, attribute = BUILT_IN.get(use, use).partition(":")
    if use in BUILT_IN:
        module = importlib.import_module(name)
    else:
        module = _import(name, folder.resolve(), key)
    found = getattr(module, attribute, None)
    if not callable(found):
        classes = [
            each
            for each, value in vars(module).items()
            if isinstance(value, type) and each[0] != "_"
        ]
        raise UserError(
            f"{key}: module '{name}' has no class '{attribute}'{nearest(attribute, classes)}"
        )
    if isinstance(found, type) and not callable(getattr(found, method.partition("(")[0], None)):
        raise UserError(f"{key}: class '{attribute}' of module '{name}' has no method {method}")
    return cast(Callable[[Any], Any], found)


def _import(name: str, folder: Path, key: str) -> ModuleType:
    """The module `name`, from `folder` if it has one of that name. Raises UserError."""
    while _brought:
        sys.modules.pop(_brought.pop(), None)
    top = name.partition(".")[0]
    if _has(folder, top):
        loaded = sys.modules.get(top)
        if loaded is None:
            places = []
        else:
            places = [getattr(loaded, "__file__", None), *getattr(loaded, "__path__", ())]
        elsewhere = loaded is not None and not any(
            place and Path(place).is_relative_to(folder) for place in places
        )
        if elsewhere or top in sys.stdlib_module_names:
            raise UserError(f"{key}: '{top}' in {folder} has the name of another module; rename it")
    before = set(sys.modules)
    # So that Python finds files written a moment ago.
    importlib.invalidate_caches()
    try:
        with first_on_path(folder), redirect_stdout(sys.stderr):
            call_within(LONGEST_IMPORT, __import__, name)
            return sys.modules[name]
    except TooLate:
        raise UserError(
            f"{key}: importing '{name}' took longer than {LONGEST_IMPORT:g} s"
        ) from None
    # A module may also exit, or interrupt itself.
    except BaseException as error:
        if (
            isinstance(error, ModuleNotFoundError)
            and error.name
            and f"{name}.".startswith(f"{error.name}.")
        ):
            hint = nearest(name, [file.stem for file in folder.glob("*.py")])
            raise UserError(
                f"{key}: there is no module '{name}' in {folder}, nor installed{hint}"
            ) from None
        raise UserError(f"{key}: importing '{name}' raised {described(error)}") from None
    finally:
        _brought.update(
            each for each in set(sys.modules) - before if _has(folder, each.partition(".")[0])
        )


def _has(folder: Path, top: str) -> bool:
    return (folder / f"{top}.py").is_file() or (folder / top).is_dir()


@contextmanager
def first_on_path(folder: Path) -> Iterator[None]:
    """Searches modules in `folder` first. Other changes of the path stay."""
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        with suppress(ValueError):
            sys.path.remove(str(folder))


# The maximum speed of a command, m/s, or rad/s: faster is a mistake.
FASTEST = 1000.0
LONGEST_REASON = 300
SEEDS = 2**32  # the number of seeds of NumPy's global generator
# Our own files, which a reported place leaves out: they do not help the author of the code.
OURS = Path(__file__).parent


class BadCode(UserError):
    """The user's code did something wrong. The text is one line: which code, and what happened."""

    def __init__(self, reason: str) -> None:
        line = plain(reason)
        super().__init__(
            line if len(line) <= LONGEST_REASON else f"{line[: LONGEST_REASON - 3]}..."
        )


class Guarded:
    """The controller that `make(setup)` returns, made at the first step.

    Each call must return within `answer_within` s of real time. Modules that the controller imports
    late are searched in `folder` first, like its own. What it prints goes to stderr: a program may
    read stdout.
    """

    def __init__(
        self, make: Callable[[Setup], Any], setup: Setup, folder: Path, answer_within: float
    ) -> None:
        self._name = getattr(make, "__qualname__", type(make).__name__)
        self._make = make
        # A copy: changes of the options must not reach the next run.
        self._setup = copy.deepcopy(setup)
        self._folder = folder
        self._seconds = answer_within
        self._controller: Any = None
        self.arrived = False

    def step(self, reading: Reading) -> Twist | WheelSpeeds:
        """The command for the next period. Raises BadCode."""
        if self._controller is None:
            # So that random numbers from the global generators are the same in each repetition of
            # the run.
            random.seed(self._setup.seed)
            np.random.seed(self._setup.seed % SEEDS)
            self._controller = self._guarded("__init__", self._make, self._setup)

        def ask(reading: Reading) -> Twist | WheelSpeeds:
            answer = self._controller.step(reading)
            self.arrived = bool(getattr(self._controller, "arrived", False))
            return _command(answer, self._setup.joints)

        command: Twist | WheelSpeeds = self._guarded("step", ask, reading)
        return command

    def _guarded(self, what: str, call: Callable[[Any], Any], given: Any) -> Any:
        who = f"controller {self._name}: {what}"
        limit = f"{self._seconds:g} s (controller.answer_within)"
        with redirect_stdout(sys.stderr):
            return guarded(
                who, lambda: call_within(self._seconds, call, given), self._folder, limit
            )


class WrongAnswer(Exception):
    """What is wrong with an answer of the user's code."""


def guarded(who: str, call: Callable[[], Answer], folder: Path, limit: str) -> Answer:
    """Returns `call()`, which runs the user's code, with modules searched in `folder` first.

    Raises BadCode, which begins with `who`, and for TooLate names the `limit`.
    """
    try:
        with first_on_path(folder):
            return call()
    except TooLate:
        problem = f"took longer than {limit}"
    except WrongAnswer as error:
        problem = str(error)
    # The code may also exit, or interrupt itself.
    except BaseException as error:
        problem = f"raised {described(error)}"
    raise BadCode(f"{who} {problem}")


def _command(answer: Any, joints: tuple[str, ...]) -> Twist | WheelSpeeds:
    """A controller's answer as a command of finite numbers. Raises WrongAnswer."""
    if isinstance(answer, Twist):
        return Twist(_number(answer.speed, "a speed"), _number(answer.turn_rate, "a turn rate"))
    if isinstance(answer, tuple | list) and len(answer) == 2:
        return Twist(_number(answer[0], "a speed"), _number(answer[1], "a turn rate"))
    speeds = answer.speeds if isinstance(answer, WheelSpeeds) else answer
    if not isinstance(speeds, Mapping):
        raise WrongAnswer(
            f"returned {_kind(answer)}; expected Twist(speed, turn_rate) or WheelSpeeds(speeds "
            "by joint)"
        )
    for joint in speeds:
        if not isinstance(joint, str) or joint not in joints:
            shown = str(joint)[:80]
            raise WrongAnswer(
                f"returned a speed for '{shown}'{nearest(shown, joints)}; wheels are "
                f"{', '.join(joints)}"
            )
    return WheelSpeeds({joint: _number(speed, f"'{joint}'") for joint, speed in speeds.items()})


def _number(value: Any, what: str) -> float:
    if not isinstance(value, float | int) and not isinstance(value, Real):
        raise WrongAnswer(f"returned {what} that is {_kind(value)}; expected a number")
    number = float(value)
    if not isfinite(number) or abs(number) > FASTEST:
        raise WrongAnswer(f"returned {what} of {number:g}; the maximum is {FASTEST:g}")
    return number


def _kind(value: Any) -> str:
    if value is None:
        return "None"
    return f"a value of type {type(value).__name__}"


def described(error: BaseException) -> str:
    """An exception in one line: its type, its text, and the place in the user's code that it came
    from.

    That is the innermost call in the folder of the first file that is not ours.
    """
    text = place = ""
    with suppress(Exception):
        text = str(error)
    files = [(Path(each.f_code.co_filename), line) for each, line in walk_tb(error.__traceback__)]
    theirs = [
        each
        for each in files
        if not each[0].is_relative_to(OURS) and not str(each[0]).startswith("<")
    ]
    for file, line in theirs:
        if file.is_relative_to(theirs[0][0].parent):
            place = f" ({file.name}:{line})"
    return f"{type(error).__name__}{': ' if text else ''}{text}{place}"


class Listener(Protocol):
    """Something that hears a run."""

    def begin(self, setup: Setup) -> None:
        """A run begins; what was heard before it is void, since a run may be made again from its
        start.
        """

    def hear(self, reading: Reading, command: Twist | WheelSpeeds) -> None:
        """What the controller was given, and its command."""
