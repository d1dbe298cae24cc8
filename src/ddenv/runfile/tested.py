"""What a test was made for, and which test or candidate a moment is about."""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.runfile.position import Moment
from ddenv.runfile.state import CERTIFY, Candidate, RunState, Test, Trial
from ddenv.runfile.supports import stack_with
from ddenv.text import first_of


def purpose(state: RunState, test: Test) -> str:
    """What `test` was made for, in words, as far as `state` knows: all of it in the state in which
    the test started.
    """
    if test.id < 0:
        return test.phase
    row = made_for(state, test)
    if row is not None:
        return f"{f'round {test.round} · ' if isinstance(row, Candidate) else ''}{row.label}"
    if test.phase == "round":
        if test.candidate is None:
            return "what is left, with a chosen seed"
        return f"round {test.round}"
    if test.phase == "audit":
        return "an audit of the slice"
    if test.removal is not None:
        gone = state.removals[test.removal - 1].models
        if gone:
            return f"the whole world without {first_of(gone, 1)}"
        return "the whole world, in full"
    if test.phase == CERTIFY:
        environment = state.nodes[test.node].environment
        gone = stack_with(state, environment, test.without)
        whole = "the whole world" if len(environment) == len(state.elements) else "what is left"
        if gone:
            return f"{whole} without {first_of(gone, 1)}"
        return f"{whole}, in full"
    return "baseline"


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a viewer wants the scene to show: the moment of the event `at`, None for the present,
    and a row of the table then. A candidate is one of round number `round`; without one, and
    without a try, the scene follows the run.
    """

    at: int | None = None
    round: int | None = None
    candidate: int | None = None
    trial: int | None = None


def made_for(state: RunState, test: Test | Wanted) -> Candidate | Trial | None:
    """The candidate of the current round, or the try, that a test was made for, or that is
    wanted.
    """
    if test.trial is not None:
        if 0 < test.trial <= len(state.trials):
            return state.trials[test.trial - 1]
        return None
    current = state.round
    if current is None or test.round != current.number or test.candidate is None:
        return None
    if 0 <= test.candidate < len(current.candidates):
        return current.candidates[test.candidate]
    return None


def adoptable(state: RunState) -> Trial | None:
    """The last try here that showed f and could become the environment."""
    tries = (one for one in reversed(state.trials) if one.node == state.node)
    return next((one for one in tries if one.verdict == "similar" and not one.adopted), None)


def told(moment: Moment) -> Test | None:
    """The test whose end a moment tells: the one that ended in it, or the last one of a candidate
    that was judged.
    """
    from ddenv.runfile.events import CandidateJudged, Implied, TestFinished

    state = moment.after
    event = moment.recorded.event
    if isinstance(event, TestFinished | Implied):
        return state.test(event.test)
    row = pointed(moment) if isinstance(event, CandidateJudged) else None
    if row is not None and row.tests:
        return state.test(row.tests[-1])
    return None


def pointed(moment: Moment) -> Candidate | None:
    """The candidate that a moment is about; None if it is about none."""
    from ddenv.runfile.events import Implied, OfCandidate, TestFinished, TestLost, TestStarted

    state = moment.after
    event = moment.recorded.event
    if isinstance(event, TestStarted | TestFinished | TestLost | Implied):
        row = made_for(state, state.test(event.test))
        if isinstance(row, Candidate):
            return row
        return None
    if state.round and isinstance(event, OfCandidate):
        return state.round.candidates[event.candidate]
    return None
