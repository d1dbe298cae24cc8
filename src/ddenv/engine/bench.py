"""Makes the tests: the next one on a free worker, later ones ahead of time on the others. Records all of them.

Tries of the user come first.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

import numpy as np

from ddenv.amounts import count
from ddenv.engine.auditing import audit_is_due, compare
from ddenv.engine.control import Control, Steered, Stopped
from ddenv.engine.journal import Journal
from ddenv.engine.judging import failures_of, result_data
from ddenv.engine.noting import give_up_if_late, note_slow
from ddenv.engine.pool import Broken
from ddenv.engine.subjects import Asked, Keep
from ddenv.engine.thinking import Thinking
from ddenv.engine.wall_limit import wall_limit
from ddenv.engine.worker import Start
from ddenv.engine.workers import Workers
from ddenv.errors import UserError
from ddenv.reduction.verdict import standing
from ddenv.robot.oracle import Failure
from ddenv.robot.result import RunResult
from ddenv.runfile.state import AHEAD, BROKEN, ISOLATE, Trial
from ddenv.runfile.store import ROBOT, Motions
from ddenv.world.scenario import FailureSpec

Hand = tuple[Keep, int, int]


def open_trials(journal: Journal) -> list[Trial]:
    """The tries without a verdict, oldest first."""
    return [trial for trial in journal.state.trials if not trial.verdict]


def judge_trials(journal: Journal) -> list[Hand]:
    """Writes the verdicts that are due; returns the tests still needed as (models, run, trial), oldest first."""
    wanted: list[Hand] = []
    for trial in open_trials(journal):
        keep = frozenset(trial.models)
        now = standing([keep], journal.shown, journal.rule)
        if now.verdicts[0]:
            _judge(journal, trial, keep, now.verdicts[0])
        else:
            wanted += [(keep, run, trial.number) for _, run in now.wanted]
    return wanted


def _judge(journal: Journal, trial: Trial, keep: Keep, verdict: str) -> None:
    tests = journal.tests_of(keep, journal.rule)
    known = sum(journal.state.tests[test - 1].trial != trial.number for test in tests)
    journal.record("trial_judged", trial=trial.number, verdict=verdict, tests=tests, known=known)


# How long to wait for a test before looking at commands again, and between two looks at the running robots, s.
WAIT = 0.05
LIVE_PERIOD = 0.1
# What takes longer than this shows that it is under way, s.
PATIENCE = 1.0
# Maximum number of broken tests in a row. If the simulator itself does not work (no licence, no display, a full disk), all tests
# break, and the reduction would read that as "no f". In worlds that break only some tests, others end.
MOST_BROKEN = 25

Wanted = list[tuple[Keep, int, int | None]]
# So many tests that are likely to be wanted and not started yet, the likeliest first.
Likely = Callable[[int, Callable[[Asked], bool]], list[Asked]]


class Bench:
    """Makes tests with `pool`, as `control` allows, and records them in `journal`.

    Before f is fixed, a run that failed is recorded as "failed".
    """

    def __init__(self, journal: Journal, pool: Workers, control: Control) -> None:
        self._failures: tuple[Failure, ...] = ()
        self._failed: tuple[int, ...] = ()
        self._journal = journal
        self._numbers = {name: number for number, name in enumerate(journal.state.elements)}
        self._pool = pool
        self._control = control
        self._started: set[tuple[Keep, int, bool]] = set()
        self._next_live = 0.0
        self._live_shown = False
        self._broken = 0
        self._thinking = Thinking()
        # Whether no test ended at the last look: where tests end at once, nobody waits for thoughts.
        self._quiet = False

    def work(
        self,
        phase: str,
        round: int | None,
        wanted: Callable[[], Wanted],
        meanwhile: Iterator[object] | None = None,
        likely: Likely | None = None,
    ) -> None:
        """Makes tests until none is wanted. While tests run, advances `meanwhile` (`Thinking`).

        `wanted()` lists the tests still needed as (models, run, candidate), in the order in which one worker would make
        them; it is called again after every look. Several workers take what is `likely` to be wanted, the likeliest first, if that
        is given. Raises Stopped, Steered, and UserError if nothing can be simulated or all tests break.
        """
        self._thinking.begin(meanwhile)
        while tests := wanted():
            if self._start(self._next(phase, round, tests, likely)):
                # Other tests may be wanted now.
                self._look(0.0)
            else:
                self.tick()

    def _next(self, phase: str, round: int | None, tests: Wanted, likely: Likely | None) -> list[Asked]:
        """The tests to start now, as many as workers are free. A step is one test, the next in order; nothing runs ahead."""
        speculates = self._control.speculates()
        free = self._pool.idle if speculates else int(self._pool.busy == 0)
        if not free or not self._control.may_start():
            return []
        asked = (Asked(phase, keep, run, round, candidate) for keep, run, candidate in tests)
        if likely is None or not speculates or self._journal.state.jobs <= 1:
            return list(islice((one for one in asked if not self._is_started(one)), free))
        first = next(asked)
        if self._is_started(first):
            return likely(free, self._is_started)
        # Without it nothing goes on, and whoever looks ahead may not have come to it.
        this = first.keep, first.run
        others = likely(free - 1, lambda one: (one.keep, one.run) == this or self._is_started(one)) if free > 1 else []
        return [first, *others]

    def _is_started(self, asked: Asked) -> bool:
        return (asked.keep, asked.run, self._journal.is_full(asked.phase)) in self._started

    def _start(self, tests: list[Asked]) -> bool:
        """Starts tests on free workers. Returns whether one was implied, and so needs none."""
        for asked in tests:
            if not self._control.may_start():
                return False
            implied = self._make(asked)
            if implied is None:
                return False
            self._control.started()
            if implied:
                return True
        return False

    def _make(self, asked: Asked) -> bool | None:
        """Starts a test, or writes its result if another one implies it; returns whether that is so, None if none may start.

        Raises Stopped if it is used up and no test runs.
        """
        journal, full = self._journal, self._journal.is_full(asked.phase)
        source = journal.implying(asked.keep, asked.run, full)
        if source is not None and asked.phase != "audit" and not audit_is_due(journal.state, asked.phase):
            journal.imply(asked, source)
            return True
        # The budget is that of the reduction, which is over.
        if (asked.phase != ISOLATE and self._is_spent()) or not self._control.has_room():
            return None
        test = journal.start_test(asked, source)
        self._started.add((asked.keep, asked.run, full))
        # To be compared, it ends as the other one did.
        full = full or (source is not None and journal.is_full(journal.state.tests[source - 1].phase))
        self._pool.submit(test, asked.keep, journal.state.tests[test - 1].seed, full, wall_limit(journal.state))
        return False

    def settle(self, elements: Keep, late: Callable[[], None]) -> Start | Broken:
        """How the world settles; calls `late` once if that takes longer than `PATIENCE`. Raises as `work`."""
        found = self._pool.settle(elements)
        until = time.monotonic() + PATIENCE
        while (result := found()) is None:
            if time.monotonic() > until:
                until = math.inf
                late()
            self.tick()
        return result

    def finish_trials(self) -> None:
        """Obeys the last commands, and makes the tests that the user asked for. Raises as `work`."""
        self._control.poll()
        while self._control.holds or (self._journal.state.failures and open_trials(self._journal)):
            self.tick()

    def _serve_trials(self) -> None:
        """Starts tests of tries, also while the rounds are paused. Raises Stopped if the budget is used up."""
        if not self._journal.state.failures or not open_trials(self._journal):
            return
        wanted = [Asked("hand", keep, run, trial=trial) for keep, run, trial in judge_trials(self._journal)]
        for asked in [one for one in wanted if not self._is_started(one)][: self._pool.idle]:
            if self._make(asked) is None:
                return

    def _is_spent(self) -> bool:
        """Whether no test may start any more. Raises Stopped once none runs."""
        state = self._journal.state
        if state.budget is None or state.made + self._pool.busy < state.budget:
            return False
        if self._pool.busy == 0:
            raise Stopped(f"the budget of {count(state.budget, 'test')} is used up")
        return True

    def tick(self) -> None:
        """Obeys commands, records finished tests, shows the running robots. Raises as `work`.

        Does not return if the user has changed something: the old search must not use a test that ends now.
        """
        self._look(WAIT)

    def _look(self, wait: float) -> None:
        """As `tick`; waits at most `wait` s for a test to finish."""
        self._look_around(wait)
        while self._control.holds:
            if self._control.may_search:
                raise Steered
            self._look_around(WAIT)

    def _look_around(self, wait: float) -> None:
        self._control.poll()
        thinks = self._quiet and self._pool.busy > 0 and self._thinking.step()
        finished = self._pool.finished(0.0 if thinks else wait)
        for test, result in finished:
            self._record(test, result)
            self._thinking.test_ended()
            if self._journal.state.tests[test - 1].phase != AHEAD:
                self._give_up_if_all_break(result)
        self._quiet = not finished
        # Before the search gets the workers that are free now.
        self._serve_trials()
        if self._pool.busy == 0:
            self._control.settled()
            if not finished:
                time.sleep(wait)
        if time.monotonic() >= self._next_live:
            self._next_live = time.monotonic() + LIVE_PERIOD
            self._show_live()

    def _give_up_if_all_break(self, result: RunResult | Broken) -> None:
        """Raises UserError after too many broken tests in a row, or if the whole world takes too long."""
        if result.outcome == "timeout":
            give_up_if_late(self._journal, result.failure)
        self._broken = self._broken + 1 if result.outcome in BROKEN else 0
        if self._broken >= MOST_BROKEN:
            raise UserError(
                f"{self._broken} tests in a row broke, the last one: {result.failure}; "
                f"fix this and continue with 'ddenv resume {self._journal.file.path}' (these tests are then made again)"
            )

    def _show_live(self) -> None:
        note_slow(self._journal, self._pool.paces())
        live = self._pool.live()
        if live or self._live_shown:
            self._journal.file.set_live(live)
        self._live_shown = bool(live)

    def _record(self, test: int, result: RunResult | Broken) -> None:
        motions: Motions = {}
        if isinstance(result, RunResult):
            motions = {ROBOT: _samples(result.trajectory)}
            motions |= {name: _samples(motion) for name, motion in result.motions.items()}
        data = result_data(result, self._counted())
        if data["outcome"] in BROKEN:
            # It is made again, unless that has happened already.
            started = self._journal.state.tests[test - 1]
            self._started.discard((self._journal.keep_of_test(test), started.run, self._journal.is_full(started.phase)))
        noticed: dict[str, Any] = {key: self._numbered(data[key]) for key in ("first_sensed", "first_touched")}
        if "took_part" in data:
            noticed["took_part"] = sorted(self._numbers[name] for name in data["took_part"] if name in self._numbers)
        self._journal.record("test_finished", motions, test=test, **data | noticed)
        compare(self._journal, [self._journal.state.tests[test - 1]])

    def _counted(self) -> tuple[Failure, ...]:
        """f, and the other failures that the user accepted."""
        state = self._journal.state
        if self._failed != state.failures:
            spec = FailureSpec.model_validate(state.scenario["failure"])
            self._failures, self._failed = failures_of(self._journal.file, state, spec), state.failures
        return self._failures

    def _numbered(self, times: dict[str, float]) -> list[list[float]]:
        """`times` by name, s, as [number of the model, s] in order of time; only for elements."""
        numbers = self._numbers
        pairs = sorted((seconds, numbers[name]) for name, seconds in times.items() if name in numbers)
        return [[number, seconds] for seconds, number in pairs]


def _samples(trajectory: np.ndarray) -> bytes:
    return np.ascontiguousarray(trajectory, dtype="<f8").tobytes()
