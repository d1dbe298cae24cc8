"""What the certificates of a run show, in numbers: `ddenv.words.claims` says it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from statistics import median

from ddenv.environment import Environment
from ddenv.evidence.certificate import (
    HELPING,
    Expected,
    NumberedRun,
    Pairs,
    Terms,
    certificate_from_here,
    certificate_tests,
    falls,
    keeps,
    often,
    settle,
    vain_after,
)
from ddenv.evidence.certificate import Claim as Settled
from ddenv.evidence.rates import Shown, anytime_interval, wilson_interval
from ddenv.runfile.fold_decisions import exact_runs, origin, rested_on
from ddenv.runfile.progress import Certificate, Claim, Isolation
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import BROKEN, CERTIFY, OUTCOMES, RunState, Test
from ddenv.runfile.supports import stack_with, stacks_of
from ddenv.text import Names

# After so many pairs without a model, what a certificate still takes is forecast from what it has
# seen.
PAIRS_THAT_SHOW = 10


def is_minimal(certificate: Certificate) -> bool:
    """Whether a certificate shows that what is left keeps the rate of the same failure, and that
    each model in it is needed.
    """
    claims = certificate.claims
    kept = bool(claims) and (claims[0].verdict == "kept" or bool(certificate.seeds))
    return (
        kept
        and certificate.elsewhere is None
        and all(claim.verdict == "needed" for claim in claims[1:])
    )


def helping(certificate: Certificate) -> Names:
    """The models but for which a certificate shows the end to be minimal; the one without which f
    shows most often comes first.
    """
    left, *removals = certificate.claims
    helps = [claim for claim in removals if claim.verdict != "needed"]
    if left.verdict != "kept" or not all(claim.verdict in HELPING for claim in helps):
        return ()
    helps.sort(key=lambda claim: -claim.shown / max(1, claim.runs))
    return tuple(claim.without for claim in helps if claim.without is not None)


def only_helping(certificate: Certificate) -> Names:
    """Those of them without which f is shown to be not much rarer: a user may leave one out."""
    little = {claim.without for claim in certificate.claims if claim.verdict == "helps"}
    return tuple(name for name in helping(certificate) if name in little)


def terms_of(state: RunState, certificate: Certificate) -> Terms:
    """The terms of a certificate of a run, which may go on with the runs of an earlier one."""
    first = next(one for one in state.certificates if one.first_run == certificate.first_run)
    return Terms(
        certify_rate=certificate.certify_rate,
        keep_rate=certificate.keep_rate,
        error=certificate.error,
        at_least=certificate.at_least,
        first_rate=first.certify_rate,
        vain=vain_after(certificate.rate),
    )


def so_far(state: RunState, certificate: Certificate) -> dict[str | None, Settled]:
    """What the runs of a certificate have shown by now, by the model that they leave out; None is
    what is left. Models that no run has left out yet are missing.
    """
    node = state.nodes[certificate.node]
    whole = state.environments[origin(state, certificate.node).id]
    left = state.environments[node.id]
    outcomes = _outcomes(state, certificate)
    rests = {
        test.without: state.environments[test.environment]
        for test in _finished(state, certificate)
        if test.node == certificate.node and test.without
    }

    def shown(environment: Environment, run: int) -> Shown:
        return outcomes.get((environment, run))

    terms = terms_of(state, certificate)
    if certificate.seeds:
        return {None: settle(often(left, terms.at_least), shown)}
    kept = settle(keeps(left, whole, terms), shown)
    error = terms.error_of_models(kept.bound)
    return {
        None: kept,
        **{name: settle(falls(rest, left, error), shown) for name, rest in rests.items()},
    }


def _outcomes(state: RunState, certificate: Certificate) -> dict[NumberedRun, Shown]:
    """What its finished runs showed, by environment and run, counted from its first one."""
    return {
        (state.environments[test.environment], test.run - certificate.first_run): "broken"
        if test.broke
        else test.shows_f
        for test in _finished(state, certificate)
    }


def _finished(state: RunState, certificate: Certificate) -> list[Test]:
    return [
        test
        for test in state.confirm_tests
        if test.run >= certificate.first_run and test.is_finished
    ]


def never_left_out(state: RunState, certificate: Certificate) -> int:
    """How many models of a finished certificate's environment no run leaves out: those that were
    pinned, with their stacks.
    """
    there = state.nodes[certificate.node].environment
    gone = {
        name for claim in certificate.claims for name in stack_with(state, there, claim.without)
    }
    if is_minimal(certificate):
        return len(there) - len(gone)
    return 0


def is_nearest(one: Isolation) -> bool:
    """Whether fresh runs show that a world passes, and that it does not with any one model put
    back.
    """
    return one.found is not None and all(
        claim.verdict in ("passes", "needed") for claim in one.checks[-1].claims
    )


def current(state: RunState) -> Certificate | None:
    """The last finished certificate of the current environment, if there is one; a later one may
    not be finished.
    """
    here = (one for one in reversed(state.certificates) if one.node == state.node and not one.past)
    return next((one for one in here if one.claims), None)


def runs_behind(state: RunState, certificate: Certificate, claim: Claim) -> tuple[Test, ...]:
    """The sound runs of a claim's environment that the certificate rests on (the chosen ones, if
    seeds were), not those made ahead of time.
    """
    if certificate.seeds:
        chosen = exact_runs(state)
        own = [test for test in rested_on(state) if test.run in chosen and test.phase != CERTIFY]
    else:
        fresh = (test for test in state.confirm_tests if state.rests_on >> test.id & 1)
        own = [
            test
            for test in fresh
            if test.node == certificate.node and test.run >= certificate.first_run
        ]
    finished = (test for test in own if test.environment == claim.environment and test.is_finished)
    return tuple({test.run: test for test in finished if not test.broke}.values())


@dataclass(frozen=True, slots=True)
class Instead:
    """Another failure than f: a key of `DEEDS`, the number of runs, and how far from f's end they
    ended, m: median and maximum; NaN where no distance is known.
    """

    failure: str
    runs: int
    away: float
    farthest: float


def failing_instead(state: RunState, certificate: Certificate, claim: Claim) -> Instead | None:
    """What the robot does without a model that is needed, where it mostly fails otherwise and does
    not reach its goal.
    """
    if claim.verdict != "needed" or claim.without is None:
        return None
    runs = [test for test in runs_behind(state, certificate, claim) if not test.shows_f]
    ends = Counter(test.failure if test.outcome == "other" else "pass" for test in runs)
    if not ends or (failure := ends.most_common(1)[0][0]) == "pass":
        return None
    away = [
        test.distance for test in runs if test.failure == failure and test.distance is not None
    ] or [math.nan]
    return Instead(failure, ends[failure], median(away), max(away))


def in_the_making(state: RunState) -> Certificate | None:
    """The certificate that is being made, if there is one."""
    now = state.certificate
    if now is not None and state.confirming and not now.claims:
        return now
    return None


def fresh_runs_made(state: RunState, now: Certificate) -> int:
    """How many runs of the last certificate are finished."""
    return len(_finished(state, now))


def expected_fresh_runs(state: RunState, now: Certificate) -> Expected:
    """How many runs a certificate of the current environment takes, as (low, likely, high)."""
    if now.seeds:
        return now.at_least, now.at_least, now.at_least
    left = len(state.environment) - len(state.pinned.intersection(state.environment))
    before = 0 if state.baseline is None else state.baseline.runs
    expected = certificate_tests(now.rate, now.certify_rate, left, now.at_least, before)
    if now is not in_the_making(state):
        return expected
    outcomes = _outcomes(state, now)
    claims = so_far(state, now)
    removals = [claim for name, claim in claims.items() if name is not None]
    pairs = [len(claim.rests_on) // 2 for claim in removals]
    if max(pairs, default=0) < PAIRS_THAT_SHOW:
        return expected
    seen = Pairs()
    for claim in removals:
        # Each pair is a run without the model and one with it.
        shown = [outcomes[test] is True for test in claim.rests_on]
        for without, with_it in zip(shown[::2], shown[1::2], strict=True):
            seen = seen.after(without, with_it)
    undecided = [made for made, claim in zip(pairs, removals, strict=True) if not claim.verdict]
    undecided += [0] * (left - len(removals))
    left_runs = sum(
        environment == state.environments[state.nodes[now.node].id] for environment, _ in outcomes
    )
    return certificate_from_here(len(outcomes), left_runs, undecided, seen, sum(pairs))


def has_dropped(state: RunState) -> bool:
    """Whether the runs of the current environment so far show that f is rarer in it than it may
    be.
    """
    here = state.here
    if here is None or settings(state).accept_rate == "exact":
        return False
    whole = origin(state, here.number)
    if here is whole or not here.runs or not whole.runs:
        return False
    least = settings(state).keep_rate * whole.shown / len(whole.runs)
    return wilson_interval(here.shown, len(here.runs))[1] < least


@dataclass(frozen=True, slots=True, kw_only=True)
class FreshRuns:
    """Runs with fresh seeds of the environment of `node`, and the `claim` that they make: its
    verdict is "" while they are being made.

    `running` are the tests that run now. `is_left`: all that is left ran. `is_chosen`: the whole
    world ran only where what is left missed f, so these runs say nothing about its rate.
    """

    node: int
    claim: Claim
    running: tuple[Test, ...] = ()
    is_left: bool = False
    is_chosen: bool = False

    @property
    def without(self) -> str | None:
        """The model that is left out."""
        return self.claim.without

    @property
    def has_rate(self) -> bool:
        """Whether the runs say how often f shows."""
        return self.claim.runs > 0 and not self.is_chosen


def fresh_runs(state: RunState) -> tuple[FreshRuns, ...]:
    """The runs of the current environment's certificate: what is left comes first, the world that f
    was seen in last.
    """
    certificate = state.certificate
    if certificate is None:
        return ()
    tests: dict[_Key, list[Test]] = {}
    for test in state.confirm_tests:
        if test.run >= certificate.first_run:
            tests.setdefault((test.node, test.without), []).append(test)
    claims = {(certificate.node, claim.without): claim for claim in certificate.claims}
    bounds: dict[_Key, float | None] = {}
    if not claims:
        for without, claim in so_far(state, certificate).items():
            bounds[certificate.node, without] = claim.bound
    first = origin(state, certificate.node).number
    left_runs = {test.run for test in tests.get((certificate.node, None), [])}
    whole_runs = {test.run for test in tests.get((first, None), [])}
    found: list[FreshRuns] = []
    for key in _environments_run(state, certificate, first, tests):
        node, without = key
        made = tests.get(key, [])
        runs = FreshRuns(
            node=node,
            claim=claims.get(key) or _open_claim(without, made, bounds.get(key)),
            running=tuple(test for test in made if test.outcome == "running"),
            is_left=not found,
            is_chosen=node == first != certificate.node and whole_runs < left_runs,
        )
        found.append(runs)
    return tuple(found)


# The node of an environment, and the model that is left out of it.
_Key = tuple[int, str | None]


def _environments_run(
    state: RunState, certificate: Certificate, first: int, tests: Collection[_Key]
) -> Iterator[_Key]:
    """What is left, that without each model, earlier environments, and the world of node `first`.

    Stacks that are kept together are named by their first models. Where the rate is lost, nothing
    is claimed of removals.
    """
    is_open = not (certificate.claims or certificate.seeds)
    claimed = {claim.without for claim in certificate.claims}
    whole = (first, None)
    keys: list[_Key] = [(certificate.node, None)]
    for name, *others in stacks_of(state, state.environment):
        if state.pinned.isdisjoint((name, *others)) and (is_open or name in claimed):
            keys.append((certificate.node, name))
    yield from keys
    earlier = [key for key in tests if key not in keys and key != whole]
    yield from sorted(earlier, key=lambda key: -key[0])
    # A finished certificate need not have run the whole world.
    if certificate.node != first and (is_open or whole in tests):
        yield whole


def _open_claim(without: str | None, tests: Sequence[Test], bound: float | None) -> Claim:
    """What the finished ones of these tests show so far."""
    counts = Counter(test.outcome for test in tests if test.is_finished)
    shown = counts["similar"]
    runs = counts.total() - sum(counts[outcome] for outcome in BROKEN)
    low, high = anytime_interval(shown, runs)
    return Claim(
        without=without,
        verdict="",
        shown=shown,
        runs=runs,
        low=low,
        high=high,
        outcomes=tuple((outcome, counts[outcome]) for outcome in OUTCOMES if counts[outcome]),
        bound=bound,
    )
