"""A screen looks at a run file: whatever becomes of the file, it neither writes, nor waits, nor
falls over.
"""

import os
import sqlite3
import threading

import fake_moments
import fake_run
import pytest
from attached import Attached

from ddenv.errors import UserError
from ddenv.guiding.commands import Pause, Resume, Stop
from ddenv.runfile.events import EngineStarted
from ddenv.workbench.app import Workbench
from ddenv.workbench.shared import poll as polling
from ddenv.workbench.shared.poll import Poll
from tests.waiting import eventually


def look(poll):
    poll._looked = poll._posed = -1e9
    return poll.look()


def files(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """A look reads all there is, however slow the machine."""
    monkeypatch.setattr(polling, "PATIENCE", 60.0)


@pytest.fixture
def poll(run):
    fake_moments.mid_round(run)
    opened = Poll(run.path)
    yield opened
    opened.close()


def test_only_what_is_new_makes_a_snapshot(run, poll):
    assert look(poll).state.tests_done == 10
    assert look(poll) is None
    run.write("paused")
    assert look(poll).state.paused
    assert look(poll) is None


def test_a_long_run_is_caught_up_with_over_several_looks(run, poll, monkeypatch):
    monkeypatch.setattr(polling, "SOME_EVENTS", 10)
    monkeypatch.setattr(polling, "PATIENCE", 0.0)
    revisions = [snapshot.state.revision for _ in range(9) if (snapshot := poll.look())]
    assert revisions[:3] == [10, 20, 30]
    assert revisions[-1] == len(run.file.events())


def test_the_path_of_f_itself_comes_with_the_snapshot(run, poll):
    snapshot = look(poll)
    assert snapshot.original == fake_run.path_samples()
    run.write("paused")
    assert look(poll).original is snapshot.original


@pytest.mark.parametrize("becomes", ["deleted", "replaced"])
def test_a_file_that_is_gone_is_told_and_neither_made_again_nor_another_one_touched(
    run, runs, poll, becomes
):
    before = look(poll)
    run.close()
    for path in runs.glob("crates-1*"):
        path.rename(runs / f"moved-{path.name}")
    if becomes == "replaced":
        fake_run.FakeRun(run.path).close()
    there = files(runs)
    after = look(poll)
    assert after.gone and after.state is before.state
    assert becomes in after.error and after.status == "lost"
    assert look(poll) is None
    with pytest.raises(UserError, match="is gone"):
        poll.file.send("pause")
    poll.close()
    assert files(runs) == there


def test_watching_writes_nothing(run, runs):
    fake_moments.mid_round(run)
    before = files(runs)
    watching = Poll(run.path, watch=True)
    assert look(watching).state.tests_done == 10
    run.write("paused")
    assert look(watching).state.paused
    watching.close()
    run.close()
    assert set(before) - {"crates-1.ddenv-wal", "crates-1.ddenv-shm"} == set(files(runs))
    settled = files(runs)
    watching = Poll(run.path, watch=True)
    assert look(watching).state.tests_done == 10
    watching.close()
    assert files(runs) == settled


async def test_the_whole_screen_writes_nothing_while_it_watches(run, runs):
    fake_moments.finished(run).close()
    before = files(runs)
    async with Workbench(run.path, watch=True).run_test(size=(120, 36)) as pilot:
        await pilot.pause()
        await pilot.app.workers.wait_for_complete()
        assert files(runs) == before
    assert files(runs) == before


def test_a_run_that_comes_to_life_is_followed(run, runs):
    fake_moments.mid_round(run).close()
    watching = Poll(run.path, watch=True)
    assert look(watching).status == "lost"
    engine = fake_run.RunFile(run.path)
    engine.own()
    engine.append(EngineStarted(pid=1, jobs=2, version="0", simulator="none"))
    with run.engine():
        assert look(watching).status in ("running", "baseline")
    engine.close()
    watching.close()


def test_the_last_to_close_leaves_one_file(run, runs, poll):
    look(poll)
    run.close()
    assert (runs / "crates-1.ddenv-wal").exists()
    poll.close()
    assert [path.name for path in runs.iterdir() if path.name.startswith("crates-1.ddenv-")] == []


def test_a_writer_that_holds_the_file_does_not_stop_the_screen(run, runs):
    run.close()
    # Before an engine has worked on it a run file has no log: who writes then locks readers out.
    made = fake_run.FakeRun(runs / "b.ddenv")
    made.close()
    poll = Poll(made.path)
    first = look(poll)
    writer = sqlite3.connect(made.path, isolation_level=None)
    writer.execute("PRAGMA locking_mode = EXCLUSIVE")
    writer.execute("BEGIN EXCLUSIVE")
    writer.execute("DELETE FROM live")
    assert look(poll) is None
    writer.execute("COMMIT")
    writer.close()
    look(poll)
    assert poll._snapshot.state.elements == first.state.elements
    poll.close()


async def test_commands_are_sent_in_order_and_answered_on_the_screens_thread(run):
    fake_moments.mid_round(run)
    async with Attached(run) as session:
        answers = []
        for command in (Pause(), Resume(), Stop()):
            session.screen.asking.send(
                command, then=lambda: answers.append(threading.current_thread())
            )
        await eventually(lambda: len(answers) == 3)
        assert set(answers) == {threading.current_thread()}
        assert [kind for kind, _ in session.asked()] == ["pause", "resume", "stop"]


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is read-only for root")
def test_a_folder_where_nothing_may_be_written(run, runs):
    fake_moments.finished(run).close()
    runs.chmod(0o500)
    try:
        poll = Poll(run.path)
        assert look(poll).state.ended
        poll.close()
    finally:
        runs.chmod(0o700)
