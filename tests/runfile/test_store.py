"""The run file: what is in it stays, and another file is refused."""

import json
import sqlite3
import zipfile
from array import array
from contextlib import closing

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.errors import UserError
from ddenv.runfile.events import Created, Paused, RoundStarted, TestFinished
from ddenv.runfile.fold import fold
from ddenv.runfile.lock import engine_is_alive, engine_lock
from ddenv.runfile.state import partition_letter
from ddenv.runfile.store import (
    LOGS,
    ROBOT,
    SCHEMA_VERSION,
    Live,
    Recorded,
    RunFile,
    create,
    recorded,
)

CREATED = Created(scenario={}, elements=("Häuser",))
TestFinished.__test__ = False


def ended(failure: str = "") -> TestFinished:
    return TestFinished(
        test=1,
        outcome="pass",
        failure=failure,
        distance=None,
        end_pose=None,
        simulated_seconds=2.0,
        wall_seconds=1.0,
    )


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "a.ddenv"
    create(path, {"world": b"<sdf/>"}, CREATED)
    return path


def _sql(path, *statements):
    database = sqlite3.connect(path)
    for statement in statements:
        database.execute(statement)
    database.commit()
    database.close()


def test_documents_events_commands_and_motions_come_back(path):
    with RunFile(path) as engine, RunFile(path) as viewer:
        engine.own()
        samples = array("d", range(16))
        event = engine.append(ended("Häuser"), {ROBOT: samples.tobytes(), "board": b""})
        assert viewer.events()[1:] == [event]
        assert viewer.events(after=event.id) == []
        assert viewer.motion(1) == samples
        assert viewer.motions(1) == {ROBOT: samples, "board": array("d")}
        assert viewer.motion(2) is None
        assert viewer.document("world") == b"<sdf/>"
        assert viewer.send("veto", round=1, candidate=2) == 1
        assert [(one.kind, one.data) for one in engine.commands()] == [
            ("veto", {"round": 1, "candidate": 2})
        ]
        engine.set_live([Live(slot=1, test=7, time=0.5, pose=(1.0, 2.0, 0.2, 1.0, 0.0, 0.0, 0.0))])
        assert viewer.live() == [
            Live(slot=1, test=7, time=0.5, pose=(1.0, 2.0, 0.2, 1.0, 0.0, 0.0, 0.0))
        ]
        board = {"board": (3.0, 2.0, 0.2, 1.0, 0.0, 0.0, 0.0)}
        engine.set_live(
            [Live(slot=1, test=7, time=0.5, pose=(1.0, 2.0, 0.2, 1.0, 0.0, 0.0, 0.0), models=board)]
        )
        assert viewer.live()[0].models == board


def test_a_settled_run_is_one_file(path, tmp_path):
    with RunFile(path) as file:
        file.own()
        file.append(Paused())
        file.settle()
        copy = tmp_path / "copy.ddenv"
        copy.write_bytes(path.read_bytes())
    with RunFile(copy) as file:
        assert [event.kind for event in file.events()] == ["created", "paused"]


def test_an_existing_file_is_never_overwritten(path):
    before = path.read_bytes()
    with pytest.raises(UserError, match="exists already"):
        create(path, {}, CREATED)
    assert path.read_bytes() == before


def _killed(path):
    """Leaves beside the deleted run what a killed engine leaves: what it wrote last."""
    with RunFile(path) as file:
        file.own()
        file.append(Paused())
        logs = {
            log: log.read_bytes()
            for ending in LOGS
            if (log := path.with_name(path.name + ending)).exists()
        }
    path.unlink()
    for log, content in logs.items():
        log.write_bytes(content)
    return logs


def test_a_new_run_has_nothing_of_a_deleted_one_that_was_killed(path):
    assert _killed(path)
    create(path, {"world": b"<sdf/>"}, {"scenario": {}, "elements": ["board"]})
    with RunFile(path) as file:
        file.own()
        assert [event.kind for event in file.events()] == ["created"]
        assert fold(file.events()).elements == ("board",)


