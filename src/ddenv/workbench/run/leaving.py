"""What leads away from the run screen: dialogs beside the run, the export, and out of the workbench."""

from __future__ import annotations

from pathlib import Path

from rich.text import Text
from textual import work

from ddenv.runfile.settings import settings
from ddenv.workbench.background import is_open
from ddenv.workbench.map.place import LAYERS
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.dialogs import Method, Quit, SceneDialog
from ddenv.workbench.run.processes import Scene
from ddenv.workbench.run.steering import Steering
from ddenv.workbench.wording import attach_name


class Leaving(Steering):
    """The part of the run screen that opens dialogs and closes the screen."""

    run: Path
    scene: Scene

    def show_legend(self) -> None:
        """Says what the signs on the map mean now."""
        raise NotImplementedError

    def action_layers(self) -> None:
        from ddenv.workbench.run.layers import Layers

        self.app.push_screen(Layers(self.query_one(WorldMap), LAYERS), lambda _: self.show_legend())

    def action_copy(self) -> None:
        from ddenv.workbench.run.copying import Copy

        state, chosen = self.snapshot.state, self.selection()
        texts = [("names of the models left", "\n".join(state.environment))]
        if chosen:
            texts.append(("names selected", "\n".join(name for name in state.elements if name in chosen)))
        name = attach_name(self.run)
        texts += [("to come back", f"ddenv open {name}"), ("to go on without it", f"ddenv resume {name}")]
        texts += [("where the run file is", str(self.run))]
        self.app.push_screen(Copy(texts))

    def action_export(self) -> None:
        from ddenv.workbench.export.export_dialog import ExportScreen

        self.app.push_screen(ExportScreen(self.run))

    def action_method(self) -> None:
        options = settings(self.snapshot.state)
        self.app.push_screen(Method(options.algorithm, options.pair))

    def action_scene(self) -> None:
        dialog = SceneDialog(self.scene)
        if not self.scene.on:
            self.scene.start()
            self._await_scene(dialog)
        self.app.push_screen(dialog)

    @work(thread=True, group="scene")
    def _await_scene(self, dialog: SceneDialog) -> None:
        self.scene.wait()
        self.app.call_from_thread(self._scene_answered, dialog)

    def _scene_answered(self, dialog: SceneDialog) -> None:
        if is_open(dialog):
            dialog.refresh_address()
        elif self.scene.trouble:
            self.notify(self.scene.trouble, severity="error", markup=False)

    def action_detach(self) -> None:
        """Leaves the workbench and says how to come back."""
        works = "The engine works on" if self.snapshot.engine != "absent" else "No engine is running"
        again = f"{attach_name(self.run)}{' --watch' if self.watch else ''}"
        self.app.exit(0, message=Text(f"{works}. Attach again with: ddenv open {again}"))

    def action_quit(self) -> None:
        if self.snapshot.engine == "absent" or self.snapshot.gone:
            self.app.exit(0)
        elif self.watch:
            self.action_detach()
        else:
            self.app.push_screen(Quit(), self._quit)

    def _quit(self, answer: str | None) -> None:
        if answer == "leave":
            self.action_detach()
        elif answer == "stop":
            self.send("stop", then=self._leave_stopped)

    def _leave_stopped(self) -> None:
        self.app.exit(0, message=Text(f"The engine stops. Go on later with: ddenv resume {attach_name(self.run)}"))
