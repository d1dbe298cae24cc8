"""`ddenv.reduce`: the reduction as a function, for a test of your own. It needs neither Drake nor a
robot.
"""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import count as counted
from itertools import takewhile
from numbers import Integral, Real
from typing import Any, TypeVar, cast

import numpy as np

from ddenv.arrays import Floats
from ddenv.environment import NOTHING, Environment
from ddenv.errors import UserError
from ddenv.evidence.certificate import (
    LONGER,
    NumberedRun,
    Terms,
    Verdict,
    error_of,
    tests_in_blocks,
)
from ddenv.evidence.rates import Shown, anytime_interval, estimated_rate, wilson_interval
from ddenv.reduction import procedure as steps
from ddenv.reduction.algorithms import tried_again
from ddenv.reduction.evidence import Evidence, Place, Traits, Trial
from ddenv.reduction.guide import begin_search, make_guide
from ddenv.reduction.round import Partition, Round, Rounds
from ddenv.reduction.verdict import Acceptance, standing
from ddenv.run_numbers import CALLS_OF_CERTIFICATE
from ddenv.settings import SETTINGS
from ddenv.text import Names, count, percent, rounded

NEVER_SHOWS = (
    "the failure does not show with all elements: in none of {}, so it shows in less than {} % "
    "of them (95 %); "
    "there is nothing to reduce, unless more baseline_runs show it"
)
# Without a word of the user a test is taken to be steady if so many calls with all elements show
# the failure, and so many with what is left, in addition to the one of the search.
REPLAYS = 5
# A test that turns out to be flaky gets so many re-runs.
FLAKY_ITERATIONS = 3
# This share of `most_tests` is for the last certificate alone, which has so many tests in any case.
CERTIFICATE_SHARE = 0.25
FEWEST_TESTS = 40

# Larger numbers are a mistake, and their squares could be infinite.
LARGEST = 1e9
PLACE = "x, y, z m"

Test = Callable[[frozenset[str]], bool]
Value = TypeVar("Value")


@dataclass(frozen=True)
class Step:
    """The environment `kept`, in the order of the elements, after `tests` tests."""

    tests: int
    kept: Names


@dataclass(frozen=True)
class NamedRound:
    """A round, before it is tested: the environment, its parts in the order in which they are
    tried, and its candidates: "partition" or "complement", and the number of its part.
    """

    environment: Names
    partitions: tuple[Names, ...]
    candidates: tuple[tuple[str, int], ...]


@dataclass(frozen=True, kw_only=True)
class RateClaim:
    """A claim about what is left, or, if `without` is an element, about that without it.

    `verdict`: what is left is "kept" (it keeps the rate) or "lost"; an element is "needed" (without
    it the rate falls below what must be kept), "helps" (the failure is rarer without it, but not
    that rare), "rarer" (by how much is not shown) or "not needed" (it seems to show as often); "not
    shown" if the runs do not decide.

    `shown` of `runs` fresh runs showed the failure; `low`..`high` is the 95 % interval of the rate.
    What is left keeps at least `bound` of the rate of all elements; without an element the failure
    shows at most `bound` times as often as with it.
    """

    without: str | None
    verdict: Verdict
    shown: int
    runs: int
    low: float
    high: float
    bound: float | None = None


