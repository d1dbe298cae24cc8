"""The report on a run: the result in a few words, then the details."""

from __future__ import annotations

from pathlib import Path

from ddenv import __version__
from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.page.blocks import (
    Paragraph,
    Part,
    Report,
    Strong,
    duration,
    moment,
    named,
    percent,
    say,
    thousands,
)
from ddenv.page.html import html
from ddenv.page.markdown import markdown, pictures
from ddenv.report.outcomes import others_met, rate_of_left, sureness, worth
from ddenv.report.repeat import repeat, settings
from ddenv.report.result import margins, what_is_left, why
from ddenv.report.rounds import guiding, way
from ddenv.report.run_data import Record, read_run
from ddenv.runfile.failure_words import deed
from ddenv.runfile.state import RunState, spent
from ddenv.text import as_sentence, coordinates, count, plain
from ddenv.words.claims import ended, for_everyone
from ddenv.world.access import write_file

KINDS = (".html", ".htm", ".md")
PICTURES = ("map", "chart")
# Models are named up to this number.
MOST_NAMES = 6


def content(record: Record) -> Report:
    state = record.state
    about = (
        what_is_left,
        worth,
        why,
        margins,
        way,
        guiding,
        others_met,
        sureness,
        settings,
        repeat,
    )
    sections = [each(record) for each in about]
    damage = (
        say(Strong("Parts of this run could not be read."), f" {plain(each)}.", notice=True)
        for each in record.troubles
    )
    version = plain(state.engine_version)
    begun = moment(record.started)
    by = f"run by ddenv {version}, " if version and version != __version__ else ""
    when = f", begun {begun} UTC" if begun else ""
    return Report(
        name=plain(state.scenario.get("name", record.path.stem)),
        verdict=_verdict(state),
        lead=(*in_short(record), *damage, _standing(record), *_failure(state)),
        figures=_figures(record),
        sections=tuple(each for each in sections if each is not None),
        foot=(
            f"{plain(record.path.name)}{when}; {by}report by ddenv {__version__}. Times are in "
            "UTC, lengths in m."
        ),
    )


def _verdict(state: RunState) -> str:
    left = len(state.environment)
    whole = len(state.elements)
    if state.baseline is None:
        return "No failure is known yet"
    if state.certified and not left:
        return f"None of the {count(whole, 'model')} is needed to make the robot fail"
    if left == whole:
        return f"The robot fails with all {count(left, 'model')}; none has been removed yet"
    verb = "is" if left == 1 else "are"
    so_far = "" if state.certified else " so far"
    return f"{left} of {whole} models {verb} enough to make the robot fail{so_far}"


def _standing(record: Record) -> Paragraph:
    state = record.state
    why = plain(ended(state) if state.status == "finished" else state.reason).rstrip(".")
    if state.status == "finished" and state.certified:
        if not state.environment:
            return say(
                Strong("Minimal."), " Look at the robot, its goal, and the models that always stay."
            )
        return say(Strong("Minimal:"), f" {why}.")
    reason = f": {why}" if why else ""
    at = f" at {moment(state.updated_at)} UTC" if moment(state.updated_at) else ""
    title, words = {
        "finished": ("Not shown to be minimal:", f" {why or 'no reason is known'}."),
        "stopped": ("Stopped", f"{reason}. This report shows what was known then."),
        "failed": ("The engine could not go on", f"{reason}."),
        "created": ("Not started yet:", " no test has been made."),
    }.get(state.status, ("This run has not ended.", f" This report shows what was known{at}."))
    if not (state.ended or state.status == "created" or record.alive):
        if at:
            words = f" The engine is not running; its last message came{at}."
        else:
            words = " The engine is not running."
    return say(Strong(title), words, notice=True)


def _failure(state: RunState) -> list[Paragraph]:
    """The scenario in its author's words, how the robot failed in it, and what is wrong with the
    world.
    """
    description = plain(state.scenario.get("description", ""))
    position = state.f_position
    said = [say(description)] if description else []
    if position is not None:
        said.append(
            say(f"The failure f: the robot {deed(state.failure)} at ({coordinates(position)}) m.")
        )
    elif state.tests_done:
        seen = count(state.tests_done, "run")
        said.append(
            say(f"The whole world is run first to determine the failure: {seen} ended so far.")
        )
    notes = (plain(each) for _, each in state.notes)
    return [*said, *(say(as_sentence(words), notice=True) for words in notes)]


