"""Isolation: the fewest models that have to go from the whole world so that the robot reaches its
goal. It makes a passing world larger, until putting any one model back makes the robot fail: the
same search with another predicate, over what is removed.

Zeller and Hildebrandt, "Simplifying and Isolating Failure-Inducing Input", 2002; but the failing
end stays the whole world, as in "Debugging Inputs" (Kirschner, Soremekun and Zeller, 2020): else
the result would be the difference of two worlds that nobody has seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from ddenv.environment import NOTHING, Environment, Numbers
from ddenv.evidence.certificate import Claim, Procedure, Wanted, error_of, falls, often
from ddenv.evidence.certificate import Verdict as ClaimVerdict
from ddenv.evidence.rates import estimated_rate, leans_to
from ddenv.reduction.algorithms import ddmin
from ddenv.reduction.procedure import NamedClaim, Runs, Work, judge, settled
from ddenv.reduction.round import Candidate, Partition, Round, Rounds, Stacks
from ddenv.reduction.verdict import Verdict

# A world passes if the robot reaches its goal in so many of its runs, and fails in at most this
# part of those of the whole world.
MOSTLY = 0.9
FAILURES_LEFT = 0.2
# The chance that the search takes a world that does not pass, or misses one that does: fresh runs
# judge the end.
SEARCH_ERROR = 0.05
# After this many runs the likelier side counts; fresh runs that do not decide leave it open.
MOST_RUNS = 60
# Fresh runs judge so many ends; after that the last one stays as it is.
MOST_CHECKS = 6


@dataclass(frozen=True)
class Passing:
    """The rule by which a world passes: the robot reaches its goal at the rate `wanted`, rather
    than at `rather_than`, by Wald's sequential test, with this chance of `error` at either rate.
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

    def run(self, place: int) -> int:
        """The runs are those of the search, from its first one."""
        return place

    def passes_over(self, broken: int, runs: int) -> bool:
        """A world in which a run broke is not called one that passes."""
        return False

    def verdict(self, shown: int, missed: int) -> Verdict:
        """Of a world in which `shown` runs reached the goal and `missed` did not: "similar" if it
        passes; "" while it is open.
        """
        passes = leans_to(shown, missed, self.wanted, self.rather_than, self.error)
        if passes is None and shown + missed >= MOST_RUNS:
            passes = shown / (shown + missed) > math.sqrt(self.wanted * self.rather_than)
        if passes is None:
            return ""
        if passes:
            return "similar"
        return "dissimilar"


@dataclass(frozen=True)
class Each:
    """The rule where chosen runs are reduced exactly: a world passes if the robot reaches its goal
    in each of them.
    """

    exact: Numbers

    def run(self, place: int) -> int:
        """The number of the run at this place, from 0."""
        return self.exact[place]

    def passes_over(self, broken: int, runs: int) -> bool:
        """As `Passing.passes_over`."""
        return False

    def verdict(self, shown: int, missed: int) -> Verdict:
        """As `Passing.verdict`."""
        if missed:
            return "dissimilar"
        if shown == len(self.exact):
            return "similar"
        return ""


@dataclass(frozen=True)
class Checked:
    """Fresh runs of the world without `removed`, and of it with each model of `removed` put back,
    showed these claims.
    """

    removed: Environment
    claims: tuple[NamedClaim, ...]

    @property
    def passes(self) -> bool:
        return self.claims[0].claim.verdict == "passes"


@dataclass(frozen=True, kw_only=True)
class Asked:
    """An isolation: of `whole`, the suspects may go, at first `size` of them; `stacks` has what
    goes with each. Each check has the error of its number, and begins `block` runs after the one
    before.
    """

    whole: Environment
    suspects: Partition
    stacks: Stacks
    size: int
    rule: Passing | Each
    keep_rate: float
    at_least: int
    first_run: int
    block: int


class Driver(Runs, Protocol):
    def checked(self, check: Checked) -> None:
        """Fresh runs have shown this."""


def isolation(
    driver: Driver, asked: Asked, checks: Sequence[Checked] = ()
) -> Work[Environment | None]:
    """Returns what has to go so that the robot passes; None if no such world is found. `checks` are
    known already.
    """
    checks = list(checks)
    while len(checks) < MOST_CHECKS:
        refuted = {
            asked.whole,
            *(asked.whole - check.removed for check in checks if not check.passes),
        }
        smaller = _smaller(asked, checks[-1], refuted) if checks else NOTHING
        if checks and checks[-1].passes and not smaller:
            return checks[-1].removed
        removed = yield from _search(driver, asked, smaller, refuted)
        if not removed:
            return None
        checks.append((yield from _check(driver, asked, removed, len(checks))))
        driver.checked(checks[-1])
    if checks[-1].passes:
        return checks[-1].removed
    return None


