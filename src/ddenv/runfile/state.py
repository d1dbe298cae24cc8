"""What a run looks like at one moment: plain frozen data, made by `ddenv.runfile.fold` from the run's events."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import islice, takewhile
from typing import Any

from ddenv.runfile.persistent import PersistentTuple

OUTCOMES = ("similar", "other", "pass", "error", "timeout")
# Besides these a test may run still or be lost, and a baseline run may have failed when f was not fixed yet.
UNFINISHED = ("running", "lost")
_TALLY = (*OUTCOMES, "failed", *UNFINISHED)


@dataclass(frozen=True)
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

    `confirming` says that the rounds are over, and that what is left is run in full because tests were cut.
    `pinned` models stay. `nodes` are the environments that the run came to, `node` is the number of the current one.
    `trials` are the user's own selections, `decisions` all that the user decided. The ends of `failures`
    (tests) count as f in this node.
    `lower_bound`: at least so many models are needed, as far as f shows wherever all that it needs is there.
    `engine_version` is that of the ddenv that worked on it last, `simulator` what it computed with.
    `refusal` is the last command that the engine could not obey, with its reason.
    `tally` counts the tests by outcome, `deflake_runs` the finished re-runs of candidates. `working_seconds` is how
    long engines have worked on it up to their ends, s; `started_at` (Unix time, s) is set while one works.
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
    tests: PersistentTuple[Test] = field(default_factory=PersistentTuple)
    tally: dict[str, int] = field(default_factory=lambda: dict.fromkeys(_TALLY, 0))
    deflake_runs: int = 0
    confirming: bool = False
    history: tuple[Point, ...] = ()
    evidence_test: int | None = None
    minimal: bool = False
    pinned: frozenset[str] = frozenset()
    nodes: tuple[Node, ...] = ()
    node: int = 0
    trials: tuple[Trial, ...] = ()
    decisions: tuple[Decision, ...] = ()
    failures: tuple[int, ...] = ()
    lower_bound: int = 0
    last_command: int = 0
    refusal: tuple[int, str] = (0, "")
    engine_version: str = ""
    simulator: str = ""
    jobs: int = 0
    working_seconds: float = 0.0
    started_at: float | None = None
    updated_at: float = 0.0

    def changed(self, **values: Any) -> RunState:
        """One that differs in the values of these fields."""
        # `dataclasses.replace` passes all the many fields through the constructor: half of what an event would cost.
        state = object.__new__(RunState)
        state.__dict__.update(self.__dict__, **values)
        return state

    @property
    def failure(self) -> str:
        """How the robot failed in f, in a word; "" where that is not known."""
        if self.baseline is None or not 0 < self.baseline.failure_test <= len(self.tests):
            return ""
        return self.tests[self.baseline.failure_test - 1].failure

    @property
    def other_failures(self) -> int:
        """How many baseline runs failed, but not as f did; 0 until f is fixed."""
        baseline = takewhile(lambda test: test.phase == "baseline", self.tests)
        return sum(test.outcome == "other" for test in baseline)

    @property
    def broken_runs(self) -> int:
        """How many baseline runs broke, and count as runs without f."""
        baseline = takewhile(lambda test: test.phase == "baseline", self.tests)
        return sum(test.outcome in ("error", "timeout") for test in baseline)

    @property
    def cut_tests(self) -> int:
        """How many tests were ended before their time."""
        return sum(test.cut for test in self.tests)

    @property
    def budget(self) -> int | None:
        """The most tests in all, None for any number."""
        reduction = self.scenario.get("reduction")
        most = reduction.get("budget") if isinstance(reduction, dict) else None
        return most if isinstance(most, int) and most > 0 else None

    @property
    def here(self) -> Node | None:
        """The current node; None before the run was made."""
        return self.nodes[self.node] if self.nodes else None

    @property
    def finished_tests(self) -> tuple[Test, ...]:
        """Gathered at each call: ask for `tests_done` where their number is enough."""
        return tuple(test for test in self.tests if test.is_finished)

    @property
    def tests_done(self) -> int:
        """How many tests are finished."""
        return len(self.tests) - sum(self.tally[outcome] for outcome in UNFINISHED)

    @property
    def confirm_tests(self) -> tuple[Test, ...]:
        """The full runs of what is left, in the order they were started."""
        # Nothing but them is started after the rounds.
        return tuple(takewhile(lambda test: test.phase == "confirm", reversed(self.tests)))[::-1]

    @property
    def running_tests(self) -> tuple[Test, ...]:
        """The tests that are not known to have ended, in the order they were started."""
        # They are among the last ones: the many before them need not be looked at.
        latest = (test for test in reversed(self.tests) if test.outcome == "running")
        return tuple(islice(latest, self.tally["running"]))[::-1]

    def outcomes(self) -> dict[str, int]:
        """Finished tests by outcome, in the order of `OUTCOMES`."""
        counts = {outcome: self.tally[outcome] for outcome in OUTCOMES}
        return counts | {"failed": self.tally["failed"]} if self.tally["failed"] else counts

    @property
    def ended(self) -> bool:
        return self.status in ("finished", "stopped", "failed")


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
class Round:
    """One turn of the algorithm. `partitions` are in the order they are tried; `winner` is a candidate's index or None.

    `missed` counts the parts without which f did not show.
    """

    number: int
    n_partitions: int
    split: Split
    candidates: PersistentTuple[Candidate]
    winner: int | None = None
    done: bool = False
    missed: int = 0

    @property
    def environment(self) -> tuple[str, ...]:
        return self.split.environment

    @property
    def partitions(self) -> tuple[tuple[str, ...], ...]:
        return self.split.partitions


@dataclass(frozen=True, slots=True)
class Split:
    """An environment and its disjoint parts: what all candidates of a round share instead of lists of their own.

    `pinned` models of the environment are in no part: they are in every candidate.
    """

    environment: tuple[str, ...]
    partitions: tuple[tuple[str, ...], ...]
    pinned: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Candidate:
    """A sub-environment to try. `kind` is "partition" or "complement" of partition number `partition` of `split`.

    `verdict` is "" while open, then "similar", "dissimilar", "vetoed" or "rejected" (similar, but the user said no).
    `distance` is what the prioritization ranked its partition by (m for the proximal ones), or None. `tests` are the
    ids of its tests so far, re-runs included, known ones of earlier rounds too (then `known` counts them).
    """

    index: int
    kind: str
    partition: int
    split: Split = field(repr=False, hash=False)
    distance: float | None = None
    verdict: str = ""
    tests: tuple[int, ...] = ()
    known: int = 0

    @property
    def models(self) -> tuple[str, ...]:
        """The models' names. They are gathered at each call: ask for `size` where their number is enough."""
        part = self.split.partitions[self.partition]
        if self.kind == "partition":
            return (*part, *self.split.pinned)
        left_out = frozenset(part)
        return tuple(name for name in self.split.environment if name not in left_out)

    @property
    def size(self) -> int:
        """How many models it has."""
        part = len(self.split.partitions[self.partition])
        whole = len(self.split.environment)
        return part + len(self.split.pinned) if self.kind == "partition" else whole - part

    @property
    def label(self) -> str:
        letter = partition_letter(self.partition)
        return f"part {letter}" if self.kind == "partition" else f"without {letter}"


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
class Test:
    """One run of the robot.

    `outcome` is "running" until it ends; a baseline run that failed is "failed" until f is fixed. `phase` is "baseline",
    "round", "hand" (for the user's trial number `trial`) or "confirm": a full run of what is left, or of that without the model
    `without`. `run` is i of seed = base + i: above 0 in a round it is a re-run (deflaking). `distance` is how far from f's end
    the robot ended, m. `end_pose` is x, y, z m, qw, qx, qy, qz. `failure` says how it ended otherwise than at the goal, see
    `ddenv.runfile.events`. `first_sensed` and `first_touched` are the models that the robot sensed or touched, each with the
    simulated time it was first so, s; empty in files of version 1. `cut` says that it was ended before its time because the
    robot was stuck for good, `taken` that it was taken over from another run that had made it.
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
    first_sensed: tuple[tuple[str, float], ...] = ()
    first_touched: tuple[tuple[str, float], ...] = ()
    cut: bool = False
    without: str | None = None
    trial: int | None = None
    taken: bool = False

    @property
    def is_finished(self) -> bool:
        return self.outcome not in UNFINISHED

    @property
    def is_deflake_run(self) -> bool:
        """Whether it is a finished re-run of a candidate."""
        return self.phase == "round" and self.run > 0 and self.is_finished


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
    """The size of the environment after so many finished tests; at least `needed` of its models were known to be needed."""

    tests: int
    models: int
    needed: int = 0


@dataclass(frozen=True, slots=True)
class Decision:
    """Something the user decided: `kind` is the event's, `words` say it; at Unix `time`, s, after so many `tests`, in `node`."""

    time: float
    tests: int
    node: int
    kind: str
    words: str


def partition_letter(index: int) -> str:
    """A, B, ... Z, AA, AB, ... for partition 0, 1, ..."""
    letters = ""
    index += 1
    while index:
        index, rest = divmod(index - 1, 26)
        letters = chr(ord("A") + rest) + letters
    return letters


def many(models: int) -> str:
    """1 model, 2 models."""
    return f"{models} model{'s' * (models != 1)}"
