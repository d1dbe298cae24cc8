"""What opens beside the run screen: dialogs, the history, the export, the 3-D scene; and the way out of the workbench."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.text import Text

from ddenv.errors import UserError
from ddenv.evidence.claims import FreshRuns
from ddenv.guiding.commands import AcceptOther, GoBack, Stop
from ddenv.runfile.failures import atlas
from ddenv.runfile.run_settings import settings
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import CERTIFY, RunState, Test
from ddenv.runs.folder import attach_name, run_path
from ddenv.workbench.help.pick import Pick
from ddenv.workbench.map.place import LAYERS
from ddenv.workbench.run.candidate_rows import Item
from ddenv.workbench.run.change import Change
from ddenv.workbench.run.choose import ChooseModels, Layers, copied
from ddenv.workbench.run.dialogs import Method, Quit, SceneDialog, failures, rounds
from ddenv.workbench.run.facts import FactsDialog
from ddenv.workbench.shared.background import call_if_open, is_open
from ddenv.workbench.shared.messages import ShowRun

if TYPE_CHECKING:
    from ddenv.workbench.run.run_screen import RunScreen

# The maximum number of other failures in a list.
LISTED = 200


class Opening:
    """Opens dialogs above the run screen, and acts on their answers. Those without arguments have keys, by their names."""

    def __init__(self, screen: RunScreen) -> None:
        self._screen = screen
        self._poll, self._asking, self._scene = screen.poll, screen.asking, screen.scene

    def choose(
        self,
        title: str,
        names: Sequence[str],
        several: bool,
        then: Callable[[tuple[str, ...]], None],
        chosen: Sequence[str] = (),
    ) -> None:
        if not names:
            self._asking.refuse("there are no models to choose from")
            return
        if not self._screen.world.is_on_screen:
            # The map shows the model under the cursor.
            self._screen.action_pane("map")
        pinned = self._poll.snapshot.state.pinned
        dialog = ChooseModels(title, names, several=several, mark=self._screen.world.mark, pinned=pinned, chosen=chosen)
        self._screen.app.push_screen(dialog, lambda chosen: then(chosen) if chosen else None)

    def find(self) -> None:
        names = [each.name for each in self._screen.world.place.prints]
        self.choose("Find a model on the map", names, False, lambda chosen: self._screen.find(chosen[0]))

    def change(self) -> None:
        dialog = Change(self._poll.snapshot.state)
        self._screen.app.push_screen(dialog, lambda command: self._asking.ask(command) if command else None)

    def history(self) -> None:
        from ddenv.workbench.history import History

        def chosen(node: int | None) -> None:
            if node is not None:
                # The history asked the question already.
                self._asking.ask(GoBack(node), sure=True)

        self._screen.app.push_screen(History(lambda: self._asking.situation), chosen)

    def failures(self) -> None:
        found = atlas(self._poll.snapshot.state)[:LISTED]
        if not found:
            self._asking.refuse("no test shows a failure other than f")
            return

        def chosen(row: int | None) -> None:
            if row is not None:
                self._asking.ask(AcceptOther(found[row].smallest, instead=True))

        self._screen.app.push_screen(failures(found), chosen)

    def rounds(self) -> None:
        position = self._screen.browsing.position
        chapters = tuple(position.chapters)

        def chosen(row: int | None) -> None:
            if row is not None:
                self._screen.go(chapters[row].last)

        self._screen.app.push_screen(rounds(chapters, position.at), chosen)

    def facts(self) -> None:
        position = self._screen.browsing.position
        test, _ = of_row(position.now, self._screen.table.item)
        if test is None:
            self._asking.refuse("there are no tests yet")
        else:
            self._screen.app.push_screen(FactsDialog(position, test, attach_name(self._poll.path), self.play_test))

    def play(self) -> None:
        self.play_row(self._screen.table.item)

    def play_row(self, item: Item | None) -> None:
        """Plays back the finished test that tells most of a row; of a certificate's row without a model, the one with it, too."""
        test, beside = of_row(self._screen.browsing.position.now, item, finished=True)
        if test is None:
            self._asking.refuse("no test is finished yet: only a finished test can be played back")
        elif why := self.play_test(test, beside):
            self._asking.refuse(why)

    def play_test(self, test: int, beside: int | None = None) -> str:
        from ddenv.workbench.playback.playback_screen import Playback

        position, place = self._screen.browsing.position, self._screen.world.place
        try:
            self._screen.app.push_screen(Playback(self._poll.file, position, place, test, beside))
        except UserError as error:
            return str(error)
        return ""

    def why(self) -> None:
        from ddenv.workbench.why.why_screen import Look, WhyScreen

        position, place = self._screen.browsing.position, self._screen.world.place

        def look() -> Look:
            return Look(position.now, self._poll.snapshot.engine != "absent", self._asking.trouble)

        self._screen.app.push_screen(WhyScreen(self._poll.file, position, place, look, self._asking.ask))

    def layers(self) -> None:
        self._screen.app.push_screen(Layers(self._screen.world, LAYERS), lambda _: self._screen.show_legend())

    def copy(self) -> None:
        path, name = self._poll.path, attach_name(self._poll.path)
        texts = [("names of the models left", "\n".join(self._poll.snapshot.state.environment))]
        if selected := self._screen.keys.pointed.models:
            texts.append(("names selected", "\n".join(selected)))
        texts += [("to come back", f"ddenv open {name}"), ("to go on without a screen", f"ddenv resume {name}")]
        texts += [("where the run file is", str(path))]

        def chosen(row: int | None) -> None:
            if row is not None:
                self._screen.app.copy_to_clipboard(texts[row][1])
                self._asking.say(f"{texts[row][0]} copied, if the terminal allows it")

        self._screen.app.push_screen(Pick("Copy", "or click copies", [copied(*each) for each in texts]), chosen)

    def export(self) -> None:
        from ddenv.workbench.export import ExportScreen

        world = Path(str(self._poll.snapshot.state.scenario.get("world", "")))
        self._screen.app.push_screen(ExportScreen(self._poll.path, world))

    def inside(self) -> None:
        """Begins a run inside the models that are left, and shows it."""
        snapshot = self._poll.snapshot
        if why := self._asking.barred:
            self._asking.refuse(why)
            return
        if snapshot.engine != "absent" or not snapshot.state.ended:
            self._asking.refuse(_not_over(snapshot))
            return
        self._screen.run_worker(self._begin_inside, group="inside", exclusive=True, thread=True)

    def _begin_inside(self) -> None:
        from ddenv.runs.creation import create_inside

        try:
            path = run_path(f"{self._poll.path.stem}-inside", None, None)
            create_inside(self._poll.path, path)
        except UserError as error:
            call_if_open(self._screen, self._asking.refuse, str(error))
            return
        call_if_open(self._screen, self._screen.post_message, ShowRun(path))

    def method(self) -> None:
        options = settings(self._poll.snapshot.state)
        self._screen.app.push_screen(Method(options.algorithm, options.pair))

    def scene(self) -> None:
        dialog = SceneDialog(self._scene)
        if not self._scene.on:
            self._scene.start()
            self._screen.run_worker(partial(self._await_scene, dialog), group="scene", thread=True)
        self._screen.app.push_screen(dialog)

    def _await_scene(self, dialog: SceneDialog) -> None:
        self._scene.wait()
        self._screen.app.call_from_thread(self._scene_answered, dialog)

    def _scene_answered(self, dialog: SceneDialog) -> None:
        if is_open(dialog):
            dialog.refresh_address()
        elif self._scene.trouble:
            self._screen.notify(self._scene.trouble, severity="error", markup=False)

    def detach(self) -> None:
        works = "The engine goes on" if self._poll.snapshot.engine != "absent" else "No engine is running"
        again = f"{attach_name(self._poll.path)}{' --watch' if self._poll.watch else ''}"
        self._exit(f"{works}. Attach again with: ddenv open {again}")

    def quit(self) -> None:
        snapshot = self._poll.snapshot
        if snapshot.engine == "absent" or snapshot.gone:
            self._screen.app.exit(0)
        elif self._poll.watch:
            self.detach()
        else:
            self._screen.app.push_screen(Quit(), self._quit)

    def _quit(self, answer: str | None) -> None:
        if answer == "leave":
            self.detach()
        elif answer == "stop":
            resume = f"ddenv resume {attach_name(self._poll.path)}"
            self._asking.send(Stop(), then=lambda: self._exit(f"The engine stops. Go on later with: {resume}"))

    def _exit(self, words: str) -> None:
        self._screen.app.exit(0, message=Text(words))


