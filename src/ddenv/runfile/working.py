"""With how many workers engines work on a run, and how long: no pause counts, nor the time in which a reduction waits for the user
or for the disk.
"""

from __future__ import annotations

from ddenv.runfile.events import Changes, Data, number, whole
from ddenv.runfile.state import RunState


def spent(state: RunState, until: float) -> float:
    """The time that engines have worked until Unix time `until`, s."""
    return state.working_seconds + (0.0 if state.started_at is None else max(0.0, until - state.started_at))


def stopped(state: RunState, at: float) -> Changes:
    """No engine works from Unix time `at` on, s."""
    return {"working_seconds": spent(state, at), "started_at": None}


def room(_: RunState, data: Data, at: float) -> Changes:
    """The disk has no room for more tests, or has room again."""
    return {"needs_room": 0 if data["enough"] else whole(data["needed"])}


def clock_jumped(state: RunState, data: Data, at: float) -> Changes:
    """Unix time went `seconds` on or back at once: nobody worked in that time."""
    if state.started_at is None:
        return {}
    return {"started_at": min(at, state.started_at + number(data["seconds"]))}


def on_cluster(_: RunState, data: Data, _at: float) -> Changes:
    """What has happened to the cluster that makes the tests."""
    return {"jobs": whole(data["jobs"]), "cluster": str(data["words"])}


HANDLERS = {"cluster": on_cluster, "room": room, "clock_jumped": clock_jumped}


def counted(before: RunState, after: RunState) -> RunState:
    """`after`, the state after one more event, with the clock stopped where the run stands still, and started where it goes on."""
    stood, stands = _stands(before), _stands(after)
    if stands and not stood:
        return after.changed(**stopped(after, after.updated_at))
    if stood and not stands and not after.ended and after.started_at is None:
        return after.changed(started_at=after.updated_at)
    return after


def _stands(state: RunState) -> bool:
    return state.paused or state.needs_room > 0 or state.waiting_candidate is not None
