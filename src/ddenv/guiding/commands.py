"""The commands: for each, when it is possible (`refusal`), its words, and its form in the run
file's table `command`: its kind with its fields as JSON, as in `veto {"round": 2, "candidate": 3}`.
Models are numbers into the run's elements.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, dataclass_transform, get_args

from ddenv.environment import Numbers
from ddenv.errors import UserError
from ddenv.evidence.claims import current, fresh_runs_made, in_the_making, only_helping
from ddenv.runfile.failure_words import deed
from ddenv.runfile.fold_decisions import place
from ddenv.runfile.reading import Invalid, plain, read
from ddenv.runfile.run_settings import settings
from ddenv.runfile.snapshot import EngineIs
from ddenv.runfile.state import REFUSED, Candidate, RunState, Test, Trial
from ddenv.runfile.store import RunFile
from ddenv.runfile.tested import made_for, purpose
from ddenv.schemas import check, split_pair
from ddenv.settings import SETTINGS, Value
from ddenv.text import (
    Data,
    Names,
    as_sentence,
    coordinates,
    count,
    first_of,
    printable,
    shortened,
    snake_case,
)

Row = Candidate | Trial

# Maximum number of models that a line names, and maximum width of each name in cells.
NAMED = 2
LONGEST = 32

FINISHED = "the run is finished; u, h, f, c, p, w and o continue from here"
NO_FAILURE = "f is not known yet: the baseline comes first"
NO_MODELS = "no such models"


@dataclass(frozen=True, slots=True)
class Context:
    """A run, and what else decides whether a command is possible.

    `barred` is why this viewer cannot guide the run at all, or "". `pending` is the viewer's last
    command in brief until the engine obeys it, or "".
    """

    state: RunState
    engine: EngineIs = "alive"
    barred: str = ""
    pending: str = ""

    def needs_engine(self) -> str:
        """Why no engine can answer now, or ""."""
        if self.engine == "starting":
            return "the engine is still starting"
        if self.state.status == "finished":
            return FINISHED
        if self.engine == "absent":
            return "no engine is running; space starts one"
        return ""


@dataclass(frozen=True, slots=True)
class Words:
    """A command in words: `brief` while it waits for its answer, `said` when it is sent, `question`
    before that, or "".
    """

    brief: str
    said: str = ""
    question: str = ""


@dataclass_transform(frozen_default=True)
class Asked:
    """What the user asks of a run is one of these, and so a frozen dataclass."""

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True)(cls)

    def refusal(self, now: Context) -> str:
        """Why it is not possible now, in one line, or ""."""
        return now.needs_engine()

    def words(self, state: RunState) -> Words:
        return Words(type(self).__name__.lower())


def label_of(state: RunState, test: Test) -> str:
    """What a test was made for, in words."""
    row = made_for(state, test)
    if row is None and test.round is None:
        return purpose(state, test)
    if row is not None:
        return row.label
    return f"a candidate of round {test.round}"


def numbers_of(state: RunState, names: Iterable[str]) -> Numbers:
    """The numbers of models, in the order of the world."""
    number = {name: index for index, name in enumerate(state.elements)}
    return tuple(sorted(number[name] for name in names))


def waiting(state: RunState) -> Candidate | None:
    """The candidate whose reduction waits for accept or reject."""
    round = state.round
    waits = state.waiting_candidate
    if round is None or waits is None:
        return None
    return round.candidates[waits]


def new_search(state: RunState, size: int | None = None) -> str:
    """What follows a decision that ends the search, as a sentence without a full stop.

    A new one begins from `size` models, by default as many as are left.
    """
    if state.baseline is None:
        return "The search begins with that"
    return (
        "A new search begins from "
        f"{count(len(state.environment) if size is None else size, 'model')}"
    )


def named(names: Iterable[str]) -> str:
    """The first names of some models, short enough for a line."""
    return first_of([shortened(name, LONGEST) for name in names], NAMED)


# The course of a run.


class Pause(Asked):
    """Start no new test."""


class Resume(Asked):
    """Go on; also ends a step."""


class Step(Asked):
    """Run one test, or to the end of the round, then pause."""

    unit: Literal["test", "round"] = "test"

    def refusal(self, now: Context) -> str:
        waits = now.state.waiting_candidate is not None
        return now.needs_engine() or (
            "a reduction waits: accept it with a, or reject it with x" if waits else ""
        )

    def words(self, _: RunState) -> Words:
        return Words(f"step one {self.unit}")


class AcceptMode(Asked):
    """Make each reduction at once ("automatic"), or wait for accept or reject ("ask")."""

    mode: Literal["automatic", "ask"]

    def words(self, _: RunState) -> Words:
        ask = self.mode == "ask"
        if ask:
            said = "each reduction will wait for you"
        else:
            said = "reductions are accepted automatically"
        return Words(f"accept mode {self.mode}", said)


class Stop(Asked):
    """End the engine; another one can go on from there."""

    def refusal(self, now: Context) -> str:
        if now.engine == "absent":
            return "no engine is running"
        return ""


class StartEngine(Asked):
    """Start an engine on the run. It is not a command: the run file does not have it."""

    def refusal(self, now: Context) -> str:
        state = now.state
        if now.engine == "alive":
            return f"the engine is running already{'; space resumes' if state.paused else ''}"
        if now.engine == "starting":
            return "the engine is starting already"
        if state.status == "finished":
            return FINISHED
        spent = state.budget is not None and state.made >= state.budget
        if spent:
            return f"the budget of {count(state.budget or 0, 'test')} is used up; c raises it"
        return ""


class Isolate(Asked):
    """Start an engine that finds the nearest world that passes, or goes on with that. It is not a
    command, as `StartEngine`.

    `again`: search also if that world is known.
    """

    again: bool = False

    def refusal(self, now: Context) -> str:
        state = now.state
        if state.baseline is None:
            return "no failure is known yet, so there is nothing to isolate"
        if state.status != "finished" and state.isolating is None:
            return "its search is not over; let it end first"
        if now.engine != "absent":
            return "an engine is working on the run; let it end first"
        if state.isolated is not None and state.isolating is None and not self.again:
            return (
                "a nearest world that passes is known: W shows it; 'ddenv isolate RUN --again' "
                "searches again"
            )
        return ""


class Undo(Asked):
    """Take back the last reduction, or the last accepted failure; the same reduction is not made
    again.
    """

    def refusal(self, now: Context) -> str:
        here = now.state.here
        if here is None or here.parent is None:
            return "there is no reduction to take back"
        if now.pending == "undo":
            return "the last undo is not done yet"
        return ""

    def words(self, state: RunState) -> Words:
        here = state.here
        if here is None or here.parent is None:
            return Words("undo")
        after = len(state.nodes[here.parent].environment)
        said = f"{here.what} is taken back. {new_search(state, after)}"
        again = (
            f"It will not reduce to these {len(here.environment)} again, in any branch, unless "
            "you allow it"
        )
        return Words("undo", f"{said}. {again}: v on their row, or h and enter on #{here.number}")


class GoBack(Asked):
    """Make the environment of a node the current one again; the run pauses there."""

    node: int

    def refusal(self, now: Context) -> str:
        state = now.state
        if not 0 <= self.node < len(state.nodes):
            return "there is no such place in the history"
        if state.baseline is None:
            return NO_FAILURE
        if self.node == state.node:
            return "the run is there already"
        return ""

    def words(self, state: RunState) -> Words:
        there = place(state.nodes[self.node])
        question = (
            f"Go on from {there}?\n\nThe run pauses there. Change settings (c), pin (p) or try "
            "(w, o); then press space to go on. "
            "Later results stay in the history, and you can come back to them. No test is repeated."
        )
        return Words(
            "go back",
            f"back to {there}; the run pauses there, and space begins a new search",
            question,
        )


class Change(Asked):
    """Go on with other settings; all names are in `CHANGEABLE`. With one of `JUDGES` all ends are
    judged again, and a new search begins from the whole world.
    """

    settings: Data

    def refusal(self, now: Context) -> str:
        if not set(self.settings) <= set(CHANGEABLE):
            return ONLY_CHANGEABLE
        if wrong := [why for name, value in self.settings.items() if (why := _wrong(name, value))]:
            return "; ".join(wrong)
        new = self.new(now.state)
        budget = new.get("budget")
        done = now.state.made
        if isinstance(budget, int) and budget <= done:
            return f"budget: {count(done, 'test')} were made already; enter more, or leave it empty"
        baseline = now.state.baseline
        failure = new.get("failure")
        # Another epsilon may tell more failures apart.
        if (
            baseline is not None
            and isinstance(failure, int)
            and failure > len(baseline.seen)
            and "epsilon" not in new
        ):
            return (
                f"failure: the whole world showed {count(len(baseline.seen), 'failure')}; choose "
                "one of these"
            )
        if new:
            return ""
        return "these are the settings already"

    def words(self, state: RunState) -> Words:
        new = self.new(state).items()
        words = ", ".join(
            f"{key} {'no limit' if value is None else printable(str(value))}" for key, value in new
        )
        size = None if JUDGES.isdisjoint(self.new(state)) else len(state.elements)
        then = f". {new_search(state, size)}" if self.begins_anew(state) else ""
        return Words("change settings", f"from now on: {words}{then}")

    def begins_anew(self, state: RunState) -> bool:
        """Whether a new search begins: the budget alone changes nothing in the order of the
        tests.
        """
        return not set(self.new(state)) <= {"budget"}

    def new(self, state: RunState) -> dict[str, Value]:
        """The settings that differ from the current ones."""
        now = settings(state)
        return {key: value for key, value in self.settings.items() if getattr(now, key) != value}


# The settings that may change during a run: all others define what a test is, or how f was fixed.
CHANGEABLE = {one.name: one for one in SETTINGS.values() if one.may_change}
# Those that say what f is.
JUDGES = frozenset({"epsilon", "failure"})
ONLY_CHANGEABLE = f"only {', '.join(CHANGEABLE)} can be changed during a run"


def typed(name: str, text: str) -> int | float | str | None:
    """The value that was typed or chosen; None for no limit. Raises UserError."""
    if CHANGEABLE[name].choices:
        return text
    if not text.strip() and CHANGEABLE[name].none:
        return None
    kind = CHANGEABLE[name].kind
    try:
        number: int | float = kind(text.strip())
    except ValueError:
        expected = "a whole number" if kind is int else "a number"
        raise UserError(f"{name}: expected {expected}, found '{text[:20]}'") from None
    return number


def _wrong(name: str, value: Any) -> str:
    """Why the setting cannot have a value, or ""."""
    one = CHANGEABLE[name]
    if not one.allows(value):
        expected = one.range if one.kind in (int, float) else " or ".join(one.choices) or "a name"
        return f"{name}: expected {expected}, found {printable(str(value)[:20])}"
    try:
        if name == "pair":
            split_pair(str(value))
        elif name == "algorithm":
            check("algorithm", str(value))
    except UserError as error:
        return str(error)
    return ""


# Candidates and models chosen by hand.


NONE_HELPS = "no certificate shows a model that only helps"


class OfCandidate(Asked):
    """A decision on a candidate of the current round."""

    round: int
    candidate: int

    def meant(self, state: RunState) -> Candidate | None:
        """The candidate, while its round goes on."""
        current = state.round
        if (
            current is None
            or current.done
            or current.winner is not None
            or current.number != self.round
        ):
            return None
        if 0 <= self.candidate < len(current.candidates):
            return current.candidates[self.candidate]
        return None

    def label(self, state: RunState) -> str:
        one = self.meant(state)
        if one is None:
            return "the candidate"
        return one.label

    def refusal(self, now: Context) -> str:
        state = now.state
        waits = waiting(now.state)
        # When a new search is due, earlier reductions can no longer be accepted.
        if state.round is None or waits is None or state.search_due:
            return "that reduction no longer waits"
        is_it = (self.round, self.candidate) == (state.round.number, waits.index)
        if is_it:
            return ""
        return "that reduction no longer waits"


class Accept(OfCandidate):
    """Make the reduction that waits."""

    def words(self, state: RunState) -> Words:
        return Words("accept", f"{self.label(state)} is accepted. The next round begins")


class Reject(OfCandidate):
    """Go on as if the candidate that waits had not shown f."""

    def words(self, state: RunState) -> Words:
        return Words("reject", f"{self.label(state)} is rejected")


class Veto(OfCandidate):
    """Leave out a candidate that has no verdict yet."""

    def refusal(self, now: Context) -> str:
        one = self.meant(now.state)
        if one is None:
            return round_over(now.state)
        if one.index == now.state.waiting_candidate:
            return f"{one.label} showed f and waits: reject it with x"
        if one.verdict:
            return f"{one.label} is {one.verdict} already"
        return ""

    def words(self, state: RunState) -> Words:
        return Words(
            "veto",
            (
                f"{self.label(state)} is vetoed: it will not be tried in any round; v again undoes "
                "that"
            ),
        )


class Unveto(OfCandidate):
    """Try a vetoed or rejected candidate after all."""

    def refusal(self, now: Context) -> str:
        one = self.meant(now.state)
        if one is None:
            return round_over(now.state)
        if one.verdict in REFUSED:
            return ""
        return f"{one.label} is neither vetoed, rejected nor undone"

    def words(self, state: RunState) -> Words:
        return Words(
            "allow it again", f"{self.label(state)} is allowed again and will be tried after all"
        )


def round_over(state: RunState) -> str:
    """Why candidates can no longer be left out."""
    if state.confirming and not state.ended:
        return "the rounds are over"
    return "this round is over"


def _names_of(state: RunState, numbers: Sequence[int]) -> Names | None:
    """The names of numbered models, each once; None if there are no such models."""
    if not all(0 <= number < len(state.elements) for number in numbers):
        return None
    return tuple(state.elements[number] for number in dict.fromkeys(numbers))


class Pin(Asked):
    """Keep models: they are in every candidate. `models` are numbers into the run's elements."""

    models: Numbers

    def refusal(self, now: Context) -> str:
        names = _names_of(now.state, self.models)
        kept = frozenset(now.state.environment)
        if not names:
            return NO_MODELS
        if gone := [name for name in names if name not in kept]:
            return (
                f"{named(gone[:1])} is removed already: go back (h) to an environment that has "
                "it, then pin it"
            )
        if self.new(now.state):
            return ""
        return "pinned already"

    def words(self, state: RunState) -> Words:
        return Words(
            "pin", f"pinned, so that it always stays: {named(self.new(state))}. {new_search(state)}"
        )

    def new(self, state: RunState) -> Names:
        """The models that are not pinned yet."""
        return tuple(
            name for name in _names_of(state, self.models) or () if name not in state.pinned
        )


