"""Notices engines that die at the same place again and again: whoever starts them by a script need not do so all night."""

from __future__ import annotations

from ddenv.engine.journal import Journal
from ddenv.errors import UserError
from ddenv.runfile.events import (
    AcceptModeChanged,
    Comparing,
    EngineStarted,
    EnvironmentNamed,
    LegStarted,
    SupportsStarted,
    TestLost,
    TestStarted,
)
from ddenv.runs.programs import log_of

# So many engines may die in a row, each before it has got anywhere.
MOST_DEATHS = 3
# What an engine writes again and again without getting anywhere.
NOWHERE = (AcceptModeChanged, Comparing, SupportsStarted, LegStarted, EnvironmentNamed, TestStarted, TestLost)
# The last events that are looked at.
LAST = 3000


def check_crash_loop(journal: Journal) -> None:
    """Raises UserError if the last engines all died before they got anywhere."""
    path, last = journal.file.path, journal.state.revision
    deaths, place = 0, 0
    for event in journal.file.events(max(0, last - LAST)):
        if isinstance(event.event, EngineStarted):
            deaths += 1
        elif not isinstance(event.event, NOWHERE):
            deaths, place = 0, event.id
    if deaths >= MOST_DEATHS:
        raise UserError(
            f"{path}: the last {deaths} engines died after event {place}, before a test ended; {log_of(path)} may say why; "
            f"'ddenv resume {path} --anyway' tries once more, perhaps with fewer --jobs"
        )
