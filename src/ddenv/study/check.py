"""What is left of a cell, tried once more with seeds that its reduction never used: with all of it, and without each model."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from ddenv.errors import UserError
from ddenv.study.plan import Cell
from ddenv.study.study_folder import check_path
from ddenv.world.files.access import read_bytes, write_file

# Between the seeds of a reduction and those of its check.
APART = 100_000


@dataclass(frozen=True, slots=True)
class Check:
    """Runs from `seed` on, `runs` of each: f showed in `shown` with all that is left, in `without[model]` without that one."""

    seed: int
    runs: int
    shown: int
    without: dict[str, int]

    @property
    def holds(self) -> bool:
        """Whether f showed, and without no model that is left."""
        return self.shown > 0 and not any(self.without.values())


def start_check(run: Path, cell: Cell, jobs: int) -> tuple[subprocess.Popen, IO[str]]:
    """Starts the runs as a program; what it prints goes to the file. As many runs of each as a candidate gets in a reduction."""
    words = [sys.executable, "-m", "ddenv", "test", "--minimal", "--leave-each-out", "--json"]
    words += ["--seed", str(_seed(cell)), "--repeat", str(_runs(cell)), "--jobs", str(jobs), "--", str(run)]
    told = tempfile.TemporaryFile("w+")  # noqa: SIM115
    # A ctrl+c is for the study, which ends its programs itself.
    program = subprocess.Popen(
        words, stdin=subprocess.DEVNULL, stdout=told, stderr=subprocess.STDOUT, start_new_session=True
    )
    return program, told


def write_check(folder: Path, cell: Cell, told: IO[str]) -> None:
    """Keeps what a check that has ended came to. Raises UserError with its own words if it did not come to its end."""
    told.seek(0)
    text = told.read()
    try:
        runs = json.loads(text.strip().rpartition("\n")[2])["runs"]
        shown = Counter(run["without"] for run in runs if run["outcome"] == "similar")
        names = dict.fromkeys(run["without"] for run in runs if run["without"] is not None)
        found = {"all": shown[None], "without": {name: shown[name] for name in names}}
    except (ValueError, TypeError, KeyError):
        said = text.strip().rpartition("\n")[2] or "no word of why"
        raise UserError(f"what is left could not be tried once more: {said}") from None
    kept = {"seed": _seed(cell), "runs": _runs(cell), **found}
    write_file(check_path(folder, cell), json.dumps(kept).encode())


def read_check(folder: Path, cell: Cell, left: tuple[str, ...]) -> Check | None:
    """What was kept of it; None where nothing is, or where it was of other models than those that are `left`."""
    path = check_path(folder, cell)
    try:
        kept = json.loads(read_bytes(path))
        without = {str(name): int(number) for name, number in kept["without"].items()}
        found = Check(int(kept["seed"]), int(kept["runs"]), int(kept["all"]), without)
    except (UserError, ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
        return None
    if not all(0 <= number <= found.runs for number in (found.shown, *without.values())):
        return None
    return found if (found.seed, found.runs, set(without)) == (_seed(cell), _runs(cell), set(left)) else None


def _seed(cell: Cell) -> int:
    return cell.seed + APART


def _runs(cell: Cell) -> int:
    return 1 + cell.scenario.reduction.iterations
