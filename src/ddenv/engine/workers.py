"""What the engine asks of those who make its tests, wherever they are: processes here, or a cluster."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from ddenv.engine.pool import Broken, Pace
from ddenv.engine.worker import Start
from ddenv.robot.result import RunResult
from ddenv.runfile.store import Live


class Workers(Protocol):
    """Make tests, several at a time. `Pool` says what each of these does."""

    @property
    def idle(self) -> int: ...
    @property
    def busy(self) -> int: ...
    def submit(
        self, test: int, keep: frozenset[str], seed: int, full: bool = True, limit: float | None = None
    ) -> None: ...
    def finished(self, seconds: float) -> list[tuple[int, RunResult | Broken]]: ...
    def settle(self, elements: frozenset[str]) -> Callable[[], Start | Broken | None]: ...
    def live(self) -> list[Live]: ...
    def paces(self) -> list[Pace]: ...
    def close(self) -> None: ...
