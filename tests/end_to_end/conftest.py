"""What all end-to-end tests need: terminals that are closed again."""

import shutil

import pytest

from tests.end_to_end.terminal import Terminal


@pytest.fixture
def terminal(tmp_path):
    if shutil.which("tmux") is None:
        pytest.skip("no tmux on this machine: no terminal to look at")
    opened = []

    def start(width, height, *words, **program):
        opened.append(Terminal(tmp_path, width, height, *words, **program))
        return opened[-1]

    yield start
    for each in opened:
        # Shown where the test failed.
        print(each.screen())
        each.kill()
