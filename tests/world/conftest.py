"""What tests of worlds share."""

import pytest

from ddenv.world.files.fuel import CACHES
from ddenv.world.files.roots import VARIABLES
from tests.command import in_process

pytest.register_assert_rewrite("tests.world.hostile", "tests.world.soundness")


@pytest.fixture
def no_gazebo(monkeypatch, tmp_path):
    """A machine on which nothing says where models are."""
    for variable in (*VARIABLES, *CACHES):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))


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
