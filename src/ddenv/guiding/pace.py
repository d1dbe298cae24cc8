"""The pace of a run, and whether it asks: pause, resume, step, accept mode, stop, start an engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from ddenv.amounts import count
from ddenv.guiding.situation import FINISHED, Situation, Words
from ddenv.runfile.state import RunState


@dataclass(frozen=True, slots=True)
class Pause:
    """Start no new test."""

    kind: ClassVar[str] = "pause"
    offer: ClassVar[str] = "pause"

    def refusal(self, now: Situation) -> str:
        return now.needs_engine()

    def words(self, _: RunState) -> Words:
        return Words("pause")


@dataclass(frozen=True, slots=True)
class Resume:
    """Go on; also ends a step."""

    kind: ClassVar[str] = "resume"
    offer: ClassVar[str] = "resume"

    def refusal(self, now: Situation) -> str:
        return now.needs_engine()

    def words(self, _: RunState) -> Words:
        return Words("resume")


@dataclass(frozen=True, slots=True)
class Step:
    """Run one test, or to the end of the round, then pause."""

    kind: ClassVar[str] = "step"
    offer: ClassVar[str] = ""
    unit: Literal["test", "round"] = "test"

    def refusal(self, now: Situation) -> str:
        waits = now.state.waiting_candidate is not None
        return now.needs_engine() or ("a reduction waits: accept it with a, or reject it with x" if waits else "")

    def words(self, _: RunState) -> Words:
        return Words(f"step one {self.unit}")


@dataclass(frozen=True, slots=True)
class AcceptMode:
    """Make each reduction at once ("automatic"), or wait for accept or reject ("ask")."""

    kind: ClassVar[str] = "accept_mode"
    offer: ClassVar[str] = ""
    mode: Literal["automatic", "ask"]

    def refusal(self, now: Situation) -> str:
        return now.needs_engine()

    def words(self, _: RunState) -> Words:
        ask = self.mode == "ask"
        said = "each reduction will wait for you" if ask else "reductions are accepted automatically"
        return Words(f"accept mode {self.mode}", said)


@dataclass(frozen=True, slots=True)
class Stop:
    """End the engine; another one can go on from there."""

    kind: ClassVar[str] = "stop"
    offer: ClassVar[str] = "stop"

    def refusal(self, now: Situation) -> str:
        return "no engine is running" if now.engine == "absent" else ""

    def words(self, _: RunState) -> Words:
        return Words("stop")


@dataclass(frozen=True, slots=True)
class StartEngine:
    """Start an engine on the run. It is not a command: the run file does not have it."""

    offer: ClassVar[str] = "start"

    def refusal(self, now: Situation) -> str:
        state = now.state
        if now.engine == "alive":
            return f"the engine is running already{'; space resumes' if state.paused else ''}"
        if now.engine == "starting":
            return "the engine is starting already"
        if state.status == "finished":
            return FINISHED
        spent = state.budget is not None and state.made >= state.budget
        return f"the budget of {count(state.budget or 0, 'test')} is used up; c raises it" if spent else ""


@dataclass(frozen=True, slots=True)
class Isolate:
    """Start an engine that finds the nearest world that passes, or goes on with that. It is not a command, as `StartEngine`.

    `again`: search also if that world is known.
    """

    offer: ClassVar[str] = "isolate"
    again: bool = False

    def refusal(self, now: Situation) -> str:
        state = now.state
        if state.baseline is None:
            return "no failure is known yet, so there is nothing to isolate"
        if state.status != "finished" and state.isolating is None:
            return "its search is not over; let it end first"
        if now.engine != "absent":
            return "an engine is at work on the run; let it end first"
        known = state.isolated is not None and state.isolating is None and not self.again
        return "the nearest world that passes is known; 'ddenv isolate RUN --again' searches again" if known else ""
