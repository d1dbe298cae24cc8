"""The list of recent runs on the setup screen, and what is told of one run beside a list."""

from __future__ import annotations

from rich.text import Text
from textual import work
from textual.widgets import OptionList
from textual.widgets.option_list import Option

from ddenv.map.names import shortened
from ddenv.workbench.beside import tell
from ddenv.workbench.recent import SHOWN, Recent, RunsFolder
from ddenv.workbench.wording import count, plain

# Of the models that are left so many are named.
MOST_NAMES = 40


class RunList(OptionList):
    """The runs of the runs folder, read beside the screen."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, compact=True, markup=False)
        self._runs: dict[str, Recent] = {}
        self._folder: RunsFolder | None = None

    def run_of(self, option_id: str | None) -> Recent:
        """The run that an option stands for."""
        return self._runs[option_id or ""]

    @work(thread=True, group="runs", exclusive=True)
    def read(self) -> None:
        """Lists what is in the folder now."""
        from ddenv.launch.folder import runs_folder

        self._folder = self._folder or RunsFolder(runs_folder())
        runs = self._folder.look(most=SHOWN)
        tell(self, self._show, runs)

    def _show(self, runs: list[Recent]) -> None:
        self._runs = {str(run.path): run for run in runs}
        self.clear_options()
        for run in runs:
            text = Text(f"{run.sign} {plain(run.path.stem)}", no_wrap=True, overflow="ellipsis")
            self.add_option(Option(text.append(f"  {run.words}", "dim"), id=str(run.path)))
        if not runs:
            self.add_option(Option(Text("none yet", "dim"), disabled=True))


def about(run: Recent, width: int) -> Text:
    """All that is known of a run, for a column so wide."""
    text = Text(shortened(plain(run.path.stem), width), "bold").append("\n")
    if run.trouble:
        return text.append(f"\n{plain(run.trouble)}", "not bold")
    text.append(f"{run.sign} {run.state_words}\n", "not bold")
    if run.reason:
        text.append(f"{plain(run.reason)}\n", "not bold dim")
    facts = [
        ("scenario", shortened(run.scenario, max(8, width - 10))),
        ("algorithm", run.algorithm),
        ("pair", run.pair if len(run.pair) + 10 <= width else run.pair.replace("/", f"/\n{'':10}")),
        ("tests", str(run.tests)),
        ("decisions", f"{run.decisions} by hand" if run.decisions else "none by hand"),
    ]
    for name, words in facts:
        text.append(f"\n{name:<10}", "not bold dim").append(words, "not bold")
    text.append(f"\n\n{len(run.kept)} of {count(run.total, 'model')} left\n", "bold")
    for name in run.kept[:MOST_NAMES]:
        text.append(f"  {shortened(plain(name), max(8, width - 2))}\n", "not bold")
    more = len(run.kept) - MOST_NAMES
    return text.append(f"  and {more} more\n" if more > 0 else "", "not bold dim")