def test_a_deleted_run_is_not_replaced_while_its_engine_works(path):
    logs = _killed(path)
    with (
        engine_lock(path),
        pytest.raises(UserError, match="an engine is still working on a deleted run of this name"),
    ):
        create(path, {}, CREATED)
    assert not path.exists()
    assert all(log.exists() for log in logs)


def test_nothing_is_left_of_a_file_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be written"):
        create(tmp_path / "file" / "a.ddenv", {}, {})
    with pytest.raises(UserError, match="cannot be written"):
        create(tmp_path / ("n" * 300), {}, {})
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


def test_files_that_are_no_run_files(tmp_path):
    with pytest.raises(UserError, match="no such run file"):
        RunFile(tmp_path / "none.ddenv")
    text = tmp_path / "text.ddenv"
    text.write_text("hello " * 1000)
    with pytest.raises(UserError, match="is not a ddenv run file"):
        RunFile(text)
    other = tmp_path / "other.ddenv"
    with sqlite3.connect(other) as database:
        database.execute("CREATE TABLE t (x)")
    with pytest.raises(UserError, match="is not a ddenv run file"):
        RunFile(other)
    packed = tmp_path / "handed.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("handed/run.ddenv", "hello")
    with pytest.raises(UserError, match="is a ZIP file; unpack it first"):
        RunFile(packed)


@pytest.mark.parametrize(
    ("version", "words"),
    [(SCHEMA_VERSION + 1, "written by a newer ddenv")]
    + [
        (old, rf"before its first release \(format {old}\); this one reads format 8")
        for old in (1, 4, 6)
    ],
)
def test_a_file_of_another_format_is_refused(path, version, words):
    _sql(path, f"PRAGMA user_version = {version}")
    with pytest.raises(UserError, match=words):
        RunFile(path)


def test_a_file_of_format_7_is_read_and_an_engine_that_writes_it_makes_it_newer(path):
    _sql(path, "PRAGMA user_version = 7")
    with RunFile(path) as file:
        assert file.events()
        file.own()
    with sqlite3.connect(path) as database:
        assert database.execute("PRAGMA user_version").fetchone() == (SCHEMA_VERSION,)


def test_damage_is_told_and_not_thrown(path):
    _sql(path, "INSERT INTO motion VALUES (1, '', x'0102')", "DELETE FROM document")
    _sql(path, "INSERT INTO event (time, kind, data) VALUES (0, 'paused', 'not json')")
    with RunFile(path) as file:
        for read in (file.events, lambda: file.motion(1), lambda: file.document("world")):
            with pytest.raises(UserError, match="damaged run file"):
                read()


def test_a_file_that_another_program_locks_is_not_called_damaged(path):
    with (
        RunFile(path, wait=0.05) as file,
        closing(sqlite3.connect(path, isolation_level=None)) as other,
    ):
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(
            UserError, match="cannot be read now: database is locked by another program; try again"
        ):
            file.events()
        other.execute("ROLLBACK")
        assert file.events()


def test_a_full_disk_is_one_line_and_loses_nothing(path):
    with RunFile(path) as file:
        file.own()
        file.append(Paused())
        file._db.execute(
            f"PRAGMA max_page_count = {file._db.execute('PRAGMA page_count').fetchone()[0]}"
        )
        with pytest.raises(UserError, match=r"full; its content is intact"):
            file.append(ended("y" * 100_000), {ROBOT: bytes(64_000)})
        assert [event.kind for event in file.events()] == ["created", "paused"]
        assert file.motions(1) == {}


def test_one_engine_a_run(path):
    assert not engine_is_alive(path)
    with engine_lock(path):
        assert engine_is_alive(path)
        with (
            pytest.raises(UserError, match="another engine is working on this run"),
            engine_lock(path),
        ):
            pass
    assert not engine_is_alive(path)


def test_partition_letters_go_on_after_z():
    places = (0, 25, 26, 51, 52, 701, 702)
    assert list(map(partition_letter, places)) == ["A", "Z", "AA", "AZ", "BA", "ZZ", "AAA"]


