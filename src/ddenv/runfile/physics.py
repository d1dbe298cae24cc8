"""What the tests of a run were computed with: the same tests give the same bits only by the same software on the same processor."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ddenv.runfile.events import EngineStarted


@dataclass(frozen=True, slots=True)
class Physics:
    """`now` is what the last engine computes with, `proven` what gave the same bits as the tests before it.

    Both are lists in words, such as "ddenv 0.1.0, drake 1.51.1, Python 3.11.7, Intel Xeon"; "" before the first engine. `mixed`
    has a sentence for each time that the user went on although the bits differ.
    """

    now: str = ""
    proven: str = ""
    mixed: tuple[str, ...] = ()

    def started(self, engine: EngineStarted, tests: int) -> Physics:
        """After the start of an engine, when `tests` tests were finished."""
        words = (f"ddenv {engine.version}", engine.simulator, engine.machine)
        now = ", ".join(each for each in words if each)
        return replace(self, now=now, proven=self.proven if tests else now)

    def compared(self, same: bool) -> Physics:
        """After a test was made again, with the same bits or not."""
        mixed = self.mixed if same else (*self.mixed, f"first {self.before}, then {self.after}")
        return replace(self, proven=self.now, mixed=mixed)

    @property
    def before(self) -> str:
        """What of `proven` is different now."""
        return _lacking(self.proven, self.now)

    @property
    def after(self) -> str:
        """What is different from `proven`."""
        return _lacking(self.now, self.proven)


def _lacking(these: str, those: str) -> str:
    return ", ".join(each for each in these.split(", ") if each not in those.split(", ")) or "something unknown"
