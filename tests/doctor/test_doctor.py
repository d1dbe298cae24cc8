"""`ddenv doctor`: says what is wrong with an installation, a machine or a run, and repairs a run
into a copy, never in place.
"""

import json
import shutil
import sqlite3

import pytest

from ddenv.doctor import is_well, machine
from ddenv.doctor.run_health import repair, run_health
from ddenv.errors import UserError
from ddenv.runfile.events import AcceptModeChanged, EngineStarted, Paused
from ddenv.runfile.integrity import faults, whole
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import RunFile
from tests.engine.fake import FakePool, drive, new_run
from tests.engine.killing import story
from tests.engine.oracles import needs
from tests.tiers import slow

oracle = needs("deck", "wall")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run to its end, and what it came to."""
    path = new_run(tmp_path_factory.mktemp("made"))
    return path, story(drive(path, FakePool(oracle, 2)))


@pytest.fixture
def run(made, tmp_path):
    return shutil.copy(made[0], tmp_path / "a.ddenv")


def wrong(path):
    return {finding.what: finding.says for finding in run_health(path) if finding.state == "wrong"}


def everything(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def change(path, words):
    with sqlite3.connect(path) as database:
        database.execute(words)
    database.close()


def spoil(path, part):
    """Overwrites the pages of one part of the file."""
    content = bytearray(path.read_bytes())
    first = int(len(content) * part) // 4096 * 4096
    content[first : first + 8192] = b"\xa5" * 8192
    path.write_bytes(content)


def test_a_whole_run_is_well_and_nothing_is_written(run):
    before = everything(run.parent)
    findings = run_health(run)
    assert is_well(findings) and everything(run.parent) == before
    assert {finding.what for finding in findings} >= {
        "file",
        "log",
        "SQLite",
        "events",
        "made with",
        "engine",
    }


def test_what_a_killed_engine_left_is_part_of_the_run_and_stays_where_it_is(tmp_path):
    path, copy = new_run(tmp_path), tmp_path / "left"
    copy.mkdir()
    with RunFile(path) as file:
        file.own()
        file.append(EngineStarted(pid=1, jobs=1, version="1", simulator="x"))
        events = len(file.events())
        for each in (path, path.with_name(f"{path.name}-wal")):
            shutil.copy(each, copy)
    left = copy / path.name
    before = everything(copy)
    found = {finding.what: finding for finding in run_health(left)}
    assert found["log"].state == "note" and found["events"].says.startswith(f"{events} events")
    assert everything(copy) == before
    repair(left, tmp_path / "whole.ddenv")
    with RunFile(tmp_path / "whole.ddenv") as file:
        assert len(file.events()) == events


@pytest.mark.parametrize(
    "part", slow(pytest.mark.fuzz, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9], but=[0.8])
)
def test_what_is_whole_of_a_damaged_file_is_repaired_into_a_copy_and_goes_on_to_the_same_end(
    made, run, part
):
    spoil(run, part)
    before, copy = everything(run.parent), run.parent / "copy.ddenv"
    assert wrong(run)
    try:
        repair(run, copy)
    except UserError as error:
        assert "nothing can be repaired" in str(error) and not copy.exists()
        return
    assert {
        name: content for name, content in everything(run.parent).items() if name != copy.name
    } == before
    with RunFile(copy) as file:
        assert faults(file) == [] and whole(file).trouble == ""
    assert story(drive(copy, FakePool(oracle, 2))) == made[1]


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        ("UPDATE event SET data = '{' WHERE id = 15", "damaged run file"),
        ("UPDATE motion SET samples = x'00' WHERE test = 4", "a trajectory is cut short"),
        ("UPDATE event SET kind = 'danced' WHERE id = 9", "unknown kind"),
    ],
)
def test_each_kind_of_damage_is_told_and_what_comes_before_it_is_kept(run, damage, says):
    change(run, damage)
    assert says in wrong(run)["events"]
    copy = run.parent / "copy.ddenv"
    assert says in repair(run, copy)[0].says
    assert is_well(run_health(copy))


def test_a_run_that_was_made_small_is_well(run):
    change(run, "DELETE FROM motion WHERE test = 4")
    found = run_health(run)
    assert is_well(found)
    assert [finding.says[:6] for finding in found if finding.what == "trajectories"] == ["1 of 3"]


def test_a_log_of_another_run_does_not_hide_what_is_whole(run):
    shutil.copy(run, run.parent / "b.ddenv")
    with RunFile(run.parent / "b.ddenv") as other:
        other.own()
        for _ in range(30):
            other.append(Paused())
        shutil.copy(run.parent / "b.ddenv-wal", f"{run}-wal")
    change_log = run.with_name("a.ddenv-wal")
    change_log.write_bytes(change_log.read_bytes()[:-100] + bytes(100))
    with RunFile(run, untouched=True) as file:
        alone = whole(file).events
    repair(run, run.parent / "copy.ddenv")
    with RunFile(run.parent / "copy.ddenv") as file:
        assert whole(file).trouble == "" and whole(file).events >= alone


def test_a_run_at_work_is_checked_and_copied_whole(run):
    with RunFile(run) as file, engine_lock(run):
        file.own()
        file.append(AcceptModeChanged(mode="ask"))
        found = {finding.what: finding for finding in run_health(run)}
        assert found["engine"].says == "running" and found["log"].state == "ok"
        repair(run, run.parent / "copy.ddenv")
        events = file.events()
    with RunFile(run.parent / "copy.ddenv") as copy:
        assert copy.events() == events


def test_a_copy_never_replaces_a_file(run):
    there = run.parent / "there.ddenv"
    there.write_text("mine")
    with pytest.raises(UserError, match="exists already"):
        repair(run, there)
    with pytest.raises(UserError, match="exists already"):
        repair(run, run)
    assert there.read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ((), 0),
        (("RUN",), 0),
        (("none",), 2),
        (("--repair", "x"), 2),
        (("RUN", "--repair", "RUN"), 2),
    ],
)
def test_exit_codes(run, home, words, code, command):
    said = command("doctor", *(str(run) if word == "RUN" else word for word in words))
    assert said.returncode == code, said
    assert len(said.stderr.splitlines()) == (1 if code == 2 else 0)


def test_what_is_wrong_is_an_exit_code_and_json(run, home, command):
    run.write_bytes(b"SQLite format 3\0" + b"x" * 5000)
    said = command("doctor", run, "--json")
    told = json.loads(said.stdout)
    assert said.returncode == 1 and told["well"] is False
    assert any(
        each["state"] == "wrong" and "not a ddenv run file" in each["says"]
        for each in told["findings"]
    )


def test_what_is_not_installed_is_wrong(monkeypatch):
    monkeypatch.setitem(machine.NEEDED, "nothing", "no_such_module")
    missing = [finding for finding in machine.installation() if finding.state == "wrong"]
    assert [finding.what for finding in missing] == ["nothing"]


def test_a_folder_that_cannot_be_written_is_wrong(monkeypatch, home):
    def refuse(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(machine.tempfile, "TemporaryFile", refuse)
    assert [finding.state for finding in machine.runs()][-1] == "wrong"
