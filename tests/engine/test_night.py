"""What a night brings: a full disk, a clock that jumps, a run file that is copied, deleted or
replaced under an engine.
"""

import errno
import os
import shutil
import sqlite3
import threading
import time
from collections import namedtuple
from functools import partial

import pytest

from ddenv.engine import control
from ddenv.engine.control import NEEDED, Control, DiskSpace
from ddenv.engine.journal import Journal
from ddenv.errors import UserError
from ddenv.runfile.events import EngineStarted, Paused, TestFinished
from ddenv.runfile.fold import fold
from ddenv.runfile.integrity import faults, whole
from ddenv.runfile.lock import engine_is_alive, engine_lock
from ddenv.runfile.store import LOGS, NoRoom, RunFile
from ddenv.words.news import news
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.killing import story
from tests.engine.oracles import needs
from tests.engine.reading import events, told

Usage = namedtuple("Usage", "free")


oracle = needs("deck", "wall")


def watched(path, terminated=None):
    """Works on a run as `drive` does, with an eye on the disk."""
    terminated = terminated or threading.Event()
    watch = partial(DiskSpace, terminated=terminated)
    return drive(path, FakePool(oracle, 2), terminated=terminated, watch=watch)


@pytest.fixture
def undisturbed(tmp_path):
    """What the run comes to on a good night."""
    folder = tmp_path / "good"
    folder.mkdir()
    return story(drive(new_run(folder), FakePool(oracle, 2)))


def disk(monkeypatch, free):
    monkeypatch.setattr(control, "PERIOD", 0.0)
    monkeypatch.setattr(control.shutil, "disk_usage", lambda _: Usage(free()))


def lines_and_kinds(path):
    """The lines that a follower reads, and the kinds of events."""
    lines, kinds, state = [], [], None
    for event in events(path):
        before, state = state, fold([event], state)
        kinds.append(event.kind)
        if before is not None and (line := news(event.kind, before, state)):
            lines.append(line.strip())
    return lines, kinds


def test_no_test_starts_on_a_disk_that_is_nearly_full_and_the_run_goes_on_when_there_is_room(
    tmp_path, monkeypatch, undisturbed
):
    looks = iter([10 * NEEDED] * 5 + [NEEDED - 1] * 7)
    disk(monkeypatch, lambda: next(looks, 10 * NEEDED))
    path = new_run(tmp_path)
    assert story(watched(path)) == undisturbed
    lines, kinds = lines_and_kinds(path)
    first, last = (number for number, kind in enumerate(kinds) if kind == "disk_space")
    assert "test_started" not in kinds[first:last] and "test_started" in kinds[:first]
    assert (
        "out of disk space: waiting until 32 MB are free" in lines
        and "there is disk space again" in lines
    )


def test_a_result_that_finds_no_room_waits_and_nothing_is_half_written(
    tmp_path, monkeypatch, capsys, undisturbed
):
    path = new_run(tmp_path)
    looks = []
    original = RunFile.append

    def full_for_a_while(file, event, *values):
        if isinstance(event, TestFinished) and event.test == 3 and len(looks) < 4:
            # Even less than a result.
            file._db.execute("PRAGMA max_page_count = 1")
        return original(file, event, *values)

    def look():
        looks.append(1)
        return 0 if len(looks) < 4 else 10 * NEEDED

    def waits(self, full):
        again = original_wait(self, full)
        if len(looks) < 4:
            look()
        else:
            self._file._db.execute("PRAGMA max_page_count = 1000000")
        return again

    original_wait = DiskSpace.wait
    monkeypatch.setattr(RunFile, "append", full_for_a_while)
    monkeypatch.setattr(DiskSpace, "wait", waits)
    disk(monkeypatch, lambda: 10 * NEEDED)
    assert story(watched(path)) == undisturbed
    assert capsys.readouterr().err.count("waits until 32 MB are free") == 1
    with RunFile(path) as file:
        assert whole(file).trouble == "" and faults(file) == []


def test_an_engine_that_waits_for_room_can_be_ended(tmp_path, monkeypatch):
    path = new_run(tmp_path)
    terminated = threading.Event()
    disk(monkeypatch, lambda: 10 * NEEDED)

    def full(*_):
        terminated.set()
        raise NoRoom(f"{path}: cannot be written: full")

    monkeypatch.setattr("ddenv.runfile.store._insert", full)
    with pytest.raises(UserError, match="cannot be written"):
        watched(path, terminated)


