"""`ddenv.reduce`: the reduction as a function, for a test of your own. It needs neither Drake nor a robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from numbers import Integral, Real

import numpy as np

from ddenv.arrays import Floats
from ddenv.errors import UserError
from ddenv.reduction.evidence import Evidence, Place, Traits, Trial
from ddenv.reduction.guide import Search, make_guide, search
from ddenv.reduction.round import CANDIDATES, COMPLEMENT_ORDERS, Candidate, Round

Test = Callable[[frozenset[str]], bool]


@dataclass(frozen=True)
class Step:
    """The environment `kept`, in the order of the elements, after `tests` tests."""

    tests: int
    kept: tuple[str, ...]


@dataclass(frozen=True)
class Reduction:
    """What `reduce` returns: the elements `kept`, in their order, after `tests` calls of the test in `rounds` rounds.

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
    trajectory: Floats | None = None,
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
    """Finds a few of `elements` with which `test` still shows the failure, and of which no single one can be left out.

        ddenv.reduce("abcdef", lambda kept: kept >= {"a", "e"}, algorithm="ddmin").kept  # ("a", "e")

    `test(frozenset of names)` runs the robot, or anything else, with these elements alone, and returns whether the failure showed.
    A test that returns False is repeated up to `iterations` times, for failures that do not show every time.

    `positions` maps each name to x, y, z (m). `trajectory` (N, 5) is time (s), x, y, z (m), yaw (rad) of the run that failed.
    `failure_pose` is where it failed, beginning with x, y, z (m); the default is the trajectory's end. `first_sensed` maps names to
    the time (s) when the robot first sensed them; other names were never sensed. `touched` are the names that it touched. `traits`
    maps each name to its `ddenv.Traits`. Only what the chosen schemas look at is required. `n_partitions`, `candidates`,
    `complement_order`, `growth`, `skip`, `prior` and `delta` (rad/s) mean the same as in a scenario's section `reduction`.

    With `check`, all elements are tested first: without the failure there is nothing to reduce. `on_round` is called with each
    round before it is tested. Raises UserError, in one line, for wrong arguments; exceptions of `test` are passed on.
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
    # Planned before the first test, so that a missing argument is reported at once.
    round, left = _next(running, None)
    if check and not bench.is_similar(frozenset(names)):
        raise UserError("the failure does not show with all elements: there is nothing to reduce")
    while round is not None:
        rounds += 1
        if on_round is not None:
            on_round(round)
        winner = bench.first_similar(round)
        if winner is not None:
            models = winner.models
            history.append(Step(len(bench.trials), tuple(name for name in names if name in models)))
        round, left = _next(running, winner)
    kept = tuple(name for name in names if name in left)
    return Reduction(kept, len(bench.trials), rounds, tuple(history))


def _next(running: Search, winner: Candidate | None) -> tuple[Round | None, frozenset[str]]:
    """The next round, or None and the minimal environment."""
    try:
        return running.send(winner), frozenset()
    except StopIteration as end:
        return None, end.value


class _Bench:
    """Runs tests one after another, and tests no candidate twice."""

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
        # Not any(): a generator would turn a StopIteration of the test into another exception.
        for _ in range(1 + self._iterations):  # noqa: SIM110
            if self._run(models):
                return True
        return False

    def _run(self, models: frozenset[str]) -> bool:
        similar = bool(self._test(models))
        self.trials.append(Trial(models, similar))
        return similar


# Larger numbers are a mistake, and their squares could be infinite.
LARGEST = 1e9


def checked_names(elements: Iterable[str]) -> tuple[str, ...]:
    """The elements as a tuple. Raises UserError if they are no names, or if a name occurs twice."""
    try:
        names = tuple(elements)
        different = len(set(names))
    except TypeError:
        raise UserError(f"elements: expected names, found {elements!r}") from None
    if different != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise UserError(f"elements: {twice!r} occurs twice; give each element its own name")
    return names


def checked_positions(names: tuple[str, ...], positions: Mapping[str, Place] | None) -> dict[str, Place] | None:
    """The position of each name, m. Raises UserError."""
    if positions is None:
        return None
    _check_mapping("positions", positions)
    return {name: _place(f"positions[{name!r}]", positions.get(name)) for name in names}


def checked_trajectory(trajectory: Floats | None) -> Floats | None:
    """The trajectory, shape (N, 5). Raises UserError."""
    if trajectory is None:
        return None
    try:
        path = np.asarray(trajectory)
        path = path.astype(float, casting="safe" if path.dtype.kind in "cOSU" else "unsafe")
    except (TypeError, ValueError):
        raise UserError("trajectory: expected finite numbers of shape (N, 5)") from None
    if path.ndim != 2 or path.shape[1] != 5 or not len(path) or not (np.abs(path) <= LARGEST).all():
        raise UserError(f"trajectory: expected finite numbers of shape (N, 5), found shape {path.shape}")
    if (np.diff(path[:, 0]) < 0).any():
        raise UserError("trajectory: its times, in the first column, must not decrease")
    return path


def checked_failure(failure_pose: Iterable[float] | None, path: Floats | None) -> Place | None:
    """The position of the failure, m: given, or the end of the path (N, 5). Raises UserError."""
    if failure_pose is not None:
        return _place("failure_pose", failure_pose)
    if path is None:
        return None
    x, y, z = path[-1, 1:4].tolist()
    return x, y, z


def checked_times(first_sensed: Mapping[str, float] | None) -> dict[str, float] | None:
    """The time of each name that was sensed, s. Raises UserError."""
    if first_sensed is None:
        return None
    _check_mapping("first_sensed", first_sensed)
    for name, at in first_sensed.items():
        if not isinstance(at, Real) or not 0 <= at <= LARGEST:
            raise UserError(f"first_sensed[{name!r}]: expected a time in s, found {at!r}")
    return {name: float(at) for name, at in first_sensed.items()}


def checked_traits(names: tuple[str, ...], traits: Mapping[str, Traits] | None) -> Mapping[str, Traits] | None:
    """The traits of each name. Raises UserError."""
    if traits is None:
        return None
    _check_mapping("traits", traits)
    for name in names:
        if not isinstance(traits.get(name), Traits):
            raise UserError(f"traits[{name!r}]: expected ddenv.Traits, found {traits.get(name)!r}")
    return traits


def checked_number(what: str, value: float) -> float:
    """`value` as a number above 0. Raises UserError."""
    if not isinstance(value, Real) or not 0 < value <= LARGEST:
        raise UserError(f"{what}: expected a number above 0, found {value!r}")
    return float(value)


def checked_count(what: str, value: int, least: int) -> int:
    """`value` as a whole number, `least` or more. Raises UserError."""
    if not isinstance(value, Integral) or not least <= value < 2**31:
        raise UserError(f"{what}: expected {least} or more, found {value!r}")
    return int(value)


def checked_choice(what: str, value: str, allowed: tuple[str, ...]) -> None:
    """Raises UserError if `value` is not allowed."""
    if value not in allowed:
        raise UserError(f"{what}: {value!r} is not allowed; use one of {', '.join(allowed)}")


def _check_mapping(what: str, value: object) -> None:
    if not isinstance(value, Mapping):
        raise UserError(f"{what}: expected a mapping from names to values, found {type(value).__name__}")


def _place(what: str, values: Iterable[float] | None) -> Place:
    if values is None:
        raise UserError(f"{what}: is missing")
    try:
        numbers = [] if isinstance(values, str) else [float(value) for value in values][:3]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) < 3 or not all(math.isfinite(number) and abs(number) <= LARGEST for number in numbers):
        raise UserError(f"{what}: expected x, y, z m, found {values!r}")
    return numbers[0], numbers[1], numbers[2]
