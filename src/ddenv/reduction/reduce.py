"""The reduction as a function: for whoever has a test of his own, and neither Drake nor a robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ddenv.errors import UserError
from ddenv.reduction.evidence import Evidence, Place, Trial
from ddenv.reduction.guide import make_guide, search
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
    time (s) when the robot first sensed it; names that are missing were never sensed. What a schema does not look at need not be
    given. `n_partitions`, `candidates`, `complement_order`, `prior` and `delta` (rad/s) are as in a scenario's `reduction`.

    With `check`, all elements are tested first: without the failure there is nothing to reduce. `on_round` is told of each round
    before it is tested. Raises UserError, in one line, for what makes no sense, and lets through what `test` raises.
    """
    names = tuple(elements)
    known = _evidence(names, positions, trajectory, failure_pose, first_sensed, delta, seed)
    if iterations < 0:
        raise UserError(f"iterations: expected 0 or more, found {iterations}")
    if n_partitions < 2:
        raise UserError(f"n_partitions: expected 2 or more, found {n_partitions}")
    _check_choice("candidates", candidates, CANDIDATES)
    _check_choice("complement_order", complement_order, COMPLEMENT_ORDERS)
    _check_choice("growth", growth, ("paper", "steady"))
    _check_choice("skip", skip, ("known", "implied"))
    _check_choice("prior", prior, ("spatial", "uniform"))
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
    try:
        # Planned before the first test: what is lacking is told before anything is run.
        round = next(running)
        if check and not bench.is_similar(frozenset(names)):
            raise UserError("the failure does not show with all elements: there is nothing to reduce")
        while True:
            rounds += 1
            if on_round is not None:
                on_round(round)
            winner = bench.first_similar(round)
            if winner is not None:
                kept = winner.models
                history.append(Step(len(bench.trials), tuple(name for name in names if name in kept)))
            round = running.send(winner)
    except StopIteration as end:
        kept = tuple(name for name in names if name in end.value)
    return Reduction(kept, len(bench.trials), rounds, tuple(history))


class _Bench:
    """Makes tests one after another, and no candidate twice."""

    def __init__(self, test: Test, iterations: int) -> None:
        self._test = test
        self._iterations = iterations
        self._known: dict[frozenset[str], bool] = {}
        self.trials: list[Trial] = []

    def first_similar(self, round: Round) -> Candidate | None:
        return next((one for one in round.candidates if self.is_similar(one.models)), None)

    def is_similar(self, models: frozenset[str]) -> bool:
        if models not in self._known:
            self._known[models] = any(self._run(models) for _ in range(1 + self._iterations))
        return self._known[models]

    def _run(self, models: frozenset[str]) -> bool:
        similar = bool(self._test(models))
        self.trials.append(Trial(models, similar))
        return similar


def _evidence(
    names: tuple[str, ...],
    positions: Mapping[str, Place] | None,
    trajectory: np.ndarray | None,
    failure_pose: Iterable[float] | None,
    first_sensed: Mapping[str, float] | None,
    delta: float,
    seed: int,
) -> Evidence:
    """What is known, checked. Raises UserError."""
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise UserError(f"elements: {twice!r} is there twice; give each a name of its own")
    places = (
        None if positions is None else {name: _place(f"positions[{name!r}]", positions.get(name)) for name in names}
    )
    path = None if trajectory is None else _path(trajectory)
    end = None if path is None else tuple(path[-1, 1:4].tolist())
    if failure_pose is not None:
        end = _place("failure_pose", failure_pose)
    if not (isinstance(delta, int | float) and delta > 0 and math.isfinite(delta)):
        raise UserError(f"delta: expected a number above 0, found {delta!r}")
    for name, at in (first_sensed or {}).items():
        if not isinstance(at, int | float) or math.isnan(at):
            raise UserError(f"first_sensed[{name!r}]: expected a time in s, found {at!r}")
    return Evidence(names, places, path, end, first_sensed, delta=float(delta), seed=seed)


def _path(trajectory: np.ndarray) -> np.ndarray:
    try:
        path = np.asarray(trajectory, dtype=float)
    except (TypeError, ValueError):
        raise UserError("trajectory: expected finite numbers of shape (N, 5)") from None
    if path.ndim != 2 or path.shape[1] != 5 or not len(path) or not np.isfinite(path).all():
        raise UserError(f"trajectory: expected finite numbers of shape (N, 5), found shape {path.shape}")
    if (np.diff(path[:, 0]) < 0).any():
        raise UserError("trajectory: its times, in the first column, must not decrease")
    return path


def _place(what: str, values: Iterable[float] | None) -> Place:
    if values is None:
        raise UserError(f"{what}: is missing")
    try:
        numbers = [float(value) for value in values][:3]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) < 3 or not all(map(math.isfinite, numbers)):
        raise UserError(f"{what}: expected x, y, z m, found {values!r}")
    return numbers[0], numbers[1], numbers[2]


def _check_choice(key: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise UserError(f"{key}: {value!r} is not allowed; use one of {', '.join(allowed)}")