class Unpin(Asked):
    """Let pinned models be removed again."""

    models: Numbers

    def refusal(self, now: Context) -> str:
        if self.pinned(now.state):
            return ""
        return "not pinned"

    def words(self, state: RunState) -> Words:
        return Words("unpin", f"unpinned: {named(self.pinned(state))}. {new_search(state)}")

    def pinned(self, state: RunState) -> Names:
        """The models that are pinned."""
        return tuple(name for name in _names_of(state, self.models) or () if name in state.pinned)


class Try(Asked):
    """Test a selection: `models` are the ones that are kept."""

    models: Numbers

    def refusal(self, now: Context) -> str:
        state = now.state
        names = _names_of(now.state, self.models)
        if names is None:
            return NO_MODELS
        keep = frozenset(names)
        loose = next(
            (pair for pair in state.welds if pair[0] in keep and pair[1] not in keep), None
        )
        if loose is not None:
            return f"{named(loose[:1])} is welded to {named(loose[1:])}: they stay or go together"
        if state.baseline is None:
            return NO_FAILURE
        if keep == frozenset(state.environment):
            return "that is the current environment: nothing is left out"
        under_way = (trial for trial in state.trials if not trial.verdict)
        if any(frozenset(each.models) == keep for each in under_way):
            return "that is being tried already"
        return ""

    def words(self, state: RunState) -> Words:
        names = _names_of(state, self.models) or ()
        keep = frozenset(names)
        without = [name for name in state.environment if name not in keep]
        is_part = keep < frozenset(state.environment)
        if is_part and len(without) <= len(names):
            what = f"without {named(without)}"
        else:
            what = f"only {named(names)}"
        what = f"{count(len(names), 'model')}, {what}" if names else "none of the models"
        return Words("try", f"try {len(state.trials) + 1}: {what}")


