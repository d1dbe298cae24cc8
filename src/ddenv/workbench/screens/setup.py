"""The setup screen: choose a scenario or a world, see it, set the options, start; or open an earlier run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.screen import Screen
from textual.widgets import Footer, Input, OptionList, Static
from textual.widgets.option_list import Option

from ddenv.errors import UserError
from ddenv.workbench import form
from ddenv.workbench.chosen import Chosen, read_choice
from ddenv.workbench.place import place_of
from ddenv.workbench.processes import Engine
from ddenv.workbench.screens.dialogs import Help, OpenFile
from ddenv.workbench.widgets.about import About
from ddenv.workbench.widgets.map import Place, WorldMap
from ddenv.workbench.widgets.options import OptionsForm
from ddenv.workbench.widgets.runs import RunList
from ddenv.workbench.widgets.schema import Explained, SchemaSelect
from ddenv.workbench.wording import plain, shorten

if TYPE_CHECKING:
    from ddenv.world.scenario import Scenario


class SetupScreen(Screen[None]):
    """Nothing is written before Start, and then only if everything fits."""

    CSS_PATH = "setup.tcss"
    HORIZONTAL_BREAKPOINTS: ClassVar = [(0, "-thin"), (64, "-slim"), (80, "-narrow"), (110, "-wide")]
    VERTICAL_BREAKPOINTS: ClassVar = [(0, "-flat"), (18, "-low"), (24, "-short"), (34, "-tall")]
    BINDINGS: ClassVar = [
        Binding("ctrl+s,f5", "start", "start", id="setup.start", tooltip="start the reduction", key_display="ctrl+s"),
        Binding("ctrl+o", "open", "open a file", id="setup.open", tooltip="choose a scenario or world file"),
        Binding("f1,question_mark", "help", "help", id="setup.help", tooltip="show every key", key_display="?"),
        Binding(
            "escape", "home", "back to the list", id="setup.home", tooltip="back to the list of scenarios", show=False
        ),
        Binding("ctrl+q,q", "app.leave", "quit", id="setup.quit", tooltip="leave", key_display="q"),
    ]

    def __init__(self, reading: Mapping[str, Any] | None = None) -> None:
        """`reading` holds the command line's options on how to read worlds."""
        super().__init__()
        self._reading = reading or {}
        self._chosen: Chosen | None = None
        self._files: dict[str, Path] = {}
        self._starting = False

    def compose(self) -> ComposeResult:
        yield Static(self._title(), id="header", markup=False)
        with Horizontal(id="body"):
            with Vertical(id="choice"):
                with Vertical(id="scenarios", classes="panel") as panel:
                    panel.border_title = "Scenarios"
                    panel.border_subtitle = "^o opens"
                    yield OptionList(id="scenario-list", compact=True, markup=False)
                with Vertical(id="runs", classes="panel") as panel:
                    panel.border_title = "Recent runs"
                    panel.border_subtitle = "enter opens"
                    yield RunList(id="run-list")
            with Vertical(id="right"):
                with Vertical(id="preview", classes="panel") as panel:
                    panel.border_title = "World"
                    yield WorldMap(id="map")
                    yield About(id="about")
                yield Explained(id="explained", classes="panel", can_focus=False)
                yield OptionsForm(id="options", classes="panel")
        yield Footer(compact=True, show_command_palette=False)
        yield Static("Please make the terminal larger: at least 64 x 18.", id="small", markup=False)

    @staticmethod
    def _title() -> Text:
        return Text(" ddenv", "bold", no_wrap=True).append(
            "  find the few models that make a robot fail", "not bold dim"
        )

    def on_mount(self) -> None:
        self._list_scenarios()
        self.query_one("#scenario-list").focus()

    def on_screen_resume(self) -> None:
        self.query_one(RunList).read()

    # Left: what there is to choose from.

    def _list_scenarios(self) -> None:
        from ddenv.world.bundled import SCENARIOS, bundled_names

        for name in bundled_names():
            self._offer(SCENARIOS / f"{name}.yaml")
        if self._files:
            self.query_one("#scenario-list", OptionList).highlighted = 0
        else:
            self.query_one(WorldMap).set_place(Place(), "no bundled scenarios were found; ctrl+o opens a file")

    def _offer(self, path: Path) -> str:
        """Puts a file on the list, once."""
        key = str(path)
        if key not in self._files:
            self._files[key] = path
            words = path.stem if path.suffix == ".yaml" else path.name
            self.query_one("#scenario-list", OptionList).add_option(Option(Text(plain(words), no_wrap=True), id=key))
        return key

    @on(OptionList.OptionSelected, "#run-list")
    def _open_run(self, event: OptionList.OptionSelected) -> None:
        from ddenv.workbench.screens.run import RunScreen

        recent = self.query_one(RunList).run_of(event.option_id)
        try:
            screen = RunScreen(recent.path)
        except UserError as error:
            self._complain(error)
            return
        self.app.switch_screen(screen)

    @on(OptionList.OptionHighlighted, "#scenario-list")
    def _highlighted(self, event: OptionList.OptionHighlighted) -> None:
        if event.option_id in self._files:
            self._choose(self._files[event.option_id])

    @on(OptionList.OptionSelected, "#scenario-list")
    def _selected(self) -> None:
        self.query_one("#algorithm").focus()

    # Right: the chosen one, read beside the screen.

    def _choose(self, path: Path) -> None:
        self._chosen = None
        self._form.tell("")
        self.query_one("#preview").border_title = Text(shorten(plain(path.name), 40))
        self.query_one("#preview").border_subtitle = ""
        self.query_one(About).tell("")
        self.query_one(WorldMap).set_place(Place(), "reading the world ...")
        self._read(path)

    @work(thread=True, group="world", exclusive=True)
    def _read(self, path: Path) -> None:
        from textual.worker import get_current_worker

        worker = get_current_worker()
        try:
            chosen = read_choice(path, self._reading)
            answer = chosen, place_of(chosen.world, chosen.scenario), ""
        except UserError as error:
            answer = None, Place(), str(error)
        if not worker.is_cancelled:
            self.app.call_from_thread(self._preview, *answer)

    def _preview(self, chosen: Chosen | None, place: Place, wrong: str) -> None:
        if not self.is_attached:
            return
        from ddenv.launch.runs import free_run_path

        self._chosen = chosen
        self.query_one(WorldMap).set_place(place, wrong)
        if chosen is None:
            return
        scenario = chosen.scenario
        self._form.ask_for_places(scenario is None)
        self.query_one("#preview").border_title = Text(shorten(plain(chosen.name), 40))
        self.query_one(About).tell(chosen.about)
        self._form.show_settings(chosen.settings)
        self._form.suggest_name(free_run_path(chosen.settings.name).stem)
        self._mark_places()

    @on(OptionsForm.PlaceEdited)
    def _mark_places(self) -> None:
        """Shows spawn and goal on the map while they are typed."""
        if self._chosen is None or self._chosen.scenario is not None:
            return
        spawn, goal = self._typed("spawn"), self._typed("goal")
        self.query_one(WorldMap).set_marks(spawn and (spawn[0], spawn[1], spawn[3]), goal and (goal[0], goal[1]))

    def _typed(self, what: str) -> tuple[float, ...] | None:
        try:
            return self._form.place(what)
        except UserError:
            return None

    # Between: what the algorithm, the partitioning or the prioritization does.

    @on(OptionsForm.Explain)
    def _explain(self, event: OptionsForm.Explain) -> None:
        self.query_one(Explained).show(event.kind, event.name, self._form.method["algorithm"], event.here)

    def on_descendant_focus(self) -> None:
        """Small terminals show the explanation in place of the world, while it is asked for."""
        looking = isinstance(self.focused, SchemaSelect) or isinstance(self.focused.parent, SchemaSelect)
        self.set_class(looking, "-looking")

    def action_scroll(self, pages: int) -> None:
        explained = self.query_one(Explained)
        explained.scroll_relative(y=pages * max(1, explained.size.height - 1), animate=False)

    @property
    def _form(self) -> OptionsForm:
        return self.query_one(OptionsForm)

    # Start.

    def on_button_pressed(self) -> None:
        self.action_start()

    @on(Input.Submitted)
    def _submitted(self) -> None:
        self.action_start()

    def action_start(self) -> None:
        if self._starting:
            return
        try:
            scenario, jobs, path = self._asked_for()
        except UserError as error:
            self._complain(error)
            return
        self._starting = True
        self._form.tell("checking ...")
        self._create(scenario, jobs, path, self._form.accept_mode)

    def _asked_for(self) -> tuple[Scenario, int, Path]:
        """What the form says. Raises UserError."""
        from ddenv.launch.runs import find_run
        from ddenv.launch.scenarios import scenario_for_world, with_options

        if self._chosen is None:
            raise UserError("choose a scenario or a world that can be read first")
        texts = self._form.texts
        options = form.values(form.OPTIONS, texts)
        name = str(form.value(form.NAME, texts["name"]))
        jobs = form.jobs(options.pop("jobs"))
        scenario = self._chosen.scenario
        if scenario is None:
            scenario = scenario_for_world(self._chosen.path, self._form.place("spawn"), self._form.place("goal"))
        path = find_run(name)
        if path.exists():
            raise form.FieldError("name", f"run name: {path} exists already; choose another name")
        options |= self._form.method
        return with_options(scenario, reading=self._chosen.reading, **options), jobs, path

    @work(thread=True, group="start", exclusive=True)
    def _create(self, scenario: Scenario, jobs: int, path: Path, mode: str) -> None:
        from ddenv.launch.runs import create_run

        engine = Engine(path)
        try:
            create_run(scenario, path)
            engine.start(jobs, mode)
        except UserError as error:
            self.app.call_from_thread(self._complain, error)
            return
        self.app.call_from_thread(self._started, path, engine)

    def _started(self, path: Path, engine: Engine) -> None:
        from ddenv.workbench.screens.run import RunScreen

        self.app.switch_screen(RunScreen(path, engine))

    def _complain(self, error: UserError) -> None:
        self._starting = False
        self._form.complain(error)

    # Other keys.

    def action_open(self) -> None:
        self.app.push_screen(OpenFile(Path.cwd()), self._opened)

    def _opened(self, path: Path | None) -> None:
        if path is not None:
            options = self.query_one("#scenario-list", OptionList)
            options.highlighted = options.get_option_index(self._offer(path))
            options.focus()

    def action_home(self) -> None:
        self.query_one("#scenario-list").focus()

    def action_help(self) -> None:
        bindings = (*self.BINDINGS, *SchemaSelect.BINDINGS)
        keys = [(binding.key_display or binding.key, binding.tooltip) for binding in bindings]
        more = [
            ("tab", "next field"),
            ("enter", "in a list: take it; in a field: start"),
            ("ctrl+p", "commands: themes, screenshot"),
        ]
        self.app.push_screen(Help(keys + more))
