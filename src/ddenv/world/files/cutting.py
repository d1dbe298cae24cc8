"""Cuts meshes into convex pieces in processes of their own, as many at a time as there are cores.

A mesh on which such a process crashes, or which takes it too long, costs only its own pieces: its
hull stands for it.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import time
from contextlib import suppress
from multiprocessing.connection import wait
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from typing import Any

from ddenv.world.files.kept_pieces import KNOWN, ToCut, keep
from ddenv.world.files.meshes import pack_pieces
from ddenv.world.files.watch import WATCH

# Starts a process that cuts: by `serve`.
COMMAND = (sys.executable, "-m", "ddenv.world.files.cutting")
# The maximum time of a processor for one mesh, s: three times what `MOST_WORK` takes, and a busy
# machine changes nothing.
LONGEST = 60.0
# The time between two looks, and that after which the user hears of it, s.
LOOK = 0.1
SLOW = 1.0


def cut(meshes: dict[Path, ToCut]) -> None:
    """Takes all `meshes` and cuts them. `read_kept` has the pieces of each then, by its file: none
    where that failed.
    """
    watch = WATCH.get()
    start = time.monotonic()
    total = len(meshes)
    # The finest last: it is taken first, so that no core waits for it at the end.
    waiting = sorted(meshes, key=lambda file: len(meshes[file][1]))
    idle = [_start() for _ in range(min(total, os.cpu_count() or 1))]
    busy: dict[Any, Path] = {}
    try:
        while waiting or busy:
            while waiting and idle:
                process = idle.pop()
                file = busy[process] = waiting.pop()
                # Of one that is gone nothing is read, either.
                with suppress(BrokenPipeError):
                    pickle.dump(meshes.pop(file), process.stdin)
                    process.stdin.flush()
            done = (
                f"cutting meshes into convex pieces: {total - len(waiting) - len(busy)} of {total}"
            )
            watch(done if time.monotonic() - start > SLOW else "")
            heard = wait([process.stdout for process in busy], LOOK)
            for process in [each for each in busy if each.stdout in heard]:
                file = busy.pop(process)
                try:
                    keep(file, pickle.load(process.stdout))
                    idle.append(process)
                except (EOFError, pickle.UnpicklingError):
                    process.communicate()
                    KNOWN[file] = pack_pieces([])
                    idle.append(_start())
    finally:
        for process in (*idle, *busy):
            process.kill()
            process.communicate()
        watch("")


def _start() -> Any:
    return Popen(COMMAND, stdin=PIPE, stdout=PIPE, stderr=DEVNULL)


def serve() -> None:
    """Cuts the meshes that come in, until the input ends."""
    # Loaded late: the program that wants pieces does without.
    from ddenv.world.files.pieces import convex_pieces

    while True:
        vertices, faces, most = pickle.load(sys.stdin.buffer)
        # Then the system ends this process, whatever it does; in ten times that, if it waits for
        # something.
        signal.setitimer(signal.ITIMER_PROF, LONGEST)
        signal.setitimer(signal.ITIMER_REAL, 10 * LONGEST)
        pickle.dump(
            pack_pieces(convex_pieces(vertices, faces.astype("int64"), most)), sys.stdout.buffer
        )
        sys.stdout.flush()


if __name__ == "__main__":
    serve()
