"""A terminal that nobody sees: tmux, with one window."""

from __future__ import annotations

import os
import subprocess
import sys
import uuid

from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from tests.waiting import PATIENCE, wait_until

# The program, as a shell takes it.
DDENV = f"{sys.executable} -m ddenv"


class Terminal:
    """One tmux server with one window, in which `ddenv` runs; or `program` in its place."""

    def __init__(self, home, width, height, *words, program=(sys.executable, "-m", "ddenv")):
        self.server = f"ddenv-{uuid.uuid4().hex[:8]}"
        command = ["env", f"DDENV_HOME={home}", "TERM=xterm-256color", *program, *map(str, words)]
        self.tmux(
            "-f",
            "/dev/null",
            "new-session",
            "-d",
            "-c",
            str(home),
            "-x",
            str(width),
            "-y",
            str(height),
            *command,
        )

    def tmux(self, *words):
        environment = {name: value for name, value in os.environ.items() if name != "TMUX"}
        command = ["tmux", "-L", self.server, *words]
        return subprocess.run(
            command, capture_output=True, text=True, env=environment, timeout=PATIENCE
        ).stdout

    def screen(self):
        return self.tmux("capture-pane", "-p")

    def press(self, *keys):
        self.tmux("send-keys", *keys)

    def see(self, words):
        """The screen as soon as it shows `words`."""
        seen = [""]

        def shows():
            seen[:] = [self.screen()]
            return words in seen[0]

        wait_until(shows, lambda: f"'{words}' does not show:\n{seen[0]}")
        return seen[0]

    def kill(self):
        self.tmux("kill-server")


def state_of(run):
    with RunFile(run) as file:
        return fold(file.events())
