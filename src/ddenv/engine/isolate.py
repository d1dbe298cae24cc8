"""Carries isolation through with workers and a run file: finds the nearest world that passes, as
`reduction.isolation` says.
"""

from __future__ import annotations

from typing import cast

from ddenv.engine.control import Stopped
from ddenv.engine.journal import Journal
from ddenv.engine.judging import SchemaInputs, known_failure
from ddenv.engine.scheduler import TestScheduler
from ddenv.environment import Environment
from ddenv.evidence.certificate import ERROR, HELPING, Claim, Verdict
from ddenv.evidence.rates import Shown, anytime_interval
from ddenv.reduction.evidence import distances_to_failure
from ddenv.reduction.isolation import MOST_CHECKS, Asked, Checked, Each, Passing, isolation
from ddenv.reduction.procedure import NamedClaim
from ddenv.reduction.round import Stacks
from ddenv.run_numbers import ISOLATIONS, OF_CERTIFICATE
from ddenv.runfile import events
from ddenv.runfile.fold_decisions import exact_runs
from ddenv.runfile.progress import Isolation
from ddenv.runfile.supports import stacks_of
from ddenv.world.model import World
from ddenv.world.scenario import Reduction

# So many fresh runs of the world that passes, at least: their interval has to say something.
FEWEST_RUNS = 20
VERDICTS = {"similar": "passes", "dissimilar": "fails", "unknown": "unknown"}
CHANGED = (
    "a decision of the user or a wrong slice ended the isolation; resume the run to continue "
    "from there"
)


def isolate(
    world: World, journal: Journal, scheduler: TestScheduler, at_least: int | None, before: str
) -> None:
    """Finds the nearest world that passes, or goes on with that; the run is finished then as it
    was, because of `before`.

    The end has `at_least` fresh runs; another number than the open search has begins a new one.
    Raises as `TestScheduler.work`.
    """
    now = journal.state.isolating
    if now is None or at_least not in (None, now.asked.at_least):
        _begin(world, journal, at_least, before if now is None else now.asked.before)
    removed = _Isolator(journal, scheduler).carry_out()
    scheduler.finish_trials()
    # Tests that ran ahead of time are no longer needed.
    journal.lose_running()
    _open(journal)
    whole = journal.state.environments[0]
    journal.record(
        events.IsolationFinished(
            environment=None if removed is None else journal.number(whole - removed)
        )
    )


def _open(journal: Journal) -> Isolation:
    """The isolation that is under way. Raises Stopped if a decision of the user has ended it."""
    if journal.state.isolating is None:
        raise Stopped(CHANGED)
    return journal.state.isolating


def _begin(world: World, journal: Journal, at_least: int | None, before: str) -> None:
    state = journal.state
    reduction = Reduction.model_validate(journal.state.scenario["reduction"])
    baseline = [test for test in state.tests if test.phase == "baseline" and test.is_finished]
    sound = [test for test in baseline if not test.broke]
    rule = Passing.of(sum(test.outcome == "pass" for test in sound), len(sound))
    least = at_least or max(FEWEST_RUNS, reduction.baseline_runs)
    last = state.isolations[-1] if state.isolations else None
    # One model of each stack that may go: first those that the reduction has left, then the nearest
    # to f.
    evidence = SchemaInputs(world, state.elements, reduction.delta, reduction.seed).evidence(
        journal, known_failure(state).failure_test
    )
    distance = distances_to_failure(state.elements, evidence).tolist()
    stacks = _free(journal).by_first
    left = journal.environment
    gone = {first: left.isdisjoint(stack) for first, stack in stacks.items()}
    suspects = sorted(
        stacks, key=lambda first: (gone[first], min(distance[model] for model in stacks[first]))
    )
    chosen = exact_runs(state) if journal.whole == state.environments[0] else ()
    number = len(state.isolations) + 1
    first = ISOLATIONS.start if last is None else last.asked.run + MOST_CHECKS * last.asked.block
    started = events.IsolationStarted(
        isolation=number,
        run=first,
        block=max(OF_CERTIFICATE, 2 * least),
        wanted=rule.wanted,
        rather_than=rule.rather_than,
        keep_rate=reduction.keep_rate,
        error=ERROR,
        at_least=least,
        suspects=tuple(suspects),
        size=sum(not gone[one] for one in suspects),
        before=before,
        chosen=chosen,
    )
    journal.record(started)


