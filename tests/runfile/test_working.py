"""The time that a run took is that in which an engine worked: pauses and waiting for the user do
not count.
"""

from dataclasses import replace

import pytest

from ddenv.runfile.fold import apply, fold
from ddenv.runfile.state import spent
from ddenv.runfile.store import Recorded
from tests.shorthand import typed
from tests.workbench import fake_moments, fake_run

ENGINE = {"pid": 1, "jobs": 1, "version": "1", "simulator": "x"}


@pytest.fixture
def first(tmp_path):
    run = fake_moments.waiting(fake_run.FakeRun(tmp_path / "a.ddenv"))
    events = run.file.events()
    run.close()
    return events


def at(first, *more):
    """The state after events at these times, s after the first ones; the engine started at 0."""
    state = fold(replace(one, time=0.0) for one in first)
    for time, kind, data in more:
        for event in typed(state, kind, data):
            state = apply(state, Recorded(state.revision + 1, time, event))
    return state


def test_pauses_and_waiting_do_not_count(first):
    # The run waits for the user from the beginning.
    state = at(first, (40.0, "decided", {"candidate": 0, "decision": "reject"}))
    assert spent(state, 45.0) == 5.0
    paused = (50.0, "paused", {}), (90.0, "resumed", {})
    decided = (40.0, "decided", {"candidate": 0, "decision": "reject"})
    assert spent(at(first, decided, paused[0]), 60.0) == 10.0
    assert spent(at(first, decided, *paused), 92.0) == 12.0
    assert (
        spent(at(first, decided, *paused, (100.0, "engine_stopped", {"reason": "x"})), 500.0)
        == 20.0
    )


def test_a_full_disk_and_jumps_of_the_clock_do_not_count(first):
    decided = (40.0, "decided", {"candidate": 0, "decision": "reject"})
    full = (
        (50.0, "disk_space", {"enough": False, "needed": 10, "free": 1}),
        (90.0, "disk_space", {"enough": True, "needed": 10, "free": 20}),
    )
    assert (
        at(first, decided, full[0]).needs_room == 10
        and spent(at(first, decided, full[0]), 60.0) == 10.0
    )
    assert (
        at(first, decided, *full).needs_room == 0 and spent(at(first, decided, *full), 95.0) == 15.0
    )
    # The machine slept for 1,000 s after 20 s of work.
    slept = at(first, decided, (1060.0, "clock_jumped", {"seconds": 1000.0}))
    assert spent(slept, 1065.0) == 25.0
    # The clock was set back by 1,000 s.
    back = at(first, decided, (-940.0, "clock_jumped", {"seconds": -1000.0}))
    assert spent(back, -935.0) == 25.0


def test_an_engine_that_died_in_a_pause_worked_until_then(first):
    decided = (40.0, "decided", {"candidate": 0, "decision": "reject"})
    state = at(first, decided, (50.0, "paused", {}), (500.0, "engine_started", ENGINE))
    assert spent(state, 501.0) == 11.0 and not state.paused
