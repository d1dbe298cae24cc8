"""What the user's hand leaves in a run: selections that were tried, the tree of reductions, decisions. Plain frozen data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Trial:
    """A sub-environment of the user's own making. `models` are those kept in it, of the whole world; `node` is where it was tried.

    `verdict`, `tests` and `known` are as a candidate's. `adopted` says that it became the environment.
    """

    number: int
    models: tuple[str, ...]
    node: int
    verdict: str = ""
    tests: tuple[int, ...] = ()
    known: int = 0
    adopted: bool = False

    @property
    def size(self) -> int:
        """How many models it has."""
        return len(self.models)

    @property
    def label(self) -> str:
        return f"try {self.number}"


@dataclass(frozen=True, slots=True)
class Node:
    """An environment that a run came to, in the tree of its reductions; number 0 is the whole world, without a parent.

    `how` is "start", "reduced" (a candidate showed f), "adopted" (a trial did) or "accepted" (another failure was taken for as
    good); `what` names the candidate or the trial. `tests` is how many tests were finished then, `time` is Unix time, s, and
    `round` the round that ended in it. `evidence_test` is the run in it that the next rounds look at, None before f is known.
    `method` is what it was found by. `minimal` says that the reduction ended in it, `rejected` that it was taken back.
    """

    number: int
    parent: int | None
    how: str
    what: str
    environment: tuple[str, ...]
    round: int | None = None
    tests: int = 0
    time: float = 0.0
    evidence_test: int | None = None
    method: str = ""
    minimal: bool = False
    rejected: bool = False


@dataclass(frozen=True, slots=True)
class Decision:
    """Something the user decided: `kind` is the event's, `words` say it; at Unix `time`, s, after so many `tests`, in `node`."""

    time: float
    tests: int
    node: int
    kind: str
    words: str


def many(models: int) -> str:
    """1 model, 2 models."""
    return f"{models} model{'s' * (models != 1)}"
