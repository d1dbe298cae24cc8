"""The setup screen: choose a scenario or a world, see it, change its settings, start; or open an
earlier run.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.text import Text
from textual import events, on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.reactive import Reactive
from textual.screen import Screen
from textual.widget import Widget
from textual.widgets import Button, Input, OptionList, Static

from ddenv.errors import UserError
from ddenv.text import Names, plain
from ddenv.workbench.help.footer import KeyFooter
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.runs.runs_table import RunList
from ddenv.workbench.setup import form
from ddenv.workbench.setup.choice import Choice
from ddenv.workbench.setup.fields import OptionsForm
from ddenv.workbench.setup.files import FileList, OpenFile, SaveScenario, recent_files
from ddenv.workbench.setup.missing_files import kinds
from ddenv.workbench.setup.preview import Preview
from ddenv.workbench.setup.start_run import NO_COMMAND, command_words, create, run_file, whole_cost
from ddenv.workbench.shared.background import call_if_open
from ddenv.workbench.shared.bindings import HELP, MAP_KEYS, ids, keys
from ddenv.workbench.shared.messages import ShowRun
from ddenv.workbench.widgets.panes import Panes
from ddenv.workbench.widgets.question import once_trusted

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario

SMALLEST = (64, 18)
# From this size on all panes are shown at once.
ROOMY = (110, 32)
PANES = {"choose": "f2 choose", "map": "f3 map", "settings": "f4 settings"}
BASELINE = "start, and pause after the baseline: it shows how often the whole world fails"
# Where the focus goes in each pane.
HEADS = {"choose": "#scenario-list", "map": "#map", "settings": "#algorithm"}


# In the footer.
FIRST = ids("setup", "help quit start baseline save copy open")


class SetupScreen(Screen[None]):
    """Small terminals show one of three panes at a time: the list of choices, the map, or the
    settings.

    Nothing is written before the user starts a run, and then only if all settings are valid.
    """

    CSS_PATH = "setup.tcss"
    HORIZONTAL_BREAKPOINTS = [
        (0, "-thin"),
        (SMALLEST[0], "-slim"),
        (80, "-narrow"),
        (ROOMY[0], "-wide"),
        (160, "-vast"),
    ]
    VERTICAL_BREAKPOINTS = [(0, "-flat"), (SMALLEST[1], "-low"), (ROOMY[1], "-tall"), (48, "-high")]
    BINDINGS: ClassVar = keys(
        "setup",
        ("start", "ctrl+s,f5", "start", "start", "start the reduction", "^s"),
        ("baseline", "f6,ctrl+b", "start(True)", "baseline", BASELINE, "f6"),
        ("save", "f7,ctrl+g", "save", "save", "save as a scenario file", "f7"),
        (
            "copy",
            "f8,ctrl+y",
            "copy",
            "copy",
            "copy the ddenv run command that does the same",
            "f8",
        ),
        ("more", "f9", "more", "more", "show or hide the rarely used settings"),
        ("open", "ctrl+o", "open", "open", "choose a scenario or world file"),
        ("pick_start", "s", "pick('start')", "start", "set the start on the map"),
        ("pick_heading", "h", "pick('heading')", "heading", "set the heading on the map"),
        ("pick_goal", "g", "pick('goal')", "goal", "set the goal on the map"),
        (
            "missing",
            "m",
            "missing",
            "missing",
            "to what cannot be used, such as missing files, and its remedies",
        ),
        *MAP_KEYS,
        ("choose", "f2", "pane('choose')", "choose", "to the scenarios, worlds and runs"),
        ("map", "f3", "pane('map')", "map", "to the map"),
        ("settings", "f4", "pane('settings')", "settings", "to the settings"),
        ("runs", "R", "app.runs", "runs", "the list of all runs"),
        ("lessons", "L", "app.lessons", "lessons", "lessons on delta debugging"),
        HELP,
        ("home", "escape", "home", "back", "stop picking; back to the list of files"),
        ("quit", "q", "app.leave", "quit", "leave"),
    )
    # As on the run screen, the widgets draw what the focus changes.
    focused: Reactive[Widget | None] = Reactive(None, repaint=False)

    def __init__(
        self,
        reading: Mapping[str, Any] | None = None,
        like: Path | None = None,
        file: Path | None = None,
        classes: str = "",
    ) -> None:
        """`reading` holds the command line's options for reading worlds. `classes` fit the size.

        The form starts with the settings of the run `like`, or of the scenario or world `file`.
        """
        super().__init__(classes=classes)
        self._reading = reading or {}
        self._like = like
        self._file = file
        self.form = OptionsForm(id="options")
        self.preview = Preview(self.form, self._reading, id="preview")
        self._opened_now: Path | None = None
        self._busy = False
        self._pane = "choose"

    def compose(self) -> ComposeResult:
        with Horizontal(id="header"):
            title = Text(" ddenv", "bold", no_wrap=True)
            yield Static(title.append("  find what makes a robot fail", "not bold dim"), id="title")
            yield Panes(PANES, id="panes")
        with Horizontal(id="body"):
            with Vertical(id="choice"):
                with Framed(
                    "Scenarios and worlds", "^o opens a file", id="scenarios", classes="panel"
                ):
                    yield FileList(id="scenario-list")
                with Framed("Recent runs", "enter opens", id="runs", classes="panel"):
                    yield RunList(id="run-list")
            yield self.preview
        yield self.form
        yield KeyFooter(FIRST, self._keys_here)
        yield Static("", id="small", markup=False)

    def on_mount(self) -> None:
        # Reading scenarios, worlds and runs computes for longer than the first picture, which would
        # wait for that.
        self.call_after_refresh(self._list_files)
        self.query_one(FileList).focus()

    def on_screen_resume(self) -> None:
        self.call_after_refresh(self.query_one(RunList).read)

    def on_resize(self, event: events.Resize) -> None:
        width, height = event.size
        self._arrange()
        words = f"ddenv needs {SMALLEST[0]} x {SMALLEST[1]}; this terminal has {width} x {height}"
        self.query_one("#small", Static).update(words)

    @work(thread=True, group="recent", exclusive=True)
    def _list_files(self) -> None:
        from ddenv.world.load import SCENARIOS, bundled_names

        bundled = [SCENARIOS / f"{name}.yaml" for name in bundled_names()]
        recent = recent_files()

        def offer() -> None:
            files = self.query_one(FileList)
            files.offer(bundled, recent, self._like)
            if self._file is not None:
                self._opened(self._file)
            elif not files.option_count:
                self.preview.show_nothing("there are no bundled scenarios; ctrl+o opens a file")

        call_if_open(self, offer)

    @on(OptionList.OptionSelected, "#scenario-list")
    def _selected(self) -> None:
        if self.preview.choice is not None and self.preview.asks:
            self.action_pick("start")
        else:
            self.action_pane("settings")

    @on(OptionList.OptionSelected, "#run-list")
    def _open_run(self, event: OptionList.OptionSelected) -> None:
        self.post_message(ShowRun(self.query_one(RunList).run_of(event.option_id).path))

    def action_open(self) -> None:
        self.app.push_screen(OpenFile(), self._opened)

    def _opened(self, path: Path | None) -> None:
        if path is not None:
            self._opened_now = path
            self._show_pane("choose")
            self.query_one(FileList).add(path)

    @on(FileList.Looked)
    def _choose(self, event: FileList.Looked) -> None:
        self.form.show_message("")
        self.preview.read(event.path, opened=event.path == self._opened_now)
        self._show_outcome()

    @on(Preview.Read)
    def _was_read(self, event: Preview.Read) -> None:
        # An error about a key pressed too early is out of date.
        self.form.show_message("")
        self._show_outcome()
        if event.opened and self.preview.asks:
            self.action_pick("start")

    def action_pick(self, what: str) -> None:
        if self.preview.choice is None:
            self.notify("there is no world to pick a place in yet", severity="warning", timeout=3)
            return
        self.action_pane("map")
        self.preview.pick(what)

    def action_missing(self) -> None:
        self._show_pane("map")
        (self.preview.missing if self.preview.missing.display else self.preview.map).focus()

    @on(OptionsForm.Edited)
    def _edited(self, event: OptionsForm.Edited) -> None:
        if event.place:
            self.preview.show_places()
        self._show_outcome()

    @on(Preview.PastRead)
    def _show_outcome(self) -> None:
        cost = ""
        words = ""
        typed = True
        if self.preview.choice is not None or not self.preview.awaited:
            try:
                choice, scenario = self._asked()
                command = self._command(choice, scenario)
                words = shlex.join(command) or NO_COMMAND
                typed = bool(command)
                cost = whole_cost(scenario, choice.models, self.form.jobs, self.preview.past)
            except UserError as error:
                cost = f"not ready: {error}"
        self.form.show_outcome(cost, words, typed)

    def _asked(self) -> tuple[Choice, Scenario]:
        """The choice, and its scenario with the form's settings. Raises UserError while there is
        none.
        """
        choice = self.preview.choice
        (pair, algorithm) = self.form.method
        if choice is None:
            awaited = "the world is still being read: try again in a moment"
            raise UserError(
                awaited if self.preview.awaited else "choose a scenario or a world that can be read"
            )
        # A guess is shown, but only run with if the user takes it.
        if undecided := [each for each in choice.missing if not each.remedy]:
            raise UserError(f"{kinds(undecided)} without a remedy: press m")
        return choice, form.asked_of(choice.settings, self.form.texts, pair, algorithm)

    def _command(self, choice: Choice, scenario: Scenario) -> list[str]:
        if choice.run:
            return []
        return command_words(choice, scenario, self.form.jobs, self.form.own_name)

    def action_copy(self) -> None:
        try:
            words = self._command(*self._asked())
        except UserError as error:
            self._complain(error)
            return
        if not words:
            self.notify(NO_COMMAND, severity="warning", timeout=4)
            return
        self.app.copy_to_clipboard(shlex.join(words))
        self.notify("command copied, if the terminal allows it", timeout=3)

    @on(Button.Pressed, "#start")
    @on(Input.Submitted)
    def _start_pressed(self) -> None:
        self.action_start()

    def action_start(self, only_baseline: bool = False) -> None:
        from ddenv.runs.trust import trust_own

        if self._busy:
            return
        texts = self.form.texts
        try:
            choice, scenario = self._asked()
            path = run_file(scenario.name, str(form.value(form.NAME, texts[form.NAME.name])))
            jobs = self.form.jobs
            mode = texts["accept"]
        except UserError as error:
            self._complain(error)
            return

        def answered(trusts: bool) -> None:
            if trusts:
                self._create(choice, scenario, path, jobs, mode, only_baseline)
            else:
                self._complain(UserError("not started: it needs a program that you do not trust"))

        self._busy = True
        self.form.show_message("checking ...")
        # A run file is never the user's own: somebody may have sent it.
        if not choice.run:
            trust_own(scenario, choice.path)
        once_trusted(self.app, scenario, choice.path, answered)

    @work(thread=True, group="start", exclusive=True)
    def _create(
        self,
        choice: Choice,
        scenario: Scenario,
        path: Path,
        jobs: int,
        mode: str,
        only_baseline: bool,
    ) -> None:
        try:
            engine = create(choice, scenario, path, jobs, mode, only_baseline)
        except UserError as error:
            call_if_open(self, self._complain, error)
            return
        call_if_open(self, self.post_message, ShowRun(path, engine=engine))

    def _complain(self, error: UserError) -> None:
        self._busy = False
        if isinstance(error, form.FieldError) and form.NAME.name not in error.wrong:
            self._show_pane("settings")
        self.form.complain(error)

    def action_save(self) -> None:
        try:
            _, scenario = self._asked()
        except UserError as error:
            self._complain(error)
            return

        def written(path: Path | None) -> None:
            if path is not None:
                self.notify(plain(f"wrote {path}"), timeout=5, markup=False)
                self._opened(path)

        self.app.push_screen(SaveScenario(scenario), written)

    def _show_pane(self, pane: str) -> None:
        self._pane = pane
        self._arrange()

    def _arrange(self) -> None:
        # Not by classes of the screen: these would compute all styles again.
        (width, height) = self.size
        pane = self._pane
        all = width >= ROOMY[0] and height >= ROOMY[1]
        fits = width >= SMALLEST[0] and height >= SMALLEST[1]
        self.form.display = fits
        self.query_one("#body").display = fits and (all or pane != "settings")
        self.query_one("#choice").display = all or pane == "choose"
        self.form.show_fields(all or pane == "settings")
        self.form.set_class(not all and pane == "settings", "-alone")
        self.preview.set_class(not all and pane == "map", "-alone")
        self.form.set_class(not all, "-frameless")
        panes = self.query_one(Panes)
        panes.display = not all
        panes.mark(pane)

    def _keys_here(self) -> Names:
        """The ids of the keys in the footer: those of what has the focus come first."""
        bindings = () if self.focused is None else Binding.make_bindings(self.focused.BINDINGS)
        return (*dict.fromkeys(each.id for each in bindings if each.show and each.id), *FIRST)

    @on(Panes.Chosen)
    def _pane_chosen(self, event: Panes.Chosen) -> None:
        self.action_pane(event.pane)

    def action_pane(self, pane: str) -> None:
        self._show_pane(pane)
        self.query_one(HEADS[pane]).focus()

    def action_more(self) -> None:
        self._show_pane("settings")
        self.form.toggle_more()

    def action_home(self) -> None:
        if self.preview.picked_next:
            self.preview.pick("")
        else:
            self.action_pane("choose")