def _smaller(asked: Asked, check: Checked, refuted: set[Environment]) -> Environment:
    """What is enough to remove if a check shows that a model may stay; nothing where that was
    refuted.
    """
    needless = next(
        (claim.model for claim in check.claims if claim.claim.verdict == "not needed"), None
    )
    smaller = NOTHING if needless is None else check.removed - asked.stacks.by_first[needless]
    if asked.whole - smaller in refuted:
        return NOTHING
    return smaller


def _search(
    driver: Runs, asked: Asked, smaller: Environment, refuted: set[Environment]
) -> Work[Environment]:
    """What has to go, by the seeds of the search; nothing if the robot does not pass without all
    that may go.
    """
    within = tuple(model for model in asked.suspects if model in smaller)
    searching = ddmin(within) if smaller else isolating(asked.suspects, asked.size)
    algorithm = asked.stacks.expand(searching)
    winner = None
    while True:
        try:
            round = algorithm.send(winner)
        except StopIteration as end:
            removed: Environment = end.value
            return removed
        # What was refuted is not tested again.
        candidates = [one for one in round.candidates if asked.whole - one.models not in refuted]
        worlds = [asked.whole - candidate.models for candidate in candidates]
        place = yield from judge(driver, worlds, asked.rule, "isolate")
        winner = None if place is None else candidates[place]


def _check(driver: Runs, asked: Asked, removed: Environment, number: int) -> Work[Checked]:
    """Fresh runs show whether the world without `removed` passes, and whether it does with each
    model of it put back.
    """
    passing = asked.whole - removed
    error = error_of(number + 1) / 2.0
    backs = {
        model: passing | asked.stacks.by_first[model]
        for model in asked.suspects
        if model in removed
    }
    rule = asked.rule
    first = asked.first_run + number * asked.block
    if isinstance(rule, Each):
        runs = iter([(None, passing, often(passing, asked.at_least))])
        (rate,) = yield from settled(driver, runs, lambda _: False, first, "isolate")
        named = [replace(rate, claim=replace(rate.claim, verdict="passes"))]
        for model, with_it in backs.items():
            # The search has made these runs: the robot misses its goal in one of them if the model
            # is needed.
            shown = {run: driver.shown(with_it, run, full=True) for run in rule.exact}
            known = tuple(run for run, one in shown.items() if one is not None)
            verdict: ClaimVerdict = "not shown"
            if False in shown.values():
                verdict = "needed"
            elif known == rule.exact:
                verdict = "not needed"
            named.append(NamedClaim(model, with_it, Claim(verdict=verdict), known))
        return Checked(removed, tuple(named))
    certain = replace(rule, error=error)

    def claims() -> Iterator[tuple[int | None, Environment, Procedure]]:
        yield None, passing, passes(passing, certain, asked.at_least)
        for model, with_it in backs.items():
            yield model, with_it, falls(with_it, passing, error, asked.keep_rate)

    def ends(claim: NamedClaim) -> bool:
        if claim.model is None:
            return claim.claim.verdict != "passes"
        return claim.claim.verdict == "not needed"

    return Checked(removed, (yield from settled(driver, claims(), ends, first, "isolate")))


def isolating(suspects: Partition, first: int) -> Rounds:
    """What has to go from the whole world; empty if the robot does not pass even without all
    `suspects`.

    "similar" is a world that passes without a candidate's models. First go the `first` of the
    suspects, then twice as many, until the robot passes; of those ddmin puts back as many as it
    can, so that the removal is 1-minimal.
    """
    size = max(1, first)
    while suspects:
        group = suspects[:size]
        whole = Environment.of(suspects)
        models = Environment.of(group)
        # Its one candidate may be all suspects.
        candidate = Candidate(
            kind="partition", partition=0, part=group, models=models, lacks=whole - models
        )
        winner = yield Round(
            n_partitions=1,
            environment=suspects,
            partitions=(group,),
            scores=(0.0,),
            candidates=(candidate,),
        )
        if winner is not None:
            return (yield from ddmin(group))
        if size >= len(suspects):
            break
        size *= 2
    return NOTHING


def passes(world: Environment, rule: Passing, at_least: int) -> Procedure:
    """Whether fresh runs show that `world` passes, from at least so many: "passes", "fails" or "not
    shown".

    "passes" is wrong with a probability of at most about the error of the rule: then the rate is no
    higher than `rather_than`.
    """
    reached = runs = broken = 0
    found: bool | None = None
    while found is None and runs < MOST_RUNS:
        (shown,) = yield Wanted(((world, runs),), (world,))
        reached = reached + (shown is True)
        runs = runs + 1
        broken = broken + (shown == "broken")
        # A run that broke counts against what is claimed.
        terms = rule.wanted, rule.rather_than, rule.error
        fails, passing = (leans_to(reached, runs - reached - less, *terms) for less in (broken, 0))
        if passing:
            found = True
        elif fails is False:
            found = False
    for run in range(runs, at_least if found else 0):
        yield Wanted(((world, run),), (world,))
    if found is None:
        return "not shown", None
    return ("passes" if found else "fails"), None
