"""Where the lessons are, how one is opened together with its run, and how a new one begins."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from string import Template

from ddenv.errors import UserError
from ddenv.learn import lesson_figures
from ddenv.learn.attempt import Attempt, Oracle, read_oracle
from ddenv.learn.lesson import Lesson, Step
from ddenv.learn.lesson_figures import Figures
from ddenv.learn.prediction import Foretelling, foretelling
from ddenv.learn.race import Play, recorded_play
from ddenv.learn.reading import Places, read_lesson
from ddenv.runfile.fold import fold
from ddenv.runfile.position import Position, position_in
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.world.access import read_bytes, write_file

LESSONS = Path(__file__).with_name("lessons")
TEMPLATE = Path(__file__).with_name("new_lesson.yaml")


def bundled() -> tuple[Path, ...]:
    """The files of the lessons that come with ddenv, in their order."""
    return tuple(sorted(LESSONS.glob("[0-9]*.yaml")))


def find_lesson(name: str) -> Path | None:
    """The file of a lesson by its number, its name or its path; None if there is none."""
    for number, file in enumerate(bundled(), 1):
        if name in (str(number), file.stem, file.stem.lstrip("0123456789-")):
            return file
    path = Path(name)
    if path.suffix.lower() in (".yaml", ".yml") and path.is_file():
        return path
    return None


@dataclass(frozen=True, kw_only=True)
class Opened:
    """A lesson with the position in its run, its oracle if it has one, and the ends of the runs
    beside it.
    """

    lesson: Lesson
    position: Position
    oracle: Oracle | None
    beside: Mapping[str, RunState]
    plays: Mapping[str, Play] = field(default_factory=dict)

    def attempt(self, step: Step, moves: Iterable[str] = ()) -> Attempt | None:
        """The student's own search in a step, after these moves; None if the step has none."""
        if step.budget is None or self.oracle is None:
            return None
        return Attempt(self.oracle, step.budget, moves)

    def racers(self, step: Step) -> tuple[Play, ...]:
        return tuple(self.plays[name] for name in step.race)

    def text(self, words: str, at: int) -> str:
        """`words` with their figures, as they are at the event `at`. Raises UserError for one that
        nothing here knows.
        """
        here = self.position.state(at)
        return lesson_figures.filled(
            words, Figures(self.position.end, here, self.oracle, self.beside)
        )

    @cached_property
    def foretold(self) -> tuple[Foretelling | None, ...]:
        """What each step asks to foretell. The same reason is asked for once."""
        found: list[Foretelling | None] = []
        kinds = {""}
        for step, at in zip(self.lesson.steps, self.places, strict=True):
            each = None if step.foretell is None else foretelling(self.position, at, step.foretell)
            found.append(
                replace(each, reason=None) if each is not None and each.kind in kinds else each
            )
            kinds |= {"" if each is None else each.kind}
        return tuple(found)

    @cached_property
    def asked(self) -> int:
        """How many questions, predictions with their reasons, searches and races it has."""
        foretold = [each for each in self.foretold if each is not None]
        done = sum(bool(each.question or each.budget or each.race) for each in self.lesson.steps)
        return done + len(foretold) + sum(each.reason is not None for each in foretold)

    @cached_property
    def places(self) -> tuple[int, ...]:
        found = []
        at = self.position.ids[0]
        for step in self.lesson.steps:
            at = step.at or at
            found.append(at)
        return tuple(found)


def glance(file: Path) -> Lesson:
    """A lesson for a list: its run is not read, and so its places are not known. Raises UserError
    as `open_lesson`.
    """
    return read_lesson(file, lambda run: lambda words: 0)


def open_lesson(file: Path) -> Opened:
    """Raises UserError, in one line, if anything is wrong with the lesson, its run or its
    oracle.
    """
    opened: list[Position] = []

    def places(run: Path) -> Callable[[str], int]:
        with RunFile(run) as content:
            events = content.events()
        opened.append(position_in(events))
        return Places(opened[0], events).event

    lesson = read_lesson(file, places)
    oracle = None if lesson.oracle is None else read_oracle(lesson.oracle)
    if oracle is not None and set(oracle.models) != set(opened[0].end.elements):
        raise UserError(f"{lesson.oracle}: its models are not those of {lesson.run.name}")
    searches = any(step.budget for step in lesson.steps)
    if oracle is not None and searches and frozenset(oracle.models) not in oracle.showing:
        raise UserError(
            f"{lesson.oracle}: f does not show with all models, so there is nothing to search"
        )
    plays = {} if oracle is None else _plays(lesson, oracle)
    beside = {}
    for name, run in lesson.beside.items():
        with RunFile(run) as content:
            beside[name] = fold(content.events())
    made = Opened(lesson=lesson, position=opened[0], oracle=oracle, beside=beside, plays=plays)
    _check(made)
    return made


def _plays(lesson: Lesson, oracle: Oracle) -> dict[str, Play]:
    """What is recorded of the algorithms. Raises UserError if a step needs more, or if it does not
    fit the oracle.
    """
    for step in lesson.steps:
        for name in step.race:
            if name not in oracle.rounds:
                raise UserError(
                    f"{lesson.file}:{step.line}: race: {name!r} is not recorded yet; "
                    f"'python -m docs.lessons.record_plays {lesson.file}' records it, in a "
                    "checkout of ddenv-workbench"
                )
    try:
        return {name: recorded_play(name, oracle) for name in oracle.rounds}
    except UserError as error:
        raise UserError(f"{lesson.oracle}: {error}") from None


def _check(opened: Opened) -> None:
    """Raises UserError if a text has a figure that is not known, or nothing can be foretold where a
    step asks for it.
    """
    for step, at, found in zip(opened.lesson.steps, opened.places, opened.foretold, strict=True):
        texts = [step.text]
        if (asked := step.question) is not None:
            texts += [
                asked.text,
                asked.hint,
                *(f"{each.text} {each.why}" for each in asked.answers),
            ]
        try:
            opened.text(" ".join(texts), at)
            if step.foretell is not None and found is None:
                raise UserError(
                    "foretell: nothing of this kind can be foretold there; choose another place "
                    "in the run"
                )
        except UserError as error:
            raise UserError(f"{opened.lesson.file}:{step.line}: {error}") from None


def write_template(file: Path, run: Path) -> tuple[Path, Path]:
    """Writes a lesson to start from, beside a copy of its run; returns both paths.

    Raises UserError, also for a run without a round.
    """
    copy = file.with_name(run.name)
    for path in (file, copy):
        if path.exists():
            raise UserError(f"{path}: exists already; choose another name")
    if file.suffix.lower() not in (".yaml", ".yml"):
        raise UserError(f"{file}: a lesson's name must end in .yaml")
    with RunFile(run) as content:
        state = position_in(content.events()).end
    first = next(
        (test for test in state.tests if test.phase == "round" and test.implied_by is None), None
    )
    if first is None or not state.rounds_done:
        raise UserError(f"{run}: has no finished round yet, so there is nothing to predict")
    words = {
        "file": file.name,
        "run": run.name,
        "test": f"test {first.id}",
        "round": f"round {first.round}",
    }
    write_file(copy, read_bytes(run))
    write_file(file, Template(TEMPLATE.read_text()).substitute(words).encode())
    return file, copy
