"""The dialog that exports a run: what is left as a world and a scenario, a report, a bundle,
messages, a test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import ClassVar

from textual import events, on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal, VerticalScroll
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Button, Checkbox, Input, Static
from textual.worker import get_current_worker

from ddenv.errors import UserError
from ddenv.text import count, first_of, plain, shortened
from ddenv.words.claims import ended
from ddenv.workbench.help.hints import Framed
from ddenv.workbench.shared.background import call_if_open, is_open
from ddenv.workbench.shared.bindings import HELP, keys
from ddenv.workbench.widgets.path_entry import PathEntry
from ddenv.world.access import WORLD_ENDINGS, ending_of, is_directives, without_tilde

# What can be written: its id, its label, how the suggested name ends, and the endings that a name
# may have.
KINDS = (
    ("world", "world (SDF)", ".minimal", WORLD_ENDINGS),
    ("scenario", "scenario (YAML)", ".minimal.yaml", (".yaml", ".yml")),
    ("report", "report (HTML)", ".html", (".html", ".htm", ".md")),
    ("bundle", "bundle (ZIP)", ".zip", (".zip",)),
    ("mcap", "messages (MCAP)", ".mcap", (".mcap",)),
    ("test", "pytest (folder)", "", ("",)),
)
TICKED = ("world", "scenario", "report")
# What the one under the cursor is good for.
MEANINGS = {
    "world": "The world that is left, for Gazebo or any other simulator.",
    "scenario": "Runs the robot in that world, with 'ddenv run' or 'ddenv test'.",
    "report": "A page to read, print or mail.",
    "bundle": "All that a colleague needs: run, world, report, ISSUE.md, repro.py.",
    "mcap": "ROS 2 messages for Foxglove, Rerun and ros2 bag; takes a few runs.",
    "test": "A test that fails as long as the robot does, with the run beside it.",
}
WRITING = "writing ... escape stops it"
# Maximum number of existing files to name, of files that a world needs to name, and of characters
# of each of those.
MOST_NAMED = 3
MOST_NEEDS = 3
LONGEST_NEED = 60
# The files to write, by the ids of `KINDS`.
Wanted = Mapping[str, Path]


class Tick(Checkbox):
    """A checkbox that is empty when it is off, so that nothing depends on colour alone. Only space
    ticks it: enter writes.
    """

    BINDINGS: ClassVar = [Binding("enter", "screen.write", show=False)]

    def render(self) -> Content:
        self.BUTTON_INNER = "X" if self.value else " "
        return super().render()


class ExportScreen(ModalScreen[None]):
    """Asks what to write and where, writes it, and says what was written."""

    CSS_PATH = "export.tcss"
    AUTO_FOCUS = "#export-world"
    BINDINGS: ClassVar = [
        *keys(
            "export", ("write", "ctrl+s", "write", "write", "write the chosen files"), priority=True
        ),
        *keys(
            "export",
            HELP,
            ("close", "escape", "dismiss", "close", "close this dialog"),
            ("next", "down", "app.focus_next", "", "the next field"),
            ("previous", "up", "app.focus_previous", "", "the field before"),
        ),
    ]

    def __init__(self, run: Path, world: Path = Path()) -> None:
        super().__init__()
        # Not `run`, which is a method of every screen.
        self._file = run
        self._world = world
        self._agreed: frozenset[Path] = frozenset()
        self._busy = False

    def compose(self) -> ComposeResult:
        stem = "".join(char if char.isprintable() else "-" for char in self._file.stem)
        folder = Path.home()
        with suppress(OSError):
            folder = Path.cwd()
        with Framed(
            "Export", "tab moves   space ticks   enter writes   ? help   escape closes", id="export"
        ):
            yield Static("", id="export-left", markup=False)
            with Horizontal(classes="row"):
                yield Static("folder", classes="name", markup=False)
                yield PathEntry(str(folder), id="export-folder")
            for id, title, end, _ in KINDS:
                if end:
                    name = f"{stem}{end}{ending_of(self._world) if id == 'world' else ''}"
                else:
                    name = "."
                with Horizontal(classes="row"):
                    title = title.replace("SDF", "YAML") if is_directives(self._world) else title
                    yield Tick(title, id in TICKED, id=f"export-{id}", compact=True, classes="name")
                    yield Input(name, id=f"export-{id}-name", compact=True)
            yield Static("", id="export-meaning", markup=False)
            with VerticalScroll(id="export-results", can_focus=False):
                yield Static("", id="export-words", markup=False)
                yield Static("", id="export-wrong", classes="wrong", markup=False)
            with Horizontal(id="export-buttons"):
                yield Button("Write", id="export-write", variant="primary", compact=True)

    @work(thread=True, group="look")
    def on_mount(self) -> None:
        """Says how much of the world would be written, or why nothing can be."""
        from ddenv.runfile.fold import fold
        from ddenv.runfile.store import RunFile

        try:
            with RunFile(self._file) as file:
                state = fold(file.events())
            words = f"{len(state.environment)} of {count(len(state.elements), 'model')} left"
            words += f": {ended(state)}" if state.ended else " so far: not minimal yet."
        except UserError as error:
            words = str(error)
        call_if_open(self, self.query_one("#export-left", Static).update, words)

    def on_descendant_focus(self, event: events.DescendantFocus) -> None:
        kind = (event.widget.id or "").removeprefix("export-").removesuffix("-name")
        self.query_one("#export-meaning", Static).update(MEANINGS.get(kind, ""))

    @on(Checkbox.Changed)
    def _chosen(self, event: Checkbox.Changed) -> None:
        """Keeps scenario and world together: a scenario needs the world that is written with it."""
        self._forget()
        if event.checkbox.id == "export-scenario" and event.value:
            self.query_one("#export-world", Checkbox).value = True
        if event.checkbox.id == "export-world" and not event.value:
            self.query_one("#export-scenario", Checkbox).value = False

    @on(Input.Changed)
    def _forget(self) -> None:
        self._agreed = frozenset()
        self.query_one("#export-write", Button).label = "Write"

    @on(Input.Submitted)
    @on(Button.Pressed, "#export-write")
    def action_write(self) -> None:
        if self._busy:
            return
        try:
            wanted = self._wanted()
        except UserError as error:
            self._report("", str(error))
            return
        self._busy = True
        self._report(WRITING)
        self._write(wanted)

    def _wanted(self) -> Wanted:
        """Raises UserError for names that cannot be used."""
        folder = without_tilde(self._value("folder") or ".")
        wanted = {}
        for id, title, _, endings in KINDS:
            if not self.query_one(f"#export-{id}", Checkbox).value:
                continue
            name = self._value(f"{id}-name")
            if not name or not f"{folder}{name}".isprintable():
                raise UserError(
                    f"{title}: give a name{f' that ends in {endings[0]}' if endings[0] else ''}"
                )
            wanted[id] = folder / without_tilde(name)
            if endings[0] and not wanted[id].name.lower().endswith(endings):
                raise UserError(f"{title}: '{name}' does not end in {' or '.join(endings)}")
        if not wanted:
            raise UserError("nothing is chosen: tick what to write (space)")
        return wanted

    def _value(self, id: str) -> str:
        return self.query_one(f"#export-{id}", Input).value.strip()

    @work(thread=True, group="write")
    def _write(self, wanted: Wanted) -> None:
        from ddenv.report.report import is_there

        there = [path for path in files_of(wanted) if is_there(path)]
        if there and not self._agreed.issuperset(there):
            call_if_open(self, self._ask, there)
            return
        written = list[str]()
        wrong = ""
        worker = get_current_worker()
        try:
            for line in write(self._file, wanted, lambda: worker.is_cancelled):
                written.append(line)
                call_if_open(self, self._report, "\n".join([*written, WRITING]))
        except UserError as error:
            wrong = str(error)
        self.app.call_from_thread(self._done, written, wrong)

    def _ask(self, there: list[Path]) -> None:
        self._busy = False
        self._agreed = frozenset(there)
        names = first_of([plain(path.name) for path in there], MOST_NAMED)
        verb = "exists" if len(there) == 1 else "exist"
        self._report("", f"{names} {verb} already. Write again to replace, or give other names.")
        self.query_one("#export-write", Button).label = "Replace"

    def _done(self, written: list[str], wrong: str) -> None:
        if not is_open(self):
            self.app.notify(
                wrong or "\n".join(written),
                severity="error" if wrong else "information",
                markup=False,
            )
            return
        self._busy = False
        self._forget()
        self._report("\n".join(written), wrong)

    def _report(self, words: str, wrong: str = "") -> None:
        self.query_one("#export-words", Static).update(words)
        self.query_one("#export-wrong", Static).update(wrong)


def files_of(wanted: Wanted) -> Iterator[Path]:
    """The files that would be replaced: a bundle and a test replace nothing."""
    from ddenv.report.report import files_of as files_of_report

    for id, path in wanted.items():
        if id == "report":
            yield from files_of_report(path)
        elif id not in ("bundle", "test"):
            yield path
        if id == "scenario":
            yield from (path.with_suffix(f".robot{kind}") for kind in (".sdf", ".urdf"))


def write(run: Path, wanted: Wanted, stopped: Callable[[], bool]) -> Iterator[str]:
    """Writes the files; yields a line for each. Raises UserError for the first that cannot be
    written, and once it is `stopped`.
    """
    from ddenv.report.bundle import write_bundle, write_test
    from ddenv.report.report import write_report
    from ddenv.runs.export import export_world
    from ddenv.runs.programs import export_mcap

    if "world" in wanted:
        exported = export_world(run, wanted["world"], wanted.get("scenario"))
        yield from (f"wrote {plain(path)}" for path in exported.files)
        if exported.needs:
            needs = [shortened(uri, LONGEST_NEED) for uri in exported.needs]
            yield f"the world still needs {first_of(needs, MOST_NEEDS)}"
    for id, writer in (
        ("report", partial(write_report, force=True)),
        ("bundle", write_bundle),
        ("test", write_test),
    ):
        if id in wanted:
            yield from (f"wrote {plain(path)}" for path in writer(run, wanted[id]))
    if "mcap" in wanted:
        export_mcap(run, wanted["mcap"], stopped)
        yield f"wrote {plain(wanted['mcap'])}"
