"""Fixes the failure f from runs of the whole world, and computes how likely it is to show again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from ddenv.amounts import count
from ddenv.engine.judging import end_of
from ddenv.evidence.rates import iterations_needed, miss_chance, wilson_interval
from ddenv.robot.oracle import Failure, judge_trajectory
from ddenv.runfile.events import BaselineFinished, Outcomes, Seen
from ddenv.runfile.failures import SeenFailure, grouped
from ddenv.runfile.state import BROKEN, Test
from ddenv.world.scenario import FailureSpec


def fix_failure(
    tests: Sequence[Test],
    trajectories: Mapping[int, np.ndarray],
    spec: FailureSpec,
    iterations: int,
    wanted: int = 1,
) -> BaselineFinished | str:
    """The event that ends the baseline. `tests` are in the order of runs, `trajectories` those of the failing ones, by id.

    f is the failure number `wanted`, by how many runs show each; its end is that of the run which shares its failure with most
    others. If no run failed, or if there is no such number, returns a line that tells the user so. The rate counts f only, not
    other failures; runs that broke say nothing, and are not in it.
    """
    sound = [test for test in tests if test.outcome not in BROKEN]
    failing = [test for test in sound if test.outcome == "failed" and test.end_pose is not None]
    if not failing:
        return _no_failure(tests)
    failures = [Failure(end_of(test), trajectories[test.id], spec.epsilon, spec.similarity) for test in failing]

    def apart(first: int, second: int) -> float | None:
        if judge_trajectory(failures[second].trajectory, failures[first]).outcome != "similar":
            return None
        return float(np.linalg.norm(np.subtract(failures[first].position, failures[second].position)))

    # By the oracle alone, not by kind: what it judges as one failure cannot be reduced as two.
    groups = grouped(len(failing), apart)
    seen = [_seen([failing[one] for one in group]) for group in groups]
    if wanted > len(seen):
        return _no_such_failure(seen, wanted, len(sound))
    f = groups[wanted - 1][0]
    judged = {test.id: judge_trajectory(trajectories[test.id], failures[f]) for test in failing}
    similar = sum(judgement.outcome == "similar" for judgement in judged.values())
    rate = similar / len(sound)
    low, high = wilson_interval(similar, len(sound))
    return BaselineFinished(
        runs=len(sound),
        broken=len(tests) - len(sound),
        failures=similar,
        rate=rate,
        low=low,
        high=high,
        failure_test=failing[f].id,
        position=failures[f].position,
        miss_chance=miss_chance(rate, iterations),
        iterations_95=iterations_needed(rate),
        seen=tuple(Seen(failure.test, failure.runs, failure.kinds, failure.position) for failure in seen),
        judged=Outcomes(
            {id: judgement.outcome for id, judgement in judged.items()},
            {id: judgement.distance for id, judgement in judged.items()},
        ),
    )


def _seen(group: Sequence[Test]) -> SeenFailure:
    """A group of failing tests, the one in their middle first."""
    kinds = Counter(test.failure for test in group)
    return SeenFailure(group[0].id, len(group), tuple(kind for kind, _ in kinds.most_common()), end_of(group[0]))


def _no_such_failure(seen: Sequence[SeenFailure], wanted: int, runs: int) -> str:
    listed = "; ".join(f"{number}. {one.name} in {count(one.runs, 'run')}" for number, one in enumerate(seen, 1))
    return f"there is no failure number {wanted}; {runs} runs of the whole world showed these: {listed}"


def _no_failure(tests: Sequence[Test]) -> str:
    broken = [test for test in tests if test.outcome in BROKEN]
    if len(broken) == len(tests):
        return f"no baseline run came to its end: {broken[0].failure}"
    reached = len(tests) - len(broken)
    also = f" ({len(broken)} more broke: {broken[0].failure})" if broken else ""
    return f"the robot reached its goal in all {reached} baseline runs{also}: there is no failure to reduce"
