"""Carries isolation through: removes models from the whole world, puts back what it can, and lets fresh runs judge the end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

from ddenv.engine.bench import Bench, Wanted
from ddenv.engine.control import Stopped
from ddenv.engine.journal import Journal
from ddenv.engine.judging import known_failure, rows_of
from ddenv.engine.sight import Sight
from ddenv.engine.subjects import HELD, Keep
from ddenv.evidence.rates import wilson_interval
from ddenv.reduction.algorithms import by_chunks
from ddenv.evidence.certificate import ERROR, Claim, Procedure, Terms, error_of, falls, settle
from ddenv.reduction.chance import distances_to_failure
from ddenv.reduction.guide import Search
from ddenv.reduction.isolation import Passing, isolating, passes
from ddenv.reduction.round import Candidate, Round
from ddenv.reduction.stacks import Stacks
from ddenv.reduction.verdict import Shown, decided_by, standing
from ddenv.runfile.progress import Check, Isolation
from ddenv.runfile.state import BROKEN, FRESH_RUNS, ISOLATE
from ddenv.runfile.supports import stacks_of
from ddenv.world.model import World
from ddenv.world.scenario import Reduction

# Far from all seeds of certificates, of which each has some thousands.
FIRST_RUN = 100_000_000
# Fresh runs judge so many ends; after that the last one stays as it is.
MOST_CHECKS = 6
# So many fresh runs of the world that passes, at least: their interval has to say something.
FEWEST_RUNS = 20
# Tests looked for at a time, for each worker: those that run are among them.
AHEAD_PER_JOB = 2
CHANGED = "a decision of the user, or a slice that was wrong, ended the isolation; resume the run to go on from there"
VERDICTS = {"similar": "passes", "dissimilar": "fails", "unknown": "unknown"}
# A model that is put back, None for none, with the world that shows what that does, and what fresh runs say so far.
Named = tuple[str | None, Keep, Claim]


def isolate(world: World, journal: Journal, bench: Bench, at_least: int | None, before: str) -> None:
    """Finds the nearest world that passes, or goes on with that; the run is finished then as it was, because of `before`.

    The end has `at_least` fresh runs, `FEWEST_RUNS` by default; another number than the open search has begins a new one, which
    finds its tests again. Raises as `Bench.work`.
    """
    now = journal.state.isolating
    if now is None or at_least not in (None, now.at_least):
        _begin(world, journal, at_least, before if now is None else now.before)
    isolator = Isolator(journal, bench)
    found = isolator.found()
    bench.finish_trials()
    # Tests that ran ahead of time are no longer needed.
    journal.lose_running()
    isolator.check_open()
    journal.record("isolation_finished", removal=found)


def _begin(world: World, journal: Journal, at_least: int | None, before: str) -> None:
    state, reduction = journal.state, Reduction.model_validate(journal.state.scenario["reduction"])
    baseline = [test for test in state.tests if test.phase == "baseline" and test.is_finished]
    sound = [test for test in baseline if test.outcome not in BROKEN]
    rule = Passing.of(sum(test.outcome == "pass" for test in sound), len(sound))
    least = at_least or max(FEWEST_RUNS, reduction.baseline_runs)
    last = state.isolations[-1] if state.isolations else None
    suspects, size = _suspects(world, journal, reduction)
    numbers = {name: number for number, name in enumerate(state.elements)}
    journal.record(
        "isolation_started",
        isolation=len(state.isolations) + 1,
        run=FIRST_RUN if last is None else last.first_run + MOST_CHECKS * last.block,
        block=max(FRESH_RUNS, 2 * least),
        wanted=rule.wanted,
        rather_than=rule.rather_than,
        keep_rate=reduction.keep_rate,
        error=ERROR,
        at_least=least,
        suspects=[numbers[name] for name in suspects],
        size=size,
        before=before,
    )


def _suspects(world: World, journal: Journal, reduction: Reduction) -> tuple[list[str], int]:
    """One model of each stack that may go, the likeliest first; and how many of them the reduction has left.

    These come first, and then the nearest to where f ended.
    """
    state, f = journal.state, known_failure(journal.state).failure_test
    sight = Sight(world, state.elements, reduction.delta, reduction.seed)
    evidence = sight.evidence(state, f, rows_of(journal.file, f), ())
    distance = dict(zip(state.elements, distances_to_failure(state.elements, evidence).tolist(), strict=True))
    stacks, left = _free(journal), frozenset(state.environment)
    order = sorted(
        stacks.by_first.items(),
        key=lambda each: (left.isdisjoint(each[1]), min(distance[name] for name in each[1])),
    )
    return [first for first, _ in order], sum(not left.isdisjoint(stack) for _, stack in order)


def _free(journal: Journal) -> Stacks:
    """The stacks of the whole world that may go: none with a model that is pinned, as in the search."""
    state = journal.state
    together = Stacks.of(stacks_of(state, state.elements))
    return Stacks.of(stack for stack in together.by_first.values() if state.pinned.isdisjoint(stack))


@dataclass(frozen=True)
class Isolator:
    """One engine's work on an isolation. All of it follows from the journal, so a resumed one comes to the same end."""

    journal: Journal
    bench: Bench

    @cached_property
    def _stacks(self) -> Stacks:
        return _free(self.journal)

    @cached_property
    def _whole(self) -> Keep:
        return frozenset(self.journal.state.elements)

    @property
    def _now(self) -> Isolation:
        found = self.journal.state.isolating
        if found is None:
            raise Stopped(CHANGED)
        return found

    def check_open(self) -> None:
        """Raises Stopped if a decision of the user has ended the isolation."""
        assert self._now

    def found(self) -> int | None:
        """The number of the removal after which the robot passes; None if there is none."""
        while len(self._now.checks) < MOST_CHECKS:
            if self._now.checks and self._is_shown(self._now.checks[-1]):
                return self._now.checks[-1].removal
            removed = self._search()
            if not removed:
                return None
            self._check(removed)
        last = self._now.checks[-1]
        return last.removal if last.claims[0].verdict == "passes" else None

    def _is_shown(self, check: Check) -> bool:
        """Whether nothing that a check shows sends the search on."""
        return check.claims[0].verdict == "passes" and not self._smaller(check)

    def _smaller(self, check: Check) -> Keep:
        """What is enough to remove if a check shows that a model may stay; nothing where that was refuted."""
        needless = next((claim.back for claim in check.claims if claim.verdict == "not needed"), None)
        smaller = frozenset[str]() if needless is None else self._removed(check.removal) - self._stack(needless)
        return frozenset() if self._whole - smaller in self._refused else smaller

    @property
    def _refused(self) -> frozenset[Keep]:
        """The worlds that do not pass: the whole one, as is known from its baseline, and those that fresh runs refuted."""
        refuted = (check.removal for check in self._now.checks if check.claims[0].verdict != "passes")
        return frozenset((self._whole, *(self._whole - self._removed(number) for number in refuted)))

    # The search.

    def _search(self) -> Keep:
        """What has to go, by the seeds of the search; nothing if the robot does not pass without all that may go."""
        searching, refused = self._searching(), self._refused
        winner: Candidate | None = None
        try:
            while True:
                winner = self._judge(searching.send(winner), refused)
        except StopIteration as end:
            return frozenset(end.value)

    def _searching(self) -> Search:
        """From the beginning, or from what the last check shows to be enough."""
        smaller = self._smaller(self._now.checks[-1]) if self._now.checks else frozenset()
        if smaller:
            return self._stacks.expand(by_chunks(tuple(name for name in self._now.suspects if name in smaller)))
        return self._stacks.expand(isolating(self._now.suspects, self._now.size))

    def _judge(self, round: Round, refused: frozenset[Keep]) -> Candidate | None:
        """The first candidate of a round without which the robot passes; None if there is none."""

        # Of thousands of models, the sets of all candidates would take gigabytes.
        @lru_cache(maxsize=HELD)
        def keep_of(index: int) -> Keep:
            return self._whole - round.candidates[index].models

        rule = Passing(self._now.wanted, self._now.rather_than)
        enough = AHEAD_PER_JOB * max(1, self.journal.state.jobs)
        judged = winner = 0

        def wanted() -> Wanted:
            nonlocal judged, winner
            self.check_open()
            open_ones = map(keep_of, range(judged, len(round.candidates)))
            now = standing(open_ones, self._reached, rule, refused, first=judged, enough=enough)
            for verdict in now.verdicts:
                if not verdict:
                    break
                if keep_of(judged) not in refused:
                    self._record_verdict(keep_of(judged), verdict, rule)
                if verdict == "similar":
                    winner = judged + 1
                    return []
                judged += 1
            return [(keep, run, self._number(keep)) for index, run in now.wanted for keep in (keep_of(index),)]

        self.bench.work(ISOLATE, None, wanted)
        return round.candidates[winner - 1] if winner else None

    def _record_verdict(self, keep: Keep, verdict: str, rule: Passing) -> None:
        number = self._number(keep)
        if self.journal.state.removals[number - 1].verdict == VERDICTS[verdict]:
            return
        runs = range(decided_by(lambda run: self._reached(keep, run), rule))
        tests = [self.journal.ledger[keep, run, True] for run in runs]
        self.journal.record("removal_judged", removal=number, verdict=VERDICTS[verdict], tests=tests)

    def _reached(self, keep: Keep, run: int) -> Shown:
        """Whether a finished run reached the goal; None if it is not made yet."""
        test = self.journal.ledger.get((keep, run, True))
        if test is None:
            return None
        outcome = self.journal.state.tests[test - 1].outcome
        return "broken" if outcome in BROKEN else outcome == "pass"

    @cached_property
    def _numbers(self) -> dict[Keep, int]:
        """The numbers of the worlds that were tried."""
        return {self._whole.difference(one.models): number for number, one in enumerate(self.journal.state.removals, 1)}

    def _number(self, keep: Keep) -> int:
        """The number of the removal that leaves `keep`; events name it before its first test."""
        if keep not in self._numbers:
            number = len(self.journal.state.removals) + 1
            models = [index for index, name in enumerate(self.journal.state.elements) if name not in keep]
            self.journal.record("removal_tried", removal=number, models=models)
            self._numbers[keep] = number
        return self._numbers[keep]

    def _removed(self, number: int) -> Keep:
        return frozenset(self.journal.state.removals[number - 1].models)

    def _stack(self, name: str) -> Keep:
        return frozenset(self._stacks.expanded((name,)))

    # The fresh runs.

    def _check(self, removed: Keep) -> None:
        """Writes what fresh runs show of the world without `removed`, and with each model of it put back."""
        first = self._now.first_run + len(self._now.checks) * self._now.block

        def wanted() -> Wanted:
            self.check_open()
            tests = dict.fromkeys(test for _, _, claim in self._claims(removed, first) for test in claim.wanted)
            return [(keep, first + run, self._number(keep)) for keep, run in tests]

        self.bench.work(ISOLATE, None, wanted)
        claims = list(self._claims(removed, first))
        named = sorted(
            {self.journal.ledger[keep, first + run, True] for *_, claim in claims for keep, run in claim.rests_on}
        )
        self.journal.record(
            "isolation_checked",
            removal=self._number(self._whole - removed),
            claims=[self._plain(*claim, first) for claim in claims],
            tests=named,
        )

    def _claims(self, removed: Keep, first: int) -> Iterator[Named]:
        """What is known so far: that the robot passes, then of each model that is put back; up to one that sends the search on."""
        now, passing = self._now, self._whole - removed
        error = error_of(len(now.checks) + 1) / 2.0

        def settled(procedure: Procedure) -> Claim:
            jobs = max(1, self.journal.state.jobs)
            return settle(procedure, lambda keep, run: self._reached(keep, first + run), jobs)

        claim = settled(passes(passing, Passing(now.wanted, now.rather_than, error), now.at_least))
        yield None, passing, claim
        if claim.verdict != "passes":
            return
        backs = [name for name in now.suspects if name in removed]
        terms = Terms(now.keep_rate, now.wanted, error / len(backs))
        for name in backs:
            with_it = passing | self._stack(name)
            claim = settled(falls(with_it, passing, terms))
            yield name, with_it, claim
            if claim.verdict == "not needed":
                return

    def _plain(self, name: str | None, keep: Keep, claim: Claim, first: int) -> dict[str, Any]:
        """A claim as data of an event."""
        shown = [self._reached(keep, first + run) for run in range(claim.runs)]
        runs, reached = sum(type(one) is bool for one in shown), sum(one is True for one in shown)
        low, high = wilson_interval(reached, runs) if runs else (0.0, 1.0)
        return {
            "back": None if name is None else self.journal.state.elements.index(name),
            "verdict": claim.verdict,
            "reached": reached,
            "runs": runs,
            "low": low,
            "high": high,
        }
