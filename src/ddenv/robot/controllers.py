"""Someone's own controller at work: whatever it does wrong ends the run, with the reason, and nothing else."""

from __future__ import annotations

import copy
import importlib
import random
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from functools import partial
from math import isfinite
from numbers import Real
from pathlib import Path
from types import FrameType, ModuleType, TracebackType
from typing import Any, TypeVar

import numpy as np

from ddenv.errors import UserError, printable
from ddenv.robot.protocol import Drives, Reading, Setup, Twist, WheelSpeeds
from ddenv.schemas import nearest
from ddenv.world.scenario import Controller

Given = TypeVar("Given")
Answer = TypeVar("Answer")

# What catches the interruption and goes on is interrupted again after this time, s.
AGAIN = 0.1
# Of a timer that ran before and is due by now, s.
AT_ONCE = 1e-6


class TooLate(BaseException):
    """Raised inside the call, in whatever it is doing. Not an Exception: those are what careless code catches."""


def call_within(seconds: float, call: Callable[[Given], Answer], given: Given) -> Answer:
    """What `call` makes of `given`. Raises TooLate if that takes longer than `seconds` of real time.

    Only in the main thread can it be interrupted; elsewhere, and in native code, it ends when it ends. A timer and a handler of
    SIGALRM that were there before are there again afterwards.
    """
    started = time.perf_counter()
    main = threading.current_thread() is threading.main_thread()
    answer = _interrupted(seconds, call, given) if main else call(given)
    if time.perf_counter() - started > seconds:
        raise TooLate
    return answer


def _interrupted(seconds: float, call: Callable[[Given], Answer], given: Given) -> Answer:
    # In this order no alarm ever comes to the other's handler.
    left, interval = signal.setitimer(signal.ITIMER_REAL, 0.0)
    handler = signal.signal(signal.SIGALRM, _interrupt)
    # One that repeats and rings right now has nothing left.
    left, started = left or interval, time.perf_counter()
    signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
    try:
        return call(given)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL if handler is None else handler)
        if left:
            passed = time.perf_counter() - started
            signal.setitimer(signal.ITIMER_REAL, max(left - passed, AT_ONCE), interval)


def _interrupt(number: int, frame: FrameType | None) -> None:
    # Where the call has just returned there is nothing to interrupt, but a timer to stop.
    if frame is not None and frame.f_code is not _interrupted.__code__:
        raise TooLate


# Faster is a mistake: m/s, or rad/s.
FASTEST = 1000.0
LONGEST_REASON = 300
# As many does NumPy's own generator know.
SEEDS = 2**32
# Of no interest to whoever wrote a controller.
OURS = Path(__file__).parent


class ControllerFailed(Exception):
    """A controller did something wrong. The text is one line: which one, and what happened."""

    def __init__(self, reason: str) -> None:
        line = printable(" ".join(reason.split()))
        super().__init__(line if len(line) <= LONGEST_REASON else f"{line[: LONGEST_REASON - 3]}...")


class Guarded:
    """The controller that `make` gives for `setup`. It is made when it is asked for the first time.

    Modules that it imports only then are looked for in `folder` first, as its own was. Every answer has to come within
    `answer_within` s of real time. What it prints goes to stderr: stdout may be read by a program.
    """

    def __init__(self, make: Callable[[Setup], Any], setup: Setup, folder: Path, answer_within: float) -> None:
        self._name = getattr(make, "__qualname__", type(make).__name__)
        self._make = make
        # A copy: what one run changes in its options must not reach the next.
        self._setup = copy.deepcopy(setup)
        self._folder = folder
        self._seconds = answer_within
        self._controller: Any = None
        self.arrived = False

    def step(self, reading: Reading) -> Twist | WheelSpeeds:
        """The command for the next period. Raises ControllerFailed."""
        if self._controller is None:
            # What it draws without a generator of its own is the same whenever its run is made.
            random.seed(self._setup.seed)
            np.random.seed(self._setup.seed % SEEDS)
            self._controller = self._guarded("__init__", self._make, self._setup)
        return self._guarded("step", self._ask, reading)

    def _ask(self, reading: Reading) -> Twist | WheelSpeeds:
        answer = self._controller.step(reading)
        self.arrived = bool(getattr(self._controller, "arrived", False))
        return _command(answer, self._setup.joints)

    def _guarded(self, what: str, call: Callable[[Any], Any], given: Any) -> Any:
        try:
            with first_on_path(self._folder), redirect_stdout(sys.stderr):
                return call_within(self._seconds, call, given)
        except TooLate:
            problem = f"took longer than {self._seconds:g} s (controller.answer_within)"
        except _WrongAnswer as error:
            problem = str(error)
        # It may also exit, or interrupt itself.
        except BaseException as error:
            problem = f"raised {told(error)}"
        raise ControllerFailed(f"controller {self._name}: {what} {problem}")


