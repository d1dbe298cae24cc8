"""Candidates and models chosen by hand: accept or reject the reduction that waits, veto a candidate; pin models, try a selection,
adopt it, leave out a model that only helps, count another failure as f.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ddenv.evidence.claims import current, helping
from ddenv.guiding.situation import LONGEST, NO_FAILURE, NO_MODELS, Asked, Situation, Words, label_of, named, new_search
from ddenv.runfile.deeds import deed
from ddenv.runfile.state import REFUSED, Candidate, RunState, Test, Trial
from ddenv.text import coordinates, count, printable, shortened

NONE_HELPS = "no certificate shows a model that only helps"


class OfCandidate(Asked):
    """A decision on a candidate of the current round."""

    round: int
    candidate: int

    def meant(self, state: RunState) -> Candidate | None:
        """The candidate, while its round goes on."""
        current = state.round
        if current is None or current.done or current.winner is not None or current.number != self.round:
            return None
        return current.candidates[self.candidate] if 0 <= self.candidate < len(current.candidates) else None

    def label(self, state: RunState) -> str:
        one = self.meant(state)
        return "the candidate" if one is None else one.label

    def not_waiting(self, state: RunState) -> str:
        """Why it is not the reduction that waits, or ""."""
        waits = None
        # When a new search is due, earlier reductions can no longer be accepted.
        if state.round is not None and state.waiting_candidate is not None and not state.search_due:
            waits = state.round.number, state.waiting_candidate
        return "" if (self.round, self.candidate) == waits else "that reduction no longer waits"


class Accept(OfCandidate):
    """Make the reduction that waits."""

    def refusal(self, now: Situation) -> str:
        return self.not_waiting(now.state)

    def words(self, state: RunState) -> Words:
        return Words("accept", f"{self.label(state)} is accepted. The next round begins")


class Reject(OfCandidate):
    """Go on as if the candidate that waits had not shown f."""

    def refusal(self, now: Situation) -> str:
        return self.not_waiting(now.state)

    def words(self, state: RunState) -> Words:
        return Words("reject", f"{self.label(state)} is rejected")


class Veto(OfCandidate):
    """Leave out a candidate that has no verdict yet."""

    def refusal(self, now: Situation) -> str:
        one = self.meant(now.state)
        if one is None:
            return round_over(now.state)
        if one.index == now.state.waiting_candidate:
            return f"{one.label} showed f and waits: reject it with x"
        return f"{one.label} is {one.verdict} already" if one.verdict else ""

    def words(self, state: RunState) -> Words:
        return Words("veto", f"{self.label(state)} is vetoed: it will not be tried in any round; v again undoes that")


class Unveto(OfCandidate):
    """Try a vetoed or rejected candidate after all."""

    def refusal(self, now: Situation) -> str:
        one = self.meant(now.state)
        if one is None:
            return round_over(now.state)
        return "" if one.verdict in REFUSED else f"{one.label} is neither vetoed, rejected nor undone"

    def words(self, state: RunState) -> Words:
        return Words("allow it again", f"{self.label(state)} is allowed again and will be tried after all")


def round_over(state: RunState) -> str:
    """Why candidates can no longer be left out."""
    return "the rounds are over" if state.confirming and not state.ended else "this round is over"


def _names_of(state: RunState, numbers: Sequence[int], *, empty: bool = False) -> tuple[str, ...] | None:
    """The names of numbered models, each once; None if there are no such models, or if there are none and not `empty`."""
    if not (numbers or empty) or not all(0 <= number < len(state.elements) for number in numbers):
        return None
    return tuple(state.elements[number] for number in dict.fromkeys(numbers))


class Pin(Asked):
    """Keep models: they are in every candidate. `models` are numbers into the run's elements."""

    models: tuple[int, ...]

    def refusal(self, now: Situation) -> str:
        state, names = now.state, _names_of(now.state, self.models)
        if names is None:
            return NO_MODELS
        kept = frozenset(state.environment)
        gone = next((name for name in names if name not in kept), None)
        if gone is not None:
            return (
                f"{shortened(gone, LONGEST)} is removed already: go back (h) to an environment that has it, then pin it"
            )
        return "" if self.new(state) else "pinned already"

    def words(self, state: RunState) -> Words:
        return Words("pin", f"pinned, so that it always stays: {named(self.new(state))}. {new_search(state)}")

    def new(self, state: RunState) -> tuple[str, ...]:
        """The models that are not pinned yet."""
        return tuple(name for name in _names_of(state, self.models) or () if name not in state.pinned)


class Unpin(Asked):
    """Let pinned models be removed again."""

    models: tuple[int, ...]

    def refusal(self, now: Situation) -> str:
        return "" if self.pinned(now.state) else "not pinned"

    def words(self, state: RunState) -> Words:
        return Words("unpin", f"unpinned: {named(self.pinned(state))}. {new_search(state)}")

    def pinned(self, state: RunState) -> tuple[str, ...]:
        """The models that are pinned."""
        return tuple(name for name in _names_of(state, self.models) or () if name in state.pinned)