def _free(journal: Journal) -> Stacks:
    """The stacks of the whole world that may go: none with a model that is pinned, as in the
    search.
    """
    groups = map(journal.models, stacks_of(journal.state, journal.state.elements))
    return Stacks.of(group for group in groups if group.isdisjoint(journal.pinned))


class _Isolator:
    """Drives an isolation. All of it follows from the journal, so a resumed one comes to the same
    end.
    """

    def __init__(self, journal: Journal, scheduler: TestScheduler) -> None:
        self._journal = journal
        self._scheduler = scheduler
        self._whole = journal.state.environments[0]
        now = _open(journal).asked
        rule = Each(now.chosen) if now.chosen else Passing(now.wanted, now.rather_than)
        self._asked = Asked(
            whole=self._whole,
            suspects=now.suspects,
            stacks=_free(journal),
            size=now.size,
            rule=rule,
            keep_rate=now.keep_rate,
            at_least=now.at_least,
            first_run=now.run,
            block=now.block,
        )

    def carry_out(self) -> Environment | None:
        """To the end; returns what has to go so that the robot passes. Raises as
        `TestScheduler.work`, and Stopped.
        """
        work = isolation(self, self._asked, self._known_checks())
        return self._scheduler.carry_out(work, before_tests=lambda: _open(self._journal))

    refusals = 0

    @property
    def workers(self) -> int:
        return max(1, self._journal.state.jobs)

    def shown(self, environment: Environment, run: int, full: bool = False) -> Shown:
        """Whether a finished run reached the goal; None if it is not made yet."""
        test = self._journal.test(environment, run, full=True)
        if test is None:
            return None
        if test.broke:
            return "broken"
        return test.outcome == "pass"

    def refused(self, environment: Environment) -> bool:
        return False

    refused_by_user = refused

    def judged(self, index: int, environment: Environment, verdict: str, runs: int) -> None:
        _open(self._journal)
        journal = self._journal
        number = self._journal.number(environment)
        verdict = VERDICTS[verdict]
        known = (
            removal.verdict for removal in journal.state.removals if removal.environment == number
        )
        if next(known, "") != verdict:
            tests = journal.tests(environment, map(self._asked.rule.run, range(runs)), full=True)
            journal.record(events.RemovalJudged(environment=number, verdict=verdict, tests=tests))

    def checked(self, check: Checked) -> None:
        journal = self._journal
        now = _open(self._journal)
        first = now.asked.run + len(now.checks) * now.asked.block
        rests_on = journal.full_tests(
            (test for one in check.claims for test in one.claim.rests_on), first
        )
        claims = []
        for one in check.claims:
            shown = [
                self.shown(one.environment, run)
                for run in one.exact or [first + run for run in one.runs]
            ]
            runs = sum(type(each) is bool for each in shown)
            reached = shown.count(True)
            share = reached / max(1, runs)
            low, high = (share, share) if one.exact else anytime_interval(reached, runs)
            # With the model put back the goal is reached more rarely, but it is not shown to be
            # missed.
            verdict = "not shown" if one.claim.verdict in HELPING else one.claim.verdict
            claim = events.ReturnedMade(
                back=one.model,
                verdict=verdict,
                reached=reached,
                runs=runs,
                low=low,
                high=high,
            )
            claims.append(claim)
        environment = journal.number(self._whole - check.removed)
        journal.record(
            events.IsolationChecked(environment=environment, claims=tuple(claims), tests=rests_on)
        )

    def _known_checks(self) -> list[Checked]:
        """What fresh runs have shown before this engine."""
        journal = self._journal
        checks = list[Checked]()
        for check in _open(journal).checks:
            passing = journal.state.environments[
                journal.state.removals[check.removal - 1].environment
            ]
            claims = []
            for one in check.claims:
                model = None if one.back is None else next(iter(journal.models([one.back])))
                claims.append(NamedClaim(model, passing, Claim(verdict=cast(Verdict, one.verdict))))
            checks.append(Checked(self._whole - passing, tuple(claims)))
        return checks