@dataclass(frozen=True, kw_only=True)
class Reduction:
    """What `reduce` returns: the elements `kept`, in their order, after `tests` calls of the test
    in `rounds` rounds.

    `history` begins with all elements; each further step is a reduction, or a step back. With the
    rule "kept", `claims` say what fresh calls showed, and `minimal` that by these what is kept
    shows the failure often enough, and that no single element can be left out. Where the test seems
    to be steady `minimal` rests on two calls of it without each element, and on more without any.
    It is None with the rule "first", by which one call decides: what a flaky test shows once may be
    chance.

    `flaky`: calls with the same elements gave different answers.
    """

    kept: Names
    rounds: int
    history: tuple[Step, ...]
    minimal: bool | None
    baseline_tests: int
    search_tests: int
    certificate_tests: int
    claims: tuple[RateClaim, ...] = ()
    flaky: bool = False

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
    iterations: int | None = None,
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
    most_tests: int = 1200,
    check: bool = True,
    on_round: Callable[[NamedRound], None] | None = None,
) -> Reduction:
    """Finds a few of `elements` with which `test` still shows the failure; the best end is one of
    which no single one can go.

        found = ddenv.reduce("abcdef", lambda kept: kept >= {"a", "e"}, algorithm="ddmin")
        found.kept  # ("a", "e")

    `test(frozenset of names)` runs the robot, or anything else, with these elements alone, and
    returns whether the failure showed. A few calls with all elements, and at the end with what is
    left and without each element of it, show whether the test is steady.

    If it is flaky, or if there are `iterations`, the rule is "kept". All elements are run
    `baseline_runs` times or more, and the search takes what seems to keep `keep_rate` of their
    failure rate; a candidate without the failure is called again up to `iterations` times. Fresh
    calls show at the end whether at least `certify_rate` of the rate is kept, and without which
    elements the failure is rarer. All claims together are wrong with a probability of at most 5 %.
    After the first search about `most_tests` calls are made, to certify, and to go back or on; then
    the smallest set that is not shown to be lost is kept. If a certificate is likely to take more,
    there is a warning before it begins.

    With the rule "first" the first call with the failure decides, as in the paper. That is the rule
    if `iterations` are 0, too. `accept_rate` chooses the rule.

    `positions` maps each name to x, y, z (m). `trajectory` (N, 5) is time (s), x, y, z (m), yaw
    (rad) of the run that failed. `failure_pose` is where it failed, beginning with x, y, z (m); the
    default is the trajectory's end. `first_sensed` maps names to the time (s) when the robot first
    sensed them, `traits` to `ddenv.Traits`. Only what the chosen schemas look at is required.
    `n_partitions` and what follows, to `delta` (rad/s), mean the same as in a scenario's section
    `reduction`. With `check`, all elements are tested first. `on_round` is called with each round
    before it is tested. Raises UserError, in one line, for wrong arguments; exceptions of `test`
    are passed on.
    """
    names = _names(elements)
    seems_steady = iterations is None and accept_rate is None
    iterations = iterations or 0
    accept_rate = accept_rate or ("kept" if iterations else "first")
    variants = {
        "candidates": candidates,
        "complement_order": complement_order,
        "growth": growth,
        "skip": skip,
    }
    _check(
        **variants,
        prior=prior,
        accept_rate=accept_rate,
        keep_rate=keep_rate,
        certify_rate=certify_rate,
        delta=delta,
    )
    if isinstance(most_tests, bool) or not isinstance(most_tests, Integral) or most_tests < 1:
        raise _wrong("most_tests", "a whole number, at least 1", most_tests)
    _check(iterations=iterations, n_partitions=n_partitions, seed=seed, baseline_runs=baseline_runs)
    path = _trajectory(trajectory)
    failure = _place(path[-1, 1:4] if failure_pose is None and path is not None else failure_pose)
    if failure is None and failure_pose is not None:
        raise _wrong("failure_pose", PLACE, failure_pose)
    places = _each("positions", positions, names, PLACE, _place)
    times = _each("first_sensed", first_sensed, None, "a time in s", _time)
    felt = None if touched is None else frozenset(touched)
    alike = _each(
        "traits",
        traits,
        names,
        "ddenv.Traits",
        lambda value: value if isinstance(value, Traits) else None,
    )
    known = Evidence(
        elements=names,
        positions=places,
        trajectory=path,
        failure_position=failure,
        first_sensed=times,
        touched=felt,
        traits=alike,
        delta=float(delta),
        seed=int(seed),
    )

    def begin(search: steps.Search) -> Rounds:
        guide = make_guide(
            partitioning,
            prioritization,
            lambda: replace(known, trials=caller.trials),
            n_partitions=search.n_partitions or n_partitions,
            rate=lambda: search.rule.rate or caller.share_shown,
            runs=lambda: search.rule.misses,
            proves=search.rule.proves,
            prior=prior,
            **variants,
        )
        return tried_again(
            tuple(search.chain[-1]), search.again, partial(begin_search, algorithm, guide=guide)
        )

    caller = _Caller(
        names=names,
        test=test,
        begin=begin,
        keep_rate=keep_rate if accept_rate == "kept" else 0.0,
        certify_rate=certify_rate,
        iterations=iterations,
        baseline_runs=baseline_runs,
        on_round=on_round,
        seed=int(seed),
        most_tests=int(most_tests),
    )
    # A missing argument is reported before the first test.
    next(begin(caller.start_search()), None)
    minimal: bool | None = None
    if seems_steady:
        minimal = caller.search_if_steady(check)
        if minimal is None:
            caller.keep_rate = keep_rate
            caller.iterations = FLAKY_ITERATIONS
    elif not caller.keep_rate:
        if check:
            runs = baseline_runs if iterations else 1
            caller.carry_out(steps.baseline(caller, caller.whole, runs, keeps_rate=False))
        minimal = None if caller.search_once() else False
    if caller.keep_rate:
        caller.carry_out(steps.procedure(caller, caller.whole, baseline_runs, keeps_rate=True))
        caller.keep_best()
        of_each = len(caller.claims) == 1 + len(caller.history[-1].kept)
        minimal = of_each and all(claim.verdict in ("kept", "needed") for claim in caller.claims)
    return Reduction(
        kept=caller.history[-1].kept,
        rounds=caller.rounds,
        history=tuple(caller.history),
        minimal=minimal,
        baseline_tests=caller.calls["baseline"],
        search_tests=caller.calls["round"],
        certificate_tests=caller.calls["certify"],
        claims=caller.claims,
        flaky=caller.flaky,
    )


