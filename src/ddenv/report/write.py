"""Writes the report on a run."""

from __future__ import annotations

from pathlib import Path

from ddenv.errors import UserError
from ddenv.report.content import content
from ddenv.report.html import html
from ddenv.report.markdown import markdown, pictures
from ddenv.report.read import read_run
from ddenv.world.files.whole import write_file

KINDS = (".html", ".htm", ".md")
PICTURES = ("map", "near", "chart", "interval")


def files_of(file: Path) -> list[Path]:
    """The files that a report called `file` may consist of."""
    beside = PICTURES if file.suffix.lower() == ".md" else ()
    return [file, *(file.with_name(f"{file.stem}.{name}.svg") for name in beside)]


def write_report(run: Path, file: Path, force: bool = False) -> list[Path]:
    """Writes what a run came to as an HTML page or as Markdown, by the ending of `file`; returns the files that were written.

    Markdown has its pictures in files beside it. Raises UserError, also for files that exist, unless `force`.
    """
    _check(file)
    report = content(read_run(run))
    if file.suffix.lower() != ".md":
        texts = {file: html(report)}
    else:
        drawn = pictures(report, file.stem)
        texts = {file.with_name(name): svg for name, svg in drawn.items()} | {file: markdown(report, file.stem)}
    there = [path for path in texts if is_there(path)]
    if there and not force:
        raise UserError(f"{there[-1]}: exists already; choose another name, or replace it with --force")
    for path, text in texts.items():
        write_file(path, text.encode(errors="replace"))
    return list(reversed(texts))


def is_there(path: Path) -> bool:
    """Whether a file exists; of what cannot be known, writing it will tell."""
    try:
        return path.exists()
    except OSError:
        return False


def _check(file: Path) -> None:
    """Says what is wrong before anything is read."""
    if file.suffix.lower() not in KINDS:
        raise UserError(f"{file}: a report's name ends in .html or .md")
    try:
        if file.is_dir():
            raise UserError(f"{file}: is a folder; give the name of a file in it")
        if not file.parent.is_dir():
            raise UserError(f"{file}: there is no folder {file.parent}")
    except OSError as error:
        raise UserError(f"{file}: cannot be written: {error.strerror}") from None
