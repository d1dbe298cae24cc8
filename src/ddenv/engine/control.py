"""What the user asked of a running engine: pause, steps, vetoes, accepts. It reads the run file's commands."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

from ddenv.engine.journal import Journal
from ddenv.engine.steering import STEERING, Steering
from ddenv.runfile.store import Event

# Several decisions in a row make one new search of it, s.
SETTLE = 0.5


class Stopped(Exception):
    """The engine was asked to stop."""


class Steered(Exception):
    """The user changed something that the search has to begin anew for."""


class Control:
    """Commands turned into events and into what the driver may do next.

    `credit` is how many tests may still start before a pause, None for any number. A command that makes no sense any more
    (a veto of a judged candidate, an accept of nothing) is refused with the reason. `terminated` is set by a signal,
    `since` is when this engine was asked to start (Unix time, s).
    """

    def __init__(self, journal: Journal, terminated: threading.Event, since: float = math.inf) -> None:
        self._journal = journal
        self._terminated = terminated
        self._paused = False
        self._credit: int | None = None
        self._pause_after_round = False
        self._searches = False
        self._last = -math.inf
        self._steering = Steering(journal)
        self._forget_old_stops(since)

    def _forget_old_stops(self, since: float) -> None:
        """What was meant for the ways of an engine that is gone must not hold this one; what it was told of candidates counts."""
        for command in self._journal.file.commands(self._journal.state.last_command):
            if command.time >= since:
                return
            if command.kind in ("stop", "pause", "step", "accept_mode"):
                self._handled(command)
            else:
                self._obey(command)

    def poll(self) -> None:
        """Obeys new commands. Raises Stopped."""
        if self._terminated.is_set():
            raise Stopped("the engine was terminated")
        for command in self._journal.file.commands(self._journal.state.last_command):
            self._obey(command)
            self._last = time.monotonic()
            if command.kind == "accept":
                # The reduction is made before anything else is decided.
                return

    def search_begins(self) -> None:
        """From now on what the user changes ends a search."""
        self._searches = True

    @property
    def holds(self) -> bool:
        """Whether the search that is on is over, since the user changed something."""
        return self._searches and self._journal.steered

    @property
    def may_search(self) -> bool:
        """Whether a new search may begin: not while the run is paused, and not before the user has come to rest."""
        return not self._paused and time.monotonic() - self._last > SETTLE

    def may_start(self) -> bool:
        """Whether a test may start now."""
        return not self._paused and self._credit != 0

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

    def _obey(self, command: Event) -> None:
        """Once, whenever the engine is killed: the event that it becomes says which command it was."""
        self._journal.command = command.id
        try:
            if why := self._try(command):
                self._journal.record("command_refused", why=why)
        finally:
            # A stop leaves by an exception, and must not be met again.
            self._journal.command = None
            if self._journal.state.last_command < command.id:
                self._handled(command)

    def _try(self, command: Event) -> str:
        if command.kind in STEERING:
            why = STEERING[command.kind](self._steering, command.data)
            if command.kind == "go_back" and not why and not self._paused:
                self._pause()
            return why
        obey = getattr(self, f"_obey_{command.kind}", None)
        return f"there is no command '{command.kind[:40]}'" if obey is None else obey(command.data) or ""

    def _handled(self, command: Event) -> None:
        self._journal.record("command_handled", command=command.id)

    def _obey_pause(self, _: dict[str, Any]) -> None:
        if not self._paused:
            self._pause()

    def _obey_resume(self, _: dict[str, Any]) -> None:
        self._run(credit=None, pause_after_round=False)

    def _obey_step(self, data: dict[str, Any]) -> None:
        if data.get("unit") == "round":
            self._run(credit=None, pause_after_round=True)
        else:
            self._run(credit=1, pause_after_round=False)

    def _obey_accept_mode(self, data: dict[str, Any]) -> str:
        if data.get("mode") not in ("automatic", "ask"):
            return "the accept mode is automatic or ask"
        self._journal.record("accept_mode", mode=data["mode"])
        return ""

    def _obey_stop(self, _: dict[str, Any]) -> None:
        raise Stopped("stopped by the user")

    def _run(self, credit: int | None, pause_after_round: bool) -> None:
        self._credit, self._pause_after_round = credit, pause_after_round
        if self._paused:
            self._paused = False
            self._journal.record("resumed")

    def _pause(self) -> None:
        self._paused, self._credit, self._pause_after_round = True, None, False
        self._journal.record("paused")
