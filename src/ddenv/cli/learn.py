"""`ddenv learn`: lessons, and any run step by step."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ddenv.cli.terminal import say_written
from ddenv.errors import UserError
from ddenv.runs.folder import find_run

if TYPE_CHECKING:
    from textual.screen import Screen


@click.command("learn")
@click.argument("lesson", metavar="[LESSON_OR_RUN]", required=False)
@click.argument("runs", metavar="[RUN]...", nargs=-1)
@click.option("--list", "listed", is_flag=True, help="List the lessons and your progress.")
@click.option(
    "--check", type=Path, metavar="FILE", help="Check a lesson of your own and print its mistakes."
)
@click.option(
    "--new",
    type=Path,
    metavar="FILE",
    help="Write a lesson to start from; --run is the run it shows.",
)
@click.option(
    "--run", type=str, metavar="RUN", help="The run for --new: it is copied beside the lesson."
)
@click.option(
    "--race", is_flag=True, help="Compare two to four runs of one world side by side, test by test."
)
@click.option(
    "--page",
    type=Path,
    metavar="FILE",
    help="Write the lesson's summary as one HTML page to hand out.",
)
def learn_command(
    lesson: str | None,
    runs: tuple[str, ...],
    check: Path | None,
    new: Path | None,
    run: str | None,
    **given: Any,
) -> int:
    """Lessons on delta debugging, on recorded runs: step by step, with predictions and questions.
    They need no Drake.

    LESSON is a number, a name or a file; with a run, that run is shown step by step. 'ddenv learn'
    alone shows the list.
    """
    from ddenv.learn.catalog import open_lesson, write_template

    given = {
        "list": given["listed"],
        "check": check,
        "new": new,
        "race": given["race"],
        "page": given["page"],
    }
    asked = [f"--{name}" for name, value in given.items() if value]
    if len(asked) > 1:
        raise UserError(f"{' and '.join(asked)}: give one of them")
    if given["race"]:
        return _race([*([lesson] if lesson else ()), *runs])
    if runs:
        raise UserError(f"{runs[0]!r}: expected one lesson or run; --race shows several runs")
    if run is not None and new is None:
        raise UserError("--run: only with --new")
    if given["list"]:
        _list()
    elif check is not None:
        opened = open_lesson(check)
        print(
            f"{check}: {len(opened.lesson.steps)} steps, {opened.asked} questions, no mistake found"
        )
    elif new is not None:
        if run is None:
            raise UserError("--new: needs the run that the lesson shows, such as --run ditch-1")
        say_written(write_template(new, find_run(run)))
    elif given["page"] is not None:
        _page(lesson, given["page"])
    else:
        return _open(lesson)
    return 0


def _list() -> None:
    from ddenv.learn.catalog import bundled, glance
    from ddenv.workbench.learn.kept_scores import all_scores, in_words

    scores = all_scores()
    for number, file in enumerate(bundled(), 1):
        lesson = glance(file)
        print(
            f"{number}  {lesson.title} ({lesson.minutes} min): {in_words(scores.get(lesson.name))}"
        )


def _race(names: list[str]) -> int:
    from ddenv.learn.race import RACERS, plays_of_runs
    from ddenv.workbench.launch import run_workbench

    if not RACERS[0] <= len(names) <= RACERS[1]:
        raise UserError(f"--race: expected {RACERS[0]} to {RACERS[1]} runs, found {len(names)}")
    paths = tuple(map(find_run, names))
    # Read before the screen, so that runs that cannot race are one line in the terminal.
    plays_of_runs(paths)

    def screen() -> Screen[Any]:
        from ddenv.workbench.learn.race_screen import race_of_runs

        return race_of_runs(paths)

    return run_workbench(first=screen)


def _page(name: str | None, file: Path) -> None:
    from ddenv.learn.catalog import find_lesson, open_lesson
    from ddenv.learn.handout import handout
    from ddenv.page.html import html
    from ddenv.world.access import write_file

    if name is None:
        raise UserError(f"--page: expected a lesson, as in 'ddenv learn 1 --page {file}'")
    if file.suffix.lower() not in (".html", ".htm"):
        raise UserError(f"--page: {file}: must end in .html")
    if file.exists():
        raise UserError(f"--page: {file}: exists already; choose another name")
    lesson = find_lesson(name)
    if lesson is None:
        raise UserError(f"no lesson {name!r}; 'ddenv learn --list' shows them")
    write_file(file, html(handout(open_lesson(lesson))).encode())
    say_written([file])


def _open(name: str | None) -> int:
    from ddenv.learn.catalog import find_lesson, open_lesson
    from ddenv.workbench.launch import run_workbench

    lesson = None if name is None else find_lesson(name)
    path = None if name is None or lesson is not None else find_run(name)
    if lesson is not None:
        # Opened before the screen, so that a mistake in it is one line in the terminal.
        open_lesson(lesson)
    if path is not None and not path.is_file():
        raise UserError(
            f"no lesson or run {name!r}; 'ddenv learn --list' and 'ddenv runs' list them"
        )

    def screen() -> Screen[Any]:
        from ddenv.workbench.learn.lesson_screen import LessonScreen
        from ddenv.workbench.learn.lessons_screen import LessonsScreen

        if path is None:
            return LessonsScreen(lesson)
        return LessonScreen(path)

    return run_workbench(first=screen)
