"""What opens beside the run screen: dialogs, the history, the export, the 3-D scene; and the way out of the workbench."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rich.text import Text
from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.evidence.fresh_runs import FreshRuns
from ddenv.guiding.course import GoBack, Stop
from ddenv.guiding.selections import AcceptOther
from ddenv.runfile.position import Position
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import CERTIFY, RunState, Test
from ddenv.runs.folder import attach_name
from ddenv.workbench.map.place import LAYERS
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.asking import Asking
from ddenv.workbench.run.candidate_rows import Item
from ddenv.workbench.run.dialogs import Method, Quit, SceneDialog
from ddenv.workbench.shared.background import is_open
from ddenv.workbench.shared.poll import Poll
from ddenv.workbench.shared.processes import Scene


class Opening:
    """Opens dialogs above `screen`, and acts on their answers."""

    def __init__(self, screen: Screen[Any], poll: Poll, asking: Asking, world: WorldMap, scene: Scene) -> None:
        self._screen, self._poll, self._asking, self._world, self._scene = screen, poll, asking, world, scene

    def choose(
        self,
        title: str,
        names: Sequence[str],
        several: bool,
        then: Callable[[tuple[str, ...]], None],
        chosen: Sequence[str] = (),
    ) -> None:
        """Asks for models by their names; those that are `chosen` already come first."""
        from ddenv.workbench.run.choose import ChooseModels

        if not names:
            self._asking.refuse("there are no models to choose from")
            return
        dialog = ChooseModels(title, names, several=several, pinned=self._poll.snapshot.state.pinned, chosen=chosen)
        self._screen.app.push_screen(dialog, lambda chosen: then(chosen) if chosen else None)

    def change(self) -> None:
        """Asks for other settings."""
        from ddenv.workbench.run.change import Change

        ask = self._asking.ask
        dialog = Change(self._poll.snapshot.state)
        self._screen.app.push_screen(dialog, lambda command: None if command is None else ask(command))

    def history(self) -> None:
        """Shows the tree of reductions, to go back to one of them."""
        from ddenv.workbench.history.history_screen import History

        history = History(lambda: self._asking.situation, self._world.place)
        ask = self._asking.ask
        # The history asked the question already.
        self._screen.app.push_screen(history, lambda node: None if node is None else ask(GoBack(node), sure=True))

    def failures(self) -> None:
        """Lists the other failures that the tests met, to reduce one of them in a branch."""
        from ddenv.workbench.run.failures_dialog import FailuresMet

        def chosen(test: int | None) -> None:
            if test is not None:
                # The list asked the question already.
                self._asking.ask(AcceptOther(test, instead=True), sure=True)

        self._screen.app.push_screen(FailuresMet(lambda: self._asking.situation), chosen)

    def rounds(self, position: Position, then: Callable[[int], None]) -> None:
        """Lists the rounds so far; `then` takes the event that ends the chosen one."""
        from ddenv.workbench.run.dialogs import Rounds

        dialog = Rounds(tuple(position.chapters), position.at)
        self._screen.app.push_screen(dialog, lambda chapter: then(chapter.last) if chapter else None)

    def facts(self, position: Position, item: Item | None) -> None:
        """Shows the raw facts of the test that tells most of a row, or of the last one of all."""
        from ddenv.workbench.run.facts import FactsDialog

        test, _ = of_row(position.now, item)
        if test is None:
            self._asking.refuse("there are no tests yet")
            return
        self._screen.app.push_screen(
            FactsDialog(position, test, attach_name(self._poll.path), lambda number: self._play(position, number))
        )

    def play(self, position: Position, item: Item | None) -> None:
        """Plays back the finished test that tells most of a row; of a certificate's row without a model, the one with it, too."""
        test, beside = of_row(position.now, item, finished=True)
        if test is None:
            self._asking.refuse("no test is finished yet: only a finished test can be played back")
        elif why := self._play(position, test, beside):
            self._asking.refuse(why)

    def _play(self, position: Position, test: int, beside: int | None = None) -> str:
        """Returns why a test cannot be played back, or ""."""
        from ddenv.workbench.playback.playback_screen import Playback

        try:
            self._screen.app.push_screen(Playback(self._poll.file, position, self._world.place, test, beside))
        except UserError as error:
            return str(error)
        return ""

    def why(self, position: Position) -> None:
        """Shows what happens without each model that is left."""
        from ddenv.workbench.why.why_screen import Look, WhyScreen

        def look() -> Look:
            return Look(position.now, self._poll.snapshot.engine != "absent", self._asking.trouble)

        screen = WhyScreen(self._poll.file, position, self._world.place, look, self._asking.ask)
        self._screen.app.push_screen(screen)

    def open(self, what: str) -> None:
        """A dialog or another screen, by its name in the keys."""
        {
            "signs": self.signs,
            "history": self.history,
            "failures": self.failures,
            "export": self.export,
            "method": self.method,
            "scene": self.scene,
        }[what]()

    def signs(self) -> None:
        """Shows what the signs mean."""
        from ddenv.workbench.help.signs import SignsDialog

        self._screen.app.push_screen(SignsDialog())

    def layers(self, then: Callable[[], None]) -> None:
        """Asks what the map shows; `then` is called when that is chosen."""
        from ddenv.workbench.run.choose import Layers

        self._screen.app.push_screen(Layers(self._world, LAYERS), lambda _: then())

    def copy(self, selected: Sequence[str]) -> None:
        """Lists what can be copied: names, and the commands that come back to this run."""
        from ddenv.workbench.run.choose import Copy

        path = self._poll.path
        texts = [("names of the models left", "\n".join(self._poll.snapshot.state.environment))]
        if selected:
            texts.append(("names selected", "\n".join(selected)))
        name = attach_name(path)
        texts += [("to come back", f"ddenv open {name}"), ("to go on without screen", f"ddenv resume {name}")]
        texts += [("where the run file is", str(path))]
        self._screen.app.push_screen(Copy(texts))

    def export(self) -> None:
        from ddenv.workbench.export.export_dialog import ExportScreen

        self._screen.app.push_screen(ExportScreen(self._poll.path))

    def method(self) -> None:
        """Explains how the run is reduced."""
        options = settings(self._poll.snapshot.state)
        self._screen.app.push_screen(Method(options.algorithm, options.pair))

    def scene(self) -> None:
        """Shows the address of the 3-D scene; starts it if it is not on."""
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

    # Out of the workbench.

    def detach(self) -> None:
        """Leaves the workbench and says how to come back."""
        works = "The engine goes on" if self._poll.snapshot.engine != "absent" else "No engine is running"
        again = f"{attach_name(self._poll.path)}{' --watch' if self._poll.watch else ''}"
        self._exit(f"{works}. Attach again with: ddenv open {again}")

    def quit(self) -> None:
        """Leaves at once if no engine is running; else asks whether to stop it."""
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
    return [] if item is None else [state.tests[id - 1] for id in item.tests if 0 < id <= len(state.tests)]


def _fresh(state: RunState, node: int, without: str | None) -> list[Test]:
    first = 0 if state.certificate is None else state.certificate.first_run
    own = (test for test in state.confirm_tests if test.phase == CERTIFY and test.run >= first)
    return [test for test in own if test.node == node and test.without == without]
