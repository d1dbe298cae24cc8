"""The workbench as a program: which screen comes first, what concerns the terminal, and the exit code."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from textual.app import App
from textual.binding import Binding
from textual.screen import Screen
from textual.theme import Theme

from ddenv.workbench.wording import plain

# Calm and dark; the command palette offers others.
DARK = Theme(
    name="ddenv",
    primary="#6cb6ff",
    secondary="#8b95a7",
    accent="#f2cc60",
    warning="#e3b341",
    error="#ff7b72",
    success="#57c98a",
    foreground="#d5dbe5",
    background="#0f141b",
    surface="#171e28",
    panel="#1c2531",
    dark=True,
    variables={"footer-key-foreground": "#6cb6ff", "primary-muted": "#24476b"},
)


class Workbench(App[int]):
    """Without a run it begins at the setup screen, else attached to that run. Raises UserError for what is no run file.

    `reading` holds the command line's options on how to read worlds.
    """

    TITLE = "ddenv"
    # Notifications leave the status line and the keys free.
    CSS = "ToastRack { margin-bottom: 3; }"
    ENABLE_COMMAND_PALETTE = True
    BINDINGS: ClassVar = [
        Binding(
            "ctrl+q", "leave", "quit", id="app.leave", tooltip="leave; an engine goes on", show=False, priority=True
        ),
        Binding("ctrl+z", "suspend_process", "suspend", id="app.suspend", tooltip="suspend; fg comes back", show=False),
    ]

    def __init__(self, run: Path | None = None, reading: Mapping[str, Any] | None = None) -> None:
        super().__init__()
        self._reading = reading
        self.register_theme(DARK)
        self.theme = DARK.name
        # Opened before the screen is taken, so that a wrong file is told in the terminal as one line.
        self._run_screen = self._attached(run) if run is not None else None

    @staticmethod
    def _attached(run: Path) -> Screen:
        from ddenv.workbench.screens.run import RunScreen

        return RunScreen(run)

    def _setup(self) -> Screen:
        from ddenv.workbench.screens.setup import SetupScreen

        return SetupScreen(self._reading)

    def on_mount(self) -> None:
        # After ctrl+z and fg the terminal is blank, and nothing would be drawn before it changes.
        self.app_resume_signal.subscribe(self, lambda _: self.refresh(layout=True))
        self._write("\x1b[22;2t")
        self.push_screen(self._run_screen or self._setup())

    def on_unmount(self) -> None:
        self._write("\x1b[23;2t")

    def watch_title(self, title: str) -> None:
        """The terminal's own title; saved before and given back after."""
        self._write(f"\x1b]2;{plain(title)}\x07")

    def _write(self, sequence: str) -> None:
        driver = self._driver
        if driver is not None and not self.is_headless:
            driver.write(sequence)

    def action_leave(self) -> None:
        """Leaves at once; an engine goes on, and how to come back to it is told."""
        detach = next((screen.action_detach for screen in self.screen_stack if hasattr(screen, "action_detach")), None)
        if detach is None:
            self.exit(0)
        else:
            detach()

    async def action_quit(self) -> None:
        self.action_leave()


def run_workbench(run: Path | None = None, reading: Mapping[str, Any] | None = None) -> int:
    """Runs the workbench until it is left; returns the exit code. Raises UserError if `run` is no run file."""
    app = Workbench(run, reading)
    result = app.run()
    return result if isinstance(result, int) else app.return_code or 0
