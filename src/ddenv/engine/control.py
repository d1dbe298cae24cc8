"""Obeys what the user asks of a running engine: each command becomes an event, or a refusal with
its reason. It also watches the disk and the clock.
"""

from __future__ import annotations

import math
import resource
import shutil
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

from ddenv.engine.journal import Journal
from ddenv.engine.judging import failure_of, fixed_again, rejudged
from ddenv.environment import Environment, Numbers
from ddenv.errors import UserError
from ddenv.guiding import commands as c
from ddenv.runfile import events
from ddenv.runfile.fold_decisions import failures_at, with_settings
from ddenv.runfile.store import LOGS, NoRoom, Request, RunFile

# Decisions within this time start one new search, not several, s.
SETTLE = 0.5
# Commands sent to an earlier engine must not pause this one.
OF_THE_MOMENT = (c.Stop, c.Pause, c.Step, c.AcceptMode)


class Stopped(Exception):
    """The engine was asked to stop."""


# What has to be free before a test starts, bytes: the results of tests in flight, and SQLite's log
# of them.
NEEDED = 32_000_000
# The same below the limit of a file's size: it is one result's, since the limit is there for all
# files.
NEEDED_IN_FILE = 2_000_000
# The time between two looks, s.
PERIOD = 1.0


class DiskSpace:
    """Watches the disk of a run file. `terminated` ends all waiting."""

    def __init__(self, file: RunFile, terminated: threading.Event) -> None:
        self._file = file
        self._terminated = terminated
        self._next = 0.0
        self._enough = True
        self._telling = False

    def enough(self) -> bool:
        """Whether a test may start. Writes an event when that changes."""
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + PERIOD
            self._tell(self._room())
        return self._enough

    def wait(self, full: NoRoom) -> bool:
        """Waits for a moment; returns whether to try again what found no room."""
        if self._telling or self._terminated.is_set():
            return False
        room = replace(self._room(), enough=False)
        if self._enough:
            if room.in_file:
                until = "the limit of a file's size (ulimit -f) is raised"
            else:
                until = f"{NEEDED / 1e6:.0f} MB are free"
            # The log may be on the same disk.
            with suppress(OSError):
                print(f"{full}; waits until {until}", file=sys.stderr, flush=True)
        self._tell(room)
        return not self._terminated.wait(PERIOD)

    def _tell(self, room: events.DiskSpace) -> None:
        if room.enough == self._enough:
            return
        self._enough = room.enough
        # A small event may find room where a result does not.
        self._telling = True
        with suppress(UserError):
            self._file.append(room)
        self._telling = False

    def _room(self) -> events.DiskSpace:
        path = self._file.path
        limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
        if limit != resource.RLIM_INFINITY:
            files = (path, *(path.with_name(f"{path.name}{ending}") for ending in LOGS))
            below = limit - max(file.stat().st_size for file in files if file.exists())
            if below < NEEDED_IN_FILE:
                return events.DiskSpace(
                    enough=False, needed=NEEDED_IN_FILE, free=max(0, below), in_file=True
                )
        free = shutil.disk_usage(path.parent).free
        return events.DiskSpace(enough=free >= NEEDED, needed=NEEDED, free=free)


# How far a clock that is kept exact may go on or back between two looks, s.
SMALL = 2.0


def clock_offset() -> float:
    """Unix time less that of a clock that stands still while the machine sleeps, and that nobody
    can set, s.
    """
    return time.time() - time.monotonic()


