"""How much memory one worker may use, with all that it starts.

The user's own number holds. Without one, the workers share most of what this process may use: no test may take
the memory of others, or bring the kernel to kill the engine.
"""

from __future__ import annotations

from ddenv import processor
from ddenv.world.scenario import Scenario

# What is left to all others: the engine, the workbench, the system.
SHARE = 0.9
GIGABYTE = 1e9


def memory_limit(scenario: Scenario, jobs: int) -> float:
    """What each of `jobs` workers may use, bytes; infinite where nothing is known of the machine."""
    asked = scenario.simulation.memory_limit
    return asked * GIGABYTE if asked is not None else SHARE * processor.usable_memory() / jobs


def too_large(limit: float) -> str:
    """Why a worker was killed that used more than `limit` bytes."""
    return f"used more than {limit / GIGABYTE:.3g} GB of memory (simulation.memory_limit, or fewer --jobs, allows more)"
