"""A workbench that is attached to a fake run, with what tests ask of it."""

from __future__ import annotations

from ddenv.workbench.app import Workbench
from ddenv.workbench.run.run_screen import RunScreen
from tests.conftest import ROOT
from tests.waiting import eventually

SRC = ROOT / "src/ddenv"


class Heard(Workbench):
    """It remembers the notices that are no longer shown."""

    CSS_PATH = str(SRC / "workbench/app.tcss")
    past: tuple[str, ...] = ()

    def clear_notifications(self):
        self.past += tuple(notice.message for notice in self._notifications)
        super().clear_notifications()


class Session:
    """An app on a run, driven by keys."""

    def __init__(self, app, pilot, run):
        self.app, self.pilot, self.run = app, pilot, run
        self.read = self.heard = 0

    @property
    def screen(self) -> RunScreen:
        return next(screen for screen in self.app.screen_stack if isinstance(screen, RunScreen))

    async def press(self, *keys):
        """Presses keys, and waits until what they ask for is written."""
        for key in keys:
            await self.pilot.press(key)
        await self.pilot.pause()
        await eventually(lambda: not (self.app.is_running and self.screen.asking.sending))

    async def look(self):
        """Lets the screen see what was written, without waiting for its clock."""
        self.screen.poll._looked = self.screen.poll._posed = -1e9
        self.screen.look()
        while self.screen.poll.catching_up:
            self.screen.look()
        await self.pilot.pause()
        assert not self.screen.snapshot.error or "nonsense" in self.screen.snapshot.error

    def commands(self):
        """All that was asked for."""
        return [(command.kind, command.data) for command in self.run.file.commands()]

    def asked(self):
        """What was asked for since this was called last."""
        commands = self.commands()
        new, self.read = commands[self.read :], len(commands)
        return new

    def notices(self):
        return [*self.app.past, *(notice.message for notice in self.app._notifications)]

    def said(self):
        """What was said since this was called last, as one text."""
        notices = self.notices()
        new, self.heard = notices[self.heard :], len(notices)
        return "\n".join(new)

    def text(self, selector):
        rendered = self.app.screen.query_one(selector).render()
        return getattr(rendered, "plain", str(rendered))

    def dialog(self):
        """All the words of the dialog on top."""
        return "\n".join(str(static.render()) for static in self.app.screen.query("Static"))


class Attached:
    def __init__(self, run, size=(120, 36), watch=False, notices=False):
        """With `notices` they are on the screen, too."""
        self.run, self.size, self.watch, self.notices = run, size, watch, notices

    async def __aenter__(self):
        app = Heard(self.run.path, watch=self.watch)
        self._context = app.run_test(size=self.size, notifications=self.notices)
        pilot = await self._context.__aenter__()
        await app.workers.wait_for_complete()
        await pilot.pause()
        return Session(app, pilot, self.run)

    async def __aexit__(self, *error):
        await self._context.__aexit__(*error)
