"""Files are written whole or not at all."""

import os

import pytest

from ddenv.errors import UserError
from ddenv.world.access import write_file


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    target = tmp_path / "out.sdf"
    target.write_bytes(b"before")

    def full(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(UserError, match="No space left"):
        write_file(target, b"after")
    assert target.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_is_missing_is_named(tmp_path):
    with pytest.raises(UserError, match="cannot be written"):
        write_file(tmp_path / "nowhere" / "out.sdf", b"")
