"""From the keys of the run screen to the engine: how a command is sent, when an engine is started, and what is said of it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.workbench.run.guiding import GOES_ON, Ask
from ddenv.workbench.run.poll import Poll, Snapshot
from ddenv.workbench.run.processes import Engine
from ddenv.workbench.wording import attach_name, duration, plain

# An engine answers within a moment; after so long it hangs, or its machine does, s.
PATIENCE = 5


class Controls(Screen[None]):
    """The part of the run screen that sends commands. A key that makes no sense now says so, and does nothing."""

    snapshot: Snapshot
    engine: Engine
    poll: Poll
    watch: bool
    # What was asked for last: the command's id, 0 while it is being sent, and its words.
    asked = (0, "")
    _asked_at = 0.0
    sending = 0

    def __init__(self) -> None:
        super().__init__()
        # The ids of this screen's own commands, with their words.
        self._mine: dict[int, str] = {}
        # The id of the last one that the run goes on from, 0 if an engine was started for it.
        self._due = 0

    def waiting_for(self) -> str:
        """What was asked for and is not done yet."""
        id, words = self.asked
        if self.sending:
            return words
        if self.snapshot.state.last_command >= id or self.snapshot.engine != "alive":
            return ""
        late = int(time.monotonic() - self._asked_at)
        return words if late < PATIENCE else f"{words}: no answer for {duration(late)}"

    def refuse(self, why: str) -> None:
        """Says why a key does nothing."""
        self.notify(plain(why), severity="warning", timeout=4, markup=False)

    def say(self, what: str) -> None:
        self.notify(plain(what), timeout=4, markup=False)

    def show_status(self) -> None:
        """Shows at once what was asked for."""
        raise NotImplementedError

    # Sending.

    def can_send(self) -> bool:
        """Whether this screen may ask for anything; says why not."""
        if self.watch:
            self.refuse(f"watching only: 'ddenv open {attach_name(self.poll.path)}' without --watch guides it")
        elif self.snapshot.gone:
            self.refuse("the run file is gone: nothing can be asked for; q leaves")
        elif self.snapshot.error:
            self.refuse("this run file cannot be read")
        else:
            return True
        return False

    def send(self, kind: str, words: str = "", then: Callable[[], None] | None = None, **data: Any) -> None:
        """Asks the engine for something, without waiting for the file; `then` comes once it is written."""
        words = words or kind.replace("_", " ")
        self.sending += 1
        self.asked, self._asked_at = (0, words), time.monotonic()
        self.show_status()

        def sent(id: int, error: str) -> None:
            self.sending -= 1
            if error:
                self.notify(error, severity="error", markup=False)
            else:
                self._mine[id] = words
                self.asked = (id, words)
                if self._goes_on(kind):
                    self._due = id
                    self.go_on()
                if then is not None:
                    then()
            if self.is_attached:
                self.show_status()

        self.poll.send(kind, data, sent)

    def ask(self, make: Callable[[], Ask]) -> None:
        """Sends what `make` comes to, after its question if it has one; a UserError of it is said instead."""
        if not self.can_send():
            return
        try:
            asked = make()
        except UserError as error:
            self.refuse(str(error))
            return
        if not asked.question:
            self._send_asked(asked)
            return
        from ddenv.workbench.widgets.question import Question

        self.app.push_screen(Question(asked.question), lambda yes: self._send_asked(asked) if yes else None)

    def _send_asked(self, asked: Ask) -> None:
        """Where no engine works it is written down for the next one, which is started if the run goes on from there."""
        starts = self.snapshot.engine == "absent" and self._goes_on(asked.kind)
        later = "" if self.snapshot.engine != "absent" else "; kept until an engine works, space starts one"
        self.say(f"{asked.said}; an engine is started for it" if starts else f"{asked.said}{later}")
        self.send(asked.kind, **asked.data)

    def _goes_on(self, kind: str) -> bool:
        """Whether the run goes on for that where no engine works: an ended search begins anew with other pins, too."""
        return kind in GOES_ON or (kind in ("pin", "unpin") and self.snapshot.status == "finished")

    def go_on(self) -> None:
        """Starts an engine for what was asked for where none works, or where the last one ended without having read it."""
        late = self._due > self.snapshot.state.last_command
        if late and self.snapshot.engine == "absent" and not self.snapshot.error:
            self._due = 0
            self._start_engine()

    def told_refusal(self, before: Snapshot) -> None:
        """Says why the engine did not do what this screen asked for."""
        id, why = self.snapshot.state.refusal
        if (id, why) != before.state.refusal and id in self._mine:
            self.refuse(f"{self._mine[id]}: not done, {why}")

    # The engine.

    def _works(self) -> bool:
        """Whether there is an engine to ask; says why not."""
        if not self.can_send():
            return False
        if self.snapshot.engine == "alive":
            return True
        if self.snapshot.status == "finished":
            self.refuse("the run is finished; u, h, c, p, w and o go on from there")
        elif self.snapshot.status == "starting":
            self.refuse("the engine is still starting")
        else:
            self.refuse("no engine is running; space starts one")
        return False

    def action_pause(self) -> None:
        if self.snapshot.engine == "absent":
            self.action_resume()
        elif self._works():
            self.send("resume" if self.snapshot.state.paused else "pause")

    def action_step(self, unit: str) -> None:
        if not self._works():
            return
        if self.snapshot.state.status == "waiting":
            self.refuse("a reduction waits: accept it with a, or reject it with x")
        else:
            self.send("step", f"step one {unit}", unit=unit)

    def action_mode(self) -> None:
        if self._works():
            mode = "automatic" if self.snapshot.state.accept_mode == "ask" else "ask"
            self.send("accept_mode", f"accept mode {mode}", mode=mode)
            self.say("each reduction will wait for you" if mode == "ask" else "reductions are accepted automatically")

    def action_resume(self) -> None:
        state = self.snapshot.state
        if not self.can_send():
            return
        if self.snapshot.engine == "alive":
            self.refuse("the engine is running already" + ("; space resumes" if state.paused else ""))
        elif self.snapshot.engine == "starting":
            self.refuse("the engine is starting already")
        elif state.status == "finished":
            self.refuse("the run is finished; u, h, c, p, w and o go on from there")
        elif state.budget is not None and state.tests_done >= state.budget:
            self.refuse(f"the budget of {state.budget} tests is used up; c gives more")
        else:
            self._start_engine()

    def _start_engine(self) -> None:
        if self.snapshot.engine != "absent":
            return
        try:
            self.engine.start(self.snapshot.state.jobs or os.cpu_count() or 1, self.snapshot.state.accept_mode)
        except UserError as error:
            self.notify(str(error), severity="error", markup=False)
