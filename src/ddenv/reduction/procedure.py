"""What ddenv does, from the first run of the whole world to a certified end: one pure coroutine.

It runs nothing itself. It yields the tests that it needs, and goes on once some of them have ended;
all else it asks and tells its `Driver`. The engine drives it with workers and a run file,
`ddenv.reduce` with a function. A resumed run drives it again through what is known.

1. `baseline`: the whole world is run; its failure is f.
2. `search_on`: an algorithm yields rounds of candidates. The first one that shows f becomes the
environment.
3. `certify`: fresh runs show whether what is left keeps the rate of f, and that without each model
the rate falls. 4. `onward`: where a claim fails, the search goes back to what is not shown to have
lost the rate, or on without a model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, zip_longest
from random import Random
from typing import Protocol, TypeVar

from ddenv.environment import Environment, Numbers
from ddenv.evidence.certificate import (
    HELPING,
    NEEDED_SHARE,
    Claim,
    NumberedRun,
    Procedure,
    Settling,
    Terms,
    Verdict,
    falls,
    good_enough,
    keeps,
    often,
)
from ddenv.evidence.rates import Shown, ShownIn
from ddenv.reduction.round import Candidate, Partition, Round, Rounds
from ddenv.reduction.verdict import (
    FEWEST_SHOWN,
    LONGEST_BASELINE,
    Acceptance,
    Rule,
    decided_by,
    standing,
    unproven,
)

# After this many steps back what is left stays as it is, and is not called minimal. Where each of
# many models takes a bit of the rate, more of them doubled the runs (7,016 to 14,405 of a pile with
# a rate of .32) and found nothing better.
MOST_STEPS_BACK = 5
# In blocks, claims about models begin once so much of the rate is shown to be kept: where f always
# shows, after 4 of 11 pairs.
LOOKS_KEPT_BOUND = 1 / 3
# So many blocks decide whether a model is needed, where f shows often with it and never without it.
ENOUGH_BLOCKS = 20

Result = TypeVar("Result", covariant=True)


@dataclass(frozen=True, kw_only=True)
class Test:
    """Run number `run` of an environment. With `full` it runs to its end, whatever its purpose.

    `why` is "baseline", "round" (for candidate number `candidate`, or None for what is left),
    "certify" or "isolate"; "hand" and "audit" are tests that the driver makes beside the procedure.
    `without` is the model that a fresh run leaves out.
    """

    environment: Environment
    run: int
    why: str
    candidate: int | None = None
    without: int | None = None
    full: bool = False


# Yields the tests that are needed next, in the order in which a single worker would make them, and
# goes on once some have ended.
Work = Generator[tuple[Test, ...], None, Result]


@dataclass(frozen=True)
class Baseline:
    """How many of the runs that give the rate showed f, whether several failures competed to be f,
    and whether all runs show f and have the same bits.
    """

    failures: int
    competed: bool = False
    alike: bool = False


@dataclass(frozen=True)
class Past:
    """A round that was judged before this driver began: its winner's place among the candidates, or
    None.
    """

    winner: int | None


@dataclass(frozen=True, kw_only=True)
class Search:
    """Where a search begins: `chain` leads to the environment that is searched, from the first one
    to which it may go back. What is left has to keep the rate of f in `whole`.

    `pinned` models always stay. `free` are the models that may go, each with those that go with it.
    `rule` says when a candidate is taken. The first round has `n_partitions`, None for the usual
    number. The groups `again` are left out first.
    """

    first_round: int
    whole: Environment
    chain: tuple[Environment, ...]
    pinned: Environment
    free: dict[int, Environment]
    rule: Acceptance
    n_partitions: int | None = None
    again: tuple[Partition, ...] = ()


@dataclass(frozen=True)
class Certificate:
    """The terms of all claims of a certificate together. Its run number 0 has the seed of run
    `first_run`. With `exact` it claims what these runs of the search show; its fresh runs say how
    often f shows with other seeds.
    """

    first_run: int
    terms: Terms
    exact: Numbers = ()


@dataclass(frozen=True)
class NamedClaim:
    """A claim about an environment: what is left, or that without `model`. It rests on the runs
    `exact` of the search, or on fresh ones.
    """

    model: int | None
    environment: Environment
    claim: Claim
    exact: Numbers = ()

    @property
    def runs(self) -> Numbers:
        """The fresh runs of its environment on which it rests, counted from the certificate's first
        one.
        """
        return tuple(
            run for environment, run in self.claim.rests_on if environment == self.environment
        )


@dataclass(frozen=True)
class Certified:
    """What fresh runs show of what is left, and then of it without each model, up to a claim that
    ends the certificate.
    """

    certificate: Certificate
    claims: tuple[NamedClaim, ...]


class Runs(Protocol):
    """The runs of one predicate, as far as they are known: what judges candidates and settles
    claims asks for.
    """

    def shown(self, environment: Environment, run: int, full: bool = False) -> Shown:
        """Whether a run showed what is looked for; None if it has not ended. With `full` only a run
        to its end counts.
        """

    def refused(self, environment: Environment) -> bool:
        """Whether the environment is not taken: the user refused it, or it is part of what lost the
        rate.
        """

    def refused_by_user(self, environment: Environment) -> bool:
        """Whether the user refused it."""

    @property
    def refusals(self) -> int:
        """How often that has changed."""

    @property
    def workers(self) -> int:
        """How many tests can be made at the same time."""

    def judged(self, index: int, environment: Environment, verdict: str, runs: int) -> None:
        """Candidate number `index` is "similar", "missed" (by fewer runs than usual), "dissimilar"
        or "unknown". Its first `runs` runs decided; with none, it is part of what lost the rate.
        """


class Driver(Runs, Protocol):
    """What the procedure asks and tells. All answers follow from tests that have ended, and from
    decisions of the user. Where one of these, or a slice, ends the search, any method may raise
    `Changed`; it goes on with `start_search`.
    """

    def rate(self) -> float:
        """The rate of f in the world in which it was seen, from all of its runs that decisions rest
        on.
        """

    def goes_on(self) -> bool:
        """Whether the search goes on by itself where a claim of its certificate fails."""

    def baseline_ran(self, runs: int, chose: int) -> Baseline | None:
        """What these runs of the whole world show, of which the first `chose` only choose f; None:
        no failure to reduce.
        """

    def failure_fixed(self, runs: int) -> Search:
        """The baseline of so many runs is over; returns the search that begins."""

    def start_search(self) -> Search:
        """The next search, after `Changed`."""

    def algorithm(self, search: Search) -> Rounds:
        """The algorithm, before its first round."""

    def round_began(self, number: int, round: Round) -> Past | None:
        """Returns what is known of the round, if it is over already."""

    def similar(self, number: int, index: int, environment: Environment) -> bool:
        """Candidate number `index` of a round can become the environment; returns whether it
        does.
        """

    def round_ended(self, number: int, winner: int | None) -> None:
        """`winner` is the place of the candidate that became the environment."""

    def search_ended(self, environment: Environment) -> None:
        """Nothing more can be left out of an environment by the search."""

    def certificate_due(self) -> Certificate:
        """The certificate for which fresh runs are made now."""

    def certified(self, made: Certified) -> None:
        """A certificate is finished."""

    def stepped_back(
        self, place: int, again: tuple[Partition, ...], tests: tuple[NumberedRun, ...]
    ) -> Search:
        """What is left lost the rate, by these fresh tests, as (environment, run): the search goes
        back to place number `place` of the chain, and leaves out the groups `again` first. The
        environment at `place` + 1 and all its parts are not taken again.
        """

    def left_out(self, model: int, environment: Environment) -> Search:
        """Without `model` f shows about as often, so the search goes on in `environment`."""


class Changed(Exception):
    """A decision of the user, or a slice, ends a search."""


def procedure(
    driver: Driver,
    whole: Environment,
    baseline_runs: int,
    keeps_rate: bool,
    search: Search | None = None,
    enough_alike: int | None = None,
) -> Work[Certified | None]:
    """The whole reduction, or all from `search` on. Returns the last certificate; None if there was
    no failure to reduce.
    """
    certified = None
    if search is None:
        search = yield from baseline(driver, whole, baseline_runs, keeps_rate, enough_alike)
    while search is not None:
        try:
            chain = yield from search_on(driver, search)
            driver.search_ended(chain[-1])
            certified = yield from certify(driver, search, chain)
            search = yield from onward(driver, search, chain, certified)
        except Changed:
            search = driver.start_search()
    return certified


def baseline(
    driver: Driver, whole: Environment, runs: int, keeps_rate: bool, enough_alike: int | None = None
) -> Work[Search | None]:
    """Runs the whole world. To keep the rate of a rare f, it goes on, one run at a time, so that
    workers change nothing. If the first `enough_alike` runs are alike to the last bit, no more are
    made.

    Where several failures competed, the most frequent one was lucky in the runs that chose it: as
    many others give its rate.
    """
    chose = 0
    usual = runs
    runs = min(usual, enough_alike or usual)
    while True:
        while missing := [run for run in range(runs) if driver.shown(whole, run) is None]:
            yield tuple(Test(environment=whole, run=run, why="baseline") for run in missing)
        found = driver.baseline_ran(runs, chose)
        if runs < usual and not (found and found.alike):
            runs = usual
            continue
        if found is None:
            return None
        if keeps_rate and found.failures < FEWEST_SHOWN and runs < LONGEST_BASELINE:
            runs += 1
        elif keeps_rate and found.competed and not chose:
            chose = runs
            runs = runs + usual
        else:
            return driver.failure_fixed(runs)


def search_on(driver: Driver, search: Search) -> Work[tuple[Environment, ...]]:
    """Takes what the algorithm finds, to its end; returns the chain of environments."""
    chain = search.chain
    algorithm = driver.algorithm(search)
    winner = None
    number = search.first_round
    while True:
        try:
            round = algorithm.send(winner)
        except StopIteration:
            return chain
        winner = yield from _round(driver, search, number, round)
        if winner is not None:
            chain = (*chain, winner.models | search.pinned)
        number += 1


def _round(driver: Driver, search: Search, number: int, round: Round) -> Work[Candidate | None]:
    """Tests the candidates of a round until one is similar, and accepted; returns it, or None."""
    past = driver.round_began(number, round)
    if past is not None:
        if past.winner is None:
            return None
        return round.candidates[past.winner]
    environments = [candidate.models | search.pinned for candidate in round.candidates]
    rule = search.rule.within(round.runs)
    while True:
        winner = yield from judge(driver, environments, rule, "round", search.rule)
        if winner is None or driver.similar(number, winner, environments[winner]):
            break
    driver.round_ended(number, winner)
    if winner is None:
        return None
    return round.candidates[winner]


def judge(
    driver: Runs,
    environments: Sequence[Environment],
    rule: Rule,
    why: str,
    usual: Rule | None = None,
) -> Work[int | None]:
    """Tests environments until one is similar by `rule`; returns its place, or None when all are
    judged.

    Verdicts come in order: tests of later ones that have ended wait. What is dissimilar, but not by
    the `usual` rule, was missed. Nothing is similar before its first run that showed what is looked
    for has shown it to its end.
    """
    judged = 0
    refusals = driver.refusals
    while True:
        if refusals != driver.refusals:
            # The user may want a candidate that was passed over after all.
            judged = 0
            refusals = driver.refusals
        in_full = False
        candidates = islice(environments, judged, None)
        verdicts, wanted = standing(
            candidates, driver.shown, rule, driver.refused, first=judged, enough=driver.workers
        )
        for verdict in verdicts:
            if not verdict:
                break
            environment = environments[judged]
            if (
                verdict == "similar"
                and (run := unproven(driver.shown, environment, rule)) is not None
            ):
                wanted = [(judged, run)]
                in_full = True
                break
            if driver.refused(environment):
                # Part of what lost the rate, unless the user refused it.
                if not driver.refused_by_user(environment):
                    driver.judged(judged, environment, "missed", 0)
            else:
                # By these runs alone: more of them may have ended.
                decision = decided_by(driver.shown, environment, rule)
                missed = (
                    verdict == "dissimilar"
                    and usual is not None
                    and not usual.verdict(decision.shown, decision.missed)
                )
                driver.judged(judged, environment, "missed" if missed else verdict, decision.runs)
            if verdict == "similar":
                return judged
            judged += 1
        if not wanted:
            return None
        yield tuple(
            Test(environment=environments[index], run=run, why=why, candidate=index, full=in_full)
            for index, run in wanted
        )


def certify(driver: Driver, search: Search, chain: Sequence[Environment]) -> Work[Certified]:
    """Fresh runs show whether what is left keeps the rate of f, and whether it falls without each
    model.
    """
    left = chain[-1]
    whole = search.whole
    while missing := [run for run in search.rule.exact if driver.shown(left, run) is None]:
        yield tuple(Test(environment=left, run=run, why="round") for run in missing)
    certificate = driver.certificate_due()
    rests = {model: left - stack for model, stack in search.free.items() if stack <= left}
    fresh = _fresh(driver, certificate.first_run)

    def ends(claim: NamedClaim) -> bool:
        verdict = claim.claim.verdict
        if claim.model is not None:
            return (
                verdict == "not needed"
                and driver.goes_on()
                and not driver.refused(claim.environment)
            )
        if verdict != "not shown":
            return verdict == "lost"
        return all(fresh(left, run) is not True for run in claim.runs)

    settle_claims = _settled_in_turn if certificate.terms.order_seed is None else _settled_in_blocks
    made = yield from settle_claims(driver, certificate, left, whole, rests, ends)
    if certificate.exact:
        # The search has made these runs.
        for model, rest in rests.items():
            shown = [driver.shown(rest, run) for run in certificate.exact]
            verdict: Verdict = "needed"
            if True in shown:
                verdict = "not needed"
            elif "broken" in shown:
                verdict = "unknown"
            elif None in shown:
                verdict = "not shown"
            claim = Claim(verdict=verdict)
            made = (*made, NamedClaim(model, rest, claim, certificate.exact))
    certified = Certified(certificate, made)
    driver.certified(certified)
    return certified


def _settled_in_turn(
    driver: Driver,
    certificate: Certificate,
    left: Environment,
    whole: Environment,
    rests: Mapping[int, Environment],
    ends: Callable[[NamedClaim], bool],
) -> Work[tuple[NamedClaim, ...]]:
    """The claims of a certificate with seeds, up to one that `ends` them."""
    terms = certificate.terms

    def claims(error: float) -> Iterator[tuple[int | None, Environment, Procedure]]:
        yield (
            None,
            left,
            often(left, terms.at_least) if certificate.exact else keeps(left, whole, terms),
        )
        for model, rest in () if certificate.exact else rests.items():
            yield model, rest, falls(rest, left, error)

    def settled_with(error: float) -> Work[tuple[NamedClaim, ...]]:
        return settled(driver, claims(error), ends, certificate.first_run, "certify")

    # Models are taken to be in turn, until the rate turns out not to be kept.
    made = yield from settled_with(terms.error_of_models(1.0))
    if (error := terms.error_of_models(made[0].claim.bound)) < terms.error_of_models(1.0):
        made = yield from settled_with(error)
    if _is_minimal_but_for(made):
        made = yield from settled_with(error / len(rests))
    return made


def _is_minimal_but_for(made: Sequence[NamedClaim]) -> bool:
    """Whether "minimal but for" some models will be said: the runs chose about which models, so
    each claim gets a smaller error.
    """
    verdicts = {one.claim.verdict for one in made}
    return verdicts <= {"kept", "needed", *HELPING} and not verdicts.isdisjoint(HELPING)


def settled(
    driver: Runs,
    claims: Iterator[tuple[int | None, Environment, Procedure]],
    ends: Callable[[NamedClaim], bool],
    first_run: int,
    why: str,
) -> Work[tuple[NamedClaim, ...]]:
    """Makes fresh runs until each of `claims` has a verdict, up to one that `ends` them; returns
    them.
    """

    fresh = _fresh(driver, first_run)
    opened: list[tuple[int | None, Environment, Settling]] = []
    while True:
        named: list[NamedClaim] = []
        # Each open claim has work for a worker.
        while (
            not (named and ends(named[-1]))
            and sum(not one.claim.verdict for one in named) < driver.workers
        ):
            if len(named) == len(opened):
                opened += [
                    (model, world, Settling(procedure))
                    for model, world, procedure in islice(claims, 1)
                ]
            if len(named) == len(opened):
                break
            model, environment, settling = opened[len(named)]
            named.append(NamedClaim(model, environment, settling.claim(fresh, driver.workers)))
        # Of each pair the larger world first: its run may imply the other one.
        next_ones = [sorted(one.claim.wanted, key=lambda test: -len(test[0])) for one in named]
        later = zip_longest(*(one.claim.later for one in named))
        without = {one.environment: one.model for one in reversed(named)}
        wants = dict.fromkeys(
            Test(
                environment=environment,
                run=first_run + run,
                why=why,
                without=without.get(environment),
            )
            for tests in (*next_ones, *later)
            for environment, run in filter(None, tests)
        )
        if not wants:
            return tuple(named)
        yield tuple(wants)


def _settled_in_blocks(
    driver: Driver,
    certificate: Certificate,
    left: Environment,
    whole: Environment,
    rests: Mapping[int, Environment],
    ends: Callable[[NamedClaim], bool],
) -> Work[tuple[NamedClaim, ...]]:
    """The claims of a certificate without seeds, up to one that `ends` them. One run of `left`
    serves all claims of its block.

    Models have their turn once it looks as if `left` kept the rate: until then their runs may be
    for nothing. They have none if the tests that are left decide too little of each.
    """
    first_run = certificate.first_run
    terms = certificate.terms

    fresh = _fresh(driver, first_run)
    without = {rest: model for model, rest in rests.items()}

    def claims_of(models: Mapping[int, Settling]) -> list[NamedClaim]:
        return [NamedClaim(model, rests[model], one.claim(fresh)) for model, one in models.items()]

    kept = Settling(keeps(left, whole, terms))
    models: dict[int, Settling] = {}
    error = terms.error_of_models(1.0)
    made = first = 0
    # The last one that has begun.
    block = -1
    # Whether claims have the error of those that are chosen by what the runs show.
    chosen = False
    while True:
        of_left = NamedClaim(None, left, kept.claim(fresh))
        named = [of_left, *claims_of(models)]
        in_turn = terms.error_of_models(of_left.claim.bound)
        ended = next(filter(ends, named), None)
        if ended is not None or _left_of(terms, made) <= 0:
            if models and in_turn < error:
                named = [of_left, *claims_of(_opened(rests, left, in_turn, first))]
            return _without_more_runs(named, ended)
        if of_left.claim.verdict and in_turn < error:
            # Models were taken to be in turn. Blocks that are over do not go on.
            error = in_turn
            models = {}
        if (
            not models
            and _left_of(terms, made) >= ENOUGH_BLOCKS * len(rests) > 0
            and _have_turn(of_left, fresh)
        ):
            first = block + 1
            models = _opened(rests, left, error, first)
            continue
        wanted = {test for one in named for test in one.claim.wanted}
        if not wanted and not chosen and _is_minimal_but_for(named):
            chosen = True
            error /= len(rests)
            models = _opened(rests, left, error, first)
            continue
        if not wanted:
            return tuple(named)
        block = min(run for _, run in wanted)
        order = _in_drawn_order((test for test in wanted if test[1] == block), terms.order_seed)
        made += 1
        yield tuple(
            Test(environment=one, run=first_run + run, why="certify", without=without.get(one))
            for one, run in order
        )


def _fresh(driver: Runs, first_run: int) -> ShownIn:
    """Asks for full runs by their number, counted from the first one of a certificate."""
    return lambda environment, run: driver.shown(environment, first_run + run, full=True)


def _opened(
    rests: Mapping[int, Environment], left: Environment, error: float, first: int
) -> dict[int, Settling]:
    """A claim of each model, with runs from block number `first` on."""
    return {model: Settling(falls(rest, left, error, first=first)) for model, rest in rests.items()}


def _without_more_runs(
    named: Iterable[NamedClaim], ended: NamedClaim | None
) -> tuple[NamedClaim, ...]:
    """What is said of these claims. To a search that goes on after one `ended`, those that are
    still open are of no use.
    """
    used = (one for one in named if ended is None or one.model in (None, ended.model))
    return tuple(
        one if one.claim.verdict else replace(one, claim=replace(one.claim, verdict="not shown"))
        for one in used
    )


def _in_drawn_order(tests: Iterable[NumberedRun], seed: int | None) -> list[NumberedRun]:
    return sorted(tests, key=lambda test: Random(f"{seed} {test[1]} {test[0].bits}").random())


def _left_of(terms: Terms, made: int) -> float:
    """How many tests of a certificate may still be made."""
    if terms.most_tests is None:
        return math.inf
    return terms.most_tests - made


def _have_turn(of_left: NamedClaim, fresh: ShownIn) -> bool:
    """Whether what is left is judged, or seems to keep the rate that the search aims at and is
    shown to keep a part of it.
    """
    claim = of_left.claim
    if claim.verdict or (claim.bound or 0.0) < LOOKS_KEPT_BOUND:
        return bool(claim.verdict)
    with_f = [environment for environment, run in claim.rests_on if fresh(environment, run) is True]
    of_what_is_left = with_f.count(of_left.environment)
    return of_what_is_left >= NEEDED_SHARE * (len(with_f) - of_what_is_left)


def onward(
    driver: Driver, search: Search, chain: Sequence[Environment], certified: Certified
) -> Work[Search | None]:
    """Where the search goes on after a certificate; None if it has come to its end."""
    if not driver.goes_on():
        return None
    left, *removals = certified.claims
    if left.claim.verdict == "lost":
        if search.rule.steps_back < MOST_STEPS_BACK and len(chain) > 1:
            return (yield from _step_back(driver, chain, certified))
        return None
    for claim in removals:
        if (
            claim.model is not None
            and claim.claim.verdict == "not needed"
            and not driver.refused(claim.environment)
        ):
            return driver.left_out(claim.model, claim.environment)
    return None


def _step_back(driver: Driver, chain: Sequence[Environment], certified: Certified) -> Work[Search]:
    """Back to the last environment that is not shown to have lost the rate of all runs of the whole
    world.

    Only runs by the seeds of this certificate count: by others it was taken, or went back to, which
    favour it.
    """
    first = certified.certificate.first_run
    terms = certified.certificate.terms
    lost = certified.claims[0]
    rate = driver.rate()
    fresh = _fresh(driver, first)
    sound = [shown for run in lost.runs if isinstance(shown := fresh(lost.environment, run), bool)]
    lost_rate = sum(sound) / max(1, len(sound))
    claims: dict[Environment, Claim] = {}

    def judged(environment: Environment) -> Claim:
        shows = good_enough(environment, rate, terms.keep_rate, lost_rate)
        claims[environment] = Settling(shows).claim(fresh, driver.workers)
        return claims[environment]

    while not isinstance(place := last_good(chain, judged), int):
        yield tuple(
            Test(environment=environment, run=first + run, why="certify")
            for environment, run in place
        )
    again = tuple(groups_again(chain[place], chain[place + 1], chain[-1]))
    tests = tuple(
        (environment, first + run)
        for claim in claims.values()
        for environment, run in claim.rests_on
    )
    return driver.stepped_back(place, again, tests)


def groups_again(good: Environment, bad: Environment, end: Environment) -> list[Partition]:
    """What to leave out of `good` at once: all that went after `bad`, then halves of what went from
    `good` to `bad`.
    """
    later = tuple(bad - end)
    step = tuple(good - bad)
    halves = [step[: len(step) // 2], step[len(step) // 2 :]] if len(step) > 1 else []
    return [group for group in (later, *halves) if group]


def last_good(
    chain: Sequence[Environment], judged: Callable[[Environment], Claim]
) -> int | tuple[NumberedRun, ...]:
    """The place of the last environment of `chain` not shown to have lost the rate, or the tests
    (models, run) needed to know it.

    `chain` ends with what has lost it; the next one has, too. By bisection: it assumes that the
    rate falls along the chain.
    """
    good = 0
    bad = len(chain) - 1
    while bad - good > 1:
        place = (good + bad) // 2
        claim = judged(chain[place])
        if not claim.verdict:
            return claim.wanted + claim.later
        good, bad = (place, bad) if claim.verdict == "kept" else (good, place)
    return good
