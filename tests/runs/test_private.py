"""What belongs to a run is the user's alone, until the user opens the run to others."""

import os
import stat
import subprocess

import pytest

from ddenv.errors import UserError
from ddenv.runfile.events import Paused
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import RunFile
from ddenv.runs import programs
from ddenv.runs.engine_job import EngineOptions
from tests.engine.fake import new_run


@pytest.fixture
def started(monkeypatch):
    """Programs are not really started."""
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: None)


@pytest.mark.parametrize(("mode", "beside"), [(0o600, 0o600), (0o640, 0o640), (0o664, 0o664)])
def test_all_files_of_a_run_are_for_whom_the_run_is(tmp_path, started, mode, beside):
    before = os.umask(0o002)
    try:
        path = new_run(tmp_path)
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        path.chmod(mode)
        with RunFile(path) as file, engine_lock(path):
            file.own()
            file.append(Paused())
            programs.start_engine(path, EngineOptions(jobs=1))
            programs.start_scene(path)
            files = {
                each.name.removeprefix(path.name): stat.S_IMODE(each.stat().st_mode)
                for each in tmp_path.iterdir()
            }
        assert files == dict.fromkeys(("", "-wal", "-shm", ".lock", ".log", ".scene.log"), beside)
    finally:
        os.umask(before)


def test_a_mode_that_was_widened_stays(tmp_path, started):
    path = new_run(tmp_path)
    programs.start_engine(path, EngineOptions(jobs=1))
    log = tmp_path / f"{path.name}.log"
    log.chmod(0o644)
    programs.start_engine(path, EngineOptions(jobs=1))
    assert stat.S_IMODE(log.stat().st_mode) == 0o644 and stat.S_IMODE(path.stat().st_mode) == 0o600


def test_without_a_log_no_engine_starts_but_the_scene_is_shown(tmp_path, started):
    path = new_run(tmp_path)
    for ending in (".log", ".scene.log"):
        (tmp_path / f"{path.name}{ending}").mkdir()
    with pytest.raises(UserError, match="cannot run an engine here: its log cannot be written"):
        programs.start_engine(path, EngineOptions(jobs=1))
    programs.start_scene(path)
