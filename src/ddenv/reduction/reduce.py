"""`ddenv.reduce`: the reduction as a function, for a test of your own. It needs neither Drake nor a robot. Wrong arguments raise
UserError, in one line.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import count, takewhile
from numbers import Integral, Real
from typing import Any

import numpy as np

from ddenv.arrays import Floats
from ddenv.environment import NOTHING, Environment
from ddenv.errors import UserError
from ddenv.evidence.certificate import Terms, Verdict, error_of
from ddenv.evidence.rates import Shown, anytime_interval, estimated_rate
from ddenv.reduction.evidence import Evidence, Names, Place, Traits, Trial
from ddenv.reduction.guide import Search, make_guide, search
from ddenv.reduction.procedure import (
    BaselineRan,
    Certificate,
    CertificateDue,
    Certified,
    FailureFixed,
    LeftOut,
    Leg,
    NamedClaim,
    RoundBegan,
    Similar,
    SteppedBack,
    Wants,
    baseline,
    procedure,
    search_on,
)
from ddenv.reduction.procedure import Step as ProcedureStep
from ddenv.reduction.procedure import Test as ProcedureTest
from ddenv.reduction.round import CANDIDATES, COMPLEMENT_ORDERS, Partition, Round
from ddenv.reduction.stepping_back import tried_again
from ddenv.reduction.verdict import Acceptance, standing

NOTHING_TO_REDUCE = "the failure does not show with all elements: there is nothing to reduce"
# Runs of certificates are numbered from here on, so that they chose nothing; the search never comes so far.
FIRST_FRESH, EACH_CERTIFICATE = 1_000_000, 100_000

Test = Callable[[frozenset[str]], bool]


@dataclass(frozen=True)
class Step:
    """The environment `kept`, in the order of the elements, after `tests` tests."""

    tests: int
    kept: Names


@dataclass(frozen=True)
class NamedRound:
    """A round, before it is tested: the environment, and its parts in the order in which they are tried.

    A candidate is "partition" or "complement", and the number of its part.
    """

    environment: Names
    partitions: tuple[Names, ...]
    candidates: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class RateClaim:
    """A claim about what is left, or, if `without` is an element, about that without it.

    `verdict`: what is left is "kept" (it keeps the rate) or "lost"; an element is "needed" (without it the rate falls below what
    must be kept), "helps" (without it the failure is rarer, but not that rare) or "not needed"; "not shown" if the runs do not
    decide. `shown` of `runs` fresh runs showed the failure; `low`..`high` is the 95 % interval of the rate. What is left keeps at
    least `bound` of the rate of all elements; without an element the failure shows at most `bound` times as often as with it.
    """

    without: str | None
    verdict: Verdict
    shown: int
    runs: int
    low: float
    high: float
    bound: float | None = None


@dataclass(frozen=True)
class Reduction:
    """What `reduce` returns: the elements `kept`, in their order, after `tests` calls of the test in `rounds` rounds.

    `history` begins with all elements; each further step is a reduction, or a step back to more elements. The tests are those of
    all elements at first, of the search, and those that show what the result is worth. `minimal`: what is kept shows the failure
    often enough, and no single element can be left out; each was left out in a test. With the rule "kept", `claims` say what
    fresh calls of the test showed of this; with "first" there are none.
    """

    kept: tuple[str, ...]
    rounds: int
    history: tuple[Step, ...]
    minimal: bool
    baseline_tests: int
    search_tests: int
    certificate_tests: int
    claims: tuple[RateClaim, ...] = ()

    @property
    def tests(self) -> int:
        """How often the test was called."""
        return self.baseline_tests + self.search_tests + self.certificate_tests


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
    accept_rate: str | None = None,
    keep_rate: float = 0.8,
    certify_rate: float = 2 / 3,
    baseline_runs: int = 10,
    check: bool = True,
    on_round: Callable[[NamedRound], None] | None = None,
) -> Reduction:
    """Finds a few of `elements` with which `test` still shows the failure; the best end is one of which no single one can go.

        ddenv.reduce("abcdef", lambda kept: kept >= {"a", "e"}, algorithm="ddmin").kept  # ("a", "e")

    `test(frozenset of names)` runs the robot, or anything else, with these elements alone, and returns whether the failure showed.
    A test that returns False is repeated up to `iterations` times, for failures that do not show every time.

    With `accept_rate` "first", the first run with the failure decides, as in the paper; the end may fail far more rarely than all
    elements do. With "kept", the default if there are `iterations`, all elements are run `baseline_runs` times at first, and more
    often if the failure is rare. The search takes what seems to keep `keep_rate` of their failure rate. Fresh runs show at the end
    whether at least `certify_rate` of it is kept, and without which elements the failure is rarer; where a claim fails, the search
    steps back or goes on.
    All claims together are wrong with a probability of at most 5 %.

    `positions` maps each name to x, y, z (m). `trajectory` (N, 5) is time (s), x, y, z (m), yaw (rad) of the run that failed.
    `failure_pose` is where it failed, beginning with x, y, z (m); the default is the trajectory's end. `first_sensed` maps names to
    the time (s) when the robot first sensed them; other names were never sensed. `touched` are the names that it touched. `traits`
    maps each name to its `ddenv.Traits`. Only what the chosen schemas look at is required. `n_partitions`, `candidates`,
    `complement_order`, `growth`, `skip`, `prior` and `delta` (rad/s) mean the same as in a scenario's section `reduction`.

    With `check`, all elements are tested first, as "kept" always does: without the failure there is nothing to reduce. `on_round`
    is called with each round before it is tested. Raises UserError, in one line, for wrong arguments; exceptions of `test` are
    passed on.
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
    checked_count("baseline_runs", baseline_runs, 1)
    checked_number("keep_rate", keep_rate, 0.95)
    checked_number("certify_rate", certify_rate, 0.95)
    checked_choice("accept_rate", accept_rate := accept_rate or ("kept" if iterations else "first"), ("first", "kept"))

    def begin(leg: Leg) -> Search:
        guide = make_guide(
            partitioning,
            prioritization,
            lambda: replace(known, trials=caller.trials),
            prior=prior,
            n_partitions=leg.n_partitions or n_partitions,
            candidates=candidates,
            complement_order=complement_order,
            growth=growth,
            skip=skip,
            rate=lambda: leg.rule.rate or caller.share_shown,
            runs=lambda: leg.rule.misses,
        )
        return tried_again(tuple(leg.chain[-1]), leg.again, partial(search, algorithm, guide=guide))

    keeps_rate = accept_rate == "kept"
    rates = (keep_rate if keeps_rate else 0.0, certify_rate)
    caller = _Caller(names, test, begin, rates, iterations, baseline_runs, on_round)
    # A missing argument is reported before the first test.
    next(begin(caller.leg()), None)
    if keeps_rate:
        caller.carry_out(procedure(caller, caller.whole, baseline_runs, keeps_rate=True))
        minimal = all(claim.verdict in ("kept", "needed") for claim in caller.claims)
    else:
        if check:
            caller.carry_out(baseline(caller, caller.whole, baseline_runs if iterations else 1, bool(iterations)))
        leg = caller.leg()
        caller.carry_out(search_on(caller, leg))
        rests = [caller.left - Environment.of((element,)) for element in caller.left]
        minimal = all(standing([rest], caller.shown, leg.rule).verdicts[0] == "dissimilar" for rest in rests)
    tests = caller.calls["baseline"], caller.calls["round"], caller.calls["certify"]
    return Reduction(caller.history[-1].kept, caller.rounds, tuple(caller.history), minimal, *tests, caller.claims)


