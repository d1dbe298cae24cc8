"""Calls of what may never return: they are interrupted when their time is up."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import TypeVar

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