class Adopt(Asked):
    """Make a try that showed f the environment."""

    trial: int

    def refusal(self, now: Context) -> str:
        state = now.state
        trial = self.meant(now.state)
        if trial is None:
            return "there is no such try"
        # What counted as f in the test may no longer count.
        if trial.verdict != "similar" or not state.test(trial.tests[-1]).shows_f:
            return f"{trial.label} did not show f"
        if trial.models == state.environment:
            return f"{trial.label} is the environment already"
        return _lacks_pinned(state, trial.label, trial.models)

    def words(self, state: RunState) -> Words:
        trial = self.meant(state)
        size = 0 if trial is None else trial.size
        return Words("adopt", f"try {self.trial} is adopted. {new_search(state, size)}")

    def meant(self, state: RunState) -> Trial | None:
        """The try, None if no try has this number."""
        if 0 < self.trial <= len(state.trials):
            return state.trials[self.trial - 1]
        return None


class LeaveOut(Asked):
    """Make what is left without a model that only helps the environment, by the runs of the
    certificate.
    """

    model: int

    def refusal(self, now: Context) -> str:
        if self.evidence(now.state) is None:
            return NONE_HELPS
        return ""

    def words(self, state: RunState) -> Words:
        test = self.evidence(state)
        size = 0 if test is None else len(state.environments[test.environment])
        names = _names_of(state, (self.model,)) or ()
        return Words("leave out", f"{named(names)} is left out. {new_search(state, size)}")

    def evidence(self, state: RunState) -> Test | None:
        """A fresh run without the model that showed f; None if the model does not only help."""
        found = current(state)
        names = _names_of(state, (self.model,)) or ()
        if found is None or not set(names) & set(only_helping(found)):
            return None
        fresh = (
            test
            for test in state.confirm_tests
            if test.node == found.node and test.run >= found.first_run
        )
        return next((test for test in fresh if test.without in names and test.shows_f), None)