@dataclass(kw_only=True)
class _Caller:
    """Drives the procedure: calls `test` for each test that it wants. With `keep_rate` 0 the first
    run with the failure decides. `calls` counts them by what they were made for.
    """

    names: Names
    test: Test
    begin: Callable[[steps.Search], Rounds]
    keep_rate: float
    certify_rate: float
    iterations: int
    baseline_runs: int
    on_round: Callable[[NamedRound], None] | None
    seed: int
    most_tests: int
    rounds: int = 0
    claims: tuple[RateClaim, ...] = ()
    refusals: int = 0
    workers: int = 1

    def __post_init__(self) -> None:
        self.whole = Environment.whole(len(self.names))
        self.calls: Counter[str] = Counter()
        self.trials: list[Trial] = []
        self.history = [Step(0, self.names)]
        self._known: dict[NumberedRun, bool] = {}
        # What calls with all elements showed.
        self._of_whole: list[bool] = []
        self._chain: tuple[Environment, ...] = (self.whole,)
        # n of the last round in each environment, or of the round that reached it.
        self._n_partitions: dict[Environment, int | None] = {}
        self._lost: list[Environment] = []
        self._began: list[NamedRound] = []
        self._certificates = 0
        # What fresh calls showed of each end that they did not show to be lost.
        self._shown: dict[Environment, tuple[RateClaim, ...]] = {}
        # How many calls were made before the first certificate.
        self._before: int | None = None

    def shown(self, environment: Environment, run: int, full: bool = False) -> Shown:
        return self._known.get((environment, run))

    def refused(self, environment: Environment) -> bool:
        return any(environment <= lost for lost in self._lost)

    def refused_by_user(self, environment: Environment) -> bool:
        return False

    @property
    def share_shown(self) -> float:
        """The share of the calls with all elements that showed the failure; 1 before the first."""
        if self._of_whole:
            return sum(self._of_whole) / len(self._of_whole)
        return 1.0

    def rate(self) -> float:
        # From the baseline, and from fresh calls up to the first not made: only where what is left
        # missed f they are made.
        shown = list(self._of_whole)
        for number in range(1, self._certificates + 1):
            first = _first_fresh_call(number)
            tests = ((self.whole, run) for run in counted(first))
            shown += [self._known[test] for test in takewhile(self._known.__contains__, tests)]
        return estimated_rate(sum(shown), len(shown))

    @property
    def flaky(self) -> bool:
        """Whether calls with the same elements gave different answers."""
        answers = {(environment, shown) for (environment, _), shown in self._known.items()}
        return len(answers) > len({environment for environment, _ in answers})

    @property
    def _affordable(self) -> int:
        """How many calls may still be made; before the first certificate they are not counted."""
        return self.most_tests - (0 if self._before is None else self.calls.total() - self._before)

    def goes_on(self) -> bool:
        # To an end that is not shown to be lost it goes back in any case.
        return self._affordable > 0 or not self._shown

    def algorithm(self, search: steps.Search) -> Rounds:
        """The algorithm, up to where what is left of the calls is needed for a certificate."""
        rounds = self.begin(search)
        winner = None
        while self._affordable >= CERTIFICATE_SHARE * self.most_tests:
            try:
                winner = yield rounds.send(winner)
            except StopIteration as end:
                return cast(Environment, end.value)
        return self.left

    def search_once(self) -> bool:
        """Takes the first call with the failure; returns whether the failure was gone without each
        element that is left.
        """
        search = self.start_search()
        self.carry_out(steps.search_on(self, search))
        verdicts = (standing([rest], self.shown, search.rule)[0] for rest in self._removals())
        return all(verdict == ["dissimilar"] for verdict in verdicts)

    def search_if_steady(self, check: bool) -> bool | None:
        """The same where the test shows the failure in each of a few calls with all elements, and
        gives the same answers again at the end; else None.
        """
        if check:
            self.carry_out(
                (steps.Test(environment=self.whole, run=run, why="baseline"),)
                for run in range(REPLAYS)
            )
            if not all(self._of_whole):
                return None
        alone = self.search_once()
        replays = [
            steps.Test(environment=self.left, run=run, why="certify")
            for run in range(1, 1 + REPLAYS)
        ]
        tested = (rest for rest in self._removals() if self.shown(rest, 0) is not None)
        replays += [steps.Test(environment=rest, run=1, why="certify") for rest in tested]
        self.carry_out((test,) for test in replays)
        if self.flaky:
            return None
        return alone

    def _removals(self) -> list[Environment]:
        return [self.left - Environment.of((element,)) for element in self.left]

    def keep_best(self) -> None:
        """Goes back from an end that is lost to the smallest one that fresh calls did not show to
        be.
        """
        if self.left in self._shown or not self._shown:
            return
        best = min(self._shown, key=len)
        self._go(best)
        self.claims = self._shown[best]

    def carry_out(self, work: Iterable[tuple[steps.Test, ...]]) -> None:
        """To the end. Raises UserError if the failure never shows in the baseline."""
        for asked, *_ in work:
            self._tell_rounds()
            shown = bool(self.test(frozenset(asked.environment.names(self.names))))
            self.calls[asked.why] += 1
            self._known[asked.environment, asked.run] = shown
            if asked.why == "round":
                self.trials.append(Trial(asked.environment, shown, self.names))
            elif asked.why == "baseline":
                self._of_whole.append(shown)
        self._tell_rounds()

    def _tell_rounds(self) -> None:
        # Not from inside the procedure, so that each exception comes through.
        while self.on_round is not None and self._began:
            self.on_round(self._began.pop(0))

    def baseline_ran(self, runs: int, chose: int) -> steps.Baseline:
        if not any(self._of_whole):
            runs = len(self._of_whole)
            _, most = wilson_interval(0, runs)
            raise UserError(NEVER_SHOWS.format(count(runs, "call"), math.ceil(100 * most)))
        return steps.Baseline(sum(self._of_whole))

    def failure_fixed(self, runs: int) -> steps.Search:
        return self.start_search()

    def start_search(self, again: tuple[Partition, ...] = ()) -> steps.Search:
        rate = self.rate() if self.keep_rate else 0.0
        # While calls are left it goes back, however often.
        steps_back = min(len(self._lost), steps.MOST_STEPS_BACK - 1)
        rule = Acceptance(
            most_misses=1 + self.iterations,
            rate=rate,
            keep_rate=self.keep_rate,
            steps_back=steps_back,
        )
        free = {element: Environment.of((element,)) for element in self.left}
        n_partitions = self._n_partitions.get(self.left)
        return steps.Search(
            first_round=self.rounds + 1,
            whole=self.whole,
            chain=self._chain,
            pinned=NOTHING,
            free=free,
            rule=rule,
            n_partitions=n_partitions,
            again=again,
        )

    def round_began(self, number: int, round: Round) -> None:
        self.rounds += 1
        self._n_partitions[self.left] = round.n_partitions
        candidates = tuple((candidate.kind, candidate.partition) for candidate in round.candidates)
        all_models = (round.environment, *round.partitions)
        environment, *parts = (
            tuple(self.names[model] for model in models) for models in all_models
        )
        self._began.append(NamedRound(environment, tuple(parts), candidates))

    def judged(self, *_: object) -> None:
        pass

    round_ended = search_ended = judged

    def similar(self, number: int, index: int, environment: Environment) -> bool:
        self._go(*self._chain, environment)
        return True

    def certificate_due(self) -> steps.Certificate:
        self._certificates += 1
        if self._before is None:
            self._before = self.calls.total()
            self._warn_of_price()
        terms = Terms(
            certify_rate=self.certify_rate,
            keep_rate=self.keep_rate,
            error=error_of(self._certificates),
            at_least=self.baseline_runs,
            order_seed=self.seed,
            most_tests=max(self._affordable, FEWEST_TESTS),
        )
        return steps.Certificate(_first_fresh_call(self._certificates), terms)

    def _warn_of_price(self) -> None:
        rate = self.rate()
        likely = tests_in_blocks(rate, self.certify_rate, len(self.left))
        if LONGER * likely > self.most_tests:
            warnings.warn(
                f"the failure shows in about {percent(rate)} of the calls: to certify what is "
                f"left takes about {rounded(likely):,} of them, and most_tests allows "
                f"{self.most_tests:,}; it may end not shown",
                stacklevel=2,
            )

    def certified(self, made: steps.Certified) -> None:
        claims = []
        for named in made.claims:
            shown = sum(
                self._known[named.environment, made.certificate.first_run + run]
                for run in named.runs
            )
            without = None if named.model is None else self.names[named.model]
            claim = named.claim
            low, high = anytime_interval(shown, len(named.runs))
            rate_claim = RateClaim(
                without=without,
                verdict=claim.verdict,
                shown=shown,
                runs=len(named.runs),
                low=low,
                high=high,
                bound=claim.bound,
            )
            claims.append(rate_claim)
        self.claims = tuple(claims)
        if claims[0].verdict != "lost":
            self._shown[self.left] = self.claims

    def stepped_back(self, place: int, again: tuple[Partition, ...], tests: object) -> steps.Search:
        self._lost.append(self._chain[place + 1])
        self._go(*self._chain[: place + 1])
        return self.start_search(again)

    def left_out(self, model: int, environment: Environment) -> steps.Search:
        self._go(*self._chain, environment)
        return self.start_search()

    @property
    def left(self) -> Environment:
        return self._chain[-1]

    def _go(self, *chain: Environment) -> None:
        self._n_partitions.setdefault(chain[-1], self._n_partitions.get(self.left))
        self._chain = chain
        self.history.append(Step(self.calls.total(), self.left.names(self.names)))


