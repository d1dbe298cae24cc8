"""Full runs of what is left, where the reduction rests on runs that were ended early because the robot seemed stuck for good."""

from __future__ import annotations

from collections.abc import Sequence

from ddenv.engine.bench import Wanted
from ddenv.engine.journal import Journal, Keep

AGAIN = "run again with --no-early-stop"


class Confirmation:
    """What of the end is shown by runs to their end: that f shows in `kept`, and not without any one of the models `tried`.

    As in a round, `1 + iterations` runs tell. A run that was not cut is a full one already. Nothing is kept here: all follows
    from the journal.
    """

    def __init__(self, journal: Journal, kept: Keep, tried: Sequence[str], iterations: int) -> None:
        self._journal = journal
        self._kept = kept
        self._tried = tried
        self._runs = range(1 + iterations)

    def wanted(self) -> Wanted:
        """The full runs that are still needed, in the order in which one worker would make them; none once there is a doubt."""
        if self.doubt():
            return []
        whole = [] if self._shows() else self._missing(self._kept)
        return whole + [test for name in self._tried for test in self._missing(self._kept - {name})]

    def doubt(self) -> str:
        """What a full run contradicts, in one line that says what to do; "" as far as there is nothing."""
        if not self._shows():
            if self._missing(self._kept):
                return ""
            return f"runs were ended too early: f does not show in full runs of what is left; {AGAIN}"
        for name in self._tried:
            if self._missing(self._kept - {name}):
                return ""
            if any(self._is_similar(self._kept - {name}, run) for run in self._runs):
                return f"runs were ended too early: f shows in a full run without '{name}', too; {AGAIN}"
        return ""

    def _shows(self) -> bool:
        # f itself may be a later baseline run.
        runs = range(max(len(self._runs), self._journal.state.baseline.runs))
        return any(self._is_similar(self._kept, run) for run in runs)

    def _missing(self, keep: Keep) -> Wanted:
        return [(keep, run, None) for run in self._runs if self._is_similar(keep, run) is None]

    def _is_similar(self, keep: Keep, run: int) -> bool | None:
        return self._journal.is_similar(keep, run, full=True)
