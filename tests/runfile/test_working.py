"""The time that a run took is that in which an engine worked: pauses and waiting for the user do not count."""

import pytest

from ddenv.runfile.fold import fold
from ddenv.runfile.store import Event
from ddenv.runfile.working import spent
from tests.workbench import fake_run

ENGINE = {"pid": 1, "jobs": 1, "version": "1", "simulator": "x"}


@pytest.fixture
def first(tmp_path):
    run = fake_run.waiting(fake_run.FakeRun(tmp_path / "a.ddenv"))
    events = run.file.events()
    run.close()
    return events


def at(first, *more):
    """The state after events at these times, s after the first ones; the engine started at 0."""
    events = [Event(event.id, 0.0, event.kind, event.data) for event in first]
    later = [Event(events[-1].id + number, time, kind, data) for number, (time, kind, data) in enumerate(more, 1)]
    return fold([*events, *later])


def test_pauses_and_waiting_do_not_count(first):
    # The run waits for the user from the beginning.
    state = at(first, (40.0, "decided", {"candidate": 0, "decision": "reject"}))
    assert spent(state, 45.0) == 5.0
    paused = (50.0, "paused", {}), (90.0, "resumed", {})
    decided = (40.0, "decided", {"candidate": 0, "decision": "reject"})
    assert spent(at(first, decided, paused[0]), 60.0) == 10.0
    assert spent(at(first, decided, *paused), 92.0) == 12.0
    assert spent(at(first, decided, *paused, (100.0, "engine_stopped", {"reason": "x"})), 500.0) == 20.0


def test_an_engine_that_died_in_a_pause_worked_until_then(first):
    decided = (40.0, "decided", {"candidate": 0, "decision": "reject"})
    state = at(first, decided, (50.0, "paused", {}), (500.0, "engine_started", ENGINE))
    assert spent(state, 501.0) == 11.0 and not state.paused
