"""What tests of worlds share."""

import pytest

from tests.command import in_process

pytest.register_assert_rewrite("tests.world.hostile", "tests.world.soundness")


@pytest.fixture
def check_file(monkeypatch, capsys):
    """`ddenv world check` of a path, in this process."""
    return lambda *words: in_process(monkeypatch, capsys, "world", "check", *words)


@pytest.fixture
def check(tmp_path, check_file):
    """Checks a world of the given text, in a folder of its own."""

    def run(text, *words):
        path = tmp_path / "hostile.world"
        path.write_bytes(text)
        return check_file(path, *words), path

    return run
