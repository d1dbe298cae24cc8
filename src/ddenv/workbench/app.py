"""The workbench as an app: the first screen, switching between screens, and the terminal."""

from __future__ import annotations

import asyncio
import gc
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from rich.console import RenderableType
from rich.text import Text
from textual import events, on
from textual.app import App, ComposeResult
from textual.command import Provider
from textual.geometry import Size
from textual.screen import ModalScreen, Screen
from textual.widgets import Static

from ddenv.errors import UserError
from ddenv.runs.folder import dropped_run
from ddenv.text import Data, plain
from ddenv.workbench.shared.bindings import keys
from ddenv.workbench.shared.messages import Attention, ShowRun, ShowSetup
from ddenv.workbench.terminal.cell_diff import CellDiff
from ddenv.workbench.terminal.themes import DARK, OURS, for_rich

BELL = "\x07"
# Textual's actions that move the focus.
TABS = {"app.focus_next": Screen.focus_next, "app.focus_previous": Screen.focus_previous}
# After so many turns of the event loop every widget knows that the focus has moved.
LOOPS = 8


def classes_at(screen: type[Screen[Any]], size: Size) -> str:
    """The classes of its breakpoints. A screen that begins with them opens 0.1 s sooner: it
    computes styles once.
    """
    sides = (
        (screen.HORIZONTAL_BREAKPOINTS or (), size.width),
        (screen.VERTICAL_BREAKPOINTS or (), size.height),
    )
    return " ".join(
        max(each for each in steps if each[0] <= length)[1] for steps, length in sides if steps
    )


def attention(title: str, words: str, environment: Mapping[str, str]) -> str:
    """The characters to send. Terminals ignore what they do not know, and some know both kinds:
    only one is sent.

    OSC 777 is for VTE (GNOME Terminal and others) and rxvt, OSC 9 for the others: iTerm2, WezTerm,
    kitty, Ghostty, foot, Windows.
    """
    title = plain(title).replace(";", ",")
    words = plain(words).replace(";", ",")
    if "VTE_VERSION" in environment or environment.get("TERM", "").startswith("rxvt"):
        return f"{BELL}\x1b]777;notify;{title};{words}\x1b\\"
    return f"{BELL}\x1b]9;{title}: {words}\x1b\\"


@dataclass(frozen=True, slots=True)
class Config:
    """The user's own settings: `theme` is "" if the terminal decides, `keys` are Textual's names of
    keys by action ids.

    `notify`: the terminal rings and shows a notification when a run needs a look.
    """

    theme: str = ""
    keys: Mapping[str, str] = field(default_factory=dict)
    notify: bool = True


def _commands() -> type[Provider]:
    from ddenv.workbench.help.command_palette import Commands

    return Commands


