"""What the tests showed: f, fixed from runs of the whole world; each result judged by it, as plain
data in which every number is finite; and what the schemas see of them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ddenv.engine.journal import Journal
from ddenv.engine.worker import Broken, Result
from ddenv.errors import UserError
from ddenv.evidence.rates import anytime_interval, iterations_needed, miss_chance, wilson_interval
from ddenv.reduction.evidence import Evidence, Traits
from ddenv.robot.oracle import Failure, Judgement, judge, judge_trajectory
from ddenv.runfile.events import BaselineFinished, Outcomes, SeenFailure
from ddenv.runfile.failures import grouped
from ddenv.runfile.state import RunState, Test
from ddenv.runfile.store import ROBOT, Motions, RunFile
from ddenv.runs.playback import table
from ddenv.text import Data, count, percent_at_most
from ddenv.world.extent import center, model_bounds
from ddenv.world.model import Model, World
from ddenv.world.pose import Vector, headings
from ddenv.world.scenario import FailureSpec, Reduction

# Where no run failed, so many times as many are proposed.
FURTHER = 3


def result_data(result: Result, failures: Sequence[Failure] = ()) -> Data:
    """A result as the fields of `TestFinished`, with models by name, judged by f and the failures
    accepted as f; the nearest one counts.

    Without f, a run that failed is "failed"; with it, "similar" or "other". What a run lacks is
    None.
    """
    if isinstance(result, Broken):
        return {
            "outcome": result.outcome,
            "failure": result.failure,
            "distance": None,
            "end_pose": None,
            "simulated_seconds": 0.0,
            "wall_seconds": 0.0,
            "first_sensed": {},
            "first_touched": {},
            "cut": False,
        }
    outcome = result.outcome
    distance = None
    if failures:
        judgement = nearest([judge(result, failure) for failure in failures])
        outcome = judgement.outcome
        distance = judgement.distance
    pose = tuple(float(value) for value in result.end_pose)
    more: Data = {"taken": result.taken} if result.taken else {}
    if result.took_part is not None:
        more["took_part"] = sorted(result.took_part)
    return {
        "outcome": outcome,
        "failure": result.failure,
        "distance": None if distance is None or not math.isfinite(distance) else distance,
        "end_pose": pose if all(map(math.isfinite, pose)) else None,
        "simulated_seconds": result.simulated_seconds,
        "wall_seconds": result.wall_seconds,
        "first_sensed": {name: round(seconds, 3) for name, seconds in result.first_sensed.items()},
        "first_touched": {
            name: round(seconds, 3) for name, seconds in result.first_touched.items()
        },
        "cut": result.cut,
        **more,
    }


def motions_of(result: Result) -> Motions:
    """How the robot and other models moved, as a run file has it."""
    if isinstance(result, Broken):
        return {}
    rows = {ROBOT: result.trajectory, **result.motions}
    return {name: np.ascontiguousarray(each, dtype="<f8").tobytes() for name, each in rows.items()}


def nearest(judgements: Sequence[Judgement]) -> Judgement:
    """The judgement that counts: a similar one, else the nearest."""
    return min(judgements, key=lambda each: (each.outcome != "similar", each.distance))


def known_failure(state: RunState) -> BaselineFinished:
    """The baseline, which fixed f. Raises UserError before it is done."""
    if state.baseline is None:
        raise UserError("damaged run file: f is not known before the baseline is done")
    return state.baseline


def end_of(test: Test) -> Vector:
    """Where the robot was at the end, x, y, z m. Raises UserError for a test without an end."""
    if test.end_pose is None:
        raise UserError(f"damaged run file: test {test.id} has no end pose")
    x, y, z = test.end_pose[:3]
    return x, y, z


def asked_of(state: RunState) -> Reduction:
    """How the run reduces now: the user may have changed it."""
    return Reduction.model_validate(state.scenario["reduction"])


def spec_of(state: RunState) -> FailureSpec:
    """What counts as the same failure now: the user may have changed it."""
    return FailureSpec.model_validate(state.scenario["failure"])


def failures_of(file: RunFile, state: RunState) -> tuple[Failure, ...]:
    """f first; none before it is fixed. Raises UserError for a damaged run file."""
    return tuple(failure_of(file, state, test) for test in state.failures)


def failure_of(file: RunFile, state: RunState, test: int) -> Failure:
    """The failure that a test showed. Raises UserError for a damaged run file."""
    f = known_failure(state)
    spec = spec_of(state)
    end = f.position if test == f.failure_test else end_of(state.test(test))
    return Failure(end, rows_of(file, test), spec.epsilon, spec.similarity)


def rejudged(file: RunFile, state: RunState, failures: tuple[Failure, ...]) -> Outcomes:
    """The outcomes of all failed tests so far, judged by `failures`."""
    judged = {}
    for test in (test.id for test in state.tests if test.outcome in ("similar", "other")):
        judged[test] = nearest(
            [judge_trajectory(rows_of(file, test), failure) for failure in failures]
        )
    return _outcomes(judged)


def rows_of(file: RunFile, test: int) -> np.ndarray:
    """The robot's trajectory in a test, shape (N, COLUMNS). Raises UserError if it is missing."""
    return table(file.trajectory(test))


