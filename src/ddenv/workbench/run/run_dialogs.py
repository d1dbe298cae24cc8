"""What opens beside the run screen: dialogs, the history, the export, the 3-D scene; and the way
out of the workbench.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from rich.text import Text
from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.evidence.claims import FreshRuns
from ddenv.guiding.commands import AcceptOther, GoBack, Stop
from ddenv.runfile.failures import atlas
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import CERTIFY, RunState, Test
from ddenv.runs.folder import attach_name, run_path
from ddenv.text import Names, plain, truncated
from ddenv.workbench.help.dialogs import Pick
from ddenv.workbench.run.candidate_rows import Item
from ddenv.workbench.run.change import Change
from ddenv.workbench.run.choose import ChooseModels, Layers
from ddenv.workbench.run.dialogs import Method, Quit, SceneDialog, failures, rounds
from ddenv.workbench.run.facts import FactsDialog
from ddenv.workbench.shared.background import call_if_open, is_open
from ddenv.workbench.shared.messages import ShowRun

if TYPE_CHECKING:
    from ddenv.workbench.run.run_screen import RunScreen

Answer = TypeVar("Answer")
# The maximum number of other failures in a list.
LISTED = 200


class Dialogs:
    """Opens dialogs above the run screen, and acts on their answers. Those without arguments have
    keys, by their names.
    """

    def __init__(self, screen: RunScreen) -> None:
        self._screen = screen
        self._poll = screen.poll
        self._asking = screen.asking
        self._scene = screen.scene

    def _open(self, dialog: Screen[Answer | None], then: Callable[[Answer], object]) -> None:
        """Calls `then` with the answer, unless the dialog is cancelled."""

        def answered(answer: Answer | None) -> None:
            if answer is not None:
                then(answer)

        self._screen.app.push_screen(dialog, answered)

    def choose(
        self,
        title: str,
        names: Sequence[str],
        several: bool,
        then: Callable[[Names], None],
        chosen: Sequence[str] = (),
    ) -> None:
        if not names:
            self._asking.refuse("there are no models to choose from")
            return
        if not self._screen.world.is_on_screen:
            # The map shows the model under the cursor.
            self._screen.action_pane("map")
        pinned = self._poll.snapshot.state.pinned
        mark = self._screen.world.mark
        self._open(
            ChooseModels(title, names, several=several, mark=mark, pinned=pinned, chosen=chosen),
            then,
        )

    def find(self) -> None:
        names = [each.name for each in self._screen.world.place.prints]
        self.choose(
            "Find a model on the map", names, False, lambda chosen: self._screen.find(chosen[0])
        )

    def change(self) -> None:
        self._open(Change(self._poll.snapshot.state), self._asking.ask)

    def history(self) -> None:
        from ddenv.workbench.history import History

        # It asks the question itself.
        self._open(
            History(lambda: self._asking.situation),
            lambda node: self._asking.ask(GoBack(node), sure=True),
        )

    def failures(self) -> None:
        found = atlas(self._poll.snapshot.state)[:LISTED]
        if not found:
            self._asking.refuse("no test shows a failure other than f")
            return
        self._open(
            failures(found),
            lambda row: self._asking.ask(AcceptOther(found[row].smallest, instead=True)),
        )

    def rounds(self) -> None:
        position = self._screen.browsing.position
        chapters = tuple(position.chapters)
        self._open(rounds(chapters, position.at), lambda row: self._screen.go(chapters[row].last))

    def facts(self) -> None:
        position = self._screen.browsing.position
        test, _ = of_row(position.now, self._screen.table.item)
        if test is None:
            self._asking.refuse("there are no tests yet")
        else:
            self._screen.app.push_screen(
                FactsDialog(position, test, attach_name(self._poll.path), self.play_test)
            )

    def play(self) -> None:
        self.play_row(self._screen.table.item)

    def play_row(self, item: Item | None) -> None:
        """Plays back the finished test that tells most of a row; of a certificate's row without a
        model, the one with it, too.
        """
        test, beside = of_row(self._screen.browsing.position.now, item, finished=True)
        if test is None:
            self._asking.refuse("no test is finished yet: only a finished test can be played back")
        elif why := self.play_test(test, beside):
            self._asking.refuse(why)

    def play_test(self, test: int, beside: int | None = None) -> str:
        from ddenv.workbench.playback.playback_screen import Playback

        position = self._screen.browsing.position
        place = self._screen.world.place
        try:
            self._screen.app.push_screen(Playback(self._poll.file, position, place, test, beside))
        except UserError as error:
            return str(error)
        return ""

    def why(self) -> None:
        from ddenv.workbench.why.why_screen import WhyScreen

        def engine() -> tuple[bool, str]:
            works = self._poll.snapshot.engine != "absent"
            return works, "" if works else self._screen.engine.trouble

        position = self._screen.browsing.position
        place = self._screen.world.place
        self._screen.app.push_screen(
            WhyScreen(self._poll.file, position, place, engine, self._asking.ask)
        )

    def layers(self) -> None:
        self._screen.app.push_screen(
            Layers(self._screen.world), lambda _: self._screen.show_legend()
        )

    def copy(self) -> None:
        path = self._poll.path
        name = attach_name(self._poll.path)
        texts = [("names of the models left", "\n".join(self._poll.snapshot.state.environment))]
        if selected := self._screen.pointed.models:
            texts.append(("names selected", "\n".join(selected)))
        texts += [
            ("to come back", f"ddenv open {name}"),
            ("to go on without a screen", f"ddenv resume {name}"),
        ]
        texts += [("where the run file is", str(path))]

        def chosen(row: int) -> None:
            self._screen.app.copy_to_clipboard(texts[row][1])
            self._asking.say(f"{texts[row][0]} copied, if the terminal allows it")

        lines = []
        for what, text in texts:
            first, *more = text.splitlines() or [""]
            begin = f"{truncated(plain(first), 40)}{f' and {len(more)} more lines' if more else ''}"
            lines.append(Text(f"{what:<26} ", no_wrap=True).append(begin, "dim"))
        self._open(Pick("Copy", "or click copies", lines), chosen)

    def export(self) -> None:
        from ddenv.workbench.export import ExportScreen

        world = Path(str(self._poll.snapshot.state.scenario.get("world", "")))
        self._screen.app.push_screen(ExportScreen(self._poll.path, world))

    def inside(self) -> None:
        """Begins a run inside the models that are left, and shows it."""
        state = self._poll.snapshot.state
        works = self._poll.snapshot.engine != "absent"
        if why := self._asking.barred:
            self._asking.refuse(why)
            return
        if works or not state.ended:
            what = "the reduction" if state.margining is None else "the search for margins"
            then = "" if works else "; r goes on with it"
            if state.isolating is not None:
                what = "the search for a world that passes"
                then = "; i stops it" if works else then
            self._asking.refuse(f"I works once {what} is over{then}")
            return

        def begin() -> None:
            from ddenv.runs.creation import create_inside

            try:
                path = run_path(f"{self._poll.path.stem}-inside", None, None)
                create_inside(self._poll.path, path)
            except UserError as error:
                call_if_open(self._screen, self._asking.refuse, str(error))
            else:
                call_if_open(self._screen, self._screen.post_message, ShowRun(path))

        self._screen.run_worker(begin, group="inside", exclusive=True, thread=True)

    def method(self) -> None:
        options = settings(self._poll.snapshot.state)
        self._screen.app.push_screen(Method(options.algorithm, options.pair))

    def scene(self) -> None:
        dialog = SceneDialog(self._scene)

        def answered() -> None:
            if is_open(dialog):
                dialog.refresh_address()
            elif self._scene.trouble:
                self._screen.notify(self._scene.trouble, severity="error", markup=False)

        def wait() -> None:
            self._scene.wait()
            self._screen.app.call_from_thread(answered)

        if not self._scene.on:
            self._scene.start()
            self._screen.run_worker(wait, group="scene", thread=True)
        self._screen.app.push_screen(dialog)

    def detach(self) -> None:
        if self._poll.snapshot.engine != "absent":
            works = "The engine goes on"
        else:
            works = "No engine is running"
        again = f"{attach_name(self._poll.path)}{' --watch' if self._poll.watch else ''}"
        self._exit(f"{works}. Attach again with: ddenv open {again}")

    def quit(self) -> None:
        snapshot = self._poll.snapshot

        def answered(answer: str | None) -> None:
            if answer == "leave":
                self.detach()
            elif answer == "stop":
                resume = f"ddenv resume {attach_name(self._poll.path)}"
                self._asking.send(
                    Stop(), then=lambda: self._exit(f"The engine stops. Go on later with: {resume}")
                )

        if snapshot.engine == "absent" or snapshot.gone:
            self._screen.app.exit(0)
        elif self._poll.watch:
            self.detach()
        else:
            self._screen.app.push_screen(Quit(), answered)

    def _exit(self, words: str) -> None:
        self._screen.app.exit(0, message=Text(words))


def of_row(
    state: RunState, item: Item | None, *, finished: bool = False
) -> tuple[int | None, int | None]:
    """The test that tells most of a row, by its number, and one to compare it with: both None
    without tests.

    The last test of the row that showed f, else its last one, else the last one of all. Of the runs
    without a model: the first one whose partner with the same seed, in what is left, showed f where
    it did not, and before it that partner. With `finished`, only finished tests count.
    """
    if isinstance(item, FreshRuns):
        own = _fresh(state, item.node, item.without)
    elif isinstance(item, Test):
        own = [item]
    else:
        own = state.tests_of(item.tests if item else ())
    tests = [test for test in own if test.is_finished or not finished]
    if isinstance(item, FreshRuns) and item.without is not None:
        left = {test.run: test for test in _fresh(state, item.node, None) if test.shows_f}
        pairs = ((left[test.run], test) for test in tests if test.run in left and not test.shows_f)
        for partner, test in pairs:
            if test.is_finished:
                return partner.id, test.id
    similar = [test for test in tests if test.shows_f]
    if similar or tests:
        return (similar or tests)[-1].id, None
    last = (test.id for test in reversed(state.tests) if test.is_finished or not finished)
    return next(last, None), None


def _fresh(state: RunState, node: int, without: str | None) -> list[Test]:
    first = 0 if state.certificate is None else state.certificate.first_run
    own = (test for test in state.confirm_tests if test.phase == CERTIFY and test.run >= first)
    return [test for test in own if test.node == node and test.without == without]
