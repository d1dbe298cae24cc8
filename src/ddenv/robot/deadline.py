"""Calls of code that is not ours, with a time limit."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import TypeVar

Given = TypeVar("Given")
Answer = TypeVar("Answer")

# Code that catches the interruption and goes on is interrupted again after this time, s.
AGAIN = 0.1
# The rest of an earlier timer that is already due, s.
AT_ONCE = 1e-6


class TooLate(BaseException):
    """Raised inside a call that takes too long. Not an Exception: careless code catches those."""


def call_within(seconds: float, call: Callable[[Given], Answer], given: Given) -> Answer:
    """Returns `call(given)`. Raises TooLate if that takes longer than `seconds` of real time.

    The call is interrupted only in the main thread; in other threads, and in native code, it ends when it ends. A timer and a
    handler of SIGALRM that were set before are restored.
    """
    started = time.perf_counter()
    main = threading.current_thread() is threading.main_thread()
    answer = _interrupted(seconds, call, given) if main else call(given)
    if time.perf_counter() - started > seconds:
        raise TooLate
    return answer


def _interrupted(seconds: float, call: Callable[[Given], Answer], given: Given) -> Answer:
    # In this order neither alarm ever reaches the other's handler.
    left, interval = signal.setitimer(signal.ITIMER_REAL, 0.0)
    handler = signal.signal(signal.SIGALRM, _interrupt)
    # A repeating timer that rings right now has nothing left.
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
    # If the call has just returned, only its timer is still to be stopped.
    if frame is not None and frame.f_code is not _interrupted.__code__:
        raise TooLate