def _lacks_pinned(state: RunState, label: str, models: Sequence[str]) -> str:
    """Why a selection cannot become the environment, or ""."""
    lacking = [name for name in state.environment if name in state.pinned and name not in models]
    if lacking:
        return f"{label} lacks {named(lacking)}, which is pinned: unpin it first (p)"
    return ""


class AcceptOther(Asked):
    """Count another failure as f from here on; the models of its test become the environment.

    With `instead` it is a branch from where the test was made: only that failure is f in it.
    """

    test: int
    instead: bool = False

    def refusal(self, now: Context) -> str:
        state = now.state
        if state.baseline is None:
            return NO_FAILURE
        if not 0 < self.test <= len(state.tests):
            return "there is no such test"
        test = state.test(self.test)
        if test.outcome != "other" or test.end_pose is None:
            return f"test {test.id} did not end in another failure"
        if self.instead:
            return ""
        label = label_of(state, test)
        models = state.environments[test.environment]
        if state.here is None or not models < state.environments[state.here.id]:
            return f"{label} is not part of the current environment"
        return _lacks_pinned(state, label, models.names(state.elements))

    def words(self, state: RunState) -> Words:
        test = state.test(self.test)
        models = count(len(state.environments[test.environment]), "model")
        label = label_of(state, test)
        if self.instead:
            brief = "branch to another failure"
            what = f"test {test.id}"
            said = f"a branch reduces the failure of test {test.id}, from {models} on"
            then = (
                "Reduce this failure instead of f? The run branches: these models become the "
                "environment, and only this failure counts as f in the branch. Going back in the "
                "history (h) restores f and everything found for it."
            )
        else:
            brief = "count another failure as f"
            what = printable(label)
            said = f"the other failure of {label} counts as f, too"
            then = (
                "Count this failure as f, too? Then these models become the environment. u takes "
                "it back."
            )
        near = test.distance is not None and math.isfinite(test.distance)
        apart = f", {test.distance:.2f} m from f's end" if near else ""
        question = (
            f"In {what} ({models}) the robot {deed(test.failure)} at "
            f"{_position(test.end_pose)}{apart}."
            f"\nIn f it {deed(state.failure)} at {_position(state.f_position)}.\n\n{then}"
        )
        return Words(brief, said, question)


