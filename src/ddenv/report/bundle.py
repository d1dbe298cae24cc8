"""A reproduction to hand over: what is left of a run, with all that makes it fail again on another machine."""

from __future__ import annotations

import re
import shutil
import sqlite3
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from ddenv import __version__
from ddenv.errors import UserError
from ddenv.evidence.claims import current, rate
from ddenv.report.report import content, write_report
from ddenv.report.run_data import Record, read_run
from ddenv.runfile.events import deed
from ddenv.runs.export import export_world
from ddenv.runs.folder import BUNDLED_RUN
from ddenv.runs.programs import how_to_install
from ddenv.runs.reasons import sentence
from ddenv.text import count, printable
from ddenv.world.access import write_file

RUN, WORLD, SCENARIO, REPORT, ISSUE, AGAIN = (
    BUNDLED_RUN,
    "world.sdf",
    "scenario.yaml",
    "report.html",
    "ISSUE.md",
    "repro.py",
)
MOST_NAMES = 20
NEEDS = f"needs ddenv {__version__}: {how_to_install()}"
PROGRAM = f'''"""Exits with 1 where the robot fails as it did, with 0 where it does not, with 125 where that cannot be said.

Needs ddenv, installed from its clone. In a repository: git bisect run python repro.py --folder .
"""

import subprocess
import sys
from pathlib import Path

run = Path(__file__).resolve().with_name("{RUN}")
# Without it Python itself exits with 1, and PyPI has another program of that name.
if subprocess.call([sys.executable, "-c", "import ddenv.runfile"], stderr=subprocess.DEVNULL):
    print("repro.py: {NEEDS}", file=sys.stderr)
    sys.exit(125)
sys.exit(subprocess.call([sys.executable, "-m", "ddenv", "reproduce", str(run), "--trust", *sys.argv[1:]]))
'''

TEST = """def test_{name}_no_longer_fails(ddenv_reproduce):
    found = ddenv_reproduce("{file}")
    assert found.fails is False, str(found)
"""


def write_bundle(run: Path, target: Path) -> list[Path]:
    """Writes the bundle of a run to a new folder, or to a new ZIP file by the name's ending; returns what was written.

    Raises UserError, also if `target` exists or if no certificate says how often what is left fails; then nothing is written.
    """
    if target.exists():
        raise UserError(f"{target}: exists already; choose another name")
    if not target.absolute().parent.is_dir():
        raise UserError(f"{target}: there is no folder {target.absolute().parent}; make it first")
    record = read_run(run)
    if current(record.state) is None:
        raise UserError(f"{run}: no certificate says how often what is left fails; make one first: ddenv certify {run}")
    # Complete or not there at all.
    with tempfile.TemporaryDirectory(prefix=".ddenv-bundle-", dir=target.absolute().parent) as temporary:
        folder = Path(temporary) / target.stem
        folder.mkdir()
        _fill(folder, run, record)
        if target.suffix.lower() != ".zip":
            shutil.move(folder, target)
            return sorted(target.iterdir())
        packed = Path(temporary) / "packed.zip"
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(folder.iterdir()):
                archive.write(file, f"{folder.name}/{file.name}")
        packed.replace(target)
    return [target]


def write_test(run: Path, folder: Path) -> list[Path]:
    """Writes a test for pytest to `folder`, with the run beside it; returns both files.

    It fails as long as the robot fails. Raises UserError, also if one of the files exists.
    """
    record = _certified(run)
    name = re.sub(r"\W+", "_", run.stem).strip("_").lower() or "run"
    test, copy = folder / f"test_{name}.py", folder / f"{name}.ddenv"
    for path in (test, copy):
        if path.exists():
            raise UserError(f"{path}: exists already; choose another folder")
    if not folder.is_dir():
        raise UserError(f"{folder}: is not a folder; make it first")
    with tempfile.TemporaryDirectory(prefix=".ddenv-test-", dir=folder) as temporary:
        made = Path(temporary) / copy.name
        _copy_run(run, made, record)
        made.replace(copy)
    write_file(test, TEST.format(name=name, file=copy.name).encode())
    return [test, copy]