def _not_over(snapshot: Snapshot) -> str:
    """Why no run inside what is left can begin yet: what is going on, and what ends it."""
    what, state = "the reduction", snapshot.state
    if state.isolating is not None:
        what = "the search for a world that passes"
    elif state.margining is not None:
        what = "the search for margins"
    then = (
        "; r goes on with it" if snapshot.engine == "absent" else "; i stops it" if state.isolating is not None else ""
    )
    return f"I works once {what} is over{then}"


def of_row(state: RunState, item: Item | None, *, finished: bool = False) -> tuple[int | None, int | None]:
    """The test that tells most of a row, by its number, and one to compare it with: both None without tests.

    The last test of the row that showed f, else its last one, else the last one of all. Of the runs without a model: the first one
    whose partner with the same seed, in what is left, showed f where it did not, and before it that partner. With `finished`, only
    finished tests count.
    """
    tests = [test for test in _tests(state, item) if test.is_finished or not finished]
    if isinstance(item, FreshRuns) and item.without is not None:
        left = {test.run: test for test in _fresh(state, item.node, None) if test.outcome == "similar"}
        pairs = ((left[test.run], test) for test in tests if test.run in left and test.outcome != "similar")
        for partner, test in pairs:
            if test.is_finished:
                return partner.id, test.id
    similar = [test for test in tests if test.outcome == "similar"]
    if similar or tests:
        return (similar or tests)[-1].id, None
    last = (test.id for test in reversed(state.tests) if test.is_finished or not finished)
    return next(last, None), None


def _tests(state: RunState, item: Item | None) -> list[Test]:
    if isinstance(item, Test):
        return [item]
    if isinstance(item, FreshRuns):
        return _fresh(state, item.node, item.without)
    return [] if item is None else state.tests_of(item.tests)


def _fresh(state: RunState, node: int, without: str | None) -> list[Test]:
    first = 0 if state.certificate is None else state.certificate.first_run
    own = (test for test in state.confirm_tests if test.phase == CERTIFY and test.run >= first)
    return [test for test in own if test.node == node and test.without == without]
