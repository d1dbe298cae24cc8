"""A study from its beginning to its end: what is there, what is left to do, and when it was worked on."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence, Set
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from ddenv.errors import printable
from ddenv.study.plan import Cell, Plan, Size, longest_first, sizes
from ddenv.study.progress import Progress
from ddenv.study.study_folder import Sitting, machine, opened, sittings, versions, write_sittings
from ddenv.study.study_page import write_study
from ddenv.study.work import PER_CELL, Work, is_done, made, work
from ddenv.words import count

# How often it is written how long the study took so far, s.
PERIOD = 10.0


def conduct(plan: Plan, folder: Path, jobs: int, out: TextIO) -> int:
    """Makes what is left to do of a study, in `folder`, with `jobs` workers, and writes what came of it; returns the exit code.

    0 means that every cell is minimal, 1 that not all are, 130 that it was interrupted. Raises UserError.
    """
    worlds = sizes(plan)
    with opened(folder):
        interrupted = False
        names = {cell.name for cell in plan.cells if is_done(folder, cell)}
        try:
            _make(plan, names, folder, jobs, worlds, out)
        except KeyboardInterrupt:
            interrupted = True
        page, found = write_study(plan, folder, sittings(folder))
    for each in found:
        if each.trouble and each.cell.name in names:
            print(printable(f"{each.cell.label}, seed {each.cell.seed}: {each.trouble}"), file=out)
    minimal = sum(each.holds for each in found)
    print(printable(f"{minimal} of {count(len(found), 'cell')} minimal; wrote {page}"), file=out, flush=True)
    if interrupted:
        print("interrupted; the same command goes on where it was", file=sys.stderr)
        return 130
    return 0 if minimal == len(found) else 1


def _make(plan: Plan, done: Set[str], folder: Path, jobs: int, worlds: dict[str, Size], out: TextIO) -> None:
    """Makes the cells whose names are not among those that are `done`. Raises UserError, and KeyboardInterrupt."""
    began, earlier = time.monotonic(), sittings(folder)
    open_ones = [cell for cell in plan.cells if cell.name not in done]
    if not open_ones:
        return
    progress = Progress(plan, folder, len(done), worlds, jobs, out)
    begun = Sitting(time.time(), 0.0, jobs, 0, versions(), machine())
    cells: list[Work] = []
    written = 0.0

    def write() -> None:
        tests = sum(made(each.state) - each.made_before for each in cells)
        write_sittings(folder, (*earlier, replace(begun, seconds=time.monotonic() - began, tests=tests)))

    def look(running: Sequence[Work], waiting: Sequence[Cell], ended: Sequence[Work]) -> None:
        nonlocal written
        cells[:] = (*running, *ended)
        progress.look(running, waiting, ended)
        # Now and then: a study that is killed has lost the time since.
        if time.monotonic() > written + PERIOD:
            written = time.monotonic()
            write()

    try:
        work(folder, longest_first(open_ones, worlds) if jobs > PER_CELL else open_ones, jobs, look)
    finally:
        write()
        progress.close()