def _wrong(what: str, expected: str, found: object) -> UserError:
    return UserError(f"{what}: expected {expected}, found {found!r}")


def _check(**given: Any) -> None:
    """Raises UserError for a value that the setting of this name cannot have in a scenario
    either.
    """
    for name, value in given.items():
        one = SETTINGS[name]
        # To repeat runs exactly takes seeds, and `test` has none.
        choices = [word for word in one.choices if word != "exact"]
        if choices and value not in choices:
            raise UserError(f"{name}: {value!r} is not allowed; use one of {', '.join(choices)}")
        if not one.allows(value.item() if isinstance(value, np.generic) else value):
            raise _wrong(name, one.wanted, value)


def _names(elements: Iterable[str]) -> Names:
    """The elements. Raises UserError if they are no names, or if a name occurs twice."""
    try:
        names = tuple(elements)
        twice = [name for name, times in Counter(names).items() if times > 1]
    except TypeError:
        raise _wrong("elements", "names", elements) from None
    if twice:
        raise UserError(f"elements: {twice[0]!r} occurs twice; give each element its own name")
    return names


def _trajectory(trajectory: Floats | None) -> Floats | None:
    if trajectory is None:
        return None
    try:
        path = np.asarray(trajectory)
        path = path.astype(float, casting="safe" if path.dtype.kind in "cOSU" else "unsafe")
    except (TypeError, ValueError):
        path = np.zeros(0)
    if path.ndim != 2 or path.shape[1] != 5 or not len(path) or not (np.abs(path) <= LARGEST).all():
        raise UserError(
            f"trajectory: expected finite numbers of shape (N, 5), found shape {path.shape}"
        )
    if (np.diff(path[:, 0]) < 0).any():
        raise UserError("trajectory: its times, in the first column, must not decrease")
    return path


