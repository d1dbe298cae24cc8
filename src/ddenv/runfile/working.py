"""How long engines have worked on a run: neither a pause nor the time in which a reduction waits for the user counts."""

from __future__ import annotations

from ddenv.runfile.events import Changes
from ddenv.runfile.state import RunState


def spent(state: RunState, until: float) -> float:
    """The time that engines have worked until Unix time `until`, s."""
    return state.working_seconds + (0.0 if state.started_at is None else max(0.0, until - state.started_at))


def stopped(state: RunState, at: float) -> Changes:
    """No engine works from Unix time `at` on, s."""
    return {"working_seconds": spent(state, at), "started_at": None}


def counted(before: RunState, after: RunState) -> RunState:
    """`after`, the state after one more event, with the clock stopped where the run stands still, and started where it goes on."""
    stood, stands = _stands(before), _stands(after)
    if stands and not stood:
        return after.changed(**stopped(after, after.updated_at))
    if stood and not stands and not after.ended and after.started_at is None:
        return after.changed(started_at=after.updated_at)
    return after


def _stands(state: RunState) -> bool:
    return state.paused or state.waiting_candidate is not None