def fixed_again(file: RunFile, state: RunState) -> BaselineFinished:
    """The baseline by what counts as the same failure now, which judges all tests. Raises UserError
    if it shows none.
    """
    before = known_failure(state)
    reduction = asked_of(state)
    tests = {
        test.run: test for test in state.tests if test.phase == "baseline" and test.is_finished
    }
    failed = ("failed", "similar", "other")
    unjudged = [
        replace(one, outcome="failed") if one.outcome in failed else one
        for _, one in sorted(tests.items())
    ]
    trajectories = {
        test.id: rows_of(file, test.id) for test in unjudged if test.outcome == "failed"
    }
    spec = spec_of(state)
    found = fix_failure(
        unjudged,
        trajectories,
        spec=spec,
        iterations=reduction.iterations,
        wanted=reduction.failure,
        chose=before.chose,
        usual=reduction.baseline_runs,
    )
    if isinstance(found, str):
        raise UserError(found)
    f = Failure(found.position, trajectories[found.failure_test], spec.epsilon, spec.similarity)
    alike = before.alike and found.failures == found.runs
    return replace(
        found, judged=rejudged(file, state, (f,)), wall_limit=before.wall_limit, alike=alike
    )


def fix_failure(
    tests: Sequence[Test],
    trajectories: Mapping[int, np.ndarray],
    spec: FailureSpec,
    iterations: int,
    wanted: int = 1,
    chose: int = 0,
    usual: int = 0,
) -> BaselineFinished | str:
    """The event that ends the baseline, or a line that says why there is no f. `tests` are in the
    order of runs, `trajectories` those of the failing ones, by id.

    f is the failure number `wanted`, by how many runs show each; its end is that of the run which
    shares its failure with most others. The rate counts f only; runs that broke are not in it. With
    `chose` so many first runs choose f, and only the others give its rate; where f shows in none of
    these, all do. If there are more than the `usual` number of tests, what they showed decided
    that, so the interval of the rate is one for that.
    """
    failed = [test for test in tests if test.outcome == "failed" and test.end_pose is not None]
    failing = [test for test in failed if not chose or test.run < chose]
    if not failing:
        return _no_failure(tests)
    failures = [
        Failure(end_of(test), trajectories[test.id], spec.epsilon, spec.similarity)
        for test in failing
    ]

    def apart(first: int, second: int) -> float | None:
        if judge_trajectory(failures[second].trajectory, failures[first]).outcome != "similar":
            return None
        return float(
            np.linalg.norm(np.subtract(failures[first].position, failures[second].position))
        )

    # By the oracle alone, not by kind: what it judges as one failure cannot be reduced as two.
    groups = grouped(len(failing), apart)
    seen = []
    for group in ([failing[one] for one in group] for group in groups):
        kinds = Counter(test.failure for test in group)
        names = tuple(kind for kind, _ in kinds.most_common())
        # The first one is in their middle.
        seen.append(SeenFailure(group[0].id, len(group), names, end_of(group[0])))
    if wanted > len(seen):
        listed = "; ".join(
            f"{number}. {one.name} in {count(one.runs, 'run')}"
            for number, one in enumerate(seen, 1)
        )
        runs = sum(not test.broke for test in tests)
        return (
            f"there is no failure number {wanted}; {runs} runs of the whole world showed these: "
            f"{listed}"
        )
    f = groups[wanted - 1][0]
    judged = {test.id: judge_trajectory(trajectories[test.id], failures[f]) for test in failed}
    shown = {id for id, judgement in judged.items() if judgement.outcome == "similar"}
    if not any(test.id in shown for test in tests if test.run >= chose):
        chose = 0
    sound = [test for test in tests if not test.broke and test.run >= chose]
    similar = sum(test.id in shown for test in sound)
    rate = similar / len(sound)
    broken = sum(test.broke and test.run >= chose for test in tests)
    interval = anytime_interval if len(tests) > usual else wilson_interval
    low, high = interval(similar, len(sound))
    return BaselineFinished(
        runs=len(sound),
        failures=similar,
        rate=rate,
        low=low,
        high=high,
        failure_test=failing[f].id,
        position=failures[f].position,
        miss_chance=miss_chance(rate, iterations),
        iterations_95=iterations_needed(rate),
        judged=_outcomes(judged),
        broken=broken,
        seen=tuple(seen),
        chose=chose,
    )