def _each(
    what: str,
    values: Mapping[str, Any] | None,
    names: Names | None,
    expected: str,
    read: Callable[[Any], Value | None],
) -> dict[str, Value] | None:
    """What `read` makes of the value of each of `names`, or of all that are there. Raises UserError
    where it makes nothing.
    """
    if values is None:
        return None
    if not isinstance(values, Mapping):
        raise UserError(
            f"{what}: expected a mapping from names to values, found {type(values).__name__}"
        )
    found: dict[str, Value] = {}
    for name in values if names is None else names:
        if (value := read(values.get(name))) is None:
            raise _wrong(f"{what}[{name!r}]", expected, values.get(name))
        found[name] = value
    return found


def _place(values: Any) -> Place | None:
    try:
        x, y, z = [float(value) for value in values][:3]
    except (TypeError, ValueError, OverflowError):
        return None
    bounded = all(abs(number) <= LARGEST for number in (x, y, z))
    if bounded and not isinstance(values, str):
        return (x, y, z)
    return None


def _time(value: Any) -> float | None:
    if isinstance(value, Real) and 0 <= cast(float, value) <= LARGEST:
        return float(value)
    return None


def _first_fresh_call(certificate: int) -> int:
    """The number of the first call that a certificate makes: it chose nothing before."""
    return (1 + certificate) * CALLS_OF_CERTIFICATE
