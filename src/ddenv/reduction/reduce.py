"""The reduction as a function: for whoever has a test of his own, and neither Drake nor a robot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ddenv.errors import UserError
from ddenv.reduction.arguments import (
    checked_choice,
    checked_count,
    checked_failure,
    checked_names,
    checked_number,
    checked_positions,
    checked_times,
    checked_traits,
    checked_trajectory,
)
from ddenv.reduction.evidence import Evidence, Place, Traits, Trial
from ddenv.reduction.guide import Search, make_guide, search
from ddenv.reduction.round import CANDIDATES, COMPLEMENT_ORDERS, Candidate, Round

Test = Callable[[frozenset[str]], bool]


@dataclass(frozen=True)
class Step:
    """The environment `kept`, in the order of the elements, after so many `tests`."""

    tests: int
    kept: tuple[str, ...]


@dataclass(frozen=True)
class Reduction:
    """What `reduce` found: `kept`, in the order of the elements, after `tests` calls of the test in `rounds` rounds.

    `history` begins with all elements; each further step is a reduction.
    """

    kept: tuple[str, ...]
    tests: int
    rounds: int
    history: tuple[Step, ...]


def reduce(
    elements: Iterable[str],
    test: Test,
    *,
    algorithm: str = "ddenv",
    partitioning: str = "model2model",
    prioritization: str = "failure-proximal",
    positions: Mapping[str, Place] | None = None,
    trajectory: np.ndarray | None = None,
    failure_pose: Iterable[float] | None = None,
    first_sensed: Mapping[str, float] | None = None,
    touched: Iterable[str] | None = None,
    traits: Mapping[str, Traits] | None = None,
    iterations: int = 0,
    n_partitions: int = 2,
    candidates: str = "both",
    complement_order: str = "paper",
    growth: str = "steady",
    skip: str = "implied",
    prior: str = "spatial",
    delta: float = 0.5,
    seed: int = 0,
    check: bool = True,
    on_round: Callable[[Round], None] | None = None,
) -> Reduction:
    """Finds a few of `elements` with which `test` still says that the failure shows, none of which can be left out alone.

        ddenv.reduce("abcdef", lambda kept: kept >= {"a", "e"}, algorithm="ddmin").kept  # ("a", "e")

    `test(frozenset of names)` runs the robot, or whatever it is, with these elements alone, and says whether it failed as before.
    A test that says no is asked again up to `iterations` times: for failures that do not show every time.

    `positions` maps each name to x, y, z m. `trajectory` is an array (N, 5) of time s, x, y, z m, yaw rad of the run that failed.
    `failure_pose` is where it failed, x, y, z m first; if it is not given, the trajectory's end. `first_sensed` maps a name to the
    time (s) when the robot first sensed it; names that are missing were never sensed. `touched` are the names that it touched,
    `traits` maps each name to its `ddenv.Traits`. What a schema does not look at need not be given. `n_partitions`, `candidates`,
    `complement_order`, `growth`, `skip`, `prior` and `delta` (rad/s) are as in a scenario's `reduction`.

    With `check`, all elements are tested first: without the failure there is nothing to reduce. `on_round` is told of each round
    before it is tested. Raises UserError, in one line, for what makes no sense, and lets through what `test` raises.
    """
    names = checked_names(elements)
    known = Evidence(
        names,
        checked_positions(names, positions),
        path := checked_trajectory(trajectory),
        checked_failure(failure_pose, path),
        checked_times(first_sensed),
        None if touched is None else frozenset(touched),
        checked_traits(names, traits),
        delta=checked_number("delta", delta),
        seed=checked_count("seed", seed, 0),
    )
    checked_count("iterations", iterations, 0)
    checked_count("n_partitions", n_partitions, 2)
    checked_choice("candidates", candidates, CANDIDATES)
    checked_choice("complement_order", complement_order, COMPLEMENT_ORDERS)
    checked_choice("growth", growth, ("paper", "steady"))
    checked_choice("skip", skip, ("known", "implied"))
    checked_choice("prior", prior, ("spatial", "uniform"))
    bench = _Bench(test, iterations)
    guide = make_guide(
        partitioning,
        prioritization,
        lambda: replace(known, trials=bench.trials),
        prior=prior,
        n_partitions=n_partitions,
        candidates=candidates,
        complement_order=complement_order,
        growth=growth,
        skip=skip,
    )
    running = search(algorithm, names, guide)
    history, rounds = [Step(0, names)], 0
    # Planned before the first test: what is lacking is told before anything is run.
    round, left = _next(running, None)
    if check and not bench.is_similar(frozenset(names)):
        raise UserError("the failure does not show with all elements: there is nothing to reduce")
    while round is not None:
        rounds += 1
        if on_round is not None:
            on_round(round)
        winner = bench.first_similar(round)
        if winner is not None:
            kept = winner.models
            history.append(Step(len(bench.trials), tuple(name for name in names if name in kept)))
        round, left = _next(running, winner)
    kept = tuple(name for name in names if name in left)
    return Reduction(kept, len(bench.trials), rounds, tuple(history))


def _next(running: Search, winner: Candidate | None) -> tuple[Round | None, frozenset[str]]:
    """The next round, or None and what is left."""
    try:
        return running.send(winner), frozenset()
    except StopIteration as end:
        return None, end.value


class _Bench:
    """Makes tests one after another, and no candidate twice."""

    def __init__(self, test: Test, iterations: int) -> None:
        self._test = test
        self._iterations = iterations
        self._known: dict[frozenset[str], bool] = {}
        self.trials: list[Trial] = []

    def first_similar(self, round: Round) -> Candidate | None:
        for one in round.candidates:
            if self.is_similar(one.models):
                return one
        return None

    def is_similar(self, models: frozenset[str]) -> bool:
        if models not in self._known:
            self._known[models] = self._deflaked(models)
        return self._known[models]

    def _deflaked(self, models: frozenset[str]) -> bool:
        # No generator: it would turn what the test raises into something else.
        for _ in range(1 + self._iterations):  # noqa: SIM110
            if self._run(models):
                return True
        return False

    def _run(self, models: frozenset[str]) -> bool:
        similar = bool(self._test(models))
        self.trials.append(Trial(models, similar))
        return similar
