"""Finds margins with workers and a run file: tries values of numbers as `evidence.margins` asks for
them. All of it follows from the run file, so a search that was killed comes to the same table.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace

from ddenv.engine.control import Control, Stopped
from ddenv.engine.journal import Journal
from ddenv.engine.judging import failures_of, motions_of, result_data
from ddenv.engine.limits import wall_limit
from ddenv.engine.pool import Workers
from ddenv.engine.scheduler import MOST_BROKEN, WAIT
from ddenv.engine.worker import Result, Run
from ddenv.errors import UserError
from ddenv.evidence import margins as known
from ddenv.evidence.claims import current
from ddenv.evidence.rates import estimated_rate
from ddenv.robot.oracle import ends_of
from ddenv.run_numbers import FIXES
from ddenv.runfile import events
from ddenv.runfile.progress import Margins
from ddenv.runfile.state import BROKEN, RunState
from ddenv.runs.changes import beside
from ddenv.runs.engine_job import FindMargins
from ddenv.world.extent import center
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario, seed_of
from ddenv.world.sdf.numbers import NotPossible, Number, check, chosen, numbers_of

# What the robot runs in.
Parts = tuple[Scenario, World, Model]
# A run: the number's name, its value, and the number of the run.
Wanted = tuple[str, float, int]


def numbers_left(parts: Parts, state: RunState, globs: Sequence[str]) -> list[Number]:
    """The numbers of what is left whose names match, those that promise most first. Raises
    UserError.
    """
    f = state.f_position or (0.0, 0.0, 0.0)
    world = parts[1]
    kept = sorted(state.environment, key=lambda name: math.dist(center(world.model(name)), f))
    return chosen(numbers_of(*parts, kept), globs)


def refusal(state: RunState, where: object) -> str:
    """Why no margins of the run `where` can be found now, and what to do; "" if they can."""
    certificate = current(state)
    if state.baseline is None:
        return f"f is not known yet, so there are no margins; run it first: ddenv resume {where}"
    if state.margining is None and (
        state.status not in ("finished", "stopped") or state.isolating is not None
    ):
        return f"its search has not finished; finish it first: ddenv resume {where}"
    left = None if certificate is None else certificate.claims[0]
    if (state.baseline.rate if left is None else left.shown / left.runs) < known.RAREST:
        return (
            "f shows too rarely in what is left to say where it disappears; reduce a failure "
            "that shows more often (--failure)"
        )
    if state.environment:
        return ""
    return "nothing is left, so there is no model with a margin"


@dataclass(frozen=True, kw_only=True)
class Stood:
    """How a run was before a search for margins: its status, and why."""

    status: str
    reason: str


def find_margins(
    parts: Parts,
    journal: Journal,
    pool: Workers,
    control: Control,
    asked: FindMargins | None,
    stood: Stood,
) -> None:
    """Finds the margins that are `asked` for, or goes on with the open search.

    The run is then as it `stood`. Raises Stopped, and UserError.
    """
    now = journal.state.margining
    if asked is not None:
        numbers = numbers_left(parts, journal.state, asked.globs)
        wanted = tuple(one.name for one in numbers)
        if now is not None:
            stood = Stood(status=now.asked.status, reason=now.asked.before)
        if now is None or (now.wanted, now.asked.budget) != (wanted, asked.most_runs):
            _begin(journal, numbers, asked.most_runs, stood)
    _Search(parts, journal, pool, control).carry_out()
    margins = journal.state.margins
    if (
        margins is not None
        and (pairs := known.pairs_of(margins))
        and not margins.asked.numbers[0].together
    ):
        left = margins.asked.budget - len(margins.runs) + margins.before_call
        if left >= known.FIRST_LOOK:
            journal.record(replace(margins.asked, numbers=pairs, budget=left))
            _Search(parts, journal, pool, control).carry_out()
    journal.record(events.MarginsFinished())


def _begin(journal: Journal, numbers: Sequence[Number], budget: int, stood: Stood) -> None:
    certificate = current(journal.state)
    rate = journal.rate_of_whole()
    if certificate is not None:
        rate = estimated_rate(certificate.claims[0].shown, certificate.claims[0].runs)
    asked = tuple(events.NumberAsked(**asdict(one)) for one in numbers)
    # Two numbers may be changed together at the end.
    error = known.error_each(
        rate, min(budget, known.MOST_OF_NUMBER * (len(numbers) + (len(numbers) > 1)))
    )
    status = "stopped" if stood.status == "stopped" else "finished"
    environment = journal.number(journal.environment)
    certified = certificate is not None
    journal.record(
        events.MarginsStarted(
            numbers=asked,
            environment=environment,
            rate=rate,
            error=error,
            budget=budget,
            certified=certified,
            status=status,
            before=stood.reason,
        )
    )


class _Search:
    def __init__(self, parts: Parts, journal: Journal, pool: Workers, control: Control) -> None:
        self._parts = parts
        self._journal = journal
        self._pool = pool
        self._control = control
        self._failures = failures_of(journal.file, journal.state)
        self._running: dict[int, Wanted] = {}
        self._kept = frozenset(
            journal.state.environments[self._now.asked.environment].names(journal.state.elements)
        )
        self._submitted = len(journal.state.tests)
        self._broken = 0
        left = beside(journal.state)
        self._beside = None if left is None else left.run
        # How many looks at a number are over: the second one has the runs that are left.
        self._looks = 0
        # The values of the current number that are known to be possible.
        self._possible: set[float] = set()

    @property
    def _now(self) -> Margins:
        """The search. Raises Stopped if a decision of the user has ended it."""
        now = self._journal.state.margining
        if now is None or self._journal.state.search_due:
            raise Stopped("a decision of the user ended the search for margins")
        return now

    def carry_out(self) -> None:
        """To the end. Raises Stopped, and UserError if all runs break."""
        while True:
            self._control.poll()
            asked = list(self._wanted())
            if not asked and not self._running:
                return
            for one in asked:
                if not (
                    self._pool.idle and self._control.may_start() and self._control.has_disk_space()
                ):
                    break
                if one not in self._running.values():
                    self._start(one)
            if not self._running:
                self._control.settled()
                time.sleep(WAIT)
            for test, result in self._pool.finished(WAIT):
                self._record(self._running.pop(test), result)

    def _wanted(self) -> Iterator[Wanted]:
        """The runs that are needed next: of one number after the other, twice, then of the nearest
        fix.
        """
        while self._looks < 2 * len(self._now.wanted):
            name = self._now.wanted[self._looks % len(self._now.wanted)]
            now = self._now
            tried = next(one for one in now.numbers if one.asked.name == name)
            used = sum(one.name != name for one in now.runs[now.before_call :])
            earlier = sum(one.name == name for one in now.runs[: now.before_call])
            first_look = self._looks < len(now.wanted) and len(now.wanted) > 1
            most = earlier + min(
                known.FIRST_LOOK if first_look else known.MOST_OF_NUMBER, now.asked.budget - used
            )
            rule = known.Rule(tried.rate, tried.error)
            values = list(known.wanted(tried.asked, rule, known.known_of(now, name), most))
            # Later runs may have ended before earlier ones.
            made = {(one.value, one.run) for one in now.runs if one.name == name}
            new = {value for value, _ in values} - {value for value, _ in made} - self._possible
            if sum(self._is_impossible(name, value) for value in sorted(new)):
                # Others are wanted in their place.
                continue
            self._possible |= new
            if values:
                yield from ((name, value, run) for value, run in values if (value, run) not in made)
                return
            self._looks = self._looks + 1
            self._possible = set()
        runs = range(FIXES.start, FIXES.start + known.FIX_RUNS)
        for fix in known.fixes_of(self._now)[: known.MOST_FIXES]:
            if fix.confirmed is None:
                fresh = {
                    one.run
                    for one in self._now.runs
                    if (one.name, one.value) == (fix.name, fix.value)
                }
                yield from ((fix.name, fix.value, run) for run in runs if run not in fresh)
            if fix.confirmed is not False:
                return

    def _changes(self, name: str, value: float) -> tuple[tuple[str, float], ...]:
        return known.changes_at(
            next(one.asked for one in self._now.numbers if one.asked.name == name), value
        )

    def _is_impossible(self, name: str, value: float) -> bool:
        """Whether a value is not possible; that is recorded then."""
        try:
            check(*self._parts, self._kept, dict(self._changes(name, value)))
        except NotPossible as error:
            self._journal.record(events.MarginImpossible(name=name, value=value, why=str(error)))
            return True
        return False

    def _start(self, one: Wanted) -> None:
        name, value, run = one
        self._submitted += 1
        self._running[self._submitted] = one
        seed = seed_of(self._parts[0].reduction, run)
        limit = wall_limit(self._journal.state)
        # Fresh runs are full ones, as those of a certificate.
        if run >= FIXES.start or not self._journal.stops_early:
            ends = None
        else:
            ends = ends_of(self._failures)
        test = Run(
            keep=self._kept, seed=seed, ends=ends, limit=limit, changes=self._changes(name, value)
        )
        self._pool.submit(self._submitted, test)
        self._control.started()

    def _record(self, one: Wanted, result: Result) -> None:
        data = result_data(result, self._failures)
        name, value, run = one
        seed = seed_of(self._parts[0].reduction, run)
        kept = {
            key: data[key] for key in ("outcome", "failure", "distance", "end_pose", "wall_seconds")
        }
        # Of each value, the run that can be played beside one of what is left.
        motions = motions_of(result) if run == self._beside else None
        ran = events.MarginRan(name=name, value=value, run=run, seed=seed, **kept)
        self._journal.record(ran, motions, -1 - self._now.made)
        self._broken = self._broken + 1 if data["outcome"] in BROKEN else 0
        if self._broken >= MOST_BROKEN:
            raise UserError(f"{self._broken} runs in a row broke; the last one: {data['failure']}")
