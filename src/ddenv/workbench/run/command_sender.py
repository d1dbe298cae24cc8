"""Sends the run screen's commands to the engine in the background, and starts an engine if one is
needed.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.guiding.commands import (
    Accept,
    Command,
    Context,
    Isolate,
    Reject,
    StartEngine,
    drops,
    question,
    refusal,
    said,
    send,
    starts_engine,
)
from ddenv.runfile.snapshot import Snapshot
from ddenv.runs import engine_job, processor
from ddenv.runs.folder import attach_name
from ddenv.text import duration, plain
from ddenv.workbench.shared.background import refuse
from ddenv.workbench.shared.poll import Poll
from ddenv.workbench.shared.processes import Engine

# After this time without an answer the screen says that there is none, s.
PATIENCE = 5
UNTRUSTED = "not done: it starts a program that you do not trust"


class CommandSender:
    """Sends commands for `screen`, and knows which of them the engine has not obeyed yet."""

    def __init__(
        self, screen: Screen[Any], poll: Poll, engine: Engine, changed: Callable[[], None]
    ) -> None:
        """`changed` is called when the command that waits for its answer changes."""
        self._screen = screen
        self._poll = poll
        self._engine = engine
        self._changed = changed
        # The last command, with its id, 0 while it is being sent.
        self._last: tuple[int, Command | None] = (0, None)
        self._asked_at = 0.0
        self.sending = 0
        # The words of the commands of this screen, by their ids.
        self._mine: dict[int, str] = {}
        # The id of the last command that needs an engine, 0 once one was started for it.
        self._due = 0
        # One thread: commands arrive in the order they were sent.
        self._sender = ThreadPoolExecutor(1, "send")

    def close(self) -> None:
        """Commands that were sent are still written."""
        self._sender.shutdown(wait=False)

    @property
    def situation(self) -> Context:
        snapshot = self._poll.snapshot
        last = self._last[1]
        if last is not None and self.waiting_for():
            pending = last.words(snapshot.state).brief
        else:
            pending = ""
        return Context(snapshot.state, snapshot.engine, self.barred, pending)

    @property
    def barred(self) -> str:
        """Why this screen cannot guide the run, or ""."""
        snapshot = self._poll.snapshot
        if self._poll.watch:
            return (
                f"watching only: to guide it, use 'ddenv open {attach_name(self._poll.path)}' "
                "without --watch"
            )
        if snapshot.gone:
            return "the run file is gone: it can no longer be guided; q leaves"
        if snapshot.error:
            return "this run file cannot be read"
        return ""

    def waiting_for(self) -> str:
        (id, command) = self._last
        snapshot = self._poll.snapshot
        if command is None:
            return ""
        words = command.words(snapshot.state).brief
        if self.sending:
            return words
        if snapshot.state.last_command >= id or snapshot.engine != "alive":
            return ""
        late = int(time.monotonic() - self._asked_at)
        if late < PATIENCE:
            return words
        return f"{words}: no answer for {duration(late)}"

    def refuse(self, why: str) -> None:
        refuse(self._screen, why)

    def say(self, what: str) -> None:
        self._screen.notify(plain(what), timeout=4, markup=False)

    def show_refusal(self, before: Snapshot) -> None:
        id, why = self._poll.snapshot.state.refusal
        if (id, why) != before.state.refusal and id in self._mine:
            self.refuse(f"{self._mine[id]}: not done, {why}")

    def ask(self, command: Command | StartEngine | Isolate, *, sure: bool = False) -> None:
        """Sends a command, after its question unless the user is `sure`, or shows why it is not
        possible.
        """
        now = self.situation
        # What waited is decided on, although the engine has not obeyed yet.
        sure = sure or now.pending in ("accept", "reject")
        if why := refusal(command, now):
            self.refuse(why)
        elif isinstance(command, StartEngine):
            self._once_trusted(self._start)
        elif isinstance(command, Isolate):
            self._once_trusted(lambda: self._start(engine_job.Isolate()))
        elif not sure and (dropped := drops(command, now.state)):
            self._decide_first(command, dropped)
        elif sure or not (asked := question(command, now.state)):
            self.send(command)
        else:
            from ddenv.workbench.widgets.question import ask

            ask(self._screen.app, asked, lambda: self.send(command))

    def _decide_first(self, command: Command, dropped: str) -> None:
        """Asks what becomes of the reduction that waits, before the new search that `command`
        begins.
        """
        from ddenv.workbench.run.dialogs import ReductionWaits

        state = self._poll.snapshot.state
        assert state.round is not None and state.waiting_candidate is not None
        reduction = state.round.number, state.waiting_candidate

        def answered(answer: str | None) -> None:
            if answer in ("accept", "reject"):
                self.send(Accept(*reduction) if answer == "accept" else Reject(*reduction))
            if answer in ("accept", "reject", "drop"):
                self.send(command)

        self._screen.app.push_screen(ReductionWaits(dropped), answered)

    def send(self, command: Command, then: Callable[[], None] | None = None) -> None:
        """Sends a command in the background; `then` is called once it is written.

        If no engine is running, the next one obeys it; one starts if the command needs it, and what
        that starts is trusted.
        """
        now = self.situation
        if self._poll.watch:
            self.refuse(self.barred)
        elif now.engine == "absent" and starts_engine(command, now.state):
            self._once_trusted(lambda: self._send(command, then))
        else:
            self._send(command, then)

    def _send(self, command: Command, then: Callable[[], None] | None) -> None:
        now = self.situation
        if words := said(command, now):
            self.say(words)
        self.sending += 1
        self._last = (0, command)
        self._asked_at = time.monotonic()
        self._changed()

        def sent(written: asyncio.Future[int]) -> None:
            self.sending -= 1
            try:
                id = written.result()
            except UserError as error:
                self._screen.notify(str(error), severity="error", markup=False)
            else:
                self._mine[id] = command.words(now.state).brief
                self._last = id, command
                if starts_engine(command, self._poll.snapshot.state):
                    self._due = id
                    self.go_on()
                if then is not None:
                    then()
            if self._screen.is_attached:
                self._changed()

        loop = asyncio.get_running_loop()
        loop.run_in_executor(self._sender, send, self._poll.file, command).add_done_callback(sent)

    def go_on(self) -> None:
        """Starts an engine for the last command if none is running, or if the last one ended
        without reading it.
        """
        snapshot = self._poll.snapshot
        if (
            self._due > snapshot.state.last_command
            and snapshot.engine == "absent"
            and not snapshot.error
        ):
            self._due = 0
            self._once_trusted(self._start)

    def _once_trusted(self, then: Callable[[], None]) -> None:
        """Calls `then` if the user trusts what an engine starts for this run, or says that nothing
        was done.
        """
        from ddenv.runs.experiment import read_scenario
        from ddenv.workbench.widgets.question import once_trusted

        try:
            scenario = read_scenario(self._poll.file)
        except UserError as error:
            self._screen.notify(str(error), severity="error", markup=False)
        else:
            once_trusted(
                self._screen.app,
                scenario,
                self._poll.path,
                lambda yes: then() if yes else self.refuse(UNTRUSTED),
            )

    def _start(self, job: engine_job.Job | None = None) -> None:
        state = self._poll.snapshot.state
        try:
            self._engine.start(state.jobs or processor.usable_cores(), state.accept_mode, job)
        except UserError as error:
            self._screen.notify(str(error), severity="error", markup=False)
