"""The setup screen in a test: what it shows, and what is typed into it."""

from contextlib import asynccontextmanager, suppress

import fake_run
import yaml
from textual.widgets import Select, Static
from textual.worker import WorkerCancelled

from ddenv.runfile.store import RunFile
from ddenv.runs.experiment import read_parts
from ddenv.words.methods import KINDS
from ddenv.workbench.app import Workbench
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.run.run_screen import RunScreen
from ddenv.workbench.setup.setup_screen import SetupScreen


def write_scenario(scenarios, **keys):
    """The bundled scenario, with these keys instead of its own."""
    (scenarios / "crates.yaml").write_text(yaml.safe_dump(fake_run.scenario() | keys))


class Session:
    def __init__(self, app, pilot):
        self.app, self.pilot = app, pilot

    @property
    def screen(self) -> SetupScreen:
        return next(screen for screen in self.app.screen_stack if isinstance(screen, SetupScreen))

    async def settle(self):
        # Not every worker: the file tree keeps one for as long as it lives.
        for group in ("recent", "world", "runs", "start", "save", "cost", "notes"):
            workers = [worker for worker in self.app.workers if worker.group == group]
            for worker in workers:
                with suppress(WorkerCancelled):
                    await worker.wait()
        while not self.app.screen.is_mounted:
            await self.pilot.pause()
        await self.pilot.pause()

    async def press(self, *keys):
        await self.pilot.press(*keys)
        await self.settle()

    def fill(self, **texts):
        for id, text in texts.items():
            self.screen.query_one(f"#{id}").value = text

    def wrong(self):
        return self.told("wrong")

    def method(self):
        return [self.screen.query_one(f"#{kind}", Select).value for kind in KINDS]

    def explained(self):
        """The title and the words of the explanation."""
        title, _, words = self.screen.query_one("#explained Static").render().plain.partition("  ")
        return title, words

    def value(self, id):
        return self.screen.form.texts[id]

    def told(self, id):
        """The words of a line of the screen."""
        return self.screen.query_one(f"#{id}", Static).render().plain

    def wrong_or_run(self):
        """What Start complained about, or the name of the run that it made."""
        screen = self.app.screen
        return screen.run.stem if isinstance(screen, RunScreen) else self.wrong()

    def made(self):
        """The scenario of the run that was started."""
        with RunFile(self.app.screen.run) as run:
            return read_parts(run)[0]

    def notice(self):
        """What stands in the place of the map."""
        return self.screen.query_one(WorldMap).notice

    async def filled(self, **texts):
        self.fill(**texts)
        await self.pilot.pause()

    async def place(self, **others):
        """A start and a goal in an empty place."""
        places = {
            "spawn_x": "-6",
            "spawn_y": "0",
            "spawn_z": "0.16",
            "yaw": "0",
            "goal_x": "6",
            "goal_y": "0",
        }
        await self.filled(**places | others)

    def refused(self):
        """What the dialog says is wrong."""
        return self.app.screen.query_one("#wrong", Static).render().plain

    async def open(self, path):
        """As the dialog would."""
        self.screen._opened(path)
        await self.pilot.pause()
        await self.settle()


@asynccontextmanager
async def Opened(size=(120, 36), reading=None, screen=None):
    app = Workbench(reading=reading)
    async with app.run_test(size=size) as pilot:
        await pilot.pause()
        if screen is not None:
            await app.switch_screen(screen())
        session = Session(app, pilot)
        await session.settle()
        yield session
