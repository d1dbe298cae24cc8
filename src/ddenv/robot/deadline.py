"""Time limits: real time without the time in which the machine slept or we were stopped; calls of
code that is not ours.
"""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import TypeVar

Given = TypeVar("Given")
Answer = TypeVar("Answer")

# The maximum time between two alarms during a call, s: code that catches the interruption and goes
# on is interrupted again.
ALARM = 0.1
# The minimum number of alarms before a call is too late. A process that is stopped gets one alarm
# for all that it missed.
FEWEST = 10


class Stopwatch:
    """Real time in which this process and the machine were at work, s.

    It has to be looked at often. Of the time between two looks at most `longest` s count: it is
    longer where the process was stopped; while the machine sleeps the clock itself stands still. It
    starts at `since`, s of `time.monotonic`.
    """

    def __init__(self, longest: float, since: float | None = None) -> None:
        self.since = time.monotonic() if since is None else since
        self._longest = longest
        self._last = self.since
        self._seconds = 0.0

    def look(self) -> float:
        """The time so far, s."""
        now = time.monotonic()
        self._seconds += min(now - self._last, self._longest)
        self._last = now
        return self._seconds


class TooLate(BaseException):
    """Raised inside a call that takes too long. Not an Exception: careless code catches those."""


def call_within(seconds: float, call: Callable[[Given], Answer], given: Given) -> Answer:
    """Returns `call(given)`. Raises TooLate if that takes longer than `seconds` of real time.

    The call is interrupted only in the main thread, where time in which the process is stopped does
    not count; in other threads, and in native code, it ends when it ends. It uses SIGALRM: a timer
    of the code's own ends with the call.
    """
    if threading.current_thread() is threading.main_thread():
        return _interrupted(seconds, call, given)
    started = time.perf_counter()
    answer = call(given)
    if time.perf_counter() - started > seconds:
        raise TooLate
    return answer


def _interrupted(seconds: float, call: Callable[[Given], Answer], given: Given) -> Answer:
    alarms = 0
    most = max(FEWEST, math.ceil(seconds / ALARM))

    def count(number: int, frame: FrameType | None) -> None:
        nonlocal alarms
        alarms += 1
        # If the call has just returned, only its timer is still to be stopped.
        if alarms >= most and frame is not None and frame.f_code is not _interrupted.__code__:
            raise TooLate

    signal.signal(signal.SIGALRM, count)
    computed = time.thread_time()
    signal.setitimer(signal.ITIMER_REAL, seconds / most, seconds / most)
    try:
        answer = call(given)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
    # Alarms that ring during native code come as one, when it ends.
    if alarms >= most or time.thread_time() - computed > seconds:
        raise TooLate
    return answer