def _outcomes(judged: Mapping[int, Judgement]) -> Outcomes:
    outcomes = {test: judgement.outcome for test, judgement in judged.items()}
    return Outcomes(outcomes, {test: judgement.distance for test, judgement in judged.items()})


def _no_failure(tests: Sequence[Test]) -> str:
    broken = [test for test in tests if test.broke]
    if len(broken) == len(tests):
        return f"no baseline run finished: {broken[0].failure}"
    reached = len(tests) - len(broken)
    also = f" ({len(broken)} more broke: {broken[0].failure})" if broken else ""
    # One that shows more often than this would have shown with a chance of 95 %.
    below = percent_at_most(1.0 - 0.05 ** (1.0 / reached))
    return (
        f"the robot reached its goal in all {reached} baseline runs{also}: there is no failure to "
        f"reduce; if there is one, it shows in less than {below} of all runs (95 %): "
        f"--baseline-runs {FURTHER * reached} looks further"
    )


def trajectory_of(rows: np.ndarray) -> np.ndarray:
    """Rows of t (s), x, y, z (m), qw, qx, qy, qz as rows of t, x, y, z, yaw (rad): shape (N, 8) to
    (N, 5).
    """
    return np.column_stack([rows[:, :4], headings(rows[:, 4:])])


def traits_of(model: Model) -> Traits:
    """What the learner knows about a model. The most slippery of its surfaces counts."""
    box = model_bounds(model)
    size = 0.0 if box is None else float((box[1] - box[0]).max())
    friction = min((collision.mu for collision in model.collisions), default=1.0)
    return Traits(size, friction, not model.static)


class SchemaInputs:
    """The part of the evidence that comes from the world and never changes in a run."""

    def __init__(self, world: World, elements: Sequence[str], delta: float, seed: int) -> None:
        models = {model.name: model for model in world.models}
        positions = {name: center(models[name]) for name in elements}
        traits = {name: traits_of(models[name]) for name in elements}
        self._known = Evidence(
            elements=tuple(elements), positions=positions, traits=traits, delta=delta, seed=seed
        )

    def evidence(self, journal: Journal, test: int) -> Evidence:
        """The evidence if `test` was the last similar run."""
        state = journal.state
        run = state.test(test)
        # If several failures count as f, the one that the run showed.
        ends = [end_of(state.test(test)) for test in state.failures]
        if run.end_pose is None:
            end = ends[0]
        else:
            end = min(ends, key=lambda end: math.dist(end, end_of(run)))
        # Whether a model that affected no run was sensed depends on which of two equal runs was
        # simulated.
        if run.took_part is None:
            seen = set(state.elements)
        else:
            seen = set(run.took_part.names(state.elements))
        return replace(
            self._known,
            trajectory=trajectory_of(rows_of(journal.file, test)),
            failure_position=end,
            first_sensed={name: at for name, at in run.first_sensed if name in seen},
            touched=frozenset(name for name, _ in run.first_touched),
            miss_chance=known_failure(state).miss_chance,
            _nearest={},
        )
