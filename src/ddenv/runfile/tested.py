"""What a test was made for, and which models were in it."""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.amounts import first_of
from ddenv.runfile.atlas import without_removal
from ddenv.runfile.position import Moment
from ddenv.runfile.state import AHEAD, FRESH, Candidate, RunState, Test, Trial
from ddenv.runfile.supports import stack_with

OF_TESTS = ("test_started", "test_finished", "test_lost", "implied")


@dataclass(frozen=True, slots=True)
class Purpose:
    """`words` say what a test was made for. `models` were in it; None if that is known no more: its round is over."""

    words: str
    models: tuple[str, ...] | None


def purpose(state: RunState, test: Test) -> Purpose:
    """What `test` was made for, as far as `state` knows: all of it in the state in which the test started."""
    row = made_for(state, test)
    if row is not None:
        where = f"round {test.round} · " if isinstance(row, Candidate) else ""
        return Purpose(f"{where}{row.label}", row.models)
    if test.phase == "round":
        return Purpose(f"round {test.round}", None)
    if test.phase == AHEAD:
        return Purpose("ahead of its round", None if test.tried is None else test.tried.models)
    if test.phase == "audit":
        return Purpose("an audit of the slice", state.nodes[test.node].environment)
    if test.removal is not None:
        gone = state.removals[test.removal - 1].models
        words = f"the whole world without {first_of(gone, 1)}" if gone else "the whole world, in full"
        return Purpose(words, without_removal(state, test.removal))
    if test.phase in FRESH:
        environment = state.nodes[test.node].environment
        gone = stack_with(state, environment, test.without)
        whole = "the whole world" if len(environment) == len(state.elements) else "what is left"
        words = f"{whole} without {first_of(gone, 1)}" if gone else f"{whole}, in full"
        left_out = frozenset(gone)
        return Purpose(words, tuple(name for name in environment if name not in left_out))
    return Purpose("baseline", state.elements)


def made_for(state: RunState, test: Test) -> Candidate | Trial | None:
    """The candidate of the current round, or the try, that a test was made for."""
    if test.trial is not None:
        return state.trials[test.trial - 1] if 0 < test.trial <= len(state.trials) else None
    current = state.round
    if current is None or test.round != current.number or test.candidate is None:
        return None
    return current.candidates[test.candidate] if 0 <= test.candidate < len(current.candidates) else None


def told(moment: Moment) -> Test | None:
    """The test whose end a moment tells: the one that ended in it, or the last one of a candidate that was judged."""
    kind, state, data = moment.event.kind, moment.after, moment.event.data
    if kind in ("test_finished", "implied"):
        test: Test = state.tests[data["test"] - 1]
        return test
    row = pointed(moment) if kind == "candidate_judged" else None
    return state.tests[row.tests[-1] - 1] if row is not None and row.tests else None


def pointed(moment: Moment) -> Candidate | None:
    """The candidate that a moment is about; None if it is about none."""
    state, data = moment.after, moment.event.data
    if state.round is None:
        return None
    if moment.event.kind in OF_TESTS:
        row = made_for(state, state.tests[data["test"] - 1])
        return row if isinstance(row, Candidate) else None
    index = data.get("candidate")
    return state.round.candidates[index] if type(index) is int else None
