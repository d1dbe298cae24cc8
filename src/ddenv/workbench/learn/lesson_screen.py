"""A lesson on the screen: the map and Algorithm 1 of a recorded run, its variables, and the lesson's texts and questions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Container, Vertical
from textual.screen import Screen
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.learn.attempt import Attempt
from ddenv.learn.lesson import blocks
from ddenv.learn.lesson_course import Course
from ddenv.learn.shelf import Opened
from ddenv.learn.variables import variables
from ddenv.runfile.position import Position, Step
from ddenv.runfile.state import Test
from ddenv.runfile.store import COLUMNS, Live
from ddenv.runfile.tested import told
from ddenv.text import plain
from ddenv.words.news import what_happened
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.learn.kept_scores import all_scores, keep_score
from ddenv.workbench.learn.lesson_pane import LessonPane, Variables
from ddenv.workbench.learn.race_screen import RaceScreen
from ddenv.workbench.learn.try_screen import TryScreen
from ddenv.workbench.learn.world_maps import read_world
from ddenv.workbench.map.map_words import MapLines
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.happening import Happening
from ddenv.workbench.run.snapshot import Moments
from ddenv.workbench.shared.observed import Observed
from ddenv.workbench.shared.poll import Snapshot

SMALLEST = (64, 20)


def _ids(names: str) -> tuple[str, ...]:
    return tuple(f"lesson.{name}" for name in names.split())


# The keys in the footer: in their order, and which of them go first where there is room for a few only.
SHOWN = _ids("on back skip activity hint run_back run_on next_decision next_reduction predict variables help close")
FIRST = _ids("help close on skip activity run_back run_on predict hint variables next_reduction next_decision back")


def _answer(place: int) -> Binding:
    letter = "abcdef"[place]
    return Binding(
        letter, f"answer({place})", letter, id=f"lesson.{letter}", tooltip=f"give answer {letter}", show=False
    )


class LessonScreen(Screen[bool]):
    """A lesson from where the student left it; or any run step by step. Leaving it keeps the student's place and answers.

    It returns whether the student goes on to the next lesson.
    """

    CSS_PATH = "learn.tcss"
    HORIZONTAL_BREAKPOINTS = [(0, "-thin"), (SMALLEST[0], "-narrow"), (110, "-wide")]
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (SMALLEST[1], "-tall")]
    AUTO_FOCUS = "LessonPane"
    BINDINGS: ClassVar = [
        Binding(
            "enter,space",
            "on",
            "go on",
            id="lesson.on",
            tooltip="on to what comes next in the lesson",
            key_display="enter",
        ),
        Binding("backspace", "back", "step back", id="lesson.back", tooltip="back to the step before"),
        Binding("s", "skip", "skip", id="lesson.skip", tooltip="skip the question: shows the answer, without a score"),
        Binding("h", "hint", "hint", id="lesson.hint", tooltip="show a hint for the question"),
        Binding("left", "move('moment', -1)", "run back", id="lesson.run_back", tooltip="the run: one moment back"),
        Binding("right", "move('moment', 1)", "run on", id="lesson.run_on", tooltip="the run: one moment on"),
        Binding(
            "right_parenthesis",
            "move('decision', 1)",
            "verdict",
            id="lesson.next_decision",
            tooltip="the run: to the next verdict",
        ),
        Binding(
            "left_parenthesis",
            "move('decision', -1)",
            id="lesson.decision_before",
            tooltip="the run: to the verdict before",
            show=False,
        ),
        Binding(
            "right_curly_bracket",
            "move('reduction', 1)",
            "reduction",
            id="lesson.next_reduction",
            tooltip="the run: to the next reduction",
        ),
        Binding(
            "left_curly_bracket",
            "move('reduction', -1)",
            id="lesson.reduction_before",
            tooltip="the run: to the reduction before",
            show=False,
        ),
        Binding(
            "t",
            "activity",
            "try",
            id="lesson.activity",
            tooltip="search yourself, or watch the race, where a step has one",
        ),
        Binding("p", "predict", "predict", id="lesson.predict", tooltip="predict what comes next in the run"),
        Binding(
            "v",
            "variables",
            "variables",
            id="lesson.variables",
            tooltip="the variables in place of the map (80 columns)",
        ),
        *(_answer(place) for place in range(6)),
        Binding("question_mark,f1", "app.help", "help", id="lesson.help", tooltip="show every key", key_display="?"),
        Binding(
            "escape,q", "close", "leave", id="lesson.close", tooltip="leave; your place is kept", key_display="esc"
        ),
    ]

    def __init__(self, run: Path, opened: Opened | None = None, following: str = "") -> None:
        """The lesson `opened`, whose run is `run`; without one the run alone. Raises UserError for a damaged run.

        `following` is the title of the next lesson, or "".
        """
        super().__init__()
        self._run, self._opened, self._following = run, opened, following
        self._file = Observed(run)
        self._moments = Moments(self._file)
        if opened is None:
            position, score = Position(self._file.events), None
            position.catch_up()
            if not position.ids:
                raise UserError(f"{run}: has no events yet")
        else:
            position, score = opened.position, all_scores().get(opened.lesson.name)
        self.course = Course(position, opened, score)
        self._kept = self.course.score
        self._map, self._legend = WorldMap(id="lesson-map"), MapLines(id="lesson-legend")

    def compose(self) -> ComposeResult:
        yield Static("", id="lesson-header", markup=False)
        with Container(id="lesson-body"):
            with _panel("lesson-world", "World"):
                yield self._map
                yield self._legend
            with _panel("lesson-now", "Algorithm"):
                yield Happening(id="lesson-happening")
            with _panel("lesson-variables-panel", "Variables now"):
                yield Variables(id="lesson-variables")
            with _panel("lesson-panel", "Lesson" if self._opened else "This run"):
                yield LessonPane()
        yield KeyFooter(SHOWN, FIRST)
        yield Static(f"ddenv learn needs {SMALLEST[0]} x {SMALLEST[1]}", id="small", markup=False)

    def on_mount(self) -> None:
        self._show()
        # What it needs takes long to load: the first paint comes before.
        self.call_after_refresh(read_world, self, self._run, [self._map])

    def on_unmount(self) -> None:
        self._file.close()

    # What is shown.

    def _show(self) -> None:
        self._show_run()
        course, page = self.course, self.course.page
        if self._at_next:
            page = replace(page, after=blocks(f"`enter` opens the next lesson: **{self._following}**."))
        self.query_one(LessonPane).show(page)
        self.query_one("#lesson-header", Static).update(self._heading())
        footer, due = self.query_one(KeyFooter), course.due and not course.is_open
        footer.say("lesson.activity", course.activity or "")
        footer.say("lesson.on", f"{course.activity}" if due else "next lesson" if self._at_next else "go on")
        self._keep_score()

    @property
    def _at_next(self) -> bool:
        """Whether the lesson is at its end, and another one follows."""
        return bool(self._following) and self.course.step == self.course.last

    def _keep_score(self) -> None:
        if self._opened is not None and self.course.score != self._kept:
            keep_score(self._opened.lesson.name, self.course.score)
            self._kept = self.course.score

    def _show_run(self) -> None:
        try:
            moment = self.course.position.moment(self.course.at)
        except UserError as error:
            self.notify(str(error), severity="warning", markup=False)
            return
        if moment is None:
            return
        words = what_happened(moment)
        snapshot = self._moments.of(moment, f"{words[:1].upper()}{words[1:].rstrip('.')}.")
        test = told(moment)
        if test is not None:
            snapshot = self._with_way(snapshot, test)
        self.query_one("#lesson-world").border_title = "World" if test is None else f"World: path of test {test.id}"
        self.query_one(Happening).show(snapshot)
        self.query_one(Variables).show(variables(moment))
        self._map.show(snapshot, snapshot.pointed)
        self._legend.show(0, snapshot.pointed, (), self._map.legend)
        number, all_moments = self.course.position.place
        self.query_one("#lesson-now").border_subtitle = f"moment {number} of {all_moments}"

    def _with_way(self, snapshot: Snapshot, test: Test) -> Snapshot:
        """With the path of the test that is told, as far as it is recorded, and the robot where it ended."""
        ended = (
            () if test.end_pose is None or len(test.end_pose) < COLUMNS - 1 else (Live(0, test.id, 0.0, test.end_pose),)
        )
        return replace(snapshot, evidence=self._moments.path(test.id), live=ended)

    def _heading(self) -> Text:
        course, score = self.course, self.course.score
        left = f" {plain(self._run.stem)}, step by step"
        if self._opened is not None:
            last = course.step == course.last
            place = "summary" if last else f"step {course.step + 1} of {course.last}"
            left = f" {plain(self._opened.lesson.title)} · {place}"
        right = f"{score.right} of {len(score.answered)} right"
        right += f" · {score.streak} in a row" if score.streak > 1 else ""
        right = right if score.answered else ""
        room = max(1, self.size.width - len(right) - 2)
        text = Text(left, "bold", no_wrap=True)
        text.truncate(room, overflow="ellipsis", pad=True)
        return text.append(f" {right} ", "not bold")

    def on_resize(self) -> None:
        self.call_after_refresh(self._show)

    # What is done.

    def action_on(self) -> None:
        if self.query_one(LessonPane).read_on():
            return
        if self.course.due and not self.course.is_open:
            self.action_activity()
        elif self._at_next:
            self.dismiss(True)
        elif self.course.go_on():
            self._moved()
        elif self.course.page.question is not None and self.course.page.chosen is None:
            self._say("choose an answer by its letter, or skip the question with s")
        elif self._opened is None:
            self.action_move("moment", 1)
        else:
            self._say("this is the end of the lesson: escape leaves it, backspace goes back")

    def action_back(self) -> None:
        if self.course.back():
            self._moved()
        else:
            self._say(
                "the lesson begins here" if self._opened else "no lesson is open: the left arrow goes back in the run"
            )

    def action_answer(self, place: int) -> None:
        if self.course.answer(place) is not None:
            self._moved()

    def action_skip(self) -> None:
        if self.course.skip():
            self._moved()
        else:
            self._say("no question is open")

    def action_hint(self) -> None:
        if self.course.hint():
            self._moved()
        else:
            self._say("there is no hint here")

    def action_activity(self) -> None:
        course, opened = self.course, self._opened
        here, moment = course.here, course.position.moment(course.at)
        if opened is None or here is None or moment is None or course.activity is None:
            self._say("there is nothing to try here")
            return
        base = self._moments.of(moment, "")
        if (attempt := course.attempt) is not None:
            search = TryScreen(self._run, base, attempt, course.plays, self._keep)
            self.app.push_screen(search, lambda _: self._show())
        else:
            racers = opened.racers(here)
            self.app.push_screen(RaceScreen(racers, [base] * len(racers), self._run), lambda _: self._watched())

    def _keep(self, attempt: Attempt) -> None:
        self.course.keep(attempt)
        self._keep_score()

    def _watched(self) -> None:
        self.course.watched()
        self._show()

    def action_move(self, what: Step, by: int) -> None:
        if self.course.move(what, by):
            self._moved()
        else:
            self._say("this is the end of the run" if by > 0 else "there is none before this moment")

    def action_predict(self) -> None:
        if self.course.must_answer:
            self._say("first answer the question of this step, or skip it with s")
        elif self.course.foretell():
            self._moved()
        else:
            self._say("nothing is left to predict: go back in the run first")

    def action_variables(self) -> None:
        self.toggle_class("-variables")

    def action_close(self) -> None:
        if len(self.app.screen_stack) > 2:
            self.dismiss(False)
        else:
            self.app.exit(0)

    def _moved(self) -> None:
        """After a move: what was said before it would only hide the text."""
        self.app.clear_notifications()
        self._show()

    def _say(self, why: str) -> None:
        self.notify(why, timeout=3, markup=False)


def _panel(id: str, title: str) -> Vertical:
    panel = Vertical(id=id, classes="panel")
    panel.border_title = title
    return panel
