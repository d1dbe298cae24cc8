"""Foretells how many tests a search has left, while its tests run."""

from __future__ import annotations

from collections.abc import Iterator

from ddenv.engine.journal import Journal
from ddenv.reduction.forecast import Moment, interval, playing


def forecasting(journal: Journal, number: int, moment: Moment) -> Iterator[object]:
    """Plays the search from `moment` on, and records how many tests are left; once in round `number`."""
    if journal.has("forecast", number):
        return
    done, tests = journal.state.tests_done, list[float]()
    for play in playing(moment):
        tests += [] if play is None else [play]
        yield play
    if tests:
        journal.record_once("forecast", number, tests=interval(tests), tests_done=done)