class Control:
    """Commands turned into events and into what the driver may do next.

    `terminated` is set by a signal, `after` is the number of the last command before this engine
    was asked to start. `attended`: somebody looks at the run and can answer.
    """

    def __init__(
        self,
        journal: Journal,
        terminated: threading.Event,
        after: float = math.inf,
        disk: DiskSpace | None = None,
        attended: bool = False,
    ) -> None:
        self._journal = journal
        self._terminated = terminated
        self._attended = attended
        self._paused = False
        self._credit: int | None = None
        self._pause_after_round = False
        self._searches = False
        self._last = -math.inf
        self._disk = disk
        self._offset = clock_offset()
        # What was asked for before this engine was.
        for command in self._journal.file.commands(self._journal.state.last_command):
            if command.id > after:
                return
            if c.KINDS.get(command.kind) in OF_THE_MOMENT:
                self._handled(command)
            else:
                self._obey(command)

    def poll(self) -> None:
        """Obeys new commands. Raises Stopped."""
        if self._terminated.is_set():
            raise Stopped("the engine was terminated")
        # What is reckoned from the time that the run took would be wrong after a jump of the clock.
        offset = clock_offset()
        jump = offset - self._offset
        self._offset = offset
        if abs(jump) > SMALL:
            self._journal.record(events.ClockJumped(seconds=jump))
        for command in self._journal.file.commands(self._journal.state.last_command):
            self._obey(command)
            self._last = time.monotonic()
            if c.KINDS.get(command.kind) is c.Accept:
                # The reduction comes before any other decision.
                return

    def search_begins(self) -> None:
        """From now on what the user changes ends a search."""
        self._searches = True

    @property
    def holds(self) -> bool:
        """Whether the current search is over because the user changed something."""
        return self._searches and self._journal.state.search_due

    @property
    def may_search(self) -> bool:
        """Whether a new search may begin: not while the run is paused, and not until the user has
        stopped making changes.
        """
        return not self._paused and time.monotonic() - self._last > SETTLE

    def may_start(self) -> bool:
        """Whether a test may start now."""
        return not self._paused and self._credit != 0

    def has_disk_space(self) -> bool:
        """Whether the disk has space for the results of more tests."""
        return self._disk is None or self._disk.enough()

    def speculates(self) -> bool:
        """Whether idle workers may run ahead: not while the user steps."""
        return self._credit is None

    def started(self) -> None:
        """A test was started."""
        if self._credit is not None:
            self._credit -= 1

    def settled(self) -> None:
        """No test runs: a step of one test is over."""
        if self._credit == 0:
            self._pause()

    def round_finished(self) -> None:
        """A round, or the baseline, is over."""
        if self._pause_after_round:
            self._pause()

    def offered(self) -> None:
        """A note offers another way: whoever looks has time to choose it, and an unattended run
        goes on.
        """
        if self._attended and not self._paused:
            self._pause()

    def _obey(self, request: Request) -> None:
        """Obeys a command exactly once, even if the engine is killed: its event holds the command's
        number.
        """
        self._journal.command = request.id
        try:
            try:
                command = c.parse(request.kind, request.data)
                why = c.refusal(command, c.Context(self._journal.state))
                if not why:
                    self._do(command)
            except UserError as error:
                why = str(error)
            if why:
                self._journal.record(events.CommandRefused(why=why))
        finally:
            # A stop raises an exception, and must not be read again.
            self._journal.command = None
            if self._journal.state.last_command < request.id:
                self._handled(request)

    def _handled(self, request: Request) -> None:
        self._journal.command = request.id
        self._journal.record(events.CommandHandled())
        self._journal.command = None

    def _do(self, command: c.Command) -> None:
        """Does what is possible now. Raises Stopped."""
        match command:
            case c.Pause():
                if not self._paused:
                    self._pause()
            case c.Resume():
                self._run(credit=None, pause_after_round=False)
            case c.Step(unit):
                self._run(credit=1 if unit == "test" else None, pause_after_round=unit == "round")
            case c.Stop():
                raise Stopped("stopped by the user")
            case c.Undo():
                here = self._journal.state.here
                if here is not None and here.parent is not None:
                    self._go(here.parent, rejected=here.number)
            case c.GoBack(node):
                self._go(node, rejected=None)
                if not self._paused:
                    self._pause()
            case _:
                self._journal.record(_EVENTS[type(command)](self._journal, command))

    def _run(self, credit: int | None, pause_after_round: bool) -> None:
        self._credit = credit
        self._pause_after_round = pause_after_round
        if self._paused:
            self._paused = False
            self._journal.record(events.Resumed())

    def _pause(self) -> None:
        self._paused = True
        self._credit = None
        self._pause_after_round = False
        self._journal.record(events.Paused())

    def _go(self, node: int, rejected: int | None) -> None:
        state = self._journal.state
        failures = failures_at(state, node)
        outcomes = None if failures == state.failures else _judged(self._journal, failures)
        self._journal.record(events.WentBack(node=node, rejected=rejected, judged=outcomes))


def _judged(journal: Journal, failures: Numbers) -> events.Outcomes:
    """The outcomes of all tests if the ends of `failures` count as f."""
    file = journal.file
    state = journal.state
    return rejudged(file, state, tuple(failure_of(file, state, test) for test in failures))


def _changed(journal: Journal, asked: c.Change) -> events.Event:
    state = journal.state
    new = asked.new(state)
    if c.JUDGES.isdisjoint(new) or state.baseline is None:
        return events.Changed(settings=new)
    # Stored ends are judged again.
    after = state.changed(scenario=with_settings(state.scenario, new))
    return events.Changed(settings=new, baseline=fixed_again(journal.file, after))


def _adopted(journal: Journal, asked: c.Adopt) -> events.Event:
    trial = journal.state.trials[asked.trial - 1]
    return events.Adopted(
        trial=asked.trial, environment=trial.environment, evidence_test=trial.tests[-1]
    )


def _left_out(journal: Journal, asked: c.LeaveOut) -> events.Event:
    test = asked.evidence(journal.state)
    assert test is not None
    return events.LeftOut(
        without=asked.model, environment=test.environment, evidence_test=test.id, by_user=True
    )


def _accepted_other(journal: Journal, asked: c.AcceptOther) -> events.Event:
    state = journal.state
    test = state.test(asked.test)
    unnamed = asked.instead or test.phase == "hand"
    what = f"test {test.id}" if unnamed else c.label_of(state, test)
    judged = _judged(journal, (test.id,) if asked.instead else (*state.failures, test.id))
    trial = None if asked.instead else test.trial
    return events.AcceptedOther(
        test=test.id,
        what=what,
        environment=test.environment,
        judged=judged,
        trial=trial,
        instead=asked.instead,
    )


# What each decision of the user is in the run file.
_EVENTS: dict[type[c.Command], Callable[[Journal, Any], events.Event]] = {
    c.AcceptMode: lambda journal, asked: events.AcceptModeChanged(mode=asked.mode),
    c.Accept: lambda journal, asked: events.Decided(
        round=asked.round, candidate=asked.candidate, decision="accept"
    ),
    c.Reject: lambda journal, asked: events.Decided(
        round=asked.round, candidate=asked.candidate, decision="reject"
    ),
    c.Veto: lambda journal, asked: events.Vetoed(round=asked.round, candidate=asked.candidate),
    c.Unveto: lambda journal, asked: events.Unvetoed(round=asked.round, candidate=asked.candidate),
    c.Pin: lambda journal, asked: events.Pinned(
        models=c.numbers_of(journal.state, asked.new(journal.state))
    ),
    c.Unpin: lambda journal, asked: events.Unpinned(
        models=c.numbers_of(journal.state, asked.pinned(journal.state))
    ),
    c.Try: lambda journal, asked: events.TrialStarted(
        trial=len(journal.state.trials) + 1,
        environment=journal.number(Environment.of(asked.models)),
    ),
    c.Adopt: _adopted,
    c.LeaveOut: _left_out,
    c.AcceptOther: _accepted_other,
    c.Change: _changed,
}
