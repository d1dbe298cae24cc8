"""The engine's memory: writes each event once, and finds every finished test again after a
restart.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from itertools import count

from ddenv.environment import Environment, Numbers
from ddenv.errors import UserError
from ddenv.evidence.certificate import NumberedRun
from ddenv.evidence.rates import Shown, estimated_rate
from ddenv.evidence.slices import Ties, implies
from ddenv.reduction.procedure import Test as Wanted
from ddenv.run_numbers import CERTIFICATES, OF_CERTIFICATE
from ddenv.runfile.events import EnvironmentNamed, Event, TestLost
from ddenv.runfile.fold import apply
from ddenv.runfile.fold_decisions import origin
from ddenv.runfile.state import (
    BROKEN,
    CERTIFY,
    ISOLATE,
    Round,
    RunState,
    Test,
)
from ddenv.runfile.store import Motions, RunFile
from ddenv.runfile.supports import stack_with
from ddenv.settings import SETTINGS, read


class Journal:
    """The events of a run, `state` folded from them, and a memo of its finished tests by
    (environment, run, full).

    A test that broke is made twice, and again by the next engine where a verdict needs it. Tests
    that ran to their end have `full` True, those that the search asked for False, most both:
    `early_stop` only changes runs that it cuts. What was cut counts only while the same ends count
    as f, and early stop is used. While a user's `command` is obeyed, events hold its number.
    """

    def __init__(self, file: RunFile) -> None:
        self.file = file
        self.state = RunState()
        self.command: int | None = None
        for recorded in file.events():
            self.state = apply(self.state, recorded)
        self._number_of = {name: number for number, name in enumerate(self.state.elements)}
        self._numbers: dict[Environment, int] = {}
        self._tests: dict[tuple[int, int, bool], int] = {}
        # By run: what took part in a simulated test, its models, its number.
        self._implying: dict[tuple[int, bool], list[tuple[Environment, Environment, int]]] = (
            defaultdict(list)
        )
        self._broke: Counter[tuple[int, int, bool, int]] = Counter()
        self._ties: tuple[object, Ties] = None, Ties.among(())
        self._remember(RunState(), self.state)

    def record(
        self, event: Event, motions: Motions | None = None, number: int | None = None
    ) -> None:
        """Writes an event."""
        before = self.state
        self.state = apply(before, self.file.append(event, motions, self.command, number))
        self._remember(before, self.state)

    def _remember(self, before: RunState, after: RunState) -> None:
        """Takes in what one event, or a whole file, changed."""
        for number in range(len(before.environments), len(after.environments)):
            self._numbers[after.environments[number]] = number
        if after.mixed_until != before.mixed_until:
            # What was made with something else implies nothing of tests that are made now.
            self._implying.clear()
        for test in after.tests.changed_since(before.tests):
            self._enter(test)
        if after.engines != before.engines:
            self._forget(lambda test: test.broke and self._is_made_again(test))
        if after.refuted is not before.refuted:
            self._forget(lambda test: test.implied_by is not None)
        if after.early_stop_ended is not before.early_stop_ended or _f_of(after) != _f_of(before):
            self._forget(lambda test: test.cut)
            for known in self._implying.values():
                known[:] = [implying for implying in known if not self.state.test(implying[2]).cut]

    def _enter(self, test: Test) -> None:
        if not test.is_finished:
            return
        if test.broke:
            key = test.environment, test.run, test.phase == CERTIFY, test.engine
            self._broke[key] += 1
            if self._broke[key] < 2:
                return
        for full, holds in ((False, test.phase != CERTIFY), (True, not test.cut)):
            if not holds:
                continue
            self._tests[test.environment, test.run, full] = test.id
            simulated = test.implied_by is None and not test.broke
            if test.took_part is not None and simulated and test.id > self.state.mixed_until:
                there = self.state.environments[test.environment]
                self._implying[test.run, full].append((test.took_part, there, test.id))

    def _forget(self, which: Callable[[Test], bool]) -> None:
        self._tests = {
            key: test for key, test in self._tests.items() if not which(self.state.test(test))
        }

    def _is_made_again(self, broken: Test) -> bool:
        """A baseline that is done, and a certificate, may do without a few runs that broke."""
        if broken.phase == "baseline":
            return self.state.baseline is None
        last = self.state.certificates[-1:]
        return broken.phase != CERTIFY or any(
            claim.verdict == "unknown" for one in last for claim in one.claims
        )

    def models(self, names: Iterable[str]) -> Environment:
        """The environment of those of these models that are elements."""
        return Environment.of(self._number_of[name] for name in names if name in self._number_of)

    def pairs(self, names: Iterable[tuple[str, str]]) -> tuple[tuple[int, int], ...]:
        """Pairs of models by number."""
        return tuple((self._number_of[first], self._number_of[second]) for first, second in names)

    def in_order(self, times: Mapping[str, float]) -> tuple[tuple[int, float], ...]:
        """`times` by name, s, as (model, s) in order of time; only for elements."""
        numbers = self._number_of
        pairs = sorted(
            (seconds, numbers[name]) for name, seconds in times.items() if name in numbers
        )
        return tuple((number, seconds) for seconds, number in pairs)

    def number(self, environment: Environment) -> int:
        """The number of an environment. An event names it the first time."""
        known = self._numbers.get(environment)
        if known is None:
            known = len(self.state.environments)
            command = self.command
            # A command is not obeyed by that.
            self.command = None
            self.record(EnvironmentNamed(environment=known, models=environment))
            self.command = command
        return known

    @property
    def environment(self) -> Environment:
        """What is left now."""
        return self.state.environments[self.state.nodes[self.state.node].id]

    @property
    def whole(self) -> Environment:
        """The models in the world that f was seen in: what is left has to keep its rate."""
        return self.state.environments[origin(self.state, self.state.node).id]

    @property
    def pinned(self) -> Environment:
        return self.models(self.state.pinned)

    def without(self, name: str) -> Environment:
        """What is left without a model, or without all of its stack."""
        return self.environment - self.models(stack_with(self.state, self.state.environment, name))

    def is_refused_by_user(self, environment: Environment) -> bool:
        return any(refusal.environment == environment for refusal in self.state.refused)

    def is_refused(self, environment: Environment) -> bool:
        """Whether the user refused it, or it is part of what lost the rate of what counts as f
        now.
        """
        lost = (lost for failures, lost in self.state.lost if failures == self.state.failures)
        return self.is_refused_by_user(environment) or any(environment <= one for one in lost)

    def test(self, environment: Environment, run: int, full: bool = False) -> Test | None:
        """The finished test of a run; None if it has to be made. With `full` only a run to its end
        counts.
        """
        number = self._numbers.get(environment)
        test = None if number is None else self._tests.get((number, run, full))
        if test is None:
            return None
        return self.state.test(test)

    def tests(self, environment: Environment, runs: Iterable[int], full: bool = False) -> Numbers:
        """The numbers of the finished tests among these runs."""
        tests = (self.test(environment, run, full) for run in runs)
        return tuple(test.id for test in tests if test is not None)

    def full_tests(self, tests: Iterable[NumberedRun], first: int = 0) -> Numbers:
        """The numbers of the finished full tests among these, sorted; their runs are counted from
        `first`.
        """
        return tuple(
            sorted(
                {
                    one
                    for models, run in tests
                    for one in self.tests(models, (first + run,), full=True)
                }
            )
        )

    def shown(self, environment: Environment, run: int, full: bool = False) -> Shown:
        """Whether a run showed f; None if it is not made yet."""
        test = self.test(environment, run, full)
        if test is None:
            return None
        if test.broke:
            return "broken"
        return test.shows_f

    def evidence_of(self, tests: Iterable[int]) -> int:
        """The first of `tests` that showed f."""
        return next(test for test in tests if self.state.test(test).shows_f)

    @property
    def stops_early(self) -> bool:
        """Whether tests may end early."""
        return (
            bool(read(self.state.scenario, SETTINGS["early_stop"]))
            and self.state.early_stop_ended is None
        )

    def is_full(self, wanted: Wanted) -> bool:
        """Whether a test runs to its end although its verdict is clear before."""
        return wanted.full or wanted.why not in ("round", "audit") or not self.stops_early

    def implying(self, environment: Environment, run: int, full: bool) -> int | None:
        """The first test that implies the run of an environment, if there is one."""
        ties = self.ties
        if ties is None:
            return None
        made = self._implying[run, full]
        return next(
            (
                test
                for took_part, there, test in made
                if implies(took_part, there, environment, ties)
            ),
            None,
        )

    @property
    def ties(self) -> Ties | None:
        """The ties of the run; None where no slices may be used: unwanted, unknown ties, or an
        audit that found a difference.
        """
        state = self.state
        if (
            state.ties is None
            or state.refuted is not None
            or not read(state.scenario, SETTINGS["slice"])
        ):
            return None
        if self._ties[0] is not state.ties:
            self._ties = state.ties, Ties.among(self.pairs((*state.ties, *state.welds)))
        return self._ties[1]

    def rate_of_whole(self) -> float:
        """The estimated rate of f in the whole world, or where a branch begins whose f is another
        failure.
        """
        whole = self._numbers[self.whole]
        state = self.state
        # In the runs that chose f it was lucky.
        lucky = {
            ("baseline", run)
            for run in range(0 if state.baseline is None else state.baseline.chose)
        }
        tests = [
            test
            for test in state.tests
            if test.environment == whole
            and test.phase not in (CERTIFY, ISOLATE)
            and (test.phase, test.run) not in lucky
        ]
        for first in dict.fromkeys(certificate.first_run for certificate in state.certificates):
            # A certificate runs the whole world at first only where what is left missed f: these
            # runs would show it as too rare.
            # Those that only ran ahead of time would make it depend on the number of workers.
            for run in count(first):
                test = self.test(self.whole, run, full=True)
                if test is None or not state.rests_on >> test.id & 1:
                    break
                tests.append(test)
        sound = [test for test in tests if test.is_sound]
        return estimated_rate(sum(test.shows_f for test in sound), len(sound))

    @property
    def fresh_run(self) -> int:
        """The number of the first run of the next certificate, whose seed chose nothing so far."""
        if not self.state.certificates:
            return CERTIFICATES.start
        last = self.state.certificates[-1]
        return last.first_run + max(OF_CERTIFICATE, 2 * last.at_least)

    @property
    def has_broken(self) -> bool:
        """Whether tests broke, so that the baseline, a verdict or a claim is unknown."""
        broken = any(self.state.tally[outcome] for outcome in BROKEN)
        return self.state.left_unknown or (self.state.baseline is None and broken)

    def lose_running(self) -> None:
        """Records tests that were started and never ended as lost."""
        for test in self.state.running_tests:
            self.record(TestLost(test=test.id))

    @property
    def current(self) -> Round:
        """The current round. Raises UserError before the first round."""
        if self.state.round is None:
            raise UserError("damaged run file: there is no round yet")
        return self.state.round


def _f_of(state: RunState) -> object:
    """What says where f ended, and how near that is: a test that ended early was decided by it."""
    return state.failures, state.scenario.get("failure")
