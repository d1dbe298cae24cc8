"""Files that were opened before are offered again."""

import pytest

from ddenv.runs.remembered import state_file
from ddenv.workbench.setup.files import KEPT, RECENT, FileList, recent_files, remember
from tests.workbench.setup.setup_session import Opened


@pytest.fixture
def files(tmp_path):
    made = [tmp_path / f"world-{number}.sdf" for number in range(KEPT + 3)]
    for path in made:
        path.touch()
    return made


def test_the_newest_come_first_once_and_not_without_end(files):
    for path in (*files, files[0]):
        remember(path)
    found = recent_files()
    assert found[:2] == [files[0], files[-1]]
    assert len(found) == len(set(found)) == KEPT


def test_missing_files_drop_out(files):
    remember(files[0])
    remember(files[1])
    files[1].unlink()
    assert recent_files() == [files[0]]


@pytest.mark.parametrize("content", ["", "no list", '{"a": 1}', "[1, null, {}]", "[" * 50_000, '["\\u0000"]'])
def test_a_damaged_list_is_an_empty_one(content, files):
    state_file(RECENT).write_text(content)
    assert recent_files() == []
    remember(files[0])
    assert recent_files() == [files[0]]


def test_where_nothing_can_be_written_nothing_is_remembered(files, monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("DDENV_HOME", str(tmp_path / "file" / "below"))
    remember(files[0])
    assert recent_files() == []


def labels(session):
    files = session.screen.query_one(FileList)
    return [str(files.get_option_at_index(index).prompt) for index in range(files.option_count)]


@pytest.mark.screens
async def test_an_opened_world_is_offered_the_next_time(scenarios, tmp_path):
    folder = tmp_path / "fields"
    folder.mkdir()
    path = folder / "[red]wild[.sdf"
    path.write_bytes((scenarios / "crates.sdf").read_bytes())
    async with Opened() as session:
        assert labels(session) == ["crates"]
        await session.open(path)
        assert labels(session) == ["crates", "[red]wild[.sdf  fields"]
    async with Opened() as session:
        assert labels(session) == ["crates", "[red]wild[.sdf  fields"]
        await session.press("end")
        assert session.screen.preview.choice.path == path


@pytest.mark.screens
async def test_what_cannot_be_read_and_what_is_bundled_is_not_remembered(scenarios, tmp_path):
    broken = tmp_path / "broken.sdf"
    broken.write_text("<sdf")
    async with Opened() as session:
        await session.open(broken)
        await session.open(scenarios / "crates.yaml")
        assert session.screen.preview.choice.name == "crates"
    assert not state_file(RECENT).exists()
