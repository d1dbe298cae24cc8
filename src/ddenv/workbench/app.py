"""The workbench as a program: which screen comes first, what concerns the terminal, and the exit code."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from rich.console import RenderableType
from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding
from textual.command import Provider
from textual.screen import Screen
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.workbench.help.config import Config
from ddenv.workbench.terminal.themes import DARK, OURS, fitting, for_rich
from ddenv.workbench.terminal.written import Written
from ddenv.workbench.wording import plain


def _commands() -> type[Provider]:
    from ddenv.workbench.help.command_palette import Commands

    return Commands


class Workbench(App[int]):
    """Without a run it begins at the setup screen, else attached to that run. Raises UserError for what is no run file.

    `reading` holds the command line's options on how to read worlds. With `watch` the run is looked at, and never guided.
    """

    TITLE = "ddenv"
    # Notifications leave the status line and the keys free.
    CSS = "ToastRack { margin-bottom: 3; } SearchIcon { display: none; } CommandList { min-width: 8; }"
    ENABLE_COMMAND_PALETTE = True
    COMMANDS: ClassVar[set[Callable[[], type[Provider]]]] = {_commands}
    BINDINGS: ClassVar = [
        Binding(
            "ctrl+q", "leave", "quit", id="app.leave", tooltip="leave; an engine goes on", show=False, priority=True
        ),
        Binding("ctrl+z", "suspend_process", "suspend", id="app.suspend", tooltip="suspend; fg comes back", show=False),
        Binding(
            "ctrl+p",
            "command_palette",
            "commands",
            id="app.commands",
            tooltip="find any command by its words; themes; models by name",
            show=False,
            priority=True,
        ),
        Binding(
            "ctrl+t", "change_theme", "theme", id="app.theme", tooltip="choose the colours, until you leave", show=False
        ),
        Binding(
            "f12",
            "screenshot",
            "screenshot",
            id="app.screenshot",
            tooltip="save a picture of the screen (SVG)",
            show=False,
        ),
    ]

    def __init__(
        self,
        run: Path | None = None,
        reading: Mapping[str, Any] | None = None,
        *,
        watch: bool = False,
        config: Config | None = None,
    ) -> None:
        super().__init__()
        self._written = Written()
        self._reading = reading
        for theme in OURS:
            self.register_theme(theme)
        config = config or Config()
        self.theme = config.theme or DARK.name
        self._own_keys = config.keys
        self._run, self._watch = run, watch
        if run is not None:
            from ddenv.workbench.run.observed import Observed

            # Opened before the screen is taken, so that a wrong file is told in the terminal as one line.
            Observed(run, strictly=watch).close()

    @staticmethod
    def _attached(run: Path, watch: bool) -> Screen:
        from ddenv.workbench.run.run_screen import RunScreen

        return RunScreen(run, watch=True) if watch else RunScreen(run)

    def _setup(self) -> Screen:
        from ddenv.workbench.setup.setup_screen import SetupScreen

        return SetupScreen(self._reading)

    def compose(self) -> ComposeResult:
        # Seen at once: the first screen takes a moment to be loaded.
        what = "" if self._run is None else f"  opening {plain(self._run.stem)} ..."
        yield Static(Text(" ddenv", "bold").append(what, "not bold dim"), markup=False)

    def get_css_variables(self) -> dict[str, str]:
        variables = super().get_css_variables()
        # Widgets draw with Rich, which has other names for the terminal's own colours.
        self.theme_variables = for_rich(self.theme_variables)
        return variables

    def on_mount(self) -> None:
        # After ctrl+z and fg the terminal is blank, and nothing would be drawn before it changes.
        self.app_resume_signal.subscribe(self, lambda _: self._redraw())
        self._write("\x1b[22;2t")
        self.set_keymap(dict(self._own_keys))
        if self.is_headless:
            self._begin()
        else:
            self.call_after_refresh(self._begin)

    def _begin(self) -> None:
        try:
            self.push_screen(self._setup() if self._run is None else self._attached(self._run, self._watch))
        except UserError as error:
            self.exit(2, message=Text(f"ddenv: {error}"))

    def _redraw(self) -> None:
        self._written.forget()
        self.refresh(layout=True)

    def on_resize(self) -> None:
        self._written.forget()

    def _display(self, screen: Screen, renderable: RenderableType | None) -> None:
        super()._display(screen, self._written.fewer(renderable))

    def on_unmount(self) -> None:
        self._write("\x1b[23;2t")

    def watch_title(self, title: str) -> None:
        """The terminal's own title; saved before and given back after."""
        self._write(f"\x1b]2;{plain(title)}\x07")

    def _write(self, sequence: str) -> None:
        driver = self._driver
        if driver is not None and not self.is_headless:
            driver.write(sequence)

    def action_help(self) -> None:
        """The keys of the focused pane, of the screen, and of the app."""
        from ddenv.workbench.help.dialogs import Help

        self.push_screen(Help.of(self.screen))

    def action_runs(self) -> None:
        """The list of all runs, above the screen that asks for it."""
        from ddenv.workbench.runs.runs_screen import RunsScreen

        if not any(isinstance(screen, RunsScreen) for screen in self.screen_stack):
            self.push_screen(RunsScreen())

    def show_run(self, run: Path, watch: bool = False) -> None:
        """Attaches to another run, in place of all screens. Raises UserError for what is no run file."""
        self._only(self._attached(run, watch))

    def show_setup(self, like: Path | None = None) -> None:
        """The setup screen, in place of all screens; with the settings of the run `like` filled in."""
        from ddenv.workbench.setup.setup_screen import SetupScreen

        self._only(SetupScreen(self._reading) if like is None else SetupScreen(self._reading, like=like))

    def _only(self, screen: Screen) -> None:
        while len(self.screen_stack) > 2:
            self.pop_screen()
        self.switch_screen(screen)

    def action_leave(self) -> None:
        """Leaves at once; an engine goes on, and how to come back to it is told."""
        detach = next((screen.action_detach for screen in self.screen_stack if hasattr(screen, "action_detach")), None)
        if detach is None:
            self.exit(0)
        else:
            detach()

    async def action_quit(self) -> None:
        self.action_leave()


def run_workbench(run: Path | None = None, reading: Mapping[str, Any] | None = None, *, watch: bool = False) -> int:
    """Runs the workbench until it is left; returns the exit code. Raises UserError for what is no run file, or no terminal."""
    from ddenv.workbench.help.config import read_config
    from ddenv.workbench.terminal.terminal_check import check_terminal

    config = read_config()
    app = Workbench(run, reading, watch=watch, config=config)
    check_terminal()
    if not config.theme:
        app.theme = fitting(app.console.color_system)
    result = app.run()
    return result if isinstance(result, int) else app.return_code or 0