def _certified(run: Path) -> Record:
    record = read_run(run)
    if current(record.state) is None:
        raise UserError(f"{run}: no certificate says how often what is left fails; make one first: ddenv certify {run}")
    return record


def _copy_run(run: Path, target: Path, record: Record) -> None:
    """A copy with only the trajectories that are needed."""
    try:
        source = sqlite3.connect(f"{run.absolute().as_uri()}?mode=ro", uri=True)
        with closing(source), closing(sqlite3.connect(target)) as copy:
            source.backup(copy)
            copy.execute("PRAGMA journal_mode = DELETE")
            needed = ", ".join(str(test) for test in sorted(_needed(record)))
            copy.execute(f"DELETE FROM motion WHERE test NOT IN ({needed})")
            copy.commit()
            copy.execute("VACUUM")
    except sqlite3.Error as error:
        raise UserError(f"{run}: cannot be copied: {error}") from None


def _fill(folder: Path, run: Path, record: Record) -> None:
    _copy_run(run, folder / RUN, record)
    needs = export_world(run, folder / WORLD, folder / SCENARIO).needs
    write_report(run, folder / REPORT)
    write_file(folder / AGAIN, PROGRAM.encode())
    write_file(folder / ISSUE, ("\n".join(_issue(record, needs)) + "\n").encode(errors="replace"))


def _needed(record: Record) -> set[int]:
    """The tests whose trajectories go along: f's, and those that the report draws. All tests would be a hundred times as much."""
    state = record.state
    drawn = {test for test in (state.evidence_test, *state.failures, *record.ways) if test is not None}
    drawn |= {test.id for test in state.tests if test.phase == "baseline"}
    # An implied test has the trajectories of another one.
    return drawn | {by for test in drawn if (by := state.tests[test - 1].implied_by) is not None}


def _issue(record: Record, needs: list[str]) -> Iterator[str]:
    """The text of an issue, as Markdown."""
    state, found = record.state, current(record.state)
    assert found is not None
    position = state.f_position or ()
    at = f" at ({', '.join(f'{value:.2f}' for value in position[:2])}) m" if position else ""
    yield f"# {printable(content(record).verdict)}"
    yield ""
    yield f"The robot {deed(state.failure)}{at}: {rate(found.claims[0])}."
    yield ""
    yield "Models that are enough:"
    yield ""
    yield from (f"- `{_code(name)}`" for name in state.environment[:MOST_NAMES])
    if len(state.environment) > MOST_NAMES:
        yield f"- and {count(len(state.environment) - MOST_NAMES, 'more model')}"
    yield ""
    yield from (f"{printable(sentence(each))}" for each in record.reasons[:MOST_NAMES])
    if record.nearest is not None:
        yield ""
        yield printable(record.nearest.sentences)
    yield ""
    yield "## Reproduce"
    yield ""
    yield f"    python {AGAIN}"
    yield ""
    yield f"It {NEEDS}."
    yield "It runs what is left with fresh seeds until they decide. Its exit codes are those that `git bisect run` reads:"
    yield "1 if it fails as it did, 0 if it does not, 125 if that cannot be said. `--folder FOLDER` has a controller of your own."
    yield ""
    yield f"`{REPORT}` opens in a browser and says why it fails and how that was found; `ddenv open {RUN}` shows the run itself."
    yield f"`{WORLD}` is the world that is left; `ddenv test {SCENARIO}` runs the robot in it once."
    if needs:
        names = ", ".join(f"`{_code(uri)}`" for uri in needs[:MOST_NAMES])
        yield f"Other programs also need the files that `{WORLD}` names: {names}."
    yield ""
    yield f"Made by ddenv {__version__}; {_code(state.simulator)}."


def _code(text: str) -> str:
    return printable(text).replace("`", "'")