@contextmanager
def first_on_path(folder: Path) -> Iterator[None]:
    """Modules of `folder` come first. What else is done to the path stays so."""
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        with suppress(ValueError):
            sys.path.remove(str(folder))


class _WrongAnswer(Exception):
    """What is wrong with a controller's answer."""


def _command(answer: Any, joints: tuple[str, ...]) -> Twist | WheelSpeeds:
    """The answer of a controller with nothing but finite numbers in it. Raises _WrongAnswer."""
    if isinstance(answer, Twist):
        return Twist(_number(answer.speed, "a speed"), _number(answer.turn_rate, "a turn rate"))
    if isinstance(answer, tuple | list) and len(answer) == 2:
        return Twist(_number(answer[0], "a speed"), _number(answer[1], "a turn rate"))
    speeds = answer.speeds if isinstance(answer, WheelSpeeds) else answer
    if not isinstance(speeds, Mapping):
        raise _WrongAnswer(f"gave {_kind(answer)}; expected Twist(speed, turn_rate) or WheelSpeeds(speeds by joint)")
    return WheelSpeeds({_joint(joint, joints): _number(speed, f"'{joint}'") for joint, speed in speeds.items()})


def _joint(joint: Any, joints: tuple[str, ...]) -> str:
    if joint not in joints:
        hint = nearest(str(joint)[:80], joints)
        raise _WrongAnswer(f"gave a speed for '{str(joint)[:80]}'{hint}; wheels are {', '.join(joints)}")
    return joint


def _number(value: Any, what: str) -> float:
    if not isinstance(value, float | int) and not isinstance(value, Real):
        raise _WrongAnswer(f"gave {what} that is {_kind(value)}; expected a number")
    number = float(value)
    if not isfinite(number) or abs(number) > FASTEST:
        raise _WrongAnswer(f"gave {what} of {number:g}; at most {FASTEST:g} can be")
    return number


def _kind(value: Any) -> str:
    return "None" if value is None else f"a value of type {type(value).__name__}"


def told(error: BaseException) -> str:
    """An exception in a line: its type, what it says, and the place in the code that it came from."""
    try:
        text = str(error)
    except Exception:
        text = ""
    place = _place(error.__traceback__)
    return f"{type(error).__name__}{': ' if text else ''}{text}{f' ({place})' if place else ''}"


def _place(traceback: TracebackType | None) -> str:
    """File and line of the innermost call in the folder of the first file that is not ours, empty if there is none."""
    folder, place = None, ""
    while traceback is not None:
        file, line = Path(traceback.tb_frame.f_code.co_filename), traceback.tb_lineno
        traceback = traceback.tb_next
        if file.parent == OURS or str(file).startswith("<"):
            continue
        folder = folder or file.parent
        if file.is_relative_to(folder):
            place = f"{file.name}:{line}"
    return place


__all__ = ["ControllerFailed", "Guarded", "controllers", "load"]

BUILT_IN = {
    "straight": "ddenv.robot.navigation.navigate:Straight",
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
