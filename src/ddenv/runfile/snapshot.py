"""A run as a view sees it at one moment: its state, whether an engine works on it, and where the
robots are.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from ddenv.runfile.state import Candidate, RunState, Test

if TYPE_CHECKING:
    from ddenv.runfile.store import Live

EngineIs = Literal["alive", "starting", "absent"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """All that the run screen shows at one moment.

    `engine` is "alive", "starting" or "absent". `evidence` is the robot's path on the last similar
    run, `original` its path in f itself: flat rows of `COLUMNS` floats. `spent` is the time engines
    have worked on the run, s. `error` says why the run file cannot be read. `gone` says that it was
    deleted or replaced: the rest is what was read last. `behind` says that not all of it was read
    yet. `past`: it is an earlier moment of the run, `pointed` the candidate of that moment, and
    `happened` says what happened there. `version` is the one of the program that looks.
    """

    state: RunState = field(default_factory=RunState)
    live: tuple[Live, ...] = ()
    engine: EngineIs = "absent"
    evidence: array[float] | None = None
    spent: int = 0
    error: str = ""
    original: array[float] | None = None
    gone: bool = False
    behind: bool = False
    past: bool = False
    pointed: Candidate | None = None
    happened: str = ""
    version: str = ""

    @property
    def older_engine(self) -> str:
        """The version of the run's last engine, if it is another version than this program's;
        otherwise "", or if unknown.
        """
        if self.version not in ("", self.state.engine_version):
            return self.state.engine_version
        return ""

    @property
    def status(self) -> str:
        """The state's status, or "starting" or "lost" if the engine's lock says so."""
        if self.engine == "starting":
            return "starting"
        known = self.state.ended or self.behind or self.past or self.state.status == "created"
        if known or self.engine == "alive":
            return self.state.status
        return "lost"

    @property
    def running(self) -> tuple[Test, ...]:
        """The tests that run now, in the order they were started; none when no engine is there to
        run them.
        """
        if self.engine == "alive" or self.past:
            return self.state.running_tests
        return ()

    @property
    def focus(self) -> Candidate | None:
        """The current candidate: the one that waits, or else the first one that is being tested."""
        if self.past:
            return self.pointed
        current = self.state.round
        if current is None or current.done or self.status in ("finished", "lost"):
            return None
        if self.state.waiting_candidate is not None:
            return current.candidates[self.state.waiting_candidate]
        of_round = (
            test for test in self.running if test.phase == "round" and test.round == current.number
        )
        return next(
            (current.candidates[test.candidate] for test in of_round if test.candidate is not None),
            None,
        )

    def seconds(self, test: int) -> float | None:
        """How far a running test is, simulated s."""
        return next((live.time for live in self.live if live.test == test), None)