def _figures(record: Record) -> tuple[tuple[str, str], ...]:
    state = record.state
    before = len(state.elements)
    after = len(state.environment)
    figures = [(f"{before} → {after}" if after != before else str(before), "models")]
    if after < before:
        figures.append((percent(1 - after / before), "smaller"))
    if state.baseline is not None and (shown := rate_of_left(state))[0]:
        figures.append(shown)
    rounds = len(record.rounds)
    figures.append((thousands(state.tests_done), "test" if state.tests_done == 1 else "tests"))
    if rounds:
        figures.append((thousands(rounds), "round" if rounds == 1 else "rounds"))
    figures.append((duration(spent(state, state.updated_at)), "computing time"))
    return tuple(figures)


def files_of(file: Path) -> list[Path]:
    """The files that a report called `file` may consist of."""
    beside = PICTURES if file.suffix.lower() == ".md" else ()
    return [file, *(file.with_name(f"{file.stem}.{name}.svg") for name in beside)]


def write_report(run: Path, file: Path, force: bool = False) -> list[Path]:
    """Writes the report on a run as an HTML page or as Markdown, by the ending of `file`; returns
    the files that were written.

    Markdown has its pictures in files beside it. Raises UserError, also for files that exist,
    unless `force`.
    """
    _check(file)
    report = content(read_run(run))
    if file.suffix.lower() != ".md":
        texts = {file: html(report)}
    else:
        drawn = pictures(report, file.stem)
        texts = {file.with_name(name): svg for name, svg in drawn.items()} | {
            file: markdown(report, file.stem)
        }
    there = [path for path in texts if is_there(path)]
    if there and not force:
        raise UserError(
            f"{there[-1]}: exists already; choose another name, or replace it with --force"
        )
    for path, text in texts.items():
        write_file(path, text.encode(errors="replace"))
    return list(reversed(texts))


def is_there(path: Path) -> bool:
    """Whether a file exists; False if that is unknown: then writing it reports the error."""
    try:
        return path.exists()
    except OSError:
        return False


def _check(file: Path) -> None:
    """Checks the file's name before anything is read. Raises UserError."""
    if file.suffix.lower() not in KINDS:
        raise UserError(f"{file}: a report's name ends in .html or .md")
    try:
        if file.is_dir():
            raise UserError(f"{file}: is a folder; give the name of a file in it")
        if not file.parent.is_dir():
            raise UserError(f"{file}: there is no folder {file.parent}")
    except OSError as error:
        raise UserError(f"{file}: cannot be written: {error.strerror}") from None


def in_short(record: Record) -> list[Paragraph]:
    """The paragraph that a report begins with; none before a failure is known."""
    state = record.state
    found = current(record.state)
    if state.baseline is None:
        return []
    sure = "Fresh runs have not checked that yet." if found is None else f"{for_everyone(found)}."
    runs = "1 simulated run" if state.made == 1 else f"{thousands(state.made)} simulated runs"
    cost = f"This took {runs} and {duration(spent(state, state.updated_at))} of computing time."
    what = f" The robot {deed(state.failure)} before it reached its goal. "
    left = state.environment
    whole = count(len(state.elements), "model")
    enough: tuple[Part, ...] = (f"Any of the {whole} in its world may be involved.",)
    if not left:
        always = "look at the robot, its goal and what always stays."
        enough = (f"It also fails with all {whole} of its world removed: {always}",)
    elif len(left) < len(state.elements):
        these = "1 is" if len(left) == 1 else f"{len(left)} are"
        enough = (
            f"Of the {whole} in its world, {these} enough to make it fail this way: ",
            *named(left, MOST_NAMES),
            ".",
        )
    return [say(Strong("In short:"), what, *enough, f" {sure} {cost}")]
