"""What one test may take: real time, and memory.

The user's own numbers hold for all tests. Without a time, the runs of the whole world get a long one, and all later tests a
multiple of what these took: so a slow world or machine is not taken for a hanging one. The baseline's event holds it: a resumed
engine uses the same. Without a size, the workers share most of what this process may use: no test may take the memory of others, or
bring the kernel to kill the engine.
"""

from __future__ import annotations

import math

from ddenv.runfile.state import BROKEN, RunState
from ddenv.runs import processor
from ddenv.settings import SETTINGS, read
from ddenv.world.scenario import Scenario

# What a run of the whole world may take, s.
GENEROUS = 1800.0
# A later test may take so many times what the slowest of them would take for all of its simulated time, and never less than this,
# s: machines are several times slower for a while.
FACTOR = 10.0
LEAST = 120.0
# The part of the memory that is not left to all others: the engine, the workbench, the system.
SHARE = 0.9
GIGABYTE = 1e9


def wall_limit(state: RunState) -> float:
    """What the next test of a run may take, s."""
    asked = read(state.scenario, SETTINGS["wall_timeout"])
    if isinstance(asked, int | float):
        return float(asked)
    measured = state.baseline.wall_limit if state.baseline is not None else None
    return GENEROUS if measured is None else measured


def limit_after(state: RunState, timeout: float) -> float:
    """What a test of `timeout` simulated s may take after the baseline, s."""
    sound = (test for test in state.tests if test.phase == "baseline" and test.outcome not in BROKEN)
    slowest = max((test.wall_seconds / test.simulated_seconds for test in sound if test.simulated_seconds), default=0.0)
    return max(LEAST, math.ceil(FACTOR * slowest * timeout))


def memory_limit(scenario: Scenario, jobs: int) -> float:
    """What each of `jobs` workers may use with all that it starts, bytes; infinite where nothing is known of the machine."""
    asked = scenario.simulation.memory_limit
    return asked * GIGABYTE if asked is not None else SHARE * processor.usable_memory() / jobs


def too_large(limit: float) -> str:
    """Why a worker was killed that used more than `limit` bytes."""
    return f"used more than {limit / GIGABYTE:.3g} GB of memory (simulation.memory_limit, or fewer --jobs, allows more)"