class _Caller:
    """Drives the procedure: calls `test` for each test that it wants. With `keep_rate` 0 the first run with the failure decides."""

    refusals, workers = 0, 1

    def __init__(
        self,
        names: Names,
        test: Test,
        begin: Callable[[Leg], Search],
        rates: tuple[float, float],
        iterations: int,
        baseline_runs: int,
        on_round: Callable[[NamedRound], None] | None,
    ) -> None:
        self._names, self._test, self._begin, self._on_round = names, test, begin, on_round
        self._keep_rate, self._certify_rate = rates
        self._iterations, self._baseline_runs = iterations, baseline_runs
        self.whole = Environment.whole(len(names))
        # By what they were made for: "baseline", "round" or "certify".
        self.calls: Counter[str] = Counter()
        self.trials: list[Trial] = []
        self.rounds = 0
        self.history = [Step(0, names)]
        self.claims: tuple[RateClaim, ...] = ()
        self._known: dict[tuple[Environment, int], bool] = {}
        # What calls with all elements showed.
        self._of_whole: list[bool] = []
        self._chain: tuple[Environment, ...] = (self.whole,)
        # n of the last round in each environment, or of the round that reached it.
        self._n_partitions: dict[Environment, int] = {}
        self._last_n: int | None = None
        self._lost: list[Environment] = []
        self._certificates = 0

    # What the procedure asks.

    def shown(self, environment: Environment, run: int, full: bool = False) -> Shown:
        return self._known.get((environment, run))

    def refused(self, environment: Environment) -> bool:
        return any(environment <= lost for lost in self._lost)

    def refused_by_user(self, environment: Environment) -> bool:
        return False

    @property
    def share_shown(self) -> float:
        """The share of the calls with all elements that showed the failure; 1 before the first."""
        return sum(self._of_whole) / len(self._of_whole) if self._of_whole else 1.0

    def rate(self) -> float:
        """From the baseline, and from fresh calls: at first these are made only where what is left does not show the failure, which
        would show the rate as too low, so none counts after the first that was not made.
        """
        shown = list(self._of_whole)
        for number in range(1, self._certificates + 1):
            first = FIRST_FRESH + number * EACH_CERTIFICATE
            tests = ((self.whole, run) for run in count(first))
            shown += [self._known[test] for test in takewhile(self._known.__contains__, tests)]
        return estimated_rate(sum(shown), len(shown))

    def goes_on(self) -> bool:
        return True

    def algorithm(self, leg: Leg) -> Search:
        return self._begin(leg)

    # What it finds.

    def carry_out(self, steps: Generator[ProcedureStep, Any, object]) -> None:
        """To the end. Raises UserError if the failure never shows in the baseline."""
        answer: object = None
        while True:
            try:
                step = steps.send(answer)
            except StopIteration:
                return
            answer = self._answer(step)

    def _answer(self, step: ProcedureStep) -> object:
        match step:
            case Wants():
                self._call(step.tests[0])
            case BaselineRan():
                return self._failures()
            case FailureFixed():
                return self.leg()
            case RoundBegan():
                self._begin_round(step.round)
            case Similar():
                self._go(*self._chain, step.environment)
                return True
            case CertificateDue():
                return self._certificate()
            case Certified():
                self.claims = tuple(self._claim(claim, step.certificate.first_run) for claim in step.claims)
            case LeftOut():
                self._go(*self._chain, step.environment)
                return self.leg()
            case SteppedBack():
                self._lost.append(self._chain[step.place + 1])
                self._go(*self._chain[: step.place + 1])
                return self.leg(step.again)
        return None

    def _call(self, asked: ProcedureTest) -> None:
        shown = bool(self._test(frozenset(asked.environment.names(self._names))))
        self.calls[asked.why] += 1
        self._known[asked.environment, asked.run] = shown
        if asked.why == "round":
            self.trials.append(Trial(asked.environment, shown, self._names))
        elif asked.why == "baseline":
            self._of_whole.append(shown)

    def _failures(self) -> int:
        if not any(self._of_whole):
            raise UserError(NOTHING_TO_REDUCE)
        return sum(self._of_whole)

    def leg(self, again: tuple[Partition, ...] = ()) -> Leg:
        """The next search, from what is left."""
        rate = self.rate() if self._keep_rate else 0.0
        rule = Acceptance(1 + self._iterations, rate, self._keep_rate, len(self._lost))
        free = {element: Environment.of((element,)) for element in self.left}
        n_partitions = self._n_partitions.get(self.left)
        return Leg(self.rounds + 1, self.whole, self._chain, NOTHING, free, rule, n_partitions, again)

    @property
    def left(self) -> Environment:
        """The environment that was reached."""
        return self._chain[-1]

    def _begin_round(self, round: Round) -> None:
        self.rounds += 1
        self._last_n = self._n_partitions[self.left] = round.n_partitions
        if self._on_round is not None:
            candidates = tuple((candidate.kind, candidate.partition) for candidate in round.candidates)
            self._on_round(
                NamedRound(self._named(round.environment), tuple(map(self._named, round.partitions)), candidates)
            )

    def _named(self, models: Partition) -> Names:
        return tuple(self._names[model] for model in models)

    def _go(self, *chain: Environment) -> None:
        """On, or back, along `chain`."""
        self._chain = chain
        if self._last_n is not None:
            self._n_partitions.setdefault(self.left, self._last_n)
        self.history.append(Step(self.calls.total(), self.left.names(self._names)))

    def _certificate(self) -> Certificate:
        self._certificates += 1
        terms = Terms(self._certify_rate, self._keep_rate, error_of(self._certificates), self._baseline_runs)
        return Certificate(self._certificates, FIRST_FRESH + self._certificates * EACH_CERTIFICATE, terms)

    def _claim(self, named: NamedClaim, first: int) -> RateClaim:
        shown = sum(self._known[named.environment, first + run] for run in named.runs)
        without, claim = None if named.model is None else self._names[named.model], named.claim
        interval = anytime_interval(shown, len(named.runs))
        return RateClaim(without, claim.verdict, shown, len(named.runs), *interval, claim.bound)


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


def checked_number(what: str, value: float, most: float = LARGEST) -> float:
    """`value` as a number above 0, at most `most`. Raises UserError."""
    if not isinstance(value, Real) or not 0 < value <= most:
        limit = "" if most == LARGEST else f", at most {most:g}"
        raise UserError(f"{what}: expected a number above 0{limit}, found {value!r}")
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
