"""A run as a list of runs shows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState
from ddenv.text import Names
from ddenv.words.signs import STATUS

# The states in which no engine is expected.
ENDED = ("created", "finished", "stopped", "failed")


@dataclass(frozen=True, slots=True, kw_only=True)
class Recent:
    """One run. `status` is the state's, "lost" if its engine has died, or "" if it is not read yet.

    `changed` is Unix time, s. `computed` is the time that its own simulations took, s. `chosen`
    is its scenario as it is now. `trouble` says why it cannot be opened.
    """

    path: Path
    changed: float = 0.0
    status: str = ""
    scenario: str = ""
    algorithm: str = ""
    pair: str = ""
    total: int = 0
    kept: Names = ()
    tests: int = 0
    decisions: int = 0
    minimal: bool = False
    reason: str = ""
    trouble: str = ""
    computed: float = 0.0
    chosen: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)

    @property
    def sign(self) -> str:
        if self.trouble:
            return "✗"
        return STATUS.get(self.status, ("·", ""))[0]

    @property
    def state_words(self) -> str:
        if self.trouble:
            return "cannot be read"
        if self.status == "finished":
            if self.minimal:
                return "minimal"
            return "finished"
        return STATUS.get(self.status, ("", self.status or "..."))[1]

    @property
    def brief(self) -> str:
        """How many models are left, for a list in which its sign is its state."""
        if self.total:
            return f"{len(self.kept)}/{self.total}"
        return ""

    @property
    def is_worked_on(self) -> bool:
        return bool(self.status) and self.status not in (*ENDED, "lost")


def recent_of(path: Path, state: RunState, changed: float) -> Recent:
    """A run in a file that was last `changed` then (Unix time, s), as its state says."""
    options = settings(state)
    return Recent(
        path=path,
        changed=state.updated_at or changed,
        status=state.status,
        scenario=options.name,
        algorithm=options.algorithm,
        pair=options.pair,
        total=len(state.elements),
        kept=state.environment,
        tests=state.tests_done,
        decisions=len(state.decisions),
        minimal=state.minimal,
        reason=state.reason,
        computed=computed(state),
        chosen=state.scenario,
    )


def computed(state: RunState) -> float:
    """How long the simulations of a run took, s; results that were copied or implied cost
    nothing.
    """
    return sum(
        test.wall_seconds for test in state.tests if not test.taken and test.implied_by is None
    )