def _position(pose: tuple[float, ...] | None) -> str:
    if pose is None:
        return "an unknown place"
    return f"({coordinates(pose[:3])}) m"


# All of them.


_OfCourse = Pause | Resume | Step | AcceptMode | Stop | Undo | GoBack | Change
Command = (
    _OfCourse | Accept | Reject | Veto | Unveto | Pin | Unpin | Try | Adopt | LeaveOut | AcceptOther
)
KINDS: dict[str, type[Command]] = {snake_case(each.__name__): each for each in get_args(Command)}
# The run goes on from these: an engine starts for them if none is running.
GOES_ON = (Try, Adopt, LeaveOut, AcceptOther, Undo, GoBack, Change)
# After these a new search begins: a certificate that is being made is broken off, a reduction that
# waits is dropped.
ANEW = (Pin, Unpin, Adopt, AcceptOther, Undo, GoBack)


def refusal(command: Command | StartEngine | Isolate, now: Context) -> str:
    """Why a command is not possible now, in one line, or ""."""
    return now.barred or command.refusal(now)


def starts_engine(command: Command, state: RunState) -> bool:
    """Whether an engine starts for a command if none is running. Other pins restart a finished
    search.
    """
    return isinstance(command, GOES_ON) or (
        isinstance(command, Pin | Unpin) and state.status == "finished"
    )