kinds = st.sampled_from(
    [
        "created",
        "test_started",
        "test_finished",
        "round_started",
        "reduced",
        "vetoed",
        "decided",
        "x",
    ]
)
values = st.recursive(
    st.none() | st.integers(-3, 5) | st.text(max_size=3), lambda inner: st.lists(inner, max_size=3)
)
names = st.sampled_from(
    [
        "test",
        "round",
        "candidate",
        "elements",
        "scenario",
        "partitions",
        "environment",
        "candidates",
    ]
)


@given(entries=st.lists(st.tuples(kinds, st.dictionaries(names, values)), max_size=8))
def test_events_that_make_no_sense_are_told_in_one_line(entries):
    try:
        fold(
            recorded(index + 1, 0.0, kind, json.dumps(data))
            for index, (kind, data) in enumerate(entries)
        )
    except UserError as error:
        assert "damaged run file" in str(error)


NUMBERS = "WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n)"
VIEW = f"CREATE VIEW event AS {NUMBERS} SELECT id, 0 AS time, '' AS kind, '' AS data FROM n"
TRIGGER = "CREATE TRIGGER t AFTER INSERT ON command BEGIN DELETE FROM event; END"


@pytest.mark.parametrize(
    "statements", [("DROP TABLE event", VIEW), (TRIGGER,)], ids=["view", "trigger"]
)
def test_a_view_in_the_place_of_a_table_and_a_trigger_are_refused(path, statements):
    _sql(path, *statements)
    with pytest.raises(UserError, match="its tables are not those of a run file"):
        RunFile(path)


DEEP = "[" * 100_000


@pytest.mark.parametrize(
    "data", [DEEP, "[]", "3", "{", "null"], ids=["deep", "list", "number", "cut", "null"]
)
def test_entries_that_are_no_objects_are_told(path, data):
    _sql(path, f"INSERT INTO event (time, kind, data) VALUES (0, 'paused', '{data}')")
    with RunFile(path) as file, pytest.raises(UserError, match="damaged run file"):
        file.events()


@pytest.mark.parametrize("pose", [DEEP, "xx", "3"], ids=["deep", "word", "number"])
def test_a_running_test_without_a_pose_is_told(path, pose):
    _sql(path, f"INSERT INTO live VALUES (0, 1, 0.5, '{pose}')")
    with RunFile(path) as file, pytest.raises(UserError, match="damaged run file"):
        file.live()


@pytest.mark.parametrize(
    ("partitions", "candidates"),
    [
        (((0,),), (("complement", 0, None),) * 100_000),
        (((10**12,),), ()),
        (((10**7,),) * 10_000, ()),
    ],
    ids=["candidates", "a model", "models"],
)
def test_a_small_file_cannot_fill_the_memory(partitions, candidates):
    elements = tuple(str(number) for number in range(1000))
    events = [
        Recorded(1, 0.0, Created(scenario={}, elements=elements)),
        Recorded(
            2,
            0.0,
            RoundStarted(
                round=1, n_partitions=2, environment=0, partitions=partitions, candidates=candidates
            ),
        ),
    ]
    with pytest.raises(UserError, match="is invalid"):
        fold(events)


def test_what_steers_a_terminal_is_not_passed_on():
    with pytest.raises(UserError) as caught:
        recorded(1, 0.0, "\x1b]2;x\x07", "{}")
    assert "\x1b" not in str(caught.value)
    assert str(UserError("a\x1b[2Jb\nc\ud800")).isprintable()


def test_a_run_in_a_folder_that_cannot_be_written_is_read(path, monkeypatch):
    with RunFile(path) as file:
        file.own()
        file.settle()
    monkeypatch.setattr("os.access", lambda *_: False)
    with RunFile(path) as file:
        assert [event.kind for event in file.events()] == ["created"]
        with pytest.raises(UserError, match="cannot be written"):
            file.send("pause")
