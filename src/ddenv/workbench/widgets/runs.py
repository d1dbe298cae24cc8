"""The list of recent runs on the setup screen."""

from __future__ import annotations

from rich.text import Text
from textual import work
from textual.widgets import OptionList
from textual.widgets.option_list import Option

from ddenv.workbench.recent import Recent, recent_runs
from ddenv.workbench.wording import plain


class RunList(OptionList):
    """The runs of the runs folder, read beside the screen."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, compact=True, markup=False)
        self._runs: dict[str, Recent] = {}

    def run_of(self, option_id: str | None) -> Recent:
        """The run that an option stands for."""
        return self._runs[option_id or ""]

    @work(thread=True, group="runs", exclusive=True)
    def read(self) -> None:
        """Lists what is in the folder now."""
        from ddenv.launch.runs import runs_folder

        runs = recent_runs(runs_folder())
        self.app.call_from_thread(self._show, runs)

    def _show(self, runs: list[Recent]) -> None:
        if not self.is_attached:
            return
        self._runs = {str(run.path): run for run in runs}
        self.clear_options()
        for run in runs:
            text = Text(f"{run.sign} {plain(run.path.stem)}", no_wrap=True, overflow="ellipsis")
            self.add_option(Option(text.append(f"  {run.words}", "dim"), id=str(run.path)))
        if not runs:
            self.add_option(Option(Text("none yet", "dim"), disabled=True))
