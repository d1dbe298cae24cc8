"""Simulators that do harm, for worker processes: they import little, and start fast."""

import os
import signal
import sys

import numpy as np

from ddenv.robot.result import RunResult


class Hostile:
    """Does what the name of the only model says."""

    def __init__(self, *_):
        pass

    def run(self, keep, seed, progress=None, ends=None):
        return getattr(self, min(keep))(seed)

    def ends(self, seed):
        return RunResult(
            outcome="pass",
            failure="",
            trajectory=np.zeros((2, 8)),
            motions={},
            simulated_seconds=1.0,
            wall_seconds=0.0,
            seed=seed,
        )

    def segfaults(self, seed):
        print("first line\n\n  last\x1b line", flush=True)
        os.kill(os.getpid(), signal.SIGSEGV)

    def exits(self, seed):
        os._exit(3)

    def fills(self, seed):
        hoard = [bytearray(b"x" * 50_000_000)]
        while True:
            hoard.append(bytearray(b"x" * 50_000_000))

    def babbles(self, seed):
        for _ in range(100):
            os.write(1, os.urandom(65536))
            print("garbage", file=sys.stderr)
        return self.ends(seed)

    def interrupts(self, seed):
        raise KeyboardInterrupt


def dies_at_once(*_):
    os.kill(os.getpid(), signal.SIGKILL)


class DiesWithoutTheBeam:
    """Fails where the wall is; dies where the wall is without the beam."""

    def __init__(self, *_):
        self.made = 0

    def run(self, keep, seed, progress=None, ends=None):
        if "wall" in keep and "beam" not in keep:
            os.kill(os.getpid(), signal.SIGABRT)
        failed = "wall" in keep
        way = np.zeros((3, 8))
        way[:, 0], way[:, 1], way[:, 4] = (0, 1, 2), (0, 1, 2.0 if failed else 4.0), 1
        return RunResult(
            outcome="failed" if failed else "pass",
            failure="stuck" if failed else "",
            trajectory=way,
            motions={},
            simulated_seconds=2.0,
            wall_seconds=0.01,
            seed=seed,
        )
