"""What all end-to-end tests need: terminals that are closed again, and engines that are stopped."""

import shutil

import pytest

from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.store import RunFile
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
    # An engine outlives its terminal.
    for path in tmp_path.rglob("*.ddenv"):
        if engine_is_alive(path):
            with RunFile(path) as run:
                run.send("stop")
