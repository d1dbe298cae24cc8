"""Processes that cut meshes, but for one kind that they do not survive."""

from __future__ import annotations

import os
import sys

from tests.waiting import wait_until

PYRAMID = (
    "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 1 1 1\nf 1 4 3 2\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"
)
PROGRAM = """
import os, signal, time
from ddenv.world.files import cutting, pieces

with open({pids!r}, "a") as file:
    file.write(f"{{os.getpid()}}\\n")
usual = pieces.convex_pieces

def convex_pieces(vertices, faces, most):
    while len(vertices) == 5:
        {deed}
    return usual(vertices, faces, most)

pieces.convex_pieces = convex_pieces
cutting.LONGEST = {longest}
cutting.serve()
"""
DEEDS = {
    "crashes": "os.kill(os.getpid(), signal.SIGSEGV)",
    "ends": "os._exit(0)",
    "raises": "raise KeyError",
    "computes": "pass",
    "hangs": "time.sleep(9)",
}


class Cutters:
    """Lets meshes be cut by processes that do this on a pyramid."""

    def __init__(self, folder, deed, longest=60.0):
        self._pids = folder / "pids"
        self._file = folder / "cutter.py"
        self._file.write_text(
            PROGRAM.format(pids=str(self._pids), deed=DEEDS[deed], longest=longest)
        )
        self.command = (sys.executable, str(self._file))

    def wait(self):
        """Until one has started."""
        wait_until(lambda: self._pids.exists() and self._pids.read_text().endswith("\n"))

    def started(self):
        return len(self._pids.read_text().split()) if self._pids.exists() else 0

    def left(self):
        """Those that still run."""
        return [pid for pid in map(int, self._pids.read_text().split()) if runs(pid)]


def runs(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def write_world(folder, *meshes):
    """A world with a static model for each of `meshes`, OBJ texts by name."""
    models = ""
    for name, text in meshes:
        (folder / f"{name}.obj").write_text(text)
        shape = f"<geometry><mesh><uri>{name}.obj</uri></mesh></geometry>"
        models += (
            f"<model name='{name}'><static>true</static><link name='l'><collision "
            f"name='c'>{shape}</collision></link></model>"
        )
    world = folder / "meshes.sdf"
    world.write_text(f"<sdf version='1.7'><world name='w'>{models}</world></sdf>")
    return world
