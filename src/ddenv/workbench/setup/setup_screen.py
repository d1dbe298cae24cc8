"""The setup screen: choose a scenario or a world, see it, set all that is to be set, start; or open an earlier run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

from rich.text import Text
from textual import events, on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.widgets import Footer, OptionList, Static

from ddenv.errors import UserError
from ddenv.workbench.background import tell
from ddenv.workbench.help.dialogs import OpenFile
from ddenv.workbench.map.place import place_of
from ddenv.workbench.map.world_map import Place, WorldMap
from ddenv.workbench.runs.runs_table import RunList
from ddenv.workbench.setup import form
from ddenv.workbench.setup.beginnings import About, FileList
from ddenv.workbench.setup.chosen import Chosen, read_choice, read_run
from ddenv.workbench.setup.costs import Past, past_of
from ddenv.workbench.setup.fields import Explained, OptionsForm
from ddenv.workbench.setup.starting import Starting
from ddenv.workbench.widgets.panes import SetupPanes
from ddenv.workbench.wording import plain, shorten

LEAST = (64, 18)
# From this size on everything is seen at once.
ROOMY = (110, 32)
# From this size on the rarely used settings are seen, too.
VAST = (160, 48)
PANES = {"F2": "choose", "F3": "map", "F4": "settings"}
HEADS = {"choose": "#scenario-list", "map": "#map", "settings": "#algorithm"}


class SetupScreen(Starting):
    """Small terminals show one of three panes at a time: what to choose from, the map, or the settings."""

    CSS_PATH = "setup.tcss"
    HORIZONTAL_BREAKPOINTS: ClassVar = [
        (0, "-thin"),
        (LEAST[0], "-slim"),
        (80, "-narrow"),
        (ROOMY[0], "-wide"),
        (VAST[0], "-vast"),
    ]
    VERTICAL_BREAKPOINTS: ClassVar = [(0, "-flat"), (LEAST[1], "-low"), (ROOMY[1], "-tall"), (VAST[1], "-high")]
    BINDINGS: ClassVar = [
        Binding("ctrl+s,f5", "start", "start", id="setup.start", tooltip="start the reduction", key_display="^s"),
        Binding(
            "f6,ctrl+b",
            "baseline",
            "baseline",
            id="setup.baseline",
            tooltip="start, and pause after the baseline: it shows how often the whole world fails",
            key_display="f6",
        ),
        Binding("f7,ctrl+g", "save", "save", id="setup.save", tooltip="save as a scenario file", key_display="f7"),
        Binding(
            "f8,ctrl+y",
            "copy",
            "copy",
            id="setup.copy",
            tooltip="copy the ddenv run command that does the same",
            key_display="f8",
        ),
        Binding("f9", "more", "more", id="setup.more", tooltip="show or hide the rarely used settings", show=False),
        Binding("ctrl+o", "open", "open", id="setup.open", tooltip="choose a scenario or world file"),
        Binding("s", "pick('start')", "start", id="setup.pick_start", tooltip="set the start on the map", show=False),
        Binding(
            "h", "pick('heading')", "heading", id="setup.pick_heading", tooltip="set the heading on the map", show=False
        ),
        Binding("g", "pick('goal')", "goal", id="setup.pick_goal", tooltip="set the goal on the map", show=False),
        Binding("plus,equals_sign", "zoom(1.25)", "closer", id="setup.closer", tooltip="map: closer", show=False),
        Binding("minus", "zoom(0.8)", "farther", id="setup.farther", tooltip="map: farther away", show=False),
        Binding("0", "fit", "fit", id="setup.fit", tooltip="map: show all that matters", show=False),
        Binding("f2", "pane('choose')", "choose", id="setup.choose", tooltip="to what there is to choose", show=False),
        Binding("f3", "pane('map')", "map", id="setup.map", tooltip="to the map", show=False),
        Binding("f4", "pane('settings')", "settings", id="setup.settings", tooltip="to the settings", show=False),
        Binding("R", "app.runs", "runs", id="setup.runs", tooltip="the list of all runs", show=False),
        Binding("f1,question_mark", "app.help", "help", id="setup.help", tooltip="show every key", key_display="?"),
        Binding(
            "escape", "home", "back", id="setup.home", tooltip="leave picking; back to the list of files", show=False
        ),
        Binding("q", "app.leave", "quit", id="setup.quit", tooltip="leave"),
    ]

    def __init__(self, reading: Mapping[str, Any] | None = None, like: Path | None = None) -> None:
        """`reading` holds the command line's options on how to read worlds; `like` is a run to begin with the settings of."""
        super().__init__()
        self._reading = reading or {}
        self._like = like
        self._opened_now: Path | None = None
        self._keep_places = False
        self._pane = "choose"

    def compose(self) -> ComposeResult:
        with Horizontal(id="header"):
            yield Static(_title(), id="title", markup=False)
            yield SetupPanes(PANES, id="panes")
        with Horizontal(id="body"):
            with Vertical(id="choice"):
                with Vertical(id="scenarios", classes="panel") as panel:
                    panel.border_title = "Scenarios and worlds"
                    panel.border_subtitle = "^o opens a file"
                    yield FileList(id="scenario-list")
                with Vertical(id="runs", classes="panel") as panel:
                    panel.border_title = "Recent runs"
                    panel.border_subtitle = "enter opens"
                    yield RunList(id="run-list")
            with Vertical(id="preview", classes="panel") as panel:
                panel.border_title = "World"
                yield WorldMap(id="map")
                yield Static("", id="picking", markup=False)
                yield About(id="about")
        yield OptionsForm(id="options", classes="panel")
        yield Footer(compact=True, show_command_palette=False)
        yield Static("", id="small", markup=False)

    def on_mount(self) -> None:
        self._list_files()
        self.query_one(FileList).focus()
        if self.size.width >= VAST[0] and self.size.height >= VAST[1]:
            self.call_after_refresh(self.form.toggle_more)

    def on_screen_resume(self) -> None:
        self.query_one(RunList).read()

    def on_resize(self, event: events.Resize) -> None:
        width, height = event.size
        self._arrange()
        self.query_one("#small", Static).update(f"ddenv needs {LEAST[0]} x {LEAST[1]}, this is {width} x {height}")

    # What there is to choose from.

    @work(thread=True, group="recent", exclusive=True)
    def _list_files(self) -> None:
        from ddenv.workbench.setup.beginnings import recent_files
        from ddenv.world.load import SCENARIOS, bundled_names

        bundled = [SCENARIOS / f"{name}.yaml" for name in bundled_names()]
        tell(self, self._offer, bundled, recent_files())

    def _offer(self, bundled: list[Path], recent: list[Path]) -> None:
        files = self.query_one(FileList)
        files.offer(bundled, recent, self._like)
        if not files.option_count:
            self.query_one(WorldMap).set_place(Place(), "no bundled scenarios were found; ctrl+o opens a file")

    @on(FileList.Looked)
    def _looked_at(self, event: FileList.Looked) -> None:
        self._choose(event.path)

    @on(OptionList.OptionSelected, "#scenario-list")
    def _selected(self) -> None:
        self.action_pane("settings")

    @on(OptionList.OptionSelected, "#run-list")
    def _open_run(self, event: OptionList.OptionSelected) -> None:
        from ddenv.workbench.run.run_screen import RunScreen

        recent = self.query_one(RunList).run_of(event.option_id)
        try:
            screen = RunScreen(recent.path)
        except UserError as error:
            self.complain(error)
            return
        self.app.switch_screen(screen)

    # The chosen one, read beside the screen.

    def _choose(self, path: Path) -> None:
        self._keep_places = self.chosen is not None and self.chosen.scenario is None
        self.chosen, self.past, self._awaited = None, Past(), True
        self.pick("")
        self.form.tell("")
        self.tell_outcome()
        self._title_preview(path.name)
        self.query_one("#preview").border_subtitle = ""
        self.query_one(About).tell("")
        self.query_one(WorldMap).set_place(Place(), "reading the world ...")
        self._read(path)

    def _title_preview(self, name: str) -> None:
        self.query_one("#preview").border_title = Text(shorten(plain(name), 40))

    @work(thread=True, group="world", exclusive=True)
    def _read(self, path: Path) -> None:
        from textual.worker import get_current_worker

        from ddenv.runs.folder import runs_folder

        worker = get_current_worker()
        try:
            chosen = read_run(path) if path.suffix == ".ddenv" else read_choice(path, self._reading)
            answer = chosen, place_of(chosen.world, chosen.scenario), _free_name(chosen.settings.name), ""
        except UserError as error:
            answer = None, Place(), "", str(error)
        if worker.is_cancelled:
            return
        tell(self, self._preview, *answer)
        if answer[0] is None:
            return
        if path == self._opened_now:
            self._remember(path)
        past = past_of(answer[0].settings, runs_folder())
        if not worker.is_cancelled:
            tell(self, self._know, answer[0], past)

    def _preview(self, chosen: Chosen | None, place: Place, name: str, wrong: str) -> None:
        self.chosen, self._awaited = chosen, False
        # What was asked for too early is not wrong any more.
        self.form.tell("")
        self.query_one(WorldMap).set_place(place, wrong)
        if chosen is None:
            return
        self._title_preview(chosen.name)
        self.query_one(About).tell(chosen.about)
        self.form.suggest_name(name)
        placed = chosen.scenario is not None
        self.form.show_settings(chosen.settings, placed, self._keep_places)
        self.mark_places()
        if not placed and self._place("spawn") is None:
            self.pick("start")

    def _know(self, chosen: Chosen, past: Past) -> None:
        if chosen is self.chosen:
            self.past, self.form.seconds = past, past.seconds
            self.tell_outcome()

    # Panes.

    @property
    def _roomy(self) -> bool:
        return self.size.width >= ROOMY[0] and self.size.height >= ROOMY[1]

    def _show_pane(self, pane: str) -> None:
        self._pane = pane
        self._arrange()

    def _arrange(self) -> None:
        # Not by classes of the screen, which would have all styles worked out again.
        all, pane = self._roomy, self._pane
        fits = self.size.width >= LEAST[0] and self.size.height >= LEAST[1]
        self.form.display = fits
        self.query_one("#body").display = fits and (all or pane != "settings")
        self.query_one("#choice").display = all or pane == "choose"
        self.form.show_fields(all or pane == "settings")
        self.form.set_class(not all and pane == "settings", "-alone")
        self.form.set_class(not all, "-frameless")
        panes = self.query_one(SetupPanes)
        panes.display = not all
        panes.mark(pane)

    @on(SetupPanes.Asked)
    def _pane_asked(self, event: SetupPanes.Asked) -> None:
        self.action_pane(event.pane)

    def action_pane(self, pane: str) -> None:
        """Shows one of the panes where there is no room for all, and goes there."""
        self._show_pane(pane)
        self.query_one(HEADS[pane]).focus()

    def show_map(self) -> None:
        self.action_pane("map")

    def complain(self, error: UserError) -> None:
        if form.field_of(error) not in (None, form.NAME.id):
            self._show_pane("settings")
        super().complain(error)

    # Other keys.

    def action_scroll(self, pages: int) -> None:
        explained = self.query_one(Explained)
        explained.scroll_relative(y=pages * max(1, explained.size.height - 1), animate=False)

    def action_more(self) -> None:
        self._show_pane("settings")
        self.form.toggle_more()

    def action_zoom(self, factor: float) -> None:
        self.query_one(WorldMap).zoom(factor)

    def action_fit(self) -> None:
        self.query_one(WorldMap).fit()

    def action_open(self) -> None:
        self.app.push_screen(OpenFile(Path.cwd()), self._opened)

    def _opened(self, path: Path | None) -> None:
        if path is not None:
            self._opened_now = path
            self._show_pane("choose")
            self.query_one(FileList).add(path)

    def action_home(self) -> None:
        if self.picked_next:
            self.pick("")
        else:
            self.action_pane("choose")


def _title() -> Text:
    return Text(" ddenv", "bold", no_wrap=True).append("  find the few models that make a robot fail", "not bold dim")


def _free_name(name: str) -> str:
    """The name that the next run of a scenario gets."""
    from ddenv.runs.folder import free_run_path

    try:
        return free_run_path(name).stem
    except OSError:
        return "run"