class Try(Asked):
    """Test a selection: `models` are the ones that are kept."""

    models: tuple[int, ...]

    def refusal(self, now: Situation) -> str:
        state, names = now.state, _names_of(now.state, self.models, empty=True)
        if names is None:
            return NO_MODELS
        keep = frozenset(names)
        loose = next((pair for pair in state.welds if pair[0] in keep and pair[1] not in keep), None)
        if loose is not None:
            return f"{named(loose[:1])} is welded to {named(loose[1:])}: they stay or go together"
        if state.baseline is None:
            return NO_FAILURE
        if keep == frozenset(state.environment):
            return "that is the current environment: nothing is left out"
        under_way = (trial for trial in state.trials if not trial.verdict)
        return "that is being tried already" if any(frozenset(each.models) == keep for each in under_way) else ""

    def words(self, state: RunState) -> Words:
        names = _names_of(state, self.models, empty=True) or ()
        keep = frozenset(names)
        without = [name for name in state.environment if name not in keep]
        is_part = keep < frozenset(state.environment)
        what = f"without {named(without)}" if is_part and len(without) <= len(names) else f"only {named(names)}"
        what = f"{count(len(names), 'model')}, {what}" if names else "none of the models"
        return Words("try", f"try {len(state.trials) + 1}: {what}")


class Adopt(Asked):
    """Make a try that showed f the environment."""

    trial: int

    def refusal(self, now: Situation) -> str:
        state, trial = now.state, self.meant(now.state)
        if trial is None:
            return "there is no such try"
        # What counted as f in the test may no longer count.
        if trial.verdict != "similar" or state.tests[trial.tests[-1] - 1].outcome != "similar":
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
        return state.trials[self.trial - 1] if 0 < self.trial <= len(state.trials) else None


class LeaveOut(Asked):
    """Make what is left without a model that only helps the environment, by the runs of the certificate."""

    model: int

    def refusal(self, now: Situation) -> str:
        return NONE_HELPS if self.evidence(now.state) is None else ""

    def words(self, state: RunState) -> Words:
        test = self.evidence(state)
        size = 0 if test is None else len(state.environments[test.environment])
        names = _names_of(state, (self.model,)) or ()
        return Words("leave out", f"{named(names)} is left out. {new_search(state, size)}")

    def evidence(self, state: RunState) -> Test | None:
        """A fresh run without the model that showed f; None if the model does not only help."""
        found, names = current(state), _names_of(state, (self.model,)) or ()
        if found is None or not set(names) & set(helping(found)):
            return None
        fresh = (test for test in state.confirm_tests if test.node == found.node and test.run >= found.first_run)
        return next((test for test in fresh if test.without in names and test.outcome == "similar"), None)


def _lacks_pinned(state: RunState, label: str, models: Iterable[str]) -> str:
    """Why a selection cannot become the environment, or ""."""
    pinned = state.pinned.difference(models)
    lacking = [name for name in state.environment if name in pinned]
    return f"{label} lacks {named(lacking)}, which is pinned: unpin it first (p)" if lacking else ""


class AcceptOther(Asked):
    """Count another failure as f from here on; the models of its test become the environment.

    With `instead` it is a branch from where the test was made: only that failure is f in it.
    """

    test: int
    instead: bool = False

    def refusal(self, now: Situation) -> str:
        state = now.state
        if state.baseline is None:
            return NO_FAILURE
        if not 0 < self.test <= len(state.tests):
            return "there is no such test"
        test = state.tests[self.test - 1]
        if test.outcome != "other" or test.end_pose is None:
            return f"test {test.id} did not end in another failure"
        if self.instead:
            return ""
        label, models = label_of(state, test), state.environments[test.environment]
        if state.here is None or not models < state.environments[state.here.id]:
            return f"{label} is not part of the current environment"
        return _lacks_pinned(state, label, models.names(state.elements))

    def words(self, state: RunState) -> Words:
        test = state.tests[self.test - 1]
        asked = _question(state, test, self.instead)
        if self.instead:
            size = count(len(state.environments[test.environment]), "model")
            said = f"a branch reduces the failure of test {test.id}, from {size} on"
            return Words("branch to another failure", said, asked)
        return Words(
            "count another failure as f", f"the other failure of {label_of(state, test)} counts as f, too", asked
        )


SelectionCommand = Accept | Reject | Veto | Unveto | Pin | Unpin | Try | Adopt | LeaveOut | AcceptOther


def _question(state: RunState, test: Test, instead: bool) -> str:
    """What happened in the test, compared with f, and what follows."""
    label = f"test {test.id}" if instead else printable(label_of(state, test))
    models = count(len(state.environments[test.environment]), "model")
    near = test.distance is not None and math.isfinite(test.distance)
    apart = f", {test.distance:.2f} m from f's end" if near else ""
    branch = (
        "Reduce this failure instead of f? The run branches: these models become the environment, and only this failure counts as "
        "f in the branch. Going back in the history (h) restores f and everything found for it."
    )
    too = "Count this failure as f, too? Then these models become the environment. u takes it back."
    return (
        f"In {label} ({models}) the robot {deed(test.failure)} at {_position(test.end_pose)}{apart}."
        f"\nIn f it {deed(state.failure)} at {_position(state.f_position)}.\n\n{branch if instead else too}"
    )


def _position(pose: tuple[float, ...] | None) -> str:
    return "an unknown place" if pose is None else f"({coordinates(pose[:3])}) m"
