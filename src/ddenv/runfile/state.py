"""The state of a run at one moment: plain frozen data, folded from the run's events by
`ddenv.runfile.fold`. And what makes that cheap: a tuple whose changed copies share all but one
small part with the original.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, TypeVar, overload

from ddenv.environment import NOTHING, Environment, Numbers
from ddenv.runfile.progress import Isolation, Margins, Node, Physics, path
from ddenv.text import Data, Names

if TYPE_CHECKING:
    from ddenv.runfile.events import BaselineFinished, EarlyStopEnded, Forecast, Place
    from ddenv.runfile.progress import Certificate, Decision, Point, Refusal, Removal, Search

# Items in a chunk. A change copies one chunk and the list of chunks; for the longest runs (60,000
# tests) both are about as long.
CHUNK = 256

Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class PersistentTuple(Sequence[Item]):
    """An immutable sequence: `added` and `changed` return a new one that shares all unchanged
    chunks. A slice is a plain tuple. It equals other ones with equal items, but no plain tuple. All
    chunks but the last hold `CHUNK` items, so equal items are always in equal chunks.
    """

    chunks: tuple[tuple[Item, ...], ...] = ()

    @classmethod
    def of(cls, items: Iterable[Item]) -> PersistentTuple[Item]:
        """One that holds `items`, in order."""
        every = tuple(items)
        return cls(tuple(every[start : start + CHUNK] for start in range(0, len(every), CHUNK)))

    def added(self, item: Item) -> PersistentTuple[Item]:
        """One with `item` appended."""
        if not self.chunks or len(self.chunks[-1]) == CHUNK:
            return PersistentTuple((*self.chunks, (item,)))
        return PersistentTuple((*self.chunks[:-1], (*self.chunks[-1], item)))

    def changed(self, index: int, item: Item) -> PersistentTuple[Item]:
        """One with `item` at `index`, which may be negative. Raises IndexError if there is no such
        index.
        """
        number, place = divmod(range(len(self))[index], CHUNK)
        # Joined slices would be copied twice.
        chunk = list(self.chunks[number])
        chunks = list(self.chunks)
        chunk[place] = item
        chunks[number] = tuple(chunk)
        return PersistentTuple(tuple(chunks))

    def changed_since(self, earlier: PersistentTuple[Item]) -> Iterator[Item]:
        """The items that differ from `earlier` at their index, in order; shared chunks cost
        nothing.
        """
        for number, chunk in enumerate(self.chunks):
            before = earlier.chunks[number] if number < len(earlier.chunks) else ()
            if chunk is not before:
                yield from (
                    item
                    for place, item in enumerate(chunk)
                    if place >= len(before) or item != before[place]
                )

    def __len__(self) -> int:
        if self.chunks:
            return CHUNK * (len(self.chunks) - 1) + len(self.chunks[-1])
        return 0

    @overload
    def __getitem__(self, index: int) -> Item: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Item, ...]: ...

    def __getitem__(self, index: int | slice) -> Item | tuple[Item, ...]:
        if isinstance(index, slice):
            return tuple(self[place] for place in range(*index.indices(len(self))))
        number, place = divmod(range(len(self))[index], CHUNK)
        return self.chunks[number][place]

    def __iter__(self) -> Iterator[Item]:
        return chain.from_iterable(self.chunks)

    def __reversed__(self) -> Iterator[Item]:
        return chain.from_iterable(map(reversed, reversed(self.chunks)))


# The first of each two models rests on the second, or is tied to it.
Pairs = tuple[tuple[str, str], ...]

OUTCOMES = ("similar", "other", "pass", "error", "timeout")
# Tests that ended so say nothing about f.
BROKEN = ("error", "timeout")
# Verdicts of the user, which a key takes back.
REFUSED = ("vetoed", "rejected", "undone")
# Other outcomes of tests; a baseline run may also be "failed" until f is fixed.
UNFINISHED = ("running", "lost")
_TALLY = (*OUTCOMES, "failed", *UNFINISHED)
# The phase of full runs of what is left with fresh seeds, and of runs of the whole world without
# the models of a removal.
CERTIFY = "certify"
ISOLATE = "isolate"


@dataclass(frozen=True, kw_only=True)
class RunState:
    """A whole run. `status`:

    created    no engine has worked on it yet baseline   the whole world is being run running
    rounds are being tested paused     no new tests are started waiting    a reduction
    (`waiting_candidate` of the current round) waits for accept or reject finished   the run ended
    by itself: `minimal` says whether no model can be removed, `reason` why it ended stopped    the
    engine was stopped and can be resumed failed     the engine could not continue: `reason` says
    why

    `confirming`: the rounds are over, and full runs with fresh seeds show what the result is worth:
    the last of `certificates`; `fresh` are the ids of its tests. The run came to `node` when
    `came_at` tests were finished. Once `search_due`, a new `search` has to begin. `judged` are the
    tests that verdicts rest on, in their order. `refused` environments are not taken because the
    user said so, `lost` ones with all of their parts because they lost the rate of f, each beside
    the failures that counted as f then: the search went so many `steps_back`, and leaves out the
    groups `again` first in the next search. The ends of the tests in `failures` count as f in the
    current node. `lower_bound` is the minimum number of models needed, if f shows wherever
    everything it needs is present. `supports`, `welds` and `ties` have (model, other): it rests on
    the other once the whole world has settled (found while `settling`; `unsettled` says why it
    could not be), is welded to it by the files, or tied to it; `ties` are None if unknown. Of the
    tests, `implied` ones were not simulated, and `audits` were although they were implied;
    decisions rest on those with the bits 1 << id of `rests_on`. Those up to `mixed_until` were
    computed with something else, and imply nothing now. If one of these, the first of `refuted`,
    did not repeat the second, slices are no longer used. Since `early_stop_ended` all tests run to
    their end. `engines` counts the engines that have worked on it. After one broke tests that a
    verdict needs (`left_unknown`), the next one makes them again. `notes` say what is wrong with
    the whole world: a word and a sentence each. `refusal` is the last command that the engine could
    not obey, with the reason. `needs_room` is how many bytes have to be free on the disk before
    more tests start; where the `file_is_full`, below the limit of a file's size. `working_seconds`
    is the time that ended engines have worked; `started_at` (Unix time, s) is set while one works.
    """

    revision: int = 0
    status: str = "created"
    reason: str = ""
    scenario: Data = field(default_factory=dict)
    elements: Names = ()
    environments: PersistentTuple[Environment] = field(default_factory=PersistentTuple)
    environment: Names = ()
    search: Search | None = None
    search_due: bool = False
    judged: PersistentTuple[int] = field(default_factory=PersistentTuple)
    refused: tuple[Refusal, ...] = ()
    refusals: int = 0
    lost: tuple[tuple[Numbers, Environment], ...] = ()
    steps_back: int = 0
    again: tuple[Numbers, ...] = ()
    engines: int = 0
    left_unknown: bool = False
    mixed_until: int = 0
    accept_mode: str = "automatic"
    paused: bool = False
    needs_room: int = 0
    file_is_full: bool = False
    waiting_candidate: int | None = None
    baseline: BaselineFinished | None = None
    round: Round | None = None
    rounds_done: int = 0
    forecast: Forecast | None = None
    tests: PersistentTuple[Test] = field(default_factory=PersistentTuple)
    tally: dict[str, int] = field(default_factory=lambda: dict.fromkeys(_TALLY, 0))
    confirming: bool = False
    history: tuple[Point, ...] = ()
    evidence_test: int | None = None
    minimal: bool = False
    pinned: frozenset[str] = frozenset()
    nodes: tuple[Node, ...] = ()
    node: int = 0
    came_at: int = 0
    trials: tuple[Trial, ...] = ()
    decisions: tuple[Decision, ...] = ()
    failures: Numbers = ()
    certificates: tuple[Certificate, ...] = ()
    fresh: PersistentTuple[int] = field(default_factory=PersistentTuple)
    isolations: tuple[Isolation, ...] = ()
    margins: Margins | None = None
    removals: PersistentTuple[Removal] = field(default_factory=PersistentTuple)
    lower_bound: int = 0
    supports: Pairs = ()
    welds: Pairs = ()
    ties: Pairs | None = None
    implied: int = 0
    rests_on: int = 0
    audits: int = 0
    refuted: tuple[int, int] | None = None
    early_stop_ended: EarlyStopEnded | None = None
    notes: tuple[tuple[str, str], ...] = ()
    settling: bool = False
    unsettled: str = ""
    last_command: int = 0
    refusal: tuple[int, str] = (0, "")
    engine_version: str = ""
    simulator: str = ""
    physics: Physics = field(default_factory=Physics)
    jobs: int = 0
    cluster: str = ""
    working_seconds: float = 0.0
    started_at: float | None = None
    updated_at: float = 0.0

    def changed(self, **values: Any) -> RunState:
        """A copy with new values of these fields."""
        # `dataclasses.replace` would pass all fields through the constructor, and double the cost
        # of an event.
        state = object.__new__(RunState)
        state.__dict__.update(self.__dict__, **values)
        return state

    def models_of(self, test: Test) -> Names:
        """The names of the models in the world of a test, collected at each call."""
        return self.environments[test.environment].names(self.elements)

    def test(self, number: int) -> Test:
        """The test with this number: they are counted from 1."""
        return self.tests[number - 1]

    def tests_of(self, numbers: Iterable[int]) -> list[Test]:
        """The tests with these numbers, as far as the file has them."""
        return [self.test(number) for number in numbers if 0 < number <= len(self.tests)]

    @property
    def evidence(self) -> Test | None:
        """The last similar run; None before the first."""
        return next(iter(self.tests_of((self.evidence_test or 0,))), None)

    @property
    def f_test(self) -> Test | None:
        """The test whose end is f in the current node; None until f is fixed."""
        return next(iter(self.tests_of(self.failures[:1])), None)

    @property
    def f_position(self) -> Place | None:
        """Where the robot ended in f, x, y, z m; None until f is fixed."""
        base = self.baseline
        test = self.f_test
        if base is None or test is None or test.id == base.failure_test or test.end_pose is None:
            if base is None:
                return None
            return base.position
        x, y, z = test.end_pose[:3]
        return x, y, z

    @property
    def failure(self) -> str:
        """How the robot failed in f, in a word; "" if unknown."""
        if self.f_test is None:
            return ""
        return self.f_test.failure

    @property
    def cut_tests(self) -> int:
        """How many tests were ended early."""
        return sum(test.cut for test in self.tests)

    @property
    def deflake_runs(self) -> int:
        """How many finished tests were re-runs of candidates."""
        return sum(test.is_deflake_run for test in self.tests)

    @property
    def budget(self) -> int | None:
        """The maximum number of tests, None for no limit."""
        reduction = self.scenario.get("reduction")
        most = reduction.get("budget") if isinstance(reduction, dict) else None
        if isinstance(most, int) and most > 0:
            return most
        return None

    @property
    def here(self) -> Node | None:
        """The current node; None before the first event."""
        if self.nodes:
            return self.nodes[self.node]
        return None

    @property
    def path(self) -> tuple[Node, ...]:
        """The nodes from the whole world to the current one."""
        return path(self.nodes, self.node)

    @property
    def finished_tests(self) -> tuple[Test, ...]:
        """All finished tests, collected at each call; use `tests_done` for their number."""
        return tuple(test for test in self.tests if test.is_finished)

    @property
    def tests_done(self) -> int:
        """How many tests are finished."""
        return len(self.tests) - sum(self.tally[outcome] for outcome in UNFINISHED)

    @property
    def certificate(self) -> Certificate | None:
        """The last certificate, if it is one of the current environment and no search began
        since.
        """
        return next(
            (one for one in self.certificates[-1:] if one.node == self.node and not one.past), None
        )

    @property
    def isolating(self) -> Isolation | None:
        """The isolation that has no result yet, if there is one: an engine goes on with it."""
        return next(
            (one for one in self.isolations[-1:] if not (one.ended or one.broken_off)), None
        )

    @property
    def isolated(self) -> Isolation | None:
        """The last isolation that has come to its end: all that is known of the nearest world that
        passes.
        """
        return next((one for one in reversed(self.isolations) if one.ended), None)

    @property
    def margining(self) -> Margins | None:
        """The search for margins that is not over, if there is one: an engine goes on with it."""
        last = self.margins
        if last is None or last.ended or last.broken_off:
            return None
        return last

    @property
    def certified(self) -> bool:
        """Whether the run ended as minimal, and fresh runs show it."""
        return self.minimal and self.certificate is not None and bool(self.certificate.claims)

    @property
    def confirm_tests(self) -> tuple[Test, ...]:
        """The tests of the last certificate, in the order they were started."""
        return tuple(map(self.test, self.fresh))

    @property
    def running_tests(self) -> tuple[Test, ...]:
        """The running tests, in the order they were started."""
        # They are among the last ones, so the search starts from the end.
        running = (test for test in reversed(self.tests) if test.outcome == "running")
        return tuple(islice(running, self.tally["running"]))[::-1]

    def outcomes(self) -> dict[str, int]:
        """Finished tests by outcome, in the order of `OUTCOMES`."""
        counts = {outcome: self.tally[outcome] for outcome in OUTCOMES}
        if self.tally["failed"]:
            return counts | {"failed": self.tally["failed"]}
        return counts

    @property
    def ahead(self) -> int:
        """How many tests were made ahead of time and are not needed so far."""
        needed = set(Environment(self.rests_on))
        made = (
            test
            for test in self.tests
            if test.phase in ("round", CERTIFY) and test.implied_by is None
        )
        return sum(test.is_finished and test.id not in needed for test in made)

    @property
    def made(self) -> int:
        """How many finished tests were simulated."""
        return self.tests_done - self.implied

    @property
    def ended(self) -> bool:
        return self.status in ("finished", "stopped", "failed")


@dataclass(frozen=True, slots=True, kw_only=True)
class Round:
    """One round: `partitions` in the order they are tried, and without how many parts f was
    `missed`. `winner` is the index of the candidate that became the environment, `accepted` that of
    one that the user accepted, or None.
    """

    number: int
    n_partitions: int
    split: Split
    candidates: PersistentTuple[Candidate]
    winner: int | None = None
    done: bool = False
    missed: int = 0
    accepted: int | None = None

    @property
    def environment(self) -> Names:
        return self.split.environment

    @property
    def partitions(self) -> tuple[Names, ...]:
        return self.split.partitions


@dataclass(frozen=True, slots=True, kw_only=True)
class Split:
    """An environment and its disjoint parts, shared by all candidates of a round; by name, and as
    `whole` and `parts` by number. `pinned` models of the environment are in no part, but in every
    candidate. `letters` has the number of each part's letter: a part that was one in the round
    before keeps its letter.
    """

    environment: Names
    partitions: tuple[Names, ...]
    pinned: Names = ()
    whole: Environment = NOTHING
    parts: tuple[Environment, ...] = ()
    always: Environment = NOTHING
    letters: Numbers = ()

    @property
    def lettered(self) -> Iterator[tuple[int, Names]]:
        """Each part's names, with the number of its letter."""
        return zip(self.letters or range(len(self.partitions)), self.partitions, strict=True)

    @property
    def letter_of(self) -> dict[str, int]:
        """The number of the letter of each model that is in a part."""
        return {name: letter for letter, part in self.lettered for name in part}


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A sub-environment to try. `kind` is "partition" or "complement" of partition number
    `partition` of `split`.

    `verdict` is "" while open, then "similar", "missed" (it missed f in a few tests; the algorithm
    may come back to it), "dissimilar", "unknown" (its tests broke), "vetoed", "rejected" (similar,
    but the user rejected it) or "undone" (the user took it back before). `distance` is what the
    prioritization ranked its partition by (m for the proximal ones), or None. `tests` are the ids
    of its tests so far, including re-runs and tests of earlier rounds.
    """

    index: int
    kind: str
    partition: int
    split: Split = field(repr=False, hash=False)
    distance: float | None = None
    verdict: str = ""
    tests: Numbers = ()

    @property
    def kept(self) -> Environment:
        """Its models."""
        part = self.split.parts[self.partition]
        if self.kind == "partition":
            return part | self.split.always
        return self.split.whole - part

    @property
    def models(self) -> Names:
        """The names of its models, collected at each call; use `size` for their number."""
        part = self.split.partitions[self.partition]
        if self.kind == "partition":
            return (*part, *self.split.pinned)
        left_out = frozenset(part)
        return tuple(name for name in self.split.environment if name not in left_out)

    @property
    def size(self) -> int:
        """How many models it has."""
        split = self.split
        part = len(self.split.partitions[self.partition])
        if self.kind == "partition":
            return part + len(split.pinned)
        return len(split.environment) - part

    @property
    def label(self) -> str:
        letters = self.split.letters
        letter = partition_letter(letters[self.partition] if letters else self.partition)
        if self.kind == "partition":
            return f"part {letter}"
        return f"without {letter}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """A sub-environment selected by the user. `models` are the ones it keeps of the whole world; it
    was tried in `node`. `verdict` and `tests` are as in a candidate. `adopted`: it became the
    environment.
    """

    number: int
    models: Names
    node: int
    environment: int = 0
    verdict: str = ""
    tests: Numbers = ()
    adopted: bool = False

    @property
    def size(self) -> int:
        """How many models it has."""
        return len(self.models)

    @property
    def label(self) -> str:
        return f"try {self.number}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Test:
    """Run number `run` of environment number `environment`, with its seed.

    What an event says of it is as in `TestStarted` and `TestFinished`. `outcome` is "running" until
    it ends; a baseline run that failed is "failed" until f is fixed. `node` was the current one;
    for a fresh run it is the last one on the way there with its environment. In a round, a `run`
    above 0 is a re-run (deflaking). `removal` is the number of the removal in whose world it ran.
    `implied_by`: it was not simulated, since that test implies it; `audits`: it was, although that
    test implies it. `taken`: its result was copied from another run. `engine` made it, from 1.
    """

    id: int
    environment: int
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
    took_part: Environment | None = None
    implied_by: int | None = None
    audits: int | None = None
    without: str | None = None
    trial: int | None = None
    removal: int | None = None
    taken: bool = False
    node: int = 0
    engine: int = 0

    @property
    def is_finished(self) -> bool:
        return self.outcome not in UNFINISHED

    @property
    def broke(self) -> bool:
        """Whether it ended and says nothing of f."""
        return self.outcome in BROKEN

    @property
    def is_sound(self) -> bool:
        """Whether it ended and says whether f showed."""
        return self.is_finished and not self.broke

    @property
    def shows_f(self) -> bool:
        return self.outcome == "similar"

    @property
    def is_deflake_run(self) -> bool:
        """Whether it is a finished re-run of a candidate."""
        return self.phase == "round" and self.run > 0 and self.is_finished


def spent(state: RunState, until: float) -> float:
    """The time that engines have worked until Unix time `until`, s."""
    return state.working_seconds + (
        0.0 if state.started_at is None else max(0.0, until - state.started_at)
    )


def partition_letter(index: int) -> str:
    """A, B, ... Z, AA, AB, ... for partition 0, 1, ..."""
    before, rest = divmod(index, 26)
    return (partition_letter(before - 1) if before else "") + chr(ord("A") + rest)
