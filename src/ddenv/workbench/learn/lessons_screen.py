"""The list of lessons, with how far the student is in each."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual import on
from textual.app import ComposeResult
from textual.binding import Binding
from textual.widgets import OptionList, Static

from ddenv.errors import UserError
from ddenv.learn.catalog import bundled, glance, open_lesson
from ddenv.learn.lesson import Lesson
from ddenv.learn.score import Score
from ddenv.text import plain, truncated
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.learn.kept_scores import all_scores, in_words
from ddenv.workbench.learn.learn_screen import LearnScreen
from ddenv.workbench.shared.bindings import HELP, keys


class LessonsScreen(LearnScreen[None]):
    """Enter opens a lesson where it was left."""

    NAME = "lessons"
    FIRST = "help back open"
    # It has room for what matters in any terminal.
    HORIZONTAL_BREAKPOINTS = VERTICAL_BREAKPOINTS = []
    BINDINGS: ClassVar = [
        Binding(
            "enter",
            "open",
            "open",
            id="lessons.open",
            tooltip="open the lesson where you left it",
            priority=True,
        ),
        *keys("lessons", HELP, ("back", "escape,q", "close", "back", "back, or leave", "esc")),
    ]

    def __init__(self, opens: Path | None = None) -> None:
        """`opens` is the file of the lesson to begin with."""
        super().__init__()
        self._opens = opens
        self._lessons: list[Lesson] = []

    def body(self) -> ComposeResult:
        with Framed("Lessons", id="lessons-panel", classes="panel"):
            yield OptionList(id="lessons-list")
        with Framed("Its aim", classes="panel", id="lesson-about-panel"):
            yield Static("", id="lesson-about", markup=False)

    def on_mount(self) -> None:
        for file in bundled():
            try:
                self._lessons.append(glance(file))
            except UserError as error:
                self.notify(str(error), severity="warning", markup=False)
        scores = all_scores()
        undone = (
            place
            for place, each in enumerate(self._lessons)
            if not scores.get(each.name, Score()).done
        )
        self._fill(next(undone, 0))
        self.query_one(OptionList).focus()
        if self._opens is not None:
            self._open(self._opens)

    def on_screen_resume(self) -> None:
        if self._lessons:
            self._fill()

    def on_resize(self) -> None:
        self._fill()

    def _fill(self, at: int | None = None) -> None:
        """The list, with the lesson number `at` under the cursor, or the one where it is."""
        options = self.query_one(OptionList)
        scores = all_scores()
        at = (options.highlighted or 0) if at is None else at
        done = sum(scores.get(lesson.name, Score()).done for lesson in self._lessons)
        heading = Text(" Lessons", "bold").append(
            f" · {done} of {len(self._lessons)} done", "not bold"
        )
        self.query_one("#lessons-header", Static).update(heading)
        width = max(30, self.size.width - 40)
        options.clear_options()
        for number, lesson in enumerate(self._lessons, 1):
            row = (
                f"{number}  {truncated(plain(lesson.title), width):<{width}} "
                f"{in_words(scores.get(lesson.name))}"
            )
            options.add_option(Text(row, no_wrap=True))
        if self._lessons:
            options.highlighted = min(at, len(self._lessons) - 1)

    def on_option_list_option_highlighted(self, event: OptionList.OptionHighlighted) -> None:
        lesson = self._lessons[event.option_index]
        about = Text(f"{plain(lesson.aim)}\n", "").append(f"About {lesson.minutes} minutes.", "dim")
        self.query_one("#lesson-about", Static).update(about)

    @on(OptionList.OptionSelected)
    def action_open(self) -> None:
        place = self.query_one(OptionList).highlighted
        if place is not None:
            self._open(self._lessons[place].file)

    def _open(self, file: Path) -> None:
        from ddenv.workbench.learn.lesson_screen import LessonScreen

        place = next(
            (place for place, each in enumerate(self._lessons) if each.file == file),
            len(self._lessons),
        )
        after = self._lessons[place + 1 : place + 2]
        try:
            opened = open_lesson(file)
            screen = LessonScreen(
                opened.lesson.run, opened, "".join(plain(each.title) for each in after)
            )
        except UserError as error:
            self.notify(str(error), severity="warning", markup=False)
            return
        if place < len(self._lessons):
            self._fill(place)
        self.app.push_screen(screen, lambda goes_on: self._open(after[0].file) if goes_on else None)
