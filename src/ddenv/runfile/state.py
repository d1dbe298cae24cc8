"""What a run looks like at one moment: plain frozen data, made by `ddenv.runfile.fold` from the run's events."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

OUTCOMES = ("similar", "other", "pass", "error", "timeout")


@dataclass(frozen=True, slots=True)
class Test:
    """One run of the robot.

    `outcome` is "running" until it ends; a baseline run that failed is "failed" until f is fixed. `phase` is "baseline" or
    "round". `run` is i of seed = base + i: above 0 in a round it is a re-run (deflaking). `distance` is how far from f's
    end the robot ended, m. `end_pose` is x, y, z m, qw, qx, qy, qz. `failure` says how it ended otherwise than at the goal.
    """

    id: int
    phase: str
    round: int | None
    candidate: int | None
    run: int
    seed: int
    outcome: str = "running"
    failure: str = ""
    distance: float | None = None
    end_pose: tuple[float, ...] | None = None
    simulated_seconds: float = 0.0
    wall_seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class Candidate:
    """A sub-environment to try. `kind` is "partition" or "complement" of partition number `partition`.

    `verdict` is "" while open, then "similar", "dissimilar", "vetoed" or "rejected" (similar, but the user said no).
    `distance` is what the prioritization ranked its partition by (m for the proximal ones), or None. `tests` are the
    ids of its tests so far, re-runs included, known ones of earlier rounds too (then `known` counts them).
    """

    index: int
    kind: str
    partition: int
    models: tuple[str, ...]
    distance: float | None = None
    verdict: str = ""
    tests: tuple[int, ...] = ()
    known: int = 0

    @property
    def label(self) -> str:
        letter = partition_letter(self.partition)
        return f"part {letter}" if self.kind == "partition" else f"without {letter}"


@dataclass(frozen=True, slots=True)
class Round:
    """One turn of the algorithm. `partitions` are in the order they are tried; `winner` is a candidate's index or None."""

    number: int
    n_partitions: int
    environment: tuple[str, ...]
    partitions: tuple[tuple[str, ...], ...]
    candidates: tuple[Candidate, ...]
    winner: int | None = None
    done: bool = False


@dataclass(frozen=True, slots=True)
class Baseline:
    """The whole world, run several times. `failure_test` is the test whose end is f; `low`..`high` is Wilson's 95 % interval.

    `miss_chance` is (1-p)^(1+iterations), the chance that a candidate's tests all miss f; `iterations_95` is how many
    iterations a 95 % chance of seeing f needs. `position` is f's end, x, y, z m.
    """

    runs: int
    failures: int
    rate: float
    low: float
    high: float
    failure_test: int
    position: tuple[float, float, float]
    miss_chance: float
    iterations_95: int


@dataclass(frozen=True, slots=True)
class Point:
    """The size of the environment after so many finished tests."""

    tests: int
    models: int


@dataclass(frozen=True, slots=True)
class RunState:
    """A whole run. `status`:

    created    no engine has worked on it yet
    baseline   the whole world is being run
    running    rounds are being tested
    paused     nothing new is started
    waiting    a reduction (`waiting_candidate` of the current round) waits for accept or reject
    finished   ended by itself: `minimal` says whether no model can be removed; `reason` says why it ended
    stopped    the engine was stopped; it can be resumed
    failed     the engine could not go on: `reason` says why
    """

    revision: int = 0
    status: str = "created"
    reason: str = ""
    scenario: dict[str, Any] = field(default_factory=dict)
    elements: tuple[str, ...] = ()
    environment: tuple[str, ...] = ()
    accept_mode: str = "automatic"
    paused: bool = False
    waiting_candidate: int | None = None
    baseline: Baseline | None = None
    round: Round | None = None
    rounds_done: int = 0
    tests: tuple[Test, ...] = ()
    history: tuple[Point, ...] = ()
    evidence_test: int | None = None
    minimal: bool = False
    last_command: int = 0
    jobs: int = 0
    working_seconds: float = 0.0
    started_at: float | None = None
    updated_at: float = 0.0

    @property
    def finished_tests(self) -> tuple[Test, ...]:
        return tuple(test for test in self.tests if test.outcome not in ("running", "lost"))

    @property
    def deflake_runs(self) -> int:
        return sum(test.phase == "round" and test.run > 0 for test in self.finished_tests)

    def outcomes(self) -> dict[str, int]:
        """Finished tests by outcome, in the order of `OUTCOMES`."""
        counts = dict.fromkeys(OUTCOMES, 0)
        for test in self.finished_tests:
            counts[test.outcome] = counts.get(test.outcome, 0) + 1
        return counts

    @property
    def ended(self) -> bool:
        return self.status in ("finished", "stopped", "failed")


def partition_letter(index: int) -> str:
    """A, B, ... Z, AA, AB, ... for partition 0, 1, ..."""
    letters = ""
    index += 1
    while index:
        index, rest = divmod(index - 1, 26)
        letters = chr(ord("A") + rest) + letters
    return letters
