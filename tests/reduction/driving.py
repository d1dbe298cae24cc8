"""A driver of the procedure for tests: workers that end in any order, over an oracle that draws
each run from its seed.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from functools import partial
from itertools import count, takewhile

from ddenv.environment import NOTHING, Environment
from ddenv.evidence.certificate import Terms, error_of
from ddenv.evidence.rates import estimated_rate
from ddenv.reduction.algorithms import tried_again
from ddenv.reduction.guide import begin_search, make_guide
from ddenv.reduction.procedure import Baseline, Certificate, Changed, Past, Search, Test
from ddenv.reduction.round import Stacks
from ddenv.reduction.verdict import Acceptance
from tests.reduction.worlds import evidence

FIRST_FRESH, EACH_CERTIFICATE = 10_000, 2_000


@dataclass(frozen=True)
class World:
    """Models of which f needs some. Without each `useful` one it is rarer; a share of all runs
    breaks.

    Models with the same label in `labels` are a stack; those with the label `pinned` always stay.
    With `keeps_rate` the search keeps the rate of f, else the first run with f decides.
    """

    labels: tuple[int, ...]
    needed: Environment
    useful: Environment
    algorithm: str
    seed: int
    rate: float = 0.95
    factor: float = 0.4
    breaks: float = 0.0
    iterations: int = 1
    keeps_rate: bool = True
    pinned: int | None = None
    baseline_runs: int = 5
    competes: bool = False

    @property
    def whole(self) -> Environment:
        return Environment.whole(len(self.labels))

    def stack(self, label: int) -> Environment:
        return Environment.of(model for model, each in enumerate(self.labels) if each == label)

    def rate_in(self, environment: Environment) -> float:
        """The true rate of f."""
        return (
            self.rate * self.factor ** len(self.useful - environment)
            if self.needed <= environment
            else 0.0
        )

    def outcome(self, environment: Environment, run: int) -> bool | str:
        """Of a run, the same whenever it is made."""
        draw = random.Random(f"{self.seed} {environment.bits} {run}")
        return (
            "broken" if draw.random() < self.breaks else draw.random() < self.rate_in(environment)
        )


@dataclass
class Known:
    """What a run file would hold: the outcomes of tests, and what was decided."""

    outcomes: dict[tuple[Environment, int], bool | str] = field(default_factory=dict)
    # The winner's place of each round that is over, and candidates that tests which broke left
    # open, as (round, environment).
    past: dict[int, int | None] = field(default_factory=dict)
    unknown: set[tuple[int, Environment]] = field(default_factory=set)


@dataclass
class Now:
    """Where the search stands."""

    chain: tuple[Environment, ...]
    round: int = 0
    certificates: int = 0
    n_partitions: dict[Environment, int] = field(default_factory=dict)
    lost: list[Environment] = field(default_factory=list)
    # The runs of the whole world that decisions rest on.
    of_whole: set[int] = field(default_factory=set)
    again: tuple[tuple[int, ...], ...] = ()


class Killed(Exception):
    """There is no driver any more."""


class Driver:
    """Makes the tests of `outcome` with so many workers; `order` says which of them end first.

    `facts` are what it was asked or told that is no test, each with the method's name first;
    `steps` counts these and its wants. At a step `interrupt` raises an exception, (step,
    exception).
    """

    def __init__(
        self, world: World, workers: int = 1, order: int = 0, known: Known | None = None
    ) -> None:
        self.world, self.workers, self.refusals = world, workers, 0
        self.outcome: Callable[[Environment, int], bool | str] = world.outcome
        self.known, self.now = known or Known(), Now((world.whole,))
        self.facts: list[tuple] = []
        self.steps = 0
        self.interrupt: tuple[int, Exception] | None = None
        self.made: list[Test] = []
        self.vetoed: set[Environment] = set()
        # Each search, with where it began and how many facts were before.
        self.searches: list[tuple[Search, Now, int]] = []
        self._order, self._running = random.Random(order), []
        self._round = None

    def shown(self, environment, run, full=False):
        return self.known.outcomes.get((environment, run))

    def refused_by_user(self, environment):
        return environment in self.vetoed

    def refused(self, environment):
        return environment in self.vetoed or any(environment <= lost for lost in self.now.lost)

    def rate(self):
        shown = [self.known.outcomes[self.world.whole, run] for run in self.now.of_whole]
        sound = [one for one in shown if one != "broken"]
        return estimated_rate(sum(sound), len(sound))

    def goes_on(self):
        return True

    def algorithm(self, search):
        facts = evidence(len(self.world.labels), self.world.seed)
        stacks = Stacks(search.free)

        def broke(candidate):
            environment = search.pinned | Environment.of(stacks.expanded(candidate.models))
            return (self.now.round, environment) in self.known.unknown

        guide = make_guide(
            "timeseg",
            "failure-proximal",
            lambda: facts,
            n_partitions=search.n_partitions or 2,
            growth="steady",
            skip="implied",
            rate=lambda: search.rule.rate or 1.0,
            runs=lambda: search.rule.misses,
            broke=broke,
            proves=search.rule.proves,
        )
        inside = tuple(
            first for first, stack in stacks.by_first.items() if stack <= search.chain[-1]
        )
        return stacks.expand(
            tried_again(
                inside, search.again, lambda left: begin_search(self.world.algorithm, left, guide)
            )
        )

    def search(self, again=()):
        """The next search, from what is left."""
        pinned = NOTHING if self.world.pinned is None else self.world.stack(self.world.pinned)
        labels = dict.fromkeys(self.world.labels)
        groups = Stacks.of(
            stack for label in labels if not (stack := self.world.stack(label)) <= pinned
        )
        free = {
            model: stack for model, stack in groups.by_first.items() if stack <= self.now.chain[-1]
        }
        rate = self.rate() if self.world.keeps_rate else 0.0
        rule = Acceptance(
            most_misses=1 + self.world.iterations,
            rate=rate,
            keep_rate=0.8,
            steps_back=len(self.now.lost),
        )
        n_partitions = self.now.n_partitions.get(self.now.chain[-1])
        search = Search(
            first_round=self.now.round + 1,
            whole=self.world.whole,
            chain=self.now.chain,
            pinned=pinned,
            free=free,
            rule=rule,
            n_partitions=n_partitions,
            again=tuple(again),
        )
        self.searches.append((search, deepcopy(self.now), len(self.facts)))
        return search

    start_search = search

    def drive(self, work, most=None):
        """Carries it to its end, and returns what it returns; None if it was killed, or after
        `most` steps.
        """
        go = partial(next, work)
        while most is None or self.steps < most:
            try:
                wanted = go()
            except StopIteration as end:
                return end.value
            except Killed:
                return None
            go = partial(next, work)
            try:
                self._step()
                self._work(wanted)
            except (Changed, Killed) as error:
                go = partial(work.throw, error)
        return None

    def _step(self, *fact):
        if self.interrupt is not None and self.steps >= self.interrupt[0]:
            (_, error), self.interrupt = self.interrupt, None
            raise error
        self.steps += 1
        self.facts += [fact] if fact else []

    def _work(self, wanted):
        """Makes tests until some have ended."""
        assert wanted
        assert len(set(wanted)) == len(wanted)
        for test in wanted:
            assert self.shown(test.environment, test.run) is None, "it is known"
            if test.why == "round":
                candidate = self._round.candidates[test.candidate]
                assert test.environment == candidate.models | self.searches[-1][0].pinned
        self._running += [test for test in wanted if test not in self._running][
            : self.workers - len(self._running)
        ]
        for _ in range(self._order.randint(1, len(self._running))):
            test = self._running.pop(self._order.randrange(len(self._running)))
            self.made.append(test)
            self.known.outcomes[test.environment, test.run] = self.outcome(
                test.environment, test.run
            )

    def baseline_ran(self, runs, chose):
        self._step("baseline_ran", runs, chose)
        self.now.of_whole = set(range(chose, runs))
        shown = sum(self.shown(self.world.whole, run) is True for run in range(chose, runs))
        return Baseline(shown, self.world.competes) if shown or chose else None

    def failure_fixed(self, runs):
        self._step("failure_fixed", runs)
        return self.search()

    def round_began(self, number, round):
        """What is known of a round, if it is over."""
        self._step("round_began", number, round)
        self.now.round, self._round = number, round
        self.now.n_partitions[self.now.chain[-1]] = round.n_partitions
        if number not in self.known.past:
            return None
        winner = self.known.past[number]
        if winner is not None:
            self._reach(round.candidates[winner].models | self.searches[-1][0].pinned)
        return Past(winner)

    def judged(self, index, environment, verdict, runs):
        self._step("judged", index, environment, verdict, runs)
        if verdict == "unknown":
            self.known.unknown.add((self.now.round, environment))

    def similar(self, number, index, environment):
        self._step("similar", number, index, environment)
        self._reach(environment)
        return True

    def round_ended(self, number, winner):
        self._step("round_ended", number, winner)
        self.known.past[number] = winner

    def search_ended(self, environment):
        self._step("search_ended", environment)

    def certificate_due(self):
        self._step("certificate_due")
        self.now.certificates += 1
        terms = Terms(
            certify_rate=2 / 3,
            keep_rate=0.8,
            error=error_of(self.now.certificates),
            at_least=self.world.baseline_runs,
        )
        return Certificate(FIRST_FRESH + EACH_CERTIFICATE * self.now.certificates, terms)

    def certified(self, made):
        self._step("certified", made)
        first = made.certificate.first_run
        tests = {test for claim in made.claims for test in claim.claim.rests_on}
        # The whole world runs where what is left missed f, and then with every seed.
        there = takewhile(lambda run: (self.world.whole, run) in tests, count())
        self.now.of_whole |= {first + run for run in there}

    def stepped_back(self, place, again, tests):
        self._step("stepped_back", place, again, tests)
        self.now.lost.append(self.now.chain[place + 1])
        self.now.chain = self.now.chain[: place + 1]
        return self.search(again)

    def left_out(self, model, environment):
        self._step("left_out", model, environment)
        self._reach(environment)
        return self.search()

    def checked(self, check):
        self._step("checked", check)

    def _reach(self, environment):
        now = self.now
        assert environment < now.chain[-1]
        now.n_partitions[environment] = now.n_partitions.get(now.chain[-1], 2)
        now.chain = (*now.chain, environment)