def test_a_clock_that_jumps_is_told_and_its_time_does_not_count(tmp_path, monkeypatch):
    path = new_run(tmp_path)
    now = [1e9, 50.0]
    with RunFile(path) as file:
        file.own()
        journal = Journal(file)
        journal.record(EngineStarted(pid=1, jobs=1, version="1", simulator="x"))
        monkeypatch.setattr(time, "time", lambda: now[0] + now[1])
        monkeypatch.setattr(time, "monotonic", lambda: now[1])
        engine = Control(journal, threading.Event())
        for jump, passed in (
            (0.1, 0.1),
            (-1.0, 600.0),
            (8 * 3600.0, 0.1),
            (0.0, 0.1),
            (-3 * 86400.0, 0.1),
        ):
            now[0], now[1] = now[0] + jump, now[1] + passed
            engine.poll()
        monkeypatch.undo()
    assert [data["seconds"] for data in told(path, "clock_jumped")] == pytest.approx(
        [8 * 3600.0, -3 * 86400.0]
    )
    assert (
        "the machine slept, or its clock was set: that time does not count"
        in lines_and_kinds(path)[0]
    )


def test_a_stop_for_an_earlier_engine_stops_no_later_one_although_the_clock_was_set_back(
    tmp_path, monkeypatch
):
    path = new_run(tmp_path)
    with RunFile(path) as file:
        monkeypatch.setattr(time, "time", lambda: 4e9)
        after = file.send("stop")
        monkeypatch.undo()
        file.own()
        journal = Journal(file)
        control = Control(journal, threading.Event(), after)
        control.poll()
        assert journal.state.last_command == after


@pytest.mark.parametrize("fate", ["deleted", "moved", "replaced by another file"])
def test_an_engine_whose_run_file_is_gone_says_so_and_touches_no_other(tmp_path, fate):
    path = new_run(tmp_path)
    other = tmp_path / "other.ddenv"
    shutil.copy(path, other)
    content, moved = other.read_bytes(), tmp_path / "moved.ddenv"

    def disturb(file):
        append, count = file.append, [0]

        def counted(*values):
            count[0] += 1
            if count[0] == 12:
                {"deleted": path.unlink, "moved": lambda: path.rename(moved)}.get(
                    fate, lambda: other.replace(path)
                )()
            return append(*values)

        file.append = counted

    with pytest.raises(
        UserError, match=f"{path}: the run file was .*{fate}.* while an engine worked on it"
    ):
        drive(path, FakePool(oracle, 2), prepare=disturb)
    assert path.exists() == (fate == "replaced by another file")
    assert not any(path.with_name(path.name + ending).exists() for ending in LOGS)
    if path.exists():
        assert path.read_bytes() == content
    if moved.exists():
        with RunFile(moved) as file:
            assert len(file.events()) >= 12 and whole(file).trouble == ""


def test_a_run_that_is_copied_while_an_engine_works_is_readable(tmp_path):
    path = new_run(tmp_path)
    copies = tmp_path / "with log", tmp_path / "alone"
    counts = []

    def disturb(file):
        append = file.append

        def counted(*values):
            event = append(*values)
            if event.id == 20:
                for folder in copies:
                    folder.mkdir()
                    shutil.copy(path, folder)
                shutil.copy(f"{path}-wal", copies[0])
                counts.append(len(file.events()))
            return event

        file.append = counted

    drive(path, FakePool(oracle, 2), prepare=disturb)
    for folder, count in zip(copies, (counts[0], 1), strict=True):
        with RunFile(folder / path.name) as file:
            found = whole(file)
            assert (found.trouble, found.events) == ("", count)
    drive(copies[1] / path.name, FakePool(oracle, 2))


NO_LOCKS = "its folder has no file locks .* copy the run"
REFUSED = {
    "no locks": ("fcntl.flock", errno.ENOLCK, NO_LOCKS),
    "unsupported": ("fcntl.flock", errno.EOPNOTSUPP, NO_LOCKS),
    "no writing": ("os.open", errno.EACCES, "Permission denied; copy the run"),
}


@pytest.mark.parametrize(("call", "number", "words"), REFUSED.values(), ids=REFUSED)
def test_a_folder_in_which_no_engine_can_work_is_told_in_one_line(
    tmp_path, monkeypatch, call, number, words
):
    path = new_run(tmp_path)

    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(f"ddenv.runfile.lock.{call}", refuse)
    with pytest.raises(UserError, match=f"cannot run an engine here: {words}"), engine_lock(path):
        pass
    assert not engine_is_alive(path)


def test_an_error_of_writing_that_is_no_full_disk_is_not_waited_for(tmp_path):
    path = new_run(tmp_path)
    with RunFile(path) as file:
        file.own(lambda _: pytest.fail("waits"))
        file._db.execute("PRAGMA query_only = ON")
        with pytest.raises(UserError, match="cannot be written") as told_once:
            file.append(Paused())
    assert not isinstance(told_once.value, NoRoom)
    assert sqlite3.connect(path).execute("SELECT count(*) FROM event").fetchone() == (1,)
