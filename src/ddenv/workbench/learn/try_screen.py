"""A student's own search: models are marked on the map, tests are run by a key, and at the end
comes an honest verdict.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import Container, VerticalScroll
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.learn.attempt import Attempt, Tried
from ddenv.learn.race import BOUND, Line, Play, comparison, in_one_sentence
from ddenv.learn.variables import SIGNS
from ddenv.runfile.snapshot import Snapshot
from ddenv.text import count, plain, shortened, truncated
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.learn.learn_screen import LearnScreen, snapshot_of
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.shared.bindings import HELP, keys

LONGEST_NAME = 16
NO_TESTS = "None yet. Each one runs the robot with some of the models that you keep."
SAID = {
    "similar": "f again without {out}: you keep {held} now.",
    "other": "another failure. That is not f, so nothing goes.",
    "pass": "the goal was reached: something that f needs was missing.",
}


class TryScreen(LearnScreen[None]):
    """The search `attempt` in the world of `run`; `keep` is called after each move. `plays` are
    compared with it at the end.
    """

    AUTO_FOCUS = "WorldMap"
    NAME = "try"
    FIRST = "help close on without done mark only map.next back again"
    BINDINGS: ClassVar = keys(
        "try",
        ("mark", "space", "mark", "mark", "mark or unmark the model under the crosshair"),
        (
            "without",
            "w",
            "test(False)",
            "test without",
            "test what is kept without the marked models",
        ),
        ("only", "o", "test(True)", "test only", "test the marked models alone"),
        ("back", "u", "back", "undo", "undo: restore what the last reduction removed"),
        ("done", "m", "done", "minimal", "claim that no single model can go: the verdict"),
        ("again", "n", "again", "new search", "begin again"),
        HELP,
        ("on", "enter", "on", "back to the lesson", "back to the lesson, once the search is over"),
        ("close", "escape,q", "close", "leave", "back to the lesson; it is kept", "esc"),
    )

    def __init__(
        self,
        run: Path,
        base: Snapshot,
        attempt: Attempt,
        plays: tuple[Play, ...],
        keep: Callable[[Attempt], None],
    ) -> None:
        super().__init__()
        self._run = run
        self._base = base
        self._plays = plays
        self._keep = keep
        self.attempt = attempt
        self._map = WorldMap(id="try-map")
        self._asked = False

    def body(self) -> ComposeResult:
        with Container(id="try-body"):
            with Framed("World", id="try-world", classes="panel"):
                yield self._map
            with VerticalScroll(id="try-tests", classes="panel", can_focus=False):
                yield Static("", id="try-table", markup=False)
            with VerticalScroll(id="try-now", classes="panel", can_focus=False) as now:
                now.border_title = "Now"
                yield Static("", id="try-said", markup=False)

    def on_mount(self) -> None:
        self._show()
        self.read_world(self._run, [self._map])

    def _show(self) -> None:
        attempt = self.attempt
        self._map.show(snapshot_of(self._base, attempt.held), None)
        header = Text(" Do it yourself", "bold", no_wrap=True)
        header.append(
            f" · {len(attempt.held)} of {count(len(attempt.oracle.models), 'model')} kept",
            "not bold",
        )
        header.append(
            f" · {attempt.tests_left} of {count(attempt.budget, 'test')} left", "not bold"
        )
        self.query_one("#try-header", Static).update(header)
        tests = self.query_one("#try-tests", VerticalScroll)
        table = self.query_one("#try-table", Static)
        if attempt.ended:
            tests.border_title = "Side by side"
            tests.border_subtitle = ""
            table.update(
                _side_by_side(
                    list(comparison(attempt.oracle, self._plays, attempt)), tests.size.width
                )
            )
        else:
            tests.border_title = "Your tests"
            tests.border_subtitle = "● f  ◇ other  ○ goal"
            rows = [_row(number, each) for number, each in enumerate(attempt.tried, 1)]
            table.update(Text("\n").join(rows or [Text(NO_TESTS)]))
            tests.scroll_end(animate=False)
        self._say_where()
        # With the focus the map would take enter, which goes back to the lesson at the end.
        self.set_focus(None if attempt.ended else self._map)
        self.refresh_bindings()

    def _say_where(self) -> None:
        said = self.query_one("#try-said", Static)
        attempt = self.attempt
        many = count(len(self.attempt.held), "model")
        if attempt.ended:
            verdict = Text(f"{'✓' if attempt.found else '✗'} {plain(attempt.verdict)}", "bold")
            said.update(
                verdict.append(
                    f"\n\n{plain(in_one_sentence(attempt.oracle, self._plays, attempt))}",
                    "not bold",
                )
            )
            return
        first = "You keep the whole world, and it shows f. Which models does f need?"
        if self._asked:
            first = (
                f"Sure that no single one of {many} can go? m again confirms it and ends the "
                "search, esc goes on."
            )
        elif attempt.tried:
            last = attempt.tried[-1]
            what = SAID[last.outcome].format(out=_names(last.out), held=many)
            first = f"Test {len(attempt.tried)}: {SIGNS[last.outcome]} {what}"
        marked = self._map.selection
        models = Text("Kept: ")
        for name in attempt.held:
            sign = "*" if name in marked else ""
            word = Text(
                f"{sign}{shortened(plain(name), LONGEST_NAME)}", "bold reverse" if sign else "bold"
            )
            word.apply_meta({"@click": f"screen.mark_one({attempt.oracle.models.index(name)})"})
            models.append_text(word).append("  ")
        left = len(attempt.held) - len(marked)
        then = (
            "space or a click marks a model, ] goes to the next. When no single one can go, "
            "press m."
        )
        if not attempt.tests_left:
            then = "No tests are left. m: the verdict on what you keep."
        elif marked:
            then = f"{len(marked)} marked (*): w tests the other {left}, o tests these alone."
        bold = "bold" if self._asked or attempt.tried else ""
        said.update(Text("\n").join((Text(first, bold), models, Text(then, "dim"))))

    def on_world_map_selection_changed(self) -> None:
        self._asked = False
        self._say_where()

    def on_resize(self) -> None:
        self.call_after_refresh(self._show)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        if action == "on":
            return self.attempt.ended
        if action == "again":
            return bool(self.attempt.moves)
        return not (self.attempt.ended and action in ("mark", "test", "back", "done"))

    def action_on(self) -> None:
        self.action_close()

    def action_close(self) -> None:
        if not self._asked:
            super().action_close()
            return
        self._asked = False
        self._say_where()

    def action_mark(self) -> None:
        self._map.action_pick()

    def action_mark_one(self, place: int) -> None:
        self._map.select(self._map.selection ^ {self.attempt.oracle.models[place]})

    def action_test(self, only: bool) -> None:
        marked = self._map.selection
        held = frozenset(self.attempt.held)
        if not marked:
            self.say("mark some models first: space, or a click on the map")
            return
        self._do(lambda: self.attempt.test(marked if only else held - marked))

    def action_back(self) -> None:
        self._do(self.attempt.back)

    def action_done(self) -> None:
        if not self._asked:
            self._asked = True
            self._say_where()
        else:
            self._do(self.attempt.end)

    def action_again(self) -> None:
        self.attempt = Attempt(self.attempt.oracle, self.attempt.budget)
        self._do(lambda: None)

    def _do(self, move: Callable[[], object]) -> None:
        """A move of the student: what it says no to is said."""
        try:
            move()
        except UserError as error:
            self.say(str(error))
            return
        self._asked = False
        self._map.select(())
        self._keep(self.attempt)
        self._show()


def _names(names: Sequence[str]) -> str:
    return ", ".join(shortened(plain(name), LONGEST_NAME) for name in names)


def _row(number: int, tried: Tried) -> Text:
    text = Text(f"{number:>2} ", no_wrap=True, overflow="ellipsis")
    text.append(f"{SIGNS[tried.outcome]} ", "bold")
    # The shorter list says it best.
    shorter = len(tried.out) <= len(tried.kept)
    if shorter:
        words = f"without {_names(tried.out)}"
    else:
        words = f"only {_names(tried.kept) or 'no model'}"
    return text.append(words, "bold" if tried.outcome == "similar" else "")


def _side_by_side(lines: list[Line], room: int) -> Text:
    width = max(len(line.name) for line in lines)
    text = Text(f"{'':<{width}}  tests  left\n", "dim")
    for line in lines:
        sign = " ✗" if line.can_go else "  "
        left = "" if line.left is None else f"{len(line.left):>6}{sign}"
        row = f"{plain(line.name):<{width}} {line.tests:>6}{left}"
        names = truncated(", ".join(map(plain, line.left or ())), max(0, room - len(row) - 1))
        row += f" {names}" if len(names) > 8 else ""
        text.append(f"{row}\n", "bold not dim" if line.name == "you" else "not dim")
    if any(line.can_go for line in lines):
        text.append("✗ one of these can still go.\n", "dim")
    return text.append(BOUND, "dim")
