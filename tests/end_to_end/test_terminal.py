"""The workbench in a real terminal: tmux, which is killed in the middle of a run."""

import os
import shutil
import subprocess
import sys
import time
import uuid

import pytest

from ddenv.runfile.fold import fold
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.store import RunFile
from tests.conftest import DATA

pytestmark = pytest.mark.skipif(shutil.which("tmux") is None, reason="no tmux on this machine: no terminal to look at")


class Terminal:
    """One tmux server with one window, in which `ddenv` runs."""

    def __init__(self, home, width, height, *words):
        self.server = f"ddenv-{uuid.uuid4().hex[:8]}"
        command = ["env", f"DDENV_HOME={home}", "TERM=xterm-256color", sys.executable, "-m", "ddenv", *map(str, words)]
        self.tmux("-f", "/dev/null", "new-session", "-d", "-x", str(width), "-y", str(height), *command)

    def tmux(self, *words):
        environment = {name: value for name, value in os.environ.items() if name != "TMUX"}
        command = ["tmux", "-L", self.server, *words]
        return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=30).stdout

    def screen(self):
        return self.tmux("capture-pane", "-p")

    def press(self, *keys):
        self.tmux("send-keys", *keys)

    def see(self, words, seconds=60):
        """The screen as soon as it shows `words`."""
        deadline = time.monotonic() + seconds
        while words not in (screen := self.screen()):
            assert time.monotonic() < deadline, f"'{words}' does not show:\n{screen}"
            time.sleep(0.1)
        return screen

    def kill(self):
        self.tmux("kill-server")


@pytest.fixture
def terminal(tmp_path):
    opened = []

    def start(width, height, *words):
        opened.append(Terminal(tmp_path, width, height, *words))
        return opened[-1]

    yield start
    for each in opened:
        each.kill()


@pytest.mark.parametrize(("width", "height"), [(120, 36), (80, 24)])
def test_pause_step_accept_and_a_killed_terminal(terminal, tmp_path, width, height):
    first = terminal(width, height, "run", DATA / "wall.yaml", "--name", "one", "--jobs", "1")
    first.see("baseline")
    run = tmp_path / "runs" / "one.ddenv"
    with RunFile(run) as viewer:
        viewer.send("pause")
    first.kill()

    bench = terminal(width, height, "open", "one")
    bench.see("paused")
    assert engine_is_alive(run)
    bench.press("t")
    bench.see("accept: ask")
    _wait(lambda: not any(test.outcome == "running" for test in _state(run).tests))
    before = len(_state(run).finished_tests)
    bench.press("s")
    bench.see(f"‖ paused   {before + 1} test")
    bench.press("Space")
    bench.see("a accepts it")
    bench.press("a")
    _wait(lambda: len(_state(run).environment) < 6)

    bench.kill()
    time.sleep(0.5)
    assert engine_is_alive(run) or _state(run).status == "finished"
    again = terminal(width, height, "open", "one")
    again.see("accept: ask")
    again.press("t")
    again.see("finished")
    assert set(_state(run).environment) == {"deck", "wall"}
    again.press("q")


def test_the_first_screen_offers_the_ditch(terminal):
    setup = terminal(80, 24)
    screen = setup.see("ditch")
    assert "ditch" in screen
    assert "43 models" in setup.see("43 models")
    setup.press("q")


def _state(run):
    with RunFile(run) as file:
        return fold(file.events())


def _wait(condition, seconds=60):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)
