"""From the keys of the run screen to the engine: what may be asked when, and why not."""

from __future__ import annotations

import os
from typing import Any

from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.runfile.store import RunFile
from ddenv.workbench.poll import Snapshot
from ddenv.workbench.processes import Engine
from ddenv.workbench.widgets.candidates import Candidates


class Controls(Screen[None]):
    """The part of the run screen that sends commands. A key that makes no sense now says so, and does nothing."""

    snapshot: Snapshot
    engine: Engine
    file: RunFile
    # The last command's id, and its words.
    asked = (0, "")

    def waiting_for(self) -> str:
        """What was asked for and is not done yet."""
        id, kind = self.asked
        return kind if self.snapshot.state.last_command < id and self.snapshot.engine == "alive" else ""

    def refuse(self, why: str) -> None:
        self.notify(why, severity="warning", timeout=3, markup=False)

    def send(self, kind: str, **data: Any) -> None:
        try:
            self.asked = (self.file.send(kind, **data), kind.replace("_", " "))
        except UserError as error:
            self.notify(str(error), severity="error", markup=False)
        self.show_status()

    def show_status(self) -> None:
        """Shows at once what was asked for."""
        raise NotImplementedError

    def _works(self) -> bool:
        """Whether there is an engine to ask; says why not."""
        status = self.snapshot.status
        if self.snapshot.engine == "alive":
            return True
        if status == "finished":
            self.refuse("the run is finished")
        elif status == "starting":
            self.refuse("the engine is still starting")
        else:
            self.refuse("no engine is running; r resumes the run")
        return False

    def action_pause(self) -> None:
        if self._works():
            self.send("resume" if self.snapshot.state.paused else "pause")

    def action_step(self, unit: str) -> None:
        if not self._works():
            return
        if self.snapshot.state.status == "waiting":
            self.refuse("a reduction waits: accept it with a, or reject it with x")
        else:
            self.send("step", unit=unit)

    def action_decide(self, decision: str) -> None:
        state = self.snapshot.state
        if state.waiting_candidate is None or state.round is None:
            self.refuse(f"nothing waits for {decision}")
        elif self._works():
            self.send(decision, round=state.round.number, candidate=state.waiting_candidate)

    def action_veto(self) -> None:
        candidate = self.query_one(Candidates).under_cursor
        state, current = self.snapshot.state, self.snapshot.state.round
        if state.confirming and not state.ended:
            self.refuse("the rounds are over")
        elif current is None or candidate is None:
            self.refuse("there are no candidates yet")
        elif candidate.verdict:
            self.refuse(f"{candidate.label} is {candidate.verdict} already")
        elif current.done or current.winner is not None:
            self.refuse("this round is over")
        elif candidate.index == state.waiting_candidate:
            self.refuse(f"{candidate.label} showed f and waits: reject it with x")
        elif self._works():
            self.send("veto", round=current.number, candidate=candidate.index)

    def action_mode(self) -> None:
        if self._works():
            mode = "automatic" if self.snapshot.state.accept_mode == "ask" else "ask"
            self.send("accept_mode", mode=mode)
            self.notify(
                "each reduction will wait for you" if mode == "ask" else "reductions are accepted automatically",
                timeout=3,
            )

    def action_resume(self) -> None:
        state = self.snapshot.state
        if self.snapshot.engine == "alive":
            self.refuse("the engine is running already" + ("; space resumes" if state.paused else ""))
        elif self.snapshot.engine == "starting":
            self.refuse("the engine is starting already")
        elif state.status == "finished":
            self.refuse("the run is finished")
        elif self.snapshot.error:
            self.refuse("this run file cannot be read")
        else:
            self._start_engine()

    def _start_engine(self) -> None:
        try:
            self.engine.start(self.snapshot.state.jobs or os.cpu_count() or 1, self.snapshot.state.accept_mode)
        except UserError as error:
            self.notify(str(error), severity="error", markup=False)