class Workbench(App[int]):
    """Starts at the setup screen, or attached to a run. Raises UserError for a file that is not a
    run.

    `reading` holds the command line's options on how to read worlds, `file` is a scenario or world
    to start with. With `watch` the run is only watched, never guided. `first` makes another screen
    to start at, and may raise UserError.
    """

    TITLE = "ddenv"
    CSS_PATH = "app.tcss"
    ENABLE_COMMAND_PALETTE = True
    COMMANDS: ClassVar[set[type[Provider] | Callable[[], type[Provider]]]] = {_commands}
    BINDINGS: ClassVar = [
        *keys(
            "app",
            ("leave", "ctrl+q", "leave", "quit", "quit; an engine keeps running"),
            ("suspend", "ctrl+z", "suspend_process", "suspend", "suspend; fg brings it back"),
            (
                "commands",
                "ctrl+p",
                "command_palette",
                "commands",
                "find any command, theme or model by name",
            ),
            priority=True,
        ),
        *keys(
            "app",
            ("theme", "ctrl+t", "change_theme", "theme", "choose the colours for this session"),
            (
                "names",
                "n",
                "map('toggle_layer', 'names')",
                "names",
                "show or hide the models' names on the map",
            ),
            ("screenshot", "f12", "screenshot", "screenshot", "save a picture of the screen (SVG)"),
        ),
    ]

    def __init__(
        self,
        run: Path | None = None,
        reading: Mapping[str, Any] | None = None,
        *,
        watch: bool = False,
        config: Config | None = None,
        file: Path | None = None,
        first: Callable[[], Screen[Any]] | None = None,
    ) -> None:
        super().__init__()
        self._written = CellDiff()
        self._reading = reading
        for theme in OURS:
            self.register_theme(theme)
        config = config or Config()
        self.theme = config.theme or DARK.name
        self._own_keys = config.keys
        self._notifies = config.notify
        self._held: tuple[str, Data] | None = None
        self._first = first
        self._run = run
        self._watch = watch
        self._file = file
        if run is not None:
            from ddenv.workbench.shared.observed import Observed

            # Opened before the screen, so that an error in the file is one line in the terminal.
            Observed(run, strictly=watch).close()

    def compose(self) -> ComposeResult:
        # Shown at once: the first screen takes a moment to load.
        what = "" if self._run is None else f"  opening {plain(self._run.stem)} ..."
        yield Static(Text(" ddenv", "bold").append(what, "not bold dim"), markup=False)

    def get_css_variables(self) -> dict[str, str]:
        variables = super().get_css_variables()
        # Widgets draw with Rich, whose names for the terminal's own colours differ.
        self.theme_variables = for_rich(self.theme_variables)
        return variables

    async def on_event(self, event: events.Event) -> None:
        """As every app, but a key ends the notice that is shown, and tab moves the focus before the
        next key is looked at: that would still go to the field before.
        """
        if isinstance(event, events.Key) and not event.is_forwarded:
            self.clear_notifications()
        key = event.key if isinstance(event, events.Key) and self.app_focus else ""
        bound = self.screen.active_bindings.get(key) if key in ("tab", "shift+tab") else None
        if bound is None or bound.binding.action not in TABS:
            await super().on_event(event)
            return
        # All that this changes is drawn at once: a second picture takes another 17 ms.
        with self.batch_update():
            TABS[bound.binding.action](self.screen)
            for _ in range(LOOPS):
                await asyncio.sleep(0)
        self.screen.check_idle()

    def on_mount(self) -> None:
        self.screen_change_signal.subscribe(self, lambda _: self._show_held())

        # After ctrl+z and fg the terminal is blank, and only changes would be drawn.
        def redraw(_: object) -> None:
            self._written.forget()
            self.refresh(layout=True)

        self.app_resume_signal.subscribe(self, redraw)
        self._write("\x1b[22;2t")
        self.set_keymap(dict(self._own_keys))
        if self.is_headless:
            self._begin()
        else:
            self.call_after_refresh(self._begin)

    def _begin(self) -> None:
        asked = ShowSetup(file=self._file) if self._run is None else ShowRun(self._run, self._watch)
        try:
            self.push_screen(self._screen_for(asked) if self._first is None else self._first())
        except UserError as error:
            self.exit(2, message=Text(f"ddenv: {error}"))
        if not self.is_headless:
            # Looking for garbage in what there is already takes longer than to answer a key.
            self.screen.call_after_refresh(gc.freeze)
            self.screen.call_after_refresh(gc.enable)

    def notify(self, message: str, **options: Any) -> None:
        """As every app, but at most one notice is shown, and none over a dialog: it waits until
        that is closed.
        """
        self._held = message, options
        self._show_held()

    def _show_held(self) -> None:
        if self._held is not None and not any(
            isinstance(screen, ModalScreen) for screen in self.screen_stack[-1:]
        ):
            (message, options) = self._held
            self._held = None
            self.clear_notifications()
            super().notify(message, **options)

    def _screen_for(self, asked: ShowRun | ShowSetup) -> Screen[Any]:
        if isinstance(asked, ShowRun):
            from ddenv.workbench.run.run_screen import RunScreen

            return RunScreen(asked.run, asked.engine, asked.watch, classes_at(RunScreen, self.size))
        from ddenv.workbench.setup.setup_screen import SetupScreen

        return SetupScreen(
            self._reading, asked.like, asked.file, classes_at(SetupScreen, self.size)
        )

    @on(ShowRun)
    @on(ShowSetup)
    def _show(self, asked: ShowRun | ShowSetup) -> None:
        try:
            screen = self._screen_for(asked)
        except UserError as error:
            self.notify(str(error), severity="warning", timeout=4, markup=False)
            return
        while len(self.screen_stack) > 2:
            self.pop_screen()
        self.switch_screen(screen)

    def on_paste(self, event: events.Paste) -> None:
        """A run file that is dropped on the terminal is opened: the terminal pastes its name."""
        path = dropped_run(event.text)
        if path is not None:
            self.post_message(ShowRun(path))

    def action_help(self) -> None:
        from ddenv.workbench.help.shortcuts import Help, groups

        self.push_screen(Help(groups(self.screen)))

    def action_screenshot(self, filename: str | None = None, path: str | None = None) -> None:
        """Into the folder for downloads; servers have none, and there it is the current one."""
        import platformdirs

        super().action_screenshot(
            filename, path or (None if platformdirs.user_downloads_path().is_dir() else ".")
        )

    def action_map(self, does: str, *words: Any) -> None:
        """Has the maps of the screen do something: `zoom`, `fit`, or `toggle_layer`."""
        from ddenv.workbench.map.world_map import WorldMap

        for world in self.screen.query(WorldMap):
            getattr(world, does)(*words)

    def action_signs(self) -> None:
        from ddenv.workbench.help.signs import SignsDialog

        self.push_screen(SignsDialog())

    def action_runs(self) -> None:
        from ddenv.workbench.runs.runs_screen import RunsScreen

        self._push_once(RunsScreen)

    def action_lessons(self) -> None:
        from ddenv.workbench.learn.lessons_screen import LessonsScreen

        self._push_once(LessonsScreen)

    def _push_once(self, kind: type[Screen[Any]]) -> None:
        if not any(type(screen) is kind for screen in self.screen_stack):
            self.push_screen(kind())

    def action_leave(self) -> None:
        """Quits at once. An engine keeps running, and the terminal shows how to attach again."""
        detach = next(
            (
                screen.action_detach
                for screen in self.screen_stack
                if hasattr(screen, "action_detach")
            ),
            None,
        )
        if detach is None:
            self.exit(0)
        else:
            detach()

    async def action_quit(self) -> None:
        self.action_leave()

    def on_resize(self) -> None:
        self._written.forget()

    def _display(self, screen: Screen[Any], renderable: RenderableType | None) -> None:
        super()._display(screen, self._written.fewer(renderable))

    def on_unmount(self) -> None:
        self._write("\x1b[23;2t")

    def watch_title(self, title: str) -> None:
        self._write(f"\x1b]2;{plain(title)}\x07")

    @on(Attention)
    def _get_attention(self, asked: Attention) -> None:
        if self._notifies:
            self._write(attention(f"ddenv {asked.run}", asked.why, os.environ))

    def _write(self, sequence: str) -> None:
        driver = self._driver
        if driver is not None and not self.is_headless:
            driver.write(sequence)
