"""Simulators of a few lines of Python in the place of Drake, and what is left of them."""

import sys
import textwrap
from pathlib import Path

from ddenv.world.scenario import Oracle, Scenario
from tests.waiting import PATIENCE
from tests.wall import wall

TOKEN = "DDENV_TEST_TOKEN"

SLEEP = "import time; time.sleep(1000)"
STUBBORN = f"import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); {SLEEP}"
# A child, and a grandchild in a session of its own, both of which hold on to all streams.
FAMILY = f"""
import os, subprocess, sys
print("0,7,0,0,0,0,0,1", flush=True)
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        subprocess.run([sys.executable, "-c", {STUBBORN!r}])
    os._exit(0)
subprocess.Popen([sys.executable, "-c", {STUBBORN!r}])
"""


def own_scenario(
    folder: Path, code: str, words: str = "", wall_timeout: float = PATIENCE, **reduction
) -> Scenario:
    """The scenario of the small world with the Python program `code`, kept in `folder`."""
    (folder / "robot.py").write_text(textwrap.dedent(code))
    return wall(
        oracle=Oracle(command=f"{sys.executable} robot.py {words}"),
        folder=folder,
        simulation={"wall_timeout": wall_timeout},
        reduction=reduction,
    )


def processes_with(*marks: str) -> list[tuple[str, bytes]]:
    """Processes in whose environment all of `marks` stand: what a test started has its token,
    whatever became of it.
    """
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            environment = (entry / "environ").read_bytes()
            if all(mark.encode() in environment for mark in marks):
                found.append((entry.name, (entry / "cmdline").read_bytes()))
        except OSError:
            continue
    return found
