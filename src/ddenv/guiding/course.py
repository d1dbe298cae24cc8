"""How a run goes on: pause, resume, step, accept mode, stop, start an engine; undo, go back, change settings."""

from __future__ import annotations

from typing import Any, Literal

from ddenv.errors import UserError
from ddenv.guiding.situation import FINISHED, NO_FAILURE, Asked, Situation, Words, new_search
from ddenv.runfile.fold_decisions import place
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState
from ddenv.schemas import check, split_pair
from ddenv.settings import SETTINGS, Value
from ddenv.text import count, printable


class Pause(Asked):
    """Start no new test."""

    def refusal(self, now: Situation) -> str:
        return now.needs_engine()

    def words(self, _: RunState) -> Words:
        return Words("pause")


class Resume(Asked):
    """Go on; also ends a step."""

    def refusal(self, now: Situation) -> str:
        return now.needs_engine()

    def words(self, _: RunState) -> Words:
        return Words("resume")


class Step(Asked):
    """Run one test, or to the end of the round, then pause."""

    unit: Literal["test", "round"] = "test"

    def refusal(self, now: Situation) -> str:
        waits = now.state.waiting_candidate is not None
        return now.needs_engine() or ("a reduction waits: accept it with a, or reject it with x" if waits else "")

    def words(self, _: RunState) -> Words:
        return Words(f"step one {self.unit}")


class AcceptMode(Asked):
    """Make each reduction at once ("automatic"), or wait for accept or reject ("ask")."""

    mode: Literal["automatic", "ask"]

    def refusal(self, now: Situation) -> str:
        return now.needs_engine()

    def words(self, _: RunState) -> Words:
        ask = self.mode == "ask"
        said = "each reduction will wait for you" if ask else "reductions are accepted automatically"
        return Words(f"accept mode {self.mode}", said)


class Stop(Asked):
    """End the engine; another one can go on from there."""

    def refusal(self, now: Situation) -> str:
        return "no engine is running" if now.engine == "absent" else ""

    def words(self, _: RunState) -> Words:
        return Words("stop")


class StartEngine(Asked):
    """Start an engine on the run. It is not a command: the run file does not have it."""

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


class Isolate(Asked):
    """Start an engine that finds the nearest world that passes, or goes on with that. It is not a command, as `StartEngine`.

    `again`: search also if that world is known.
    """

    again: bool = False

    def refusal(self, now: Situation) -> str:
        state = now.state
        if state.baseline is None:
            return "no failure is known yet, so there is nothing to isolate"
        if state.status != "finished" and state.isolating is None:
            return "its search is not over; let it end first"
        if now.engine != "absent":
            return "an engine is working on the run; let it end first"
        known = state.isolated is not None and state.isolating is None and not self.again
        return (
            "a nearest world that passes is known: W shows it; 'ddenv isolate RUN --again' searches again"
            if known
            else ""
        )


class Undo(Asked):
    """Take back the last reduction, or the last accepted failure; the same reduction is not made again."""

    def refusal(self, now: Situation) -> str:
        here = now.state.here
        if here is None or here.parent is None:
            return "there is no reduction to take back"
        return "the last undo is not done yet" if now.pending == "undo" else ""

    def words(self, state: RunState) -> Words:
        here = state.here
        if here is None or here.parent is None:
            return Words("undo")
        after = len(state.nodes[here.parent].environment)
        said = f"{here.what} is taken back. {new_search(state, after)}"
        again = f"It will not reduce to these {len(here.environment)} again, in any branch, unless you allow it"
        return Words("undo", f"{said}. {again}: v on their row, or h and enter on #{here.number}")


class GoBack(Asked):
    """Make the environment of a node the current one again; the run pauses there."""

    node: int

    def refusal(self, now: Situation) -> str:
        state = now.state
        if not 0 <= self.node < len(state.nodes):
            return "there is no such place in the history"
        if state.baseline is None:
            return NO_FAILURE
        return "the run is there already" if self.node == state.node else ""

    def words(self, state: RunState) -> Words:
        there = place(state.nodes[self.node])
        question = (
            f"Go on from {there}?\n\nThe run pauses there. Change settings (c), pin (p) or try (w, o); then press space to go on. "
            "Later results stay in the history, and you can come back to them. No test is repeated."
        )
        return Words("go back", f"back to {there}; the run pauses there, and space begins a new search", question)


class Change(Asked):
    """Go on with other settings, as in the scenario's section `reduction`; all names are in `CHANGEABLE`."""

    settings: dict[str, Any]

    def refusal(self, now: Situation) -> str:
        if not set(self.settings) <= set(CHANGEABLE):
            return ONLY_CHANGEABLE
        if wrong := [why for name, value in self.settings.items() if (why := _wrong(name, value))]:
            return "; ".join(wrong)
        new = self.new(now.state)
        budget, done = new.get("budget"), now.state.made
        if isinstance(budget, int) and budget <= done:
            return f"budget: {count(done, 'test')} were made already; enter more, or leave it empty"
        return "" if new else "these are the settings already"

    def words(self, state: RunState) -> Words:
        new = self.new(state).items()
        words = ", ".join(f"{key} {'no limit' if value is None else printable(str(value))}" for key, value in new)
        then = f". {new_search(state)}" if self.begins_anew(state) else ""
        return Words("change settings", f"from now on: {words}{then}")

    def begins_anew(self, state: RunState) -> bool:
        """Whether a new search begins: the budget alone changes nothing in the order of the tests."""
        return not set(self.new(state)) <= {"budget"}

    def new(self, state: RunState) -> dict[str, Value]:
        """The settings that differ from the current ones."""
        now = settings(state)
        return {key: value for key, value in self.settings.items() if getattr(now, key) != value}


CourseCommand = Pause | Resume | Step | AcceptMode | Stop | Undo | GoBack | Change


# The settings that may change during a run: all others define what a test is, or how f was fixed.
CHANGEABLE = {one.name: one for one in SETTINGS.values() if one.may_change}
ONLY_CHANGEABLE = f"only {', '.join(CHANGEABLE)} can be changed during a run"


def typed(name: str, text: str) -> int | str | None:
    """The value that was typed or chosen; None for no limit. Raises UserError."""
    if CHANGEABLE[name].choices:
        return text
    if not text.strip() and CHANGEABLE[name].none:
        return None
    try:
        return int(text.strip())
    except ValueError:
        raise UserError(f"{name}: expected a whole number, found '{text[:20]}'") from None


def _wrong(name: str, value: Any) -> str:
    """Why the setting cannot have a value, or ""."""
    one = CHANGEABLE[name]
    if not one.allows(value):
        expected = one.range if one.kind is int else " or ".join(one.choices) or "a name"
        return f"{name}: expected {expected}, found {printable(str(value)[:20])}"
    try:
        if name == "pair":
            split_pair(str(value))
        elif name == "algorithm":
            check("algorithm", str(value))
    except UserError as error:
        return str(error)
    return ""
