"""Makes the tests that are wanted, tries of the user first, and records all of them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import NoReturn, TypeVar

import numpy as np

from ddenv.engine.control import Control, Stopped
from ddenv.engine.journal import Journal
from ddenv.engine.judging import asked_of, failures_of, motions_of, result_data, rows_of
from ddenv.engine.limits import give_up_if_late, wall_limit
from ddenv.engine.notes import note_slow
from ddenv.engine.pool import Workers
from ddenv.engine.shared import Key, Place, result_of
from ddenv.engine.slicing import audit_is_due, compare
from ddenv.engine.worker import Broken, Ended, Result, Run, Start
from ddenv.environment import Environment
from ddenv.errors import UserError
from ddenv.reduction.procedure import Changed, Test, Work
from ddenv.reduction.verdict import Acceptance, decided_by, standing
from ddenv.robot.oracle import Failure, ends_of
from ddenv.robot.result import RunResult
from ddenv.runfile.events import (
    Compared,
    Comparing,
    EarlyStopEnded,
    Implied,
    SupportsStarted,
    TestFinished,
    TestStart,
    TestStarted,
    TrialJudged,
)
from ddenv.runfile.state import BROKEN, ISOLATE, Trial
from ddenv.runfile.state import Test as KnownTest
from ddenv.runfile.store import ROBOT
from ddenv.text import count
from ddenv.world.scenario import seed_of

# How long to wait for a test before looking at commands again, and between two looks at the running
# robots, s.
WAIT = 0.05
LIVE_PERIOD = 0.1
# What takes longer than this shows that it is under way, s.
PATIENCE = 1.0
# Maximum number of broken tests in a row. If the simulator itself does not work (no licence, no
# display, a full disk), all tests break, and the reduction would read that as "no f". In worlds
# that break only some tests, others end.
MOST_BROKEN = 25

# What a procedure returns at its end.
Found = TypeVar("Found")
Look = Callable[[], object]


class TestScheduler:
    """Makes tests with `pool`, as `control` allows, and records them in `journal`. `rule` judges
    tries of the user.

    A test that `others` have made takes no worker. Before f is fixed, a run that failed is recorded
    as "failed".
    """

    def __init__(
        self,
        journal: Journal,
        pool: Workers,
        control: Control,
        others: Mapping[Key, Place] | None = None,
    ) -> None:
        self._failures: tuple[Failure, ...] = ()
        # What the failures were made of.
        self._failed: object = None
        self._journal = journal
        self._pool = pool
        self._control = control
        self._others = dict(others or {})
        self._taken: list[Ended] = []
        self._started: set[tuple[Environment, int, bool]] = set()
        self._next_live = 0.0
        self._live_shown = False
        self._broken = 0
        self.rule = Acceptance(most_misses=1)

    def carry_out(self, work: Work[Found], before_tests: Look = lambda: None) -> Found:
        """Makes the tests of a procedure to its end, and returns what it returns; looks around with
        `before_tests` each time.

        Whatever the user changes enters the procedure as Changed, or in what it asks. Raises as
        `work`, but for a Changed that the procedure takes.
        """
        changed: Changed | None = None
        while True:
            before_tests()
            try:
                tests = next(work) if changed is None else work.throw(changed)
            except StopIteration as end:
                found: Found = end.value
                return found
            changed = None
            try:
                self.work(tests)
            except Changed as change:
                changed = change

    def work(self, tests: Sequence[Test]) -> None:
        """Starts as many of the wanted tests as workers are free, and looks around once.

        Raises Stopped, Changed, and UserError if nothing can be simulated or all tests break.
        """
        if self._start(tests):
            # Other tests may be wanted now.
            self._look(0.0)
        else:
            self.tick()

    def _start(self, tests: Sequence[Test]) -> bool:
        """Starts tests on free workers. Returns whether one was implied, and so needs none."""
        # A step is one test, the next in order.
        free = self._pool.idle if self._control.speculates() else int(self._busy == 0)
        for test in (test for test in tests if self._key(test) not in self._started):
            if not free or not self._control.may_start() or (implied := self._make(test)) is None:
                return False
            self._control.started()
            if implied:
                return True
            free -= 1
        return False

    @property
    def _busy(self) -> int:
        return self._pool.busy + len(self._taken)

    def _key(self, test: Test) -> tuple[Environment, int, bool]:
        return test.environment, test.run, self._journal.is_full(test)

    def _make(self, wanted: Test, trial: int | None = None) -> bool | None:
        """Starts a test, or writes its result if another one implies it; returns whether that is
        so, None if none may start.

        Raises Stopped if the budget is used up and no test runs.
        """
        journal = self._journal
        full = journal.is_full(wanted)
        source = journal.implying(wanted.environment, wanted.run, full)
        implied = (
            source is not None
            and wanted.why != "audit"
            and not audit_is_due(journal.state, wanted.why)
        )
        # The budget is that of the reduction, which is over.
        if not implied and (
            (wanted.why != ISOLATE and self._is_spent()) or not self._control.has_disk_space()
        ):
            return None
        environment = journal.number(wanted.environment)
        state = journal.state
        # All candidates meet the same noise.
        reduction = asked_of(state)
        number = len(state.tests) + 1
        seed = seed_of(reduction, wanted.run)
        of_round = state.round is not None and wanted.why == "round"
        start = TestStart(
            test=number,
            environment=environment,
            run=wanted.run,
            seed=seed,
            phase=wanted.why,
            round=journal.current.number if of_round else None,
            candidate=wanted.candidate if of_round else None,
            trial=trial,
            without=wanted.without,
        )
        if implied and source is not None:
            journal.record(Implied(**asdict(start), by=source), {ROBOT: source})
            return True
        journal.record(TestStarted(**asdict(start), audits=source))
        self._started.add((wanted.environment, wanted.run, full))
        # To be compared, it ends as the other one did.
        full = full or (source is not None and not state.test(source).cut)
        keep = frozenset(wanted.environment.names(state.elements))
        known = self._others.pop((keep, seed), None)
        if known is not None and (taken := result_of(known)) is not None:
            self._taken.append((number, taken))
        else:
            ends = None if full or not self._known() else ends_of(self._known())
            self._pool.submit(number, Run(keep=keep, seed=seed, ends=ends, limit=wall_limit(state)))
        return False

    def settle(self) -> Start | Broken:
        """How the world settles; tells if that takes longer than `PATIENCE`. Raises as `work`."""
        found = self._pool.settle(frozenset(self._journal.state.elements))
        until = time.monotonic() + PATIENCE
        while (result := found()) is None:
            if time.monotonic() > until:
                until = math.inf
                self._journal.record(SupportsStarted())
            self.tick()
        return result

    def check_repeats(self, mixed: bool) -> None:
        """Makes the first baseline run again if this engine computes with anything else than the
        earlier ones.

        Raises UserError if the bits differ, unless the run goes on `mixed`; and Stopped.
        """
        state = self._journal.state
        run = self._journal.file.path
        sound = (test for test in state.tests if test.phase == "baseline" and test.is_finished)
        test = next((test for test in sound if not test.broke), None)
        if state.physics.now == state.physics.proven or test is None:
            return
        result = self.made_again(test)
        if result is not None and not mixed:
            if isinstance(result, Broken):
                how = f"broke ({result.failure})"
            else:
                how = "gives a different trajectory"
            raise UserError(
                f"{run}: repeated, the first run of the whole world {how}: the tests were made "
                f"with {state.physics.proven}, and this is {state.physics.now}; 'ddenv resume "
                f"{run} --mixed' continues anyway, 'ddenv resume {run} --again' repeats all tests "
                "in a new run"
            )
        self._journal.record(Compared(same=result is None))

    def made_again(self, test: KnownTest, tells: bool = True) -> Result | None:
        """Makes a test again, once all workers are idle; returns how it ended unless the robot's
        way repeats bit for bit.

        `tells`: views say so.
        """
        while self._busy:
            # A search that is due begins after this.
            self._look_around(WAIT)
        journal = self._journal
        state = journal.state
        if tells:
            journal.record(Comparing(test=test.id))
        keep = frozenset(state.environments[test.environment].names(state.elements))
        # It ends as the one that was simulated.
        simulated = test if test.implied_by is None else state.test(test.implied_by)
        ends = ends_of(self._known()) if simulated.cut else None
        self._pool.submit(0, Run(keep=keep, seed=test.seed, ends=ends, limit=wall_limit(state)))
        while not (ended := self._pool.finished(WAIT)):
            self._control.poll()
        result = ended[0][1]
        same = isinstance(result, RunResult) and np.array_equal(
            result.trajectory, rows_of(journal.file, test.id)
        )
        if same:
            return None
        return result

    def finish_trials(self) -> None:
        """Obeys the last commands, and makes the tests that the user asked for. Raises as
        `work`.
        """
        self._control.poll()
        while self._control.holds or self._open_trials():
            self.tick()

    def _open_trials(self) -> list[Trial]:
        """The tries without a verdict, oldest first; they are made once f is known."""
        state = self._journal.state
        if state.failures:
            return [trial for trial in state.trials if not trial.verdict]
        return []

    def _serve_trials(self) -> None:
        """Judges tries, and starts their tests, also while the rounds are paused. Raises Stopped if
        the budget is used up.
        """
        for trial in self._open_trials():
            environment = self._journal.state.environments[trial.environment]
            (verdict,), wanted = standing([environment], self._journal.shown, self.rule)
            if verdict:
                runs = decided_by(self._journal.shown, environment, self.rule).runs
                tests = self._journal.tests(environment, map(self.rule.run, range(runs)))
                self._journal.record(TrialJudged(trial=trial.number, verdict=verdict, tests=tests))
            for _, run in wanted:
                test = Test(environment=environment, run=run, why="hand")
                if self._key(test) in self._started:
                    continue
                if not self._pool.idle or self._make(test, trial.number) is None:
                    return

    def _is_spent(self) -> bool:
        """Whether no test may start any more. Raises Stopped once none runs."""
        state = self._journal.state
        if state.budget is None or state.made + self._busy < state.budget:
            return False
        if self._busy == 0:
            raise Stopped(f"the budget of {count(state.budget, 'test')} is used up")
        return True

    def tick(self) -> None:
        """Obeys commands, records finished tests, shows the running robots. Raises as `work`:
        Changed where the user has changed something, since the old search must not use a test that
        ends now.
        """
        self._look(WAIT)

    def wait_for_search(self) -> NoReturn:
        """Raises Changed once a new search may begin, and as `work`."""
        while True:
            self.tick()

    def _look(self, wait: float) -> None:
        self._look_around(wait)
        while self._control.holds:
            if self._control.may_search:
                raise Changed
            self._look_around(WAIT)

    def _look_around(self, wait: float) -> None:
        self._control.poll()
        taken = self._taken
        self._taken = []
        finished = sorted(
            [*taken, *self._pool.finished(0.0 if taken else wait)], key=lambda one: one[0]
        )
        for test, result in finished:
            self._record(test, result)
            if result.outcome == "timeout":
                give_up_if_late(self._journal, result.failure)
            self._broken = self._broken + 1 if result.outcome in BROKEN else 0
            if self._broken >= MOST_BROKEN:
                raise UserError(
                    f"{self._broken} tests in a row broke; the last one: {result.failure}; "
                    f"fix this and continue with 'ddenv resume {self._journal.file.path}' (it "
                    "repeats these tests)"
                )
        # Before the search gets the workers that are free now.
        self._serve_trials()
        if self._busy == 0:
            self._control.settled()
            if not finished:
                time.sleep(wait)
        if time.monotonic() >= self._next_live:
            self._next_live = time.monotonic() + LIVE_PERIOD
            live = self._pool.live()
            note_slow(self._journal, live)
            if live or self._live_shown:
                self._journal.file.set_live([test for test, _ in live])
            self._live_shown = bool(live)

    def outcome_of(self, result: Result) -> str:
        """What a run showed, judged by what counts as f now."""
        return str(result_data(result, self._known())["outcome"])

    def _known(self) -> tuple[Failure, ...]:
        """The failures that count as f now; none before f is fixed."""
        state = self._journal.state
        failed = state.failures, state.scenario["failure"]
        if self._failed != failed:
            self._failures = failures_of(self._journal.file, state)
            self._failed = failed
        return self._failures

    def _record(self, test: int, result: Result) -> None:
        journal = self._journal
        data = result_data(result, self._known())
        started = journal.state.test(test)
        environment = journal.state.environments[started.environment]
        before = journal.test(environment, started.run)
        if data["outcome"] in BROKEN:
            # It is made again, unless that has happened already.
            self._started -= {(environment, started.run, full) for full in (False, True)}
        for name in ("first_sensed", "first_touched"):
            data[name] = journal.in_order(data[name])
        if "took_part" in data:
            data["took_part"] = journal.models(data["took_part"])
        journal.record(TestFinished(test=test, **data), motions_of(result))
        compare(journal, [journal.state.test(test)])
        if (
            before is not None
            and before.cut
            and data["outcome"] not in (before.outcome, *BROKEN)
            and not data["cut"]
        ):
            journal.record(EarlyStopEnded(test=before.id, by=test))
