"""`ddenv.reduce`: the reduction as a function, for a test of your own. It needs neither Drake nor a robot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from ddenv.arrays import Floats
from ddenv.errors import UserError
from ddenv.reduction.acceptance import Acceptance
from ddenv.reduction.arguments import (
    checked_choice,
    checked_count,
    checked_failure,
    checked_names,
    checked_number,
    checked_positions,
    checked_share,
    checked_times,
    checked_traits,
    checked_trajectory,
)
from ddenv.reduction.calls import Calls, Test
from ddenv.reduction.evidence import Evidence, Place, Traits
from ddenv.reduction.guide import make_guide, search
from ddenv.reduction.keeping import NOTHING_TO_REDUCE, Keeping
from ddenv.reduction.rate_claims import RateClaim
from ddenv.reduction.round import CANDIDATES, COMPLEMENT_ORDERS, Round
from ddenv.reduction.verdict import standing
from ddenv.reduction.walk import Step, Walk, next_round


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
    baseline_runs: int = 10,
    check: bool = True,
    on_round: Callable[[Round], None] | None = None,
) -> Reduction:
    """Finds a few of `elements` with which `test` still shows the failure; the best end is one of which no single one can go.

        ddenv.reduce("abcdef", lambda kept: kept >= {"a", "e"}, algorithm="ddmin").kept  # ("a", "e")

    `test(frozenset of names)` runs the robot, or anything else, with these elements alone, and returns whether the failure showed.
    A test that returns False is repeated up to `iterations` times, for failures that do not show every time.

    With `accept_rate` "first", the first run with the failure decides, as in the paper; the end may fail far more rarely than all
    elements do. With "kept", the default if there are `iterations`, all elements are run `baseline_runs` times at first, and more
    often if the failure is rare. The search takes what seems to keep `keep_rate` of their failure rate. Fresh runs show at the end
    whether that is so, and without which elements the rate falls below it; where a claim fails, the search steps back or goes on.
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
    checked_share("keep_rate", keep_rate, 0.95)
    checked_choice("accept_rate", accept_rate := accept_rate or ("kept" if iterations else "first"), ("first", "kept"))
    calls, everything = Calls(test), frozenset(names)
    keeping = Keeping(calls, everything, keep_rate, 1 + iterations, baseline_runs)
    guide = make_guide(
        partitioning,
        prioritization,
        lambda: replace(known, trials=calls.trials),
        prior=prior,
        n_partitions=n_partitions,
        candidates=candidates,
        complement_order=complement_order,
        growth=growth,
        skip=skip,
        rate=lambda: keeping.rate if iterations else 1.0,
        runs=lambda: keeping.rule().misses if accept_rate == "kept" else 1 + iterations,
    )
    walk, searching = Walk(names, calls, on_round or (lambda _: None)), search(algorithm, names, guide)
    # Planned before the first test, so that a missing argument is reported at once.
    planned = next_round(searching, None)
    claims: tuple[RateClaim, ...] = ()
    if accept_rate == "kept" or (check and iterations):
        keeping.baseline()
    elif check and not calls.once(everything):
        raise UserError(NOTHING_TO_REDUCE)
    before = calls.others
    if accept_rate == "kept":
        walk.search(searching, keeping.rule(), planned)
        claims = keeping.carry_on(walk)
        minimal = all(claim.verdict in ("kept", "needed") for claim in claims)
    else:
        rule = Acceptance(1 + iterations)
        walk.search(searching, rule, planned)
        rests = [walk.chain[-1] - {name} for name in walk.left]
        minimal = all(standing([rest], calls.known, rule).verdicts[0] == "dissimilar" for rest in rests)
    tests = before, len(calls.trials), calls.others - before
    return Reduction(walk.left, walk.rounds, tuple(walk.history), minimal, *tests, claims)
