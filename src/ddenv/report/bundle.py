"""A reproduction to hand over: what is left of a run, with all that makes it fail again on another
machine.
"""

from __future__ import annotations

import re
import shutil
import sqlite3
import tempfile
import zipfile
from contextlib import closing
from pathlib import Path
from string import Template

from ddenv import __version__
from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.report.report import content, write_report
from ddenv.report.run_data import Record, read_run
from ddenv.runfile.failure_words import deed
from ddenv.runs.export import export_world
from ddenv.runs.folder import BUNDLED_RUN
from ddenv.runs.programs import how_to_install
from ddenv.runs.reasons import sentence
from ddenv.text import coordinates, count, printable
from ddenv.words.claims import meaning, rate, seeds_of, uncertified
from ddenv.words.margins import rows, said
from ddenv.world.access import ending_of, write_file

RUN = BUNDLED_RUN
SCENARIO = "scenario.yaml"
REPORT = "report.html"
ISSUE = "ISSUE.md"
AGAIN = "repro.py"
MOST_NAMES = 20
NEEDS = f"needs ddenv-workbench {__version__}: {how_to_install()}"
# What is written of each bundle; `$words` are filled in.
TEMPLATES = Path(__file__).with_name("bundled")


def write_bundle(run: Path, target: Path) -> list[Path]:
    """Writes the bundle of a run to a new folder, or to a new ZIP file by the name's ending;
    returns what was written.

    Raises UserError, also if `target` exists or if no certificate says how often what is left
    fails; then nothing is written.
    """
    if target.exists():
        raise UserError(f"{target}: exists already; choose another name")
    if not target.absolute().parent.is_dir():
        raise UserError(f"{target}: there is no folder {target.absolute().parent}; create it first")
    record = _certified(run)
    # Complete or not there at all.
    with tempfile.TemporaryDirectory(
        prefix=".ddenv-bundle-", dir=target.absolute().parent
    ) as temporary:
        folder = Path(temporary) / target.stem
        folder.mkdir()
        _copy_run(run, folder / RUN, record)
        needs = export_world(run, folder / _world(record), folder / SCENARIO).needs
        write_report(run, folder / REPORT)
        write_file(folder / AGAIN, _filled("repro.py.txt", run=RUN, needs=NEEDS))
        write_file(folder / ISSUE, _issue(record, needs))
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
    test = folder / f"test_{name}.py"
    copy = folder / f"{name}.ddenv"
    for path in (test, copy):
        if path.exists():
            raise UserError(f"{path}: exists already; choose another folder")
    if not folder.is_dir():
        raise UserError(f"{folder}: is not a folder; create it first")
    with tempfile.TemporaryDirectory(prefix=".ddenv-test-", dir=folder) as temporary:
        made = Path(temporary) / copy.name
        _copy_run(run, made, record)
        made.replace(copy)
    write_file(test, _filled("test.py.txt", name=name, file=copy.name))
    return [test, copy]


def _certified(run: Path) -> Record:
    record = read_run(run)
    if current(record.state) is None:
        raise UserError(uncertified(record.state, run))
    return record


def _copy_run(run: Path, target: Path, record: Record) -> None:
    """A copy with only the trajectories of f and of what the report draws: all would be a hundred
    times as much.
    """
    state = record.state
    drawn = {
        test for test in (state.evidence_test, *state.failures, *record.ways) if test is not None
    }
    drawn |= {test.id for test in state.tests if test.phase == "baseline"}
    # An implied test has the trajectories of another one.
    drawn |= {by for test in drawn if (by := state.test(test).implied_by) is not None}
    try:
        source = sqlite3.connect(f"{run.absolute().as_uri()}?mode=ro", uri=True)
        with closing(source), closing(sqlite3.connect(target)) as copy:
            source.backup(copy)
            copy.execute("PRAGMA journal_mode = DELETE")
            copy.execute(
                f"DELETE FROM motion WHERE test NOT IN ({', '.join(map(str, sorted(drawn)))})"
            )
            copy.commit()
            copy.execute("VACUUM")
    except sqlite3.Error as error:
        raise UserError(f"{run}: cannot be copied: {error}") from None


def _world(record: Record) -> str:
    return f"world{ending_of(Path(str(record.state.scenario.get('world', ''))))}"


def _filled(template: str, **words: str) -> bytes:
    return Template((TEMPLATES / template).read_text()).substitute(words).encode(errors="replace")


def _issue(record: Record, needs: list[str]) -> bytes:
    state = record.state
    found = current(record.state)
    assert found is not None
    at = f" at ({coordinates(state.f_position[:2])}) m" if state.f_position else ""
    models = [f"- `{_code(name)}`" for name in state.environment[:MOST_NAMES]]
    if (more := len(state.environment) - MOST_NAMES) > 0:
        models.append(f"- and {count(more, 'more model')}")
    reasons = [printable(sentence(each)) for each in record.reasons[:MOST_NAMES]]
    if record.nearest is not None:
        reasons += ["", printable(record.nearest.sentences)]
    if state.margins is not None and rows(state.margins):
        reasons += [
            "",
            "How far numbers can change:",
            "",
            *(f"- {printable(words)}" for words in said(state.margins)),
        ]
    names = ", ".join(f"`{_code(uri)}`" for uri in needs[:MOST_NAMES])
    return _filled(
        ISSUE,
        verdict=printable(content(record).verdict),
        failed=f"{deed(state.failure)}{at}",
        rate=f"{rate(found.claims[0])}: {meaning(found.claims[0], found)}",
        models="\n".join(models),
        reasons="\n".join(reasons),
        program=AGAIN,
        how=f"with {seeds_of(found)}" if found.seeds else "with fresh seeds until they decide",
        needs=NEEDS,
        report=REPORT,
        run=RUN,
        world=_world(record),
        scenario=SCENARIO,
        files=f"Other programs also need the files that `{_world(record)}` names: {names}.\n"
        if needs
        else "",
        maker=f"ddenv {__version__}; {_code(state.simulator)}",
    )


def _code(text: str) -> str:
    return printable(text).replace("`", "'")
