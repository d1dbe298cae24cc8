"""Isolation: the fewest models that have to go from the whole world so that the robot reaches its goal.

A reduction makes a failing world smaller. Isolation makes a passing world larger, until putting any one model back makes the robot
fail: that is the nearest world that passes.

Zeller and Hildebrandt, "Simplifying and Isolating Failure-Inducing Input", 2002, where `dd` moves both ends. Here the failing one
stays the whole world, as in "Debugging Inputs" (Kirschner, Soremekun and Zeller, 2020): else what comes out would be the
difference of two worlds that nobody has seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ddenv.rates import leans_to
from ddenv.reduction.acceptance import Verdict, estimated_rate
from ddenv.reduction.algorithms import by_chunks
from ddenv.reduction.certificate import Procedure, Subject
from ddenv.reduction.evidence import Partition
from ddenv.reduction.guide import Search
from ddenv.reduction.round import Candidate, Round

# A world passes if the robot reaches its goal in so many of its runs, and fails in at most this part of those of the whole world.
MOSTLY, FAILURES_LEFT = 0.9, 0.2
# The chance that the search takes a world that does not pass, or misses one that does: fresh runs judge the end.
SEARCH_ERROR = 0.05
# After this many runs the likelier side counts; fresh runs that do not decide leave it open.
MOST_RUNS = 60


@dataclass(frozen=True)
class Passing:
    """The rule by which a world passes: the robot reaches its goal at the rate `wanted`, rather than at `rather_than`.

    One run decides nothing: Wald's sequential test does, with this chance of `error` at either rate.
    """

    wanted: float
    rather_than: float
    error: float = SEARCH_ERROR

    @classmethod
    def of(cls, reached: int, runs: int) -> Passing:
        """The rule where the robot reached its goal in `reached` of `runs` of the whole world."""
        rate = estimated_rate(reached, runs)
        wanted = max(MOSTLY, 1.0 - FAILURES_LEFT * (1.0 - rate))
        return cls(wanted, max(rate, wanted / 2.0))

    def verdict(self, shown: int, missed: int) -> Verdict:
        """Of a world in which `shown` runs reached the goal and `missed` did not: "similar" if it passes; "" while it is open."""
        found = leans_to(shown, missed, self.wanted, self.rather_than, self.error)
        if found is None and shown + missed >= MOST_RUNS:
            found = shown / (shown + missed) > math.sqrt(self.wanted * self.rather_than)
        return "" if found is None else ("similar" if found else "dissimilar")


def isolating(suspects: Partition, first: int) -> Search:
    """What has to go from the whole world; empty if the robot does not pass even without all `suspects`.

    Candidates are models to remove, the opposite of a reduction's, and "similar" is a world that passes without them. First go the
    `first` of the suspects, then twice as many, until the robot passes; of those ddmin puts back as many as it can. Where it ends,
    each model that is put back alone has been tried: the removal is 1-minimal.
    """
    size = max(1, first)
    while suspects:
        group = suspects[:size]
        winner = yield Round(1, suspects, (group,), (0.0,), (Candidate("partition", 0, group, suspects),))
        if winner is not None:
            return (yield from by_chunks(group))
        if size >= len(suspects):
            break
        size *= 2
    return frozenset()


def passes(world: Subject, rule: Passing, at_least: int) -> Procedure:
    """Whether fresh runs show that `world` passes, from at least so many: "passes", "fails" or "not shown".

    "passes" is wrong with a probability of at most about the error of the rule: then the goal is not reached more often than at
    `rather_than`.
    """
    reached = runs = 0
    found: bool | None = None
    while found is None and runs < MOST_RUNS:
        (shown,) = yield (world,)
        reached, runs = reached + shown, runs + 1
        found = leans_to(reached, runs - reached, rule.wanted, rule.rather_than, rule.error)
    for _ in range(at_least - runs if found else 0):
        yield (world,)
    return "not shown" if found is None else ("passes" if found else "fails")
