"""A study's folder is its own: anything else is refused in one line, and so is a second study."""

import json

import pytest

from ddenv import __version__
from ddenv.errors import UserError
from ddenv.study.folder import ABOUT, Session, machine, opened, sessions, versions, write_sessions
from ddenv.study.plan import RUNS

SESSIONS = (
    Session(
        begun=1.5e9,
        seconds=12.5,
        jobs=2,
        tests=40,
        versions="ddenv 1",
        machine="a machine, 2 cores",
    ),
    Session(begun=1.6e9, seconds=0.0, jobs=4, tests=0, versions="ddenv 2", machine="\u05e9"),
)


def refused(folder):
    with pytest.raises(UserError) as error, opened(folder):
        pass
    assert "\n" not in str(error.value)
    return str(error.value)


def test_it_is_made_with_all_above_it_and_opened_again_by_one_study_at_a_time(tmp_path):
    folder = tmp_path / "a" / "b"
    # Also after one that was killed before it wrote anything.
    for _ in range(2):
        with opened(folder):
            assert [path.name for path in folder.iterdir() if path.is_dir()] == [RUNS]
            assert "another study is running in this folder; wait for it" in refused(folder)


def test_what_is_something_else_is_refused_and_not_touched(tmp_path):
    (tmp_path / "study").write_text("mine")
    assert refused(tmp_path / "study") == f"{tmp_path}/study: is a file; give the name of a folder"
    assert "contains other files; give the name of a new or empty folder" in refused(tmp_path)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("study", "mine")]


def test_what_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone" / "too")
    for folder in (tmp_path / "file" / "study", tmp_path / "nowhere", tmp_path / ("x" * 300)):
        assert f"{folder}: cannot be written: " in refused(folder)


def test_times_are_read_as_they_were_written(tmp_path):
    assert sessions(tmp_path) == ()
    write_sessions(tmp_path, SESSIONS)
    assert sessions(tmp_path) == SESSIONS


RIGHT = {"begun": 1.0, "seconds": 1.0, "jobs": 1, "tests": 1, "versions": "", "machine": ""}
DAMAGED = (
    "",
    '{"sittings": [',
    "[]",
    "[" * 100_000,
    '{"sittings": 3}',
    '{"sittings": ["begun"]}',
    json.dumps({"sittings": [{key: RIGHT[key] for key in RIGHT if key != "machine"}]}),
    json.dumps({"sittings": [RIGHT | {"begun": "noon"}]}),
    json.dumps({"sittings": [RIGHT | {"jobs": float("inf")}]}),
)


@pytest.mark.parametrize("text", DAMAGED, ids=lambda text: text[:12])
def test_a_damaged_list_of_times_is_one_line(tmp_path, text):
    (tmp_path / ABOUT).write_text(text)
    with pytest.raises(
        UserError, match=rf"{ABOUT}: is damaged; delete it \(the runs are not affected\)"
    ):
        sessions(tmp_path)


def test_what_made_the_numbers_has_a_name():
    assert versions().startswith(f"ddenv {__version__}, Python 3.") and ", drake " in versions()
    assert "core" in machine() and "\n" not in machine()
