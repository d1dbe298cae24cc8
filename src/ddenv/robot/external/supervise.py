"""Runs a command and ends it with everything that it started: `python -I -S supervise.py FOLDER
PROGRAM [WORD...]`.

Standard input is a socket to a worker. The command starts at a `+` from there. When it has ended,
one line is sent back: `exit 3`, `signal 9`, or `error 13` if it could not be started. Another byte
from the worker, or the worker's end, ends the command at once. At the end FOLDER is removed, also
if the worker was killed before the command started. This is a program of its own because a worker
that is killed cannot clean up.
"""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

# How long a command may take to end before it is killed, and how long its remaining processes are
# killed, s.
GRACE = 2.0
PATIENCE = 5.0
PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36  # from Linux' <sys/prctl.h>


def main() -> None:
    folder, *words = sys.argv[1:]
    worker = socket.socket(fileno=0)
    # A worker ignores Ctrl-C, and programs inherit what is ignored.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    with contextlib.suppress(OSError):
        # A worker that is killed while it writes the command's files says nothing.
        if worker.recv(1) == b"+":
            worker.sendall(run(words, worker).encode())
        while worker.recv(64):
            pass
    shutil.rmtree(folder, ignore_errors=True)


def run(words: list[str], worker: socket.socket) -> str:
    """Runs the command to its end, or until the worker wants it ended. Returns how it ended."""
    woken, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.set_wakeup_fd(wake)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    prctl(PR_SET_CHILD_SUBREAPER, 1)
    try:
        process = subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            start_new_session=True,
            # In the command's process, before the command runs: it dies with us.
            preexec_fn=lambda: prctl(PR_SET_PDEATHSIG, signal.SIGKILL),
        )
    except OSError as error:
        return f"error {error.errno}"
    sources: list[socket.socket | int] = [worker, woken]
    while process.poll() is None:
        ready, _, _ = select.select(sources, [], [])
        if worker in ready:
            # Some commands have something to clean up, such as a container.
            signal_group(process.pid, signal.SIGTERM)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(GRACE)
            signal_group(process.pid, signal.SIGKILL)
            process.wait()
        else:
            os.read(woken, 64)
    signal_group(process.pid, signal.SIGKILL)
    kill_children()
    code = process.returncode
    if code >= 0:
        return f"exit {code}"
    return f"signal {-code}"


def kill_children() -> None:
    """Kills processes that have left the command's group. Those that lost their parent are our own
    children by now.
    """
    until = time.monotonic() + PATIENCE
    while (pids := children()) and time.monotonic() < until:
        for pid in pids:
            with contextlib.suppress(OSError):
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, os.WNOHANG)
        time.sleep(0.002)


def signal_group(group: int, number: int) -> None:
    with contextlib.suppress(OSError):
        os.killpg(group, number)


def children() -> list[int]:
    """Our child processes, including ended ones; none where there is no /proc."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            # The second field is a name in parentheses, which may contain anything.
            fields = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()
            if int(fields[1]) == os.getpid():
                found.append(int(entry.name))
    return found


def prctl(option: int, value: int) -> None:
    """Calls Linux' prctl, where there is one."""
    with contextlib.suppress(ImportError, OSError, AttributeError):
        import ctypes

        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


if __name__ == "__main__":
    main()
