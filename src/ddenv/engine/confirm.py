"""Full runs of what is left, needed if the reduction used runs that ended early because the robot was stuck for good."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

from ddenv.engine.bench import Wanted
from ddenv.engine.journal import Journal, Keep
from ddenv.engine.judging import known_failure

AGAIN = "run again with --no-early-stop"


class Confirmation:
    """What full runs show: whether f shows in `kept`, and whether it still shows without any one of the models `tried`.

    As in a round, `1 + iterations` runs decide. A run that was not cut is a full run already. All follows from the journal. At most
    `enough` tests are looked for at a time.
    """

    def __init__(self, journal: Journal, kept: Keep, tried: Sequence[str], iterations: int, enough: int) -> None:
        self._journal = journal
        self._kept = kept
        self._tried = tried
        self._runs = range(1 + iterations)
        self._enough = enough
        # This many of `tried`, counted from the first, are known to be needed.
        self._sure = 0

    def wanted(self) -> Wanted:
        """The full runs that are still needed, in the order in which one worker would make them; none after a contradiction."""
        return [] if self.doubt() else list(islice(self._open(), self._enough))

    def doubt(self) -> str:
        """What a full run contradicts, in one line that says what to do; "" if nothing."""
        if not self._shows():
            if self._missing(self._kept):
                return ""
            if self._journal.only_broke(self._kept, self._runs):
                return f"all full runs of what is left broke; {AGAIN}"
            return f"runs were ended too early: f does not show in full runs of what is left; {AGAIN}"
        for name in self._tried[self._sure :]:
            keep = self._kept - {name}
            if self._missing(keep):
                return ""
            if any(self._is_similar(keep, run) for run in self._runs):
                return f"runs were ended too early: f shows in a full run without '{name}', too; {AGAIN}"
            self._sure += 1
        return ""

    def _open(self) -> Iterator[tuple[Keep, int, int | None]]:
        if not self._shows():
            yield from self._missing(self._kept)
        for name in self._tried[self._sure :]:
            yield from self._missing(self._kept - {name})

    def _shows(self) -> bool:
        # f itself may be a later baseline run.
        runs = range(max(len(self._runs), known_failure(self._journal.state).runs))
        return any(self._is_similar(self._kept, run) for run in runs)

    def _missing(self, keep: Keep) -> Wanted:
        return [(keep, run, None) for run in self._runs if self._is_similar(keep, run) is None]

    def _is_similar(self, keep: Keep, run: int) -> bool | None:
        return self._journal.is_similar(keep, run, full=True)