def drops(command: Command, state: RunState) -> str:
    """That the new search which a command begins would drop the reduction that waits, or ""."""
    waits = waiting(state) if _begins_anew(command, state) else None
    if waits is None:
        return ""
    sizes = f"{len(state.environment)} → {count(waits.size, 'model')}"
    return (
        f"{as_sentence(waits.label)[:-1]} shows f and waits for you ({sizes}); a new search "
        "would drop it."
    )


def _begins_anew(command: Command, state: RunState) -> bool:
    if isinstance(command, Change):
        return command.begins_anew(state)
    return isinstance(command, ANEW)


def question(command: Command, state: RunState) -> str:
    """What is asked before a command is sent, or "": also where it breaks off a certificate, or
    drops a reduction that waits.
    """
    own = command.words(state).question
    now = in_the_making(state)
    lost = drops(command, state)
    if now is not None and _begins_anew(command, state):
        made = count(fresh_runs_made(state, now), "run")
        lost = (
            f"This aborts certificate {now.number} after {made}, which then no longer count. "
            "A new search begins and ends with another certificate."
        )
    if not lost:
        return own
    if own:
        return f"{own}\n\n{lost}"
    return f"{lost}\n\n{command.words(state).brief.capitalize()} anyway?"


def said(command: Command, now: Context) -> str:
    """What the screen says when a command is sent, or ""."""
    words = command.words(now.state).said
    if not words or now.engine != "absent":
        return words
    starts = starts_engine(command, now.state)
    if starts:
        return f"{words}; an engine starts for it"
    return f"{words}; it waits for an engine, space starts one"


def send(file: RunFile, command: Command) -> int:
    """Asks the engine of a run; returns the number of the command. Raises UserError."""
    kind, data = written(command)
    return file.send(kind, **data)


def written(command: Command) -> tuple[str, Data]:
    """A command as it stands in the run file: its kind, and its fields as JSON."""
    return snake_case(type(command).__name__), plain(command)


def parse(kind: str, data: Mapping[str, Any]) -> Command:
    """A command from a run file. Raises UserError for an unknown kind or invalid data."""
    if kind not in KINDS:
        raise UserError(f"there is no command '{kind[:40]}'")
    try:
        command: Command = read(KINDS[kind], json.dumps(data))
    except Invalid as invalid:
        raise UserError(f"no such {invalid}") from None
    return command
