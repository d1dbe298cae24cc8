"""Someone's own controller at work: whatever it does wrong ends the run, with the reason, and nothing else."""

from __future__ import annotations

import copy
import random
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from math import isfinite
from numbers import Real
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ddenv.errors import printable
from ddenv.robot.deadline import TooLate, call_within
from ddenv.robot.protocol import Reading, Setup, Twist, WheelSpeeds
from ddenv.schemas import nearest

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
