"""What the user decides by hand: vetoes, pins, trials, the way back. Each becomes an event, or a reason why it cannot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pydantic import ValidationError

from ddenv.engine.journal import Journal
from ddenv.engine.judging import failure_of, rejudged
from ddenv.errors import UserError
from ddenv.runfile.fold_decisions import failures_at
from ddenv.runfile.state import Candidate, Test
from ddenv.schemas import check, split_pair
from ddenv.world.scenario import FailureSpec, Reduction

# The settings that may change on the way: all others are part of what a test is, or of how f was fixed.
CHANGEABLE = ("pair", "algorithm", "iterations", "budget")
NO_FAILURE = "f is not known before the baseline is done"
OVER = "this round is over"


class Steering:
    """Writes into `journal` what the user decides. Every method returns why it cannot be, in one line, or ""."""

    def __init__(self, journal: Journal) -> None:
        self._journal = journal

    def accept(self, data: dict[str, Any]) -> str:
        return self._decide(data, "accept")

    def reject(self, data: dict[str, Any]) -> str:
        return self._decide(data, "reject")

    def veto(self, data: dict[str, Any]) -> str:
        candidate = self._candidate(data)
        if candidate is None:
            return OVER
        if candidate.verdict:
            return f"{candidate.label} is {candidate.verdict} already"
        self._journal.record("vetoed", round=data["round"], candidate=candidate.index, verdict="vetoed")
        return ""

    def unveto(self, data: dict[str, Any]) -> str:
        candidate = self._candidate(data)
        if candidate is None:
            return OVER
        if candidate.verdict not in ("vetoed", "rejected"):
            return f"{candidate.label} is neither vetoed nor rejected"
        self._journal.record("unvetoed", round=data["round"], candidate=candidate.index)
        return ""

    def pin(self, data: dict[str, Any]) -> str:
        state, models = self._journal.state, self._models(data)
        if models is None:
            return "no such models"
        there = frozenset(state.environment)
        gone = [name for name in models if name not in there]
        if gone:
            return f"'{gone[0]}' is removed already: go back to where it was there, and pin it then"
        new = [name for name in models if name not in state.pinned]
        if not new:
            return "pinned already"
        self._journal.record("pinned", models=self._numbers(new))
        return ""

    def unpin(self, data: dict[str, Any]) -> str:
        models = self._models(data)
        pinned = [] if models is None else [name for name in models if name in self._journal.state.pinned]
        if not pinned:
            return "not pinned"
        self._journal.record("unpinned", models=self._numbers(pinned))
        return ""

    def try_out(self, data: dict[str, Any]) -> str:
        state, models = self._journal.state, self._models(data, empty=True)
        if models is None:
            return "no such models"
        if state.baseline is None:
            return NO_FAILURE
        keep = frozenset(models)
        if keep == frozenset(state.environment):
            return "that is the environment as it is: nothing is left out"
        if any(not trial.verdict and frozenset(trial.models) == keep for trial in state.trials):
            return "that is being tried already"
        ordered = [name for name in state.elements if name in keep]
        self._journal.record("trial_started", trial=len(state.trials) + 1, models=self._numbers(ordered))
        return ""

    def adopt(self, data: dict[str, Any]) -> str:
        state, number = self._journal.state, data.get("trial")
        if type(number) is not int or not 0 < number <= len(state.trials):
            return "there is no such trial"
        trial = state.trials[number - 1]
        # What counted as f then may not count here.
        if trial.verdict != "similar" or state.tests[trial.tests[-1] - 1].outcome != "similar":
            return f"{trial.label} did not show f"
        reason = self._lacks_pinned(frozenset(trial.models))
        if reason:
            return f"{trial.label} {reason}"
        if trial.models == state.environment:
            return f"{trial.label} is the environment already"
        environment = self._numbers(trial.models)
        self._journal.record("adopted", trial=number, environment=environment, evidence_test=trial.tests[-1])
        return ""

    def accept_other(self, data: dict[str, Any]) -> str:
        state, number = self._journal.state, data.get("test")
        if state.baseline is None:
            return NO_FAILURE
        if type(number) is not int or not 0 < number <= len(state.tests):
            return "there is no such test"
        test = state.tests[number - 1]
        if test.outcome != "other" or test.phase not in ("round", "hand") or test.end_pose is None:
            return f"test {number} did not end in another failure"
        keep = self._journal.keep_of_test(number)
        reason = self._lacks_pinned(keep)
        if reason:
            return f"test {number} {reason}"
        if not keep <= frozenset(state.environment) or keep == frozenset(state.environment):
            return f"test {number} was not made in a part of the environment as it is now"
        self._accept(test, [name for name in state.environment if name in keep])
        return ""

    def undo(self, _: dict[str, Any]) -> str:
        here = self._journal.state.here
        if here is None or here.parent is None:
            return "there is no reduction to take back"
        self._go(here.parent, rejected=here.number)
        return ""

    def go_back(self, data: dict[str, Any]) -> str:
        state, number = self._journal.state, data.get("node")
        if type(number) is not int or not 0 <= number < len(state.nodes):
            return "there is no such place in the history"
        if state.baseline is None:
            return NO_FAILURE
        if number == state.node:
            return "the run is there already"
        self._go(number, rejected=None)
        return ""

    def change(self, data: dict[str, Any]) -> str:
        asked = data.get("settings")
        if not isinstance(asked, dict) or not asked or not set(asked) <= set(CHANGEABLE):
            return f"only {', '.join(CHANGEABLE)} can be changed on the way"
        before = self._journal.state.scenario["reduction"]
        reason = _wrong({**before, **asked})
        if reason:
            return reason
        # As the scenario would hold them: "2" is 2.
        meant = Reduction.model_validate({**before, **asked}).model_dump(mode="json", include=set(asked))
        new = {key: value for key, value in meant.items() if before.get(key) != value}
        if not new:
            return "that is how it is set already"
        self._journal.record("changed", settings=new)
        return ""

    def _decide(self, data: dict[str, Any], decision: str) -> str:
        state = self._journal.state
        waits = None if state.waiting_candidate is None else (state.round.number, state.waiting_candidate)
        # Where a new search is due, what was found before it is not taken any more.
        if waits is None or self._journal.steered or (data.get("round"), data.get("candidate")) != waits:
            return f"there is no such reduction to {decision} any more"
        self._journal.record("decided", round=waits[0], candidate=waits[1], decision=decision)
        return ""

    def _go(self, node: int, rejected: int | None) -> None:
        state = self._journal.state
        failures = failures_at(state, node)
        judged = {} if failures == state.failures else self._judged(failures)
        self._journal.record("went_back", node=node, rejected=rejected, **judged)

    def _judged(self, failures: tuple[int, ...]) -> dict[str, Any]:
        """What all tests are where the ends of `failures` count as f."""
        file, state = self._journal.file, self._journal.state
        spec = FailureSpec.model_validate(state.scenario["failure"])
        return rejudged(file, state, tuple(failure_of(file, state, test, spec) for test in failures))

    def _accept(self, test: Test, environment: list[str]) -> None:
        journal, state = self._journal, self._journal.state
        journal.record(
            "accepted_other",
            test=test.id,
            what=f"test {test.id}" if test.phase == "hand" else self._label(test),
            trial=test.trial,
            environment=self._numbers(environment),
            **self._judged((*state.failures, test.id)),
        )

    def _label(self, test: Test) -> str:
        round = self._journal.state.round
        current = round is not None and round.number == test.round
        return round.candidates[test.candidate].label if current else f"a candidate of round {test.round}"

    def _lacks_pinned(self, keep: frozenset[str]) -> str:
        pinned = self._journal.state.pinned - keep
        lacking = [name for name in self._journal.state.environment if name in pinned]
        return f"is without '{lacking[0]}', which is pinned: unpin it first" if lacking else ""

    def _candidate(self, data: dict[str, Any]) -> Candidate | None:
        round = self._journal.state.round
        if round is None or round.done or round.winner is not None or round.number != data.get("round"):
            return None
        index = data.get("candidate")
        return round.candidates[index] if type(index) is int and 0 <= index < len(round.candidates) else None

    def _models(self, data: dict[str, Any], empty: bool = False) -> list[str] | None:
        numbers, elements = data.get("models"), self._journal.state.elements
        if not isinstance(numbers, list) or not (numbers or empty):
            return None
        if not all(type(number) is int and 0 <= number < len(elements) for number in numbers):
            return None
        return [elements[number] for number in dict.fromkeys(numbers)]

    def _numbers(self, models: Any) -> list[int]:
        number = {name: index for index, name in enumerate(self._journal.state.elements)}
        return [number[name] for name in models]


def _wrong(reduction: dict[str, Any]) -> str:
    """Why these settings cannot be, or ""."""
    try:
        settings = Reduction.model_validate(reduction)
        check("algorithm", settings.algorithm)
        split_pair(settings.pair)
    except ValidationError as error:
        first = error.errors()[0]
        return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
    except UserError as error:
        return str(error)
    return ""


STEERING: dict[str, Callable[[Steering, dict[str, Any]], str]] = {
    "accept": Steering.accept,
    "reject": Steering.reject,
    "veto": Steering.veto,
    "unveto": Steering.unveto,
    "pin": Steering.pin,
    "unpin": Steering.unpin,
    "try": Steering.try_out,
    "adopt": Steering.adopt,
    "accept_other": Steering.accept_other,
    "undo": Steering.undo,
    "go_back": Steering.go_back,
    "change": Steering.change,
}
