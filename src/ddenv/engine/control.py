"""Obeys what the user asks of a running engine: each command becomes an event, or a refusal with its reason."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

from ddenv.engine.clock_jumps import ClockJumps
from ddenv.engine.journal import Journal
from ddenv.engine.judging import failure_of, rejudged
from ddenv.engine.room import Room
from ddenv.errors import UserError
from ddenv.guiding.commands import Command, parse, refusal
from ddenv.guiding.course import Change, GoBack, Undo
from ddenv.guiding.pace import AcceptMode, Pause, Resume, Step, Stop
from ddenv.guiding.reductions import Accept, Reject, Unveto, Veto
from ddenv.guiding.selections import AcceptOther, Adopt, Pin, Try, Unpin
from ddenv.guiding.situation import Situation, label_of, names_of, numbers_of
from ddenv.runfile.atlas import models_of
from ddenv.runfile.fold_decisions import failures_at
from ddenv.runfile.store import Event
from ddenv.world.scenario import FailureSpec

# Decisions within this time start one new search, not several, s.
SETTLE = 0.5
# Commands sent to an earlier engine must not pause this one.
OF_THE_MOMENT = (Stop, Pause, Step, AcceptMode)


class Stopped(Exception):
    """The engine was asked to stop."""


class Steered(Exception):
    """The user changed something, so the search has to start again."""


class Control:
    """Commands turned into events and into what the driver may do next.

    `credit` is how many tests may still start before a pause, None for any number. `terminated` is set by a signal, `after` is
    the number of the last command before this engine was asked to start. `room` says whether the disk has room for more tests.
    """

    def __init__(
        self, journal: Journal, terminated: threading.Event, after: float = math.inf, room: Room | None = None
    ) -> None:
        self._journal = journal
        self._terminated = terminated
        self._paused = False
        self._credit: int | None = None
        self._pause_after_round = False
        self._searches = False
        self._last = -math.inf
        self._room = room
        self._jumps = ClockJumps(journal)
        self._catch_up(after)

    def _catch_up(self, after: float) -> None:
        """Obeys what was asked for before this engine was."""
        for command in self._journal.file.commands(self._journal.state.last_command):
            if command.id > after:
                return
            if command.kind in [each.kind for each in OF_THE_MOMENT]:
                self._handled(command)
            else:
                self._obey(command)

    def poll(self) -> None:
        """Obeys new commands. Raises Stopped."""
        if self._terminated.is_set():
            raise Stopped("the engine was terminated")
        self._jumps.look()
        for command in self._journal.file.commands(self._journal.state.last_command):
            self._obey(command)
            self._last = time.monotonic()
            if command.kind == Accept.kind:
                # The reduction comes before any other decision.
                return

    def search_begins(self) -> None:
        """From now on what the user changes ends a search."""
        self._searches = True

    @property
    def holds(self) -> bool:
        """Whether the current search is over because the user changed something."""
        return self._searches and self._journal.steered

    @property
    def may_search(self) -> bool:
        """Whether a new search may begin: not while the run is paused, and not until the user has stopped making changes."""
        return not self._paused and time.monotonic() - self._last > SETTLE

    def may_start(self) -> bool:
        """Whether a test may start now."""
        return not self._paused and self._credit != 0

    def has_room(self) -> bool:
        """Whether the disk has room for the results of more tests."""
        return self._room is None or self._room.enough()

    def speculates(self) -> bool:
        """Whether idle workers may run ahead: not while the user steps."""
        return self._credit is None

    def ends_with_round(self) -> bool:
        """Whether the user steps, so that nothing of later rounds is made."""
        return self._pause_after_round

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

    def _obey(self, event: Event) -> None:
        """Obeys a command exactly once, even if the engine is killed: its event holds the command's number."""
        self._journal.command = event.id
        try:
            if why := self._why_not(event):
                self._journal.record("command_refused", why=why)
        finally:
            # A stop raises an exception, and must not be read again.
            self._journal.command = None
            if self._journal.state.last_command < event.id:
                self._handled(event)

    def _why_not(self, event: Event) -> str:
        """Obeys a command, or returns why it is not possible now."""
        try:
            command = parse(event.kind, event.data)
        except UserError as error:
            return str(error)
        journal = self._journal
        now = Situation(journal.state, search_due=journal.steered)
        why = refusal(command, now)
        if not why:
            _OBEYED[type(command)](self, command)
        return why

    def _handled(self, event: Event) -> None:
        self._journal.record("command_handled", command=event.id)

    # Speed.

    def _obey_pause(self, _: Pause) -> None:
        if not self._paused:
            self._pause()

    def _obey_resume(self, _: Resume) -> None:
        self._run(credit=None, pause_after_round=False)

    def _obey_step(self, step: Step) -> None:
        whole_round = step.unit == "round"
        self._run(credit=None if whole_round else 1, pause_after_round=whole_round)

    def _obey_accept_mode(self, asked: AcceptMode) -> None:
        self._journal.record("accept_mode", mode=asked.mode)

    def _obey_stop(self, _: Stop) -> None:
        raise Stopped("stopped by the user")

    def _run(self, credit: int | None, pause_after_round: bool) -> None:
        self._credit, self._pause_after_round = credit, pause_after_round
        if self._paused:
            self._paused = False
            self._journal.record("resumed")

    def _pause(self) -> None:
        self._paused, self._credit, self._pause_after_round = True, None, False
        self._journal.record("paused")

    # Candidates.

    def _decide(self, asked: Accept | Reject) -> None:
        self._journal.record("decided", round=asked.round, candidate=asked.candidate, decision=asked.kind)

    def _veto(self, asked: Veto) -> None:
        self._journal.record("vetoed", round=asked.round, candidate=asked.candidate, verdict="vetoed")

    def _unveto(self, asked: Unveto) -> None:
        self._journal.record("unvetoed", round=asked.round, candidate=asked.candidate)

    # Models.

    def _pin(self, asked: Pin) -> None:
        self._journal.record("pinned", models=self._numbers(asked.new(self._journal.state)))

    def _unpin(self, asked: Unpin) -> None:
        self._journal.record("unpinned", models=self._numbers(asked.pinned(self._journal.state)))

    def _try(self, asked: Try) -> None:
        state = self._journal.state
        models = numbers_of(state, names_of(state, asked.models, empty=True) or ())
        self._journal.record("trial_started", trial=len(state.trials) + 1, models=list(models))

    def _adopt(self, asked: Adopt) -> None:
        trial = self._journal.state.trials[asked.trial - 1]
        environment = self._numbers(trial.models)
        self._journal.record("adopted", trial=asked.trial, environment=environment, evidence_test=trial.tests[-1])

    def _accept_other(self, asked: AcceptOther) -> None:
        journal, state = self._journal, self._journal.state
        test, keep = state.tests[asked.test - 1], frozenset(models_of(state, state.tests[asked.test - 1]))
        unnamed = asked.instead or test.phase == "hand"
        journal.record(
            "accepted_other",
            test=test.id,
            what=f"test {test.id}" if unnamed else label_of(state, test),
            trial=None if asked.instead else test.trial,
            environment=self._numbers(name for name in state.elements if name in keep),
            instead=asked.instead,
            **self._judged((test.id,) if asked.instead else (*state.failures, test.id)),
        )

    # Going back, and other settings.

    def _undo(self, _: Undo) -> None:
        here = self._journal.state.here
        if here is not None and here.parent is not None:
            self._go(here.parent, rejected=here.number)

    def _go_back(self, asked: GoBack) -> None:
        self._go(asked.node, rejected=None)
        if not self._paused:
            self._pause()

    def _change(self, asked: Change) -> None:
        self._journal.record("changed", settings=asked.new(self._journal.state))

    def _go(self, node: int, rejected: int | None) -> None:
        state = self._journal.state
        failures = failures_at(state, node)
        judged = {} if failures == state.failures else self._judged(failures)
        self._journal.record("went_back", node=node, rejected=rejected, **judged)

    def _judged(self, failures: tuple[int, ...]) -> dict[str, Any]:
        """The outcomes of all tests if the ends of `failures` count as f."""
        file, state = self._journal.file, self._journal.state
        spec = FailureSpec.model_validate(state.scenario["failure"])
        return rejudged(file, state, tuple(failure_of(file, state, test, spec) for test in failures))

    def _numbers(self, models: Iterable[str]) -> list[int]:
        """In the order of `models`."""
        number = {name: index for index, name in enumerate(self._journal.state.elements)}
        return [number[name] for name in models]


_OBEYED: dict[type[Command], Callable[[Control, Any], None]] = {
    Pause: Control._obey_pause,
    Resume: Control._obey_resume,
    Step: Control._obey_step,
    AcceptMode: Control._obey_accept_mode,
    Stop: Control._obey_stop,
    Accept: Control._decide,
    Reject: Control._decide,
    Veto: Control._veto,
    Unveto: Control._unveto,
    Pin: Control._pin,
    Unpin: Control._unpin,
    Try: Control._try,
    Adopt: Control._adopt,
    AcceptOther: Control._accept_other,
    Undo: Control._undo,
    GoBack: Control._go_back,
    Change: Control._change,
}
