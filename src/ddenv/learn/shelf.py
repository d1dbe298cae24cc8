"""Where the lessons are, and how one is opened together with its run."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ddenv.errors import UserError
from ddenv.learn import figures
from ddenv.learn.lesson import Lesson
from ddenv.learn.oracle import Oracle, read_oracle
from ddenv.learn.places import Places
from ddenv.learn.reading import read_lesson
from ddenv.runfile.position import Position, position_in
from ddenv.runfile.store import RunFile

LESSONS = Path(__file__).parent / "lessons"


def bundled() -> tuple[Path, ...]:
    """The files of the lessons that come with ddenv, in their order."""
    return tuple(sorted(LESSONS.glob("[0-9]*.yaml")))


def find_lesson(name: str) -> Path | None:
    """The file of a lesson by its number, its name or its path; None if there is none."""
    for number, file in enumerate(bundled(), 1):
        if name in (str(number), file.stem, file.stem.lstrip("0123456789-")):
            return file
    path = Path(name)
    return path if path.suffix.lower() in (".yaml", ".yml") and path.is_file() else None


@dataclass(frozen=True)
class Opened:
    """A lesson with the position in its run, and its oracle if it has one."""

    lesson: Lesson
    position: Position
    oracle: Oracle | None

    def text(self, words: str, at: int) -> str:
        """`words` with their figures, as they are at the event `at`."""
        return figures.filled(words, figures.values(self.position.end, self.position.state(at), self.oracle))

    @cached_property
    def places(self) -> tuple[int, ...]:
        """The event that each step shows."""
        found, at = [], self.position.ids[0]
        for step in self.lesson.steps:
            at = step.at or at
            found.append(at)
        return tuple(found)


def open_lesson(file: Path) -> Opened:
    """Raises UserError, in one line, if anything is wrong with the lesson, its run or its oracle."""
    opened: list[Position] = []

    def places(run: Path) -> Places:
        with RunFile(run) as content:
            events = content.events()
        opened.append(position_in(events))
        return Places(opened[0], events)

    lesson = read_lesson(file, places)
    oracle = None if lesson.oracle is None else read_oracle(lesson.oracle)
    if oracle is not None and set(oracle.models) != set(opened[0].end.elements):
        raise UserError(f"{lesson.oracle}: its models are not those of {lesson.run.name}")
    if oracle is None:
        _need_no_oracle(lesson)
    return Opened(lesson, opened[0], oracle)


def _need_no_oracle(lesson: Lesson) -> None:
    """Raises UserError if a text has a figure that only an oracle knows."""
    for step in lesson.steps:
        asked = step.question
        answers = (
            () if asked is None else (asked.text, asked.hint, *(f"{each.text} {each.why}" for each in asked.answers))
        )
        for name in figures.OF_ORACLE:
            if f"{{{name}}}" in " ".join((step.text, *answers)):
                raise UserError(f"{lesson.file}:{step.line}: {{{name}}} needs an oracle; give the key 'oracle'")
