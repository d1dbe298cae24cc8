"""What one test may take, real time and memory, and how often engines may die at once.

The user's own numbers hold for all tests. Without a time, the runs of the whole world get a long
one, and later tests a multiple of what these took; the baseline's event holds it. Without a size,
the workers share most of what this process may use.
"""

from __future__ import annotations

import math

from ddenv.engine.journal import Journal
from ddenv.errors import UserError
from ddenv.runfile import events
from ddenv.runfile.state import RunState
from ddenv.runs import processor
from ddenv.runs.programs import log_of
from ddenv.settings import SETTINGS, read
from ddenv.text import count
from ddenv.world.scenario import Scenario

# What a run of the whole world may take, s.
GENEROUS = 1800.0
# A later test may take so many times what the slowest of them would take for all of its simulated
# time, and never less than this, s: machines are several times slower for a while.
FACTOR = 10.0
LEAST = 120.0
# The part of the memory that is not left to all others: the engine, the workbench, the system.
SHARE = 0.9
GIGABYTE = 1e9
# So many runs of the whole world may be too late before one has ended.
MOST_LATE = 3
# So many engines may die in a row, each before it has got anywhere: before it wrote anything but
# these, among the last events.
MOST_DEATHS = 3
LAST = 3000
NOWHERE = {
    "accept_mode_changed",
    "comparing",
    "supports_started",
    "leg_started",
    "environment_named",
}
NOWHERE |= {"test_started", "test_lost"}
HELPS = (
    "try fewer models that can move, a shorter --timeout, another simulation.time_step in the "
    "scenario"
)


def wall_limit(state: RunState) -> float:
    """What the next test of a run may take, s."""
    asked = read(state.scenario, SETTINGS["wall_timeout"])
    if isinstance(asked, int | float):
        return float(asked)
    measured = state.baseline.wall_limit if state.baseline is not None else None
    if measured is None:
        return GENEROUS
    return measured


def limit_after(state: RunState, timeout: float) -> float:
    """What a test of `timeout` simulated s may take after the baseline, s."""
    sound = (test for test in state.tests if test.phase == "baseline" and not test.broke)
    slowest = max(
        (test.wall_seconds / test.simulated_seconds for test in sound if test.simulated_seconds),
        default=0.0,
    )
    return max(LEAST, math.ceil(FACTOR * slowest * timeout))


def memory_limit(scenario: Scenario, jobs: int) -> float:
    """What each of `jobs` workers may use with all that it starts, bytes; infinite where nothing is
    known of the machine.
    """
    asked = scenario.simulation.memory_limit
    if asked is not None:
        return asked * GIGABYTE
    return SHARE * processor.usable_memory() / jobs


def check_crash_loop(journal: Journal) -> None:
    """Raises UserError if the last engines all died before they got anywhere."""
    path = journal.file.path
    last = journal.state.revision
    deaths = 0
    place = 0
    for event in journal.file.events(max(0, last - LAST)):
        if isinstance(event.event, events.EngineStarted):
            deaths += 1
        elif event.kind not in NOWHERE:
            deaths = 0
            place = event.id
    if deaths >= MOST_DEATHS:
        raise UserError(
            f"{path}: the last {deaths} engines died after event {place}, before a test ended; "
            f"{log_of(path)} may say why; "
            f"'ddenv resume {path} --anyway' tries once more, perhaps with fewer --jobs"
        )


def give_up_if_late(journal: Journal, late: str) -> None:
    """After a test that was too `late`, in words. Raises UserError if several runs of the whole
    world were, and none has ended.
    """
    state = journal.state
    if state.baseline is None and state.tests_done == state.tally["timeout"] >= MOST_LATE:
        late = f"{count(state.tally['timeout'], 'run')} of the whole world {late}"
        raise UserError(f"{late}, and none has ended; {HELPS}")
