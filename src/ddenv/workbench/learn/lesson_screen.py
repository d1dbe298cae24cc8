"""A lesson on the screen: the map and Algorithm 1 of a recorded run, its variables, and the
lesson's texts and questions.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Container
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.learn.attempt import Attempt
from ddenv.learn.catalog import Opened
from ddenv.learn.lesson import blocks
from ddenv.learn.lesson_course import LETTERS, Course
from ddenv.learn.variables import variables
from ddenv.runfile.position import Position, Step
from ddenv.runfile.store import COLUMNS, Live
from ddenv.runfile.tested import told
from ddenv.text import plain
from ddenv.words.news import what_happened
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.learn.kept_scores import all_scores, keep_score
from ddenv.workbench.learn.learn_screen import LearnScreen
from ddenv.workbench.learn.lesson_pane import LessonPane, Variables, letters
from ddenv.workbench.learn.race_screen import RaceScreen
from ddenv.workbench.learn.try_screen import TryScreen
from ddenv.workbench.map.map_words import MapLines
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.explanation_panel import Happening
from ddenv.workbench.run.snapshot import Moments
from ddenv.workbench.shared.bindings import HELP, keys
from ddenv.workbench.shared.observed import Observed


class LessonScreen(LearnScreen[bool]):
    """A lesson from where the student left it; or any run step by step. Leaving it keeps the
    student's place and answers.

    It returns whether the student goes on to the next lesson.
    """

    AUTO_FOCUS = "LessonPane"
    NAME = "lesson"
    FIRST = (
        "help close on skip again activity run_back run_on predict hint variables next_reduction "
        "next_decision back"
    )
    BINDINGS: ClassVar = keys(
        "lesson",
        ("on", "enter,space", "on", "go on", "continue the lesson", "enter"),
        ("back", "backspace", "back", "step back", "back to the step before"),
        ("skip", "s", "skip", "skip", "skip the question: shows the answer, without a score"),
        ("hint", "h", "hint", "hint", "show a hint for the question"),
        ("run_back", "left", "move('moment', -1)", "run back", "the run: one moment back"),
        ("run_on", "right", "move('moment', 1)", "run on", "the run: one moment on"),
        (
            "next_decision",
            "right_parenthesis",
            "move('decision', 1)",
            "verdict",
            "the run: to the next verdict",
        ),
        (
            "decision_before",
            "left_parenthesis",
            "move('decision', -1)",
            "",
            "the run: to the verdict before",
        ),
        (
            "next_reduction",
            "right_curly_bracket",
            "move('reduction', 1)",
            "reduction",
            "the run: to the next reduction",
        ),
        (
            "reduction_before",
            "left_curly_bracket",
            "move('reduction', -1)",
            "",
            "the run: to the reduction before",
        ),
        (
            "activity",
            "t",
            "activity",
            "try",
            "search yourself, or watch the race, where a step has one",
        ),
        ("predict", "p", "predict", "predict", "predict what comes next in the run"),
        (
            "again",
            "r",
            "again",
            "start again",
            "at the end of a lesson: start it again, with a new score",
        ),
        (
            "variables",
            "v",
            "variables",
            "variables",
            "the variables instead of the map (80 columns)",
        ),
        *(
            (letter, letter, f"answer({place})", letter, f"give answer {letter}")
            for place, letter in enumerate(LETTERS)
        ),
        HELP,
        ("close", "escape,q", "close", "leave", "leave; your place is kept", "esc"),
    )

    def __init__(self, run: Path, opened: Opened | None = None, following: str = "") -> None:
        """The lesson `opened`, whose run is `run`; without one the run alone. Raises UserError for
        a damaged run.

        `following` is the title of the next lesson, or "".
        """
        super().__init__()
        self._run = run
        self._opened = opened
        self._following = following
        self._file = Observed(run)
        self._moments = Moments(self._file)
        if opened is None:
            position = Position(self._file.events)
            score = None
            position.catch_up()
            if not position.ids:
                raise UserError(f"{run}: has no events yet")
        else:
            position = opened.position
            score = all_scores().get(opened.lesson.name)
        self.course = Course(position, opened, score)
        self._kept = self.course.score
        self._map = WorldMap(id="lesson-map")
        self._legend = MapLines(id="lesson-legend")

    def body(self) -> ComposeResult:
        with Container(id="lesson-body"):
            with Framed("World", id="lesson-world", classes="panel"):
                yield self._map
                yield self._legend
            with Framed("Algorithm", id="lesson-now", classes="panel"):
                yield Happening(id="lesson-happening")
            with Framed("Variables now", id="lesson-variables-panel", classes="panel"):
                yield Variables(id="lesson-variables")
            with Framed(
                "Lesson" if self._opened else "This run", id="lesson-panel", classes="panel"
            ):
                yield LessonPane()

    def on_mount(self) -> None:
        self._show()
        self.read_world(self._run, [self._map])

    def on_unmount(self) -> None:
        self._file.close()

    def _show(self) -> None:
        self._show_run()
        course = self.course
        page = self.course.page
        ended = self._opened is not None and course.step == course.last
        if ended:
            if self._following:
                following = f"\n\n`enter` opens the next lesson: **{self._following}**."
            else:
                following = ""
            done = f"Done. `backspace` goes back through it, `r` starts it again.{following}"
            page = replace(page, after=blocks(done))
        self.query_one(LessonPane).show(page)
        self._show_heading()
        footer = self.query_one(KeyFooter)
        due = course.due and not course.is_open
        asked = page.question if page.chosen is None else None
        # The pane *Algorithm* comes with the first step that speaks of it; where none does, it is
        # shown from the start.
        steps = () if self._opened is None else self._opened.lesson.steps
        plain = course.step < next(
            (at for at, step in enumerate(steps) if "*Algorithm*" in step.text), 0
        )
        self.set_class(plain, "-plain")
        can = {
            "lesson.activity": course.activity or "",
            "lesson.skip": "skip" if asked or course.due else "",
            "lesson.hint": "hint" if asked and asked.hint else "",
            "lesson.again": "start again" if ended else "",
            "lesson.back": "step back" if course.step else "",
            "lesson.predict": "" if plain or course.must_answer else "predict",
        }
        # The keys of the run come with the algorithm.
        of_run = {
            "run_back": "run back",
            "run_on": "run on",
            "next_decision": "verdict",
            "next_reduction": "reduction",
        }
        can |= {
            f"lesson.{key}": "" if plain else words
            for key, words in (of_run | {"variables": "variables"}).items()
        }
        for id, words in can.items():
            footer.say(id, words)
        if due:
            on = f"{course.activity}"
        elif self._at_next:
            on = "next lesson"
        elif ended:
            on = ""
        else:
            on = "go on"
        footer.say("lesson.on", "answer" if asked else on, letters(asked) if asked else "")
        self._keep_score()

    @property
    def _at_next(self) -> bool:
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
            # With its path, as far as it is recorded, and the robot where it ended.
            pose = test.end_pose
            live: tuple[Live, ...] = ()
            if pose is not None and len(pose) == COLUMNS - 1:
                live = (Live(slot=0, test=test.id, time=0.0, pose=pose),)
            snapshot = replace(snapshot, evidence=self._moments.path(test.id), live=live)
        self.query_one("#lesson-world").border_title = (
            "World" if test is None else f"World: path of test {test.id}"
        )
        self.query_one(Happening).show(snapshot)
        self.query_one(Variables).show(variables(moment))
        self._map.show(snapshot, snapshot.pointed)
        self._legend.show(self._map.shown)
        number, all_moments = self.course.position.place
        self.query_one("#lesson-now").border_subtitle = f"moment {number} of {all_moments}"

    def _show_heading(self) -> None:
        course = self.course
        score = self.course.score
        left = f" {plain(self._run.stem)}, step by step"
        if self._opened is not None:
            last = course.step == course.last
            place = "summary" if last else f"step {course.step + 1} of {course.last}"
            left = f" {plain(self._opened.lesson.title)} · {place}"
        right = f"{score.right} of {len(score.answered)} right" if score.answered else ""
        right += f" · {score.streak} in a row" if score.streak > 1 else ""
        text = Text(left, "bold", no_wrap=True)
        text.truncate(max(1, self.size.width - len(right) - 2), overflow="ellipsis", pad=True)
        self.query_one("#lesson-header", Static).update(text.append(f" {right} ", "not bold"))

    def on_resize(self) -> None:
        self.call_after_refresh(self._show)

    def action_on(self) -> None:
        if self.query_one(LessonPane).read_on():
            return
        if self.course.due and not self.course.is_open:
            self.action_activity()
        elif self._at_next:
            self.dismiss(True)
        elif self.course.go_on():
            self._moved()
        elif self.course.is_open:
            # Without a cursor the frame says how to answer.
            if (place := self.query_one(LessonPane).cursor) is not None:
                self.action_answer(place)
        elif self._opened is None:
            self.action_move("moment", 1)
        else:
            self.say("this is the end of the lesson: escape leaves it, backspace goes back")

    def action_back(self) -> None:
        if self.course.back():
            self._moved()
        else:
            self.say(
                "the lesson begins here"
                if self._opened
                else "no lesson is open: the left arrow goes back in the run"
            )

    def action_again(self) -> None:
        if self.course.again():
            self._moved()

    def action_answer(self, place: int) -> None:
        if self.course.answer(place) is not None:
            self._moved()

    def action_skip(self) -> None:
        if self.course.skip():
            self._moved()
        else:
            self.say("no question is open")

    def action_hint(self) -> None:
        if self.course.hint():
            self._moved()
        else:
            self.say("there is no hint here")

    def action_activity(self) -> None:
        course = self.course
        opened = self._opened
        here = course.here
        moment = course.position.moment(course.at)
        if opened is None or here is None or moment is None or course.activity is None:
            self.say("there is nothing to try here")
            return
        base = self._moments.of(moment, "")
        attempt = course.attempt

        def keep(attempt: Attempt) -> None:
            course.keep(attempt)
            self._keep_score()

        def done(_: object) -> None:
            if attempt is None:
                course.watched()
            self._show()

        if attempt is not None:
            self.app.push_screen(TryScreen(self._run, base, attempt, course.plays, keep), done)
        else:
            racers = opened.racers(here)
            self.app.push_screen(RaceScreen(racers, [base] * len(racers), self._run), done)

    def action_move(self, what: Step, by: int) -> None:
        if self.course.move(what, by):
            self._moved()
        else:
            self.say("this is the end of the run" if by > 0 else "there is none before this moment")

    def action_predict(self) -> None:
        if self.course.must_answer:
            self.say("first answer the question of this step, or skip it with s")
        elif self.course.foretell():
            self._moved()
        else:
            self.say("nothing is left to predict: go back in the run first")

    def action_variables(self) -> None:
        self.toggle_class("-variables")

    def _moved(self) -> None:
        """After a move: what was said before it would only hide the text."""
        self.app.clear_notifications()
        self._show()
