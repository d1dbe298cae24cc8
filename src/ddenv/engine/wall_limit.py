"""How long one test may take in real time.

The user's own number holds for all tests. Without one, the runs of the whole world get a long time, and all later tests a
multiple of what these took: so a slow world or machine is not taken for a hanging one. The baseline's event holds the limit: a
resumed engine uses the same.
"""

from __future__ import annotations

import math

from ddenv.runfile.state import BROKEN, RunState
from ddenv.settings import SETTINGS, read

# What a run of the whole world may take, s.
GENEROUS = 1800.0
# A later test may take so many times what the slowest of them would take for all of its simulated time, and never less than this,
# s: machines are several times slower for a while.
FACTOR = 10.0
LEAST = 120.0


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
