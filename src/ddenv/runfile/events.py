"""The events of a run file: what each says, as frozen dataclasses with their units.

Models are numbers into the run's `elements`, environments are numbers into those that
`EnvironmentNamed` has, tests count from 1. A field with a default may be missing in a file. Times
are in s, places in m.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, dataclass_transform

from ddenv.environment import NOTHING
from ddenv.runfile.failure_words import named
from ddenv.runfile.reading import (
    Models,
    Natural,
    Number,
    OneOf,
    Part,
    Pose,
    Positive,
    Real,
    Seconds,
    Share,
)
from ddenv.text import Data, Names, snake_case

Pair = tuple[Natural, Natural]
Place = tuple[Real, Real, Real]
Phase = Annotated[str, OneOf("baseline", "round", "hand", "audit", "certify", "isolate")]
Outcome = Annotated[str, OneOf("similar", "other", "pass", "error", "timeout", "failed")]
Verdict = Annotated[str, OneOf("similar", "dissimilar", "unknown")]


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field,))
class Event:
    """Every event is one of these, and so a frozen dataclass."""

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True)(cls)


# The engine.


class Created(Event):
    """The first event: the scenario as plain data, and the names of all models that may go. In
    `welds` the first one is welded to the second.
    """

    scenario: Data
    elements: Names
    welds: tuple[Pair, ...] = ()


class EngineStarted(Event):
    """`version` is that of ddenv, `simulator` has those of Drake and numpy, or the oracle,
    `machine` Python and the processor.
    """

    pid: Natural
    jobs: Natural
    version: str
    simulator: str
    machine: str = ""


class Cluster(Event):
    """What has happened to a cluster, in `words`, and how many tests its workers can make at the
    same time now.
    """

    jobs: Natural
    words: str


class Comparing(Event):
    """A test is made again, because this engine computes with something else than the earlier ones,
    or as runs must repeat.
    """

    test: Number


class Compared(Event):
    """Whether its bits are the same; if not, the user goes on with mixed tests."""

    same: bool


class Paused(Event):
    """No new test starts."""


class Resumed(Event):
    """Tests start again."""


class DiskSpace(Event):
    """Whether the disk has room for more tests: `needed` bytes; `free` are there. `in_file`: up to
    the limit of a file's size.
    """

    enough: bool
    needed: Natural
    free: Natural
    in_file: bool = False


class ClockJumped(Event):
    """Unix time went on or back by so many seconds at once: the machine slept, or its clock was
    set.
    """

    seconds: Real


class Finished(Event):
    """The run ended by itself. `minimal` says whether no model can be removed."""

    minimal: bool
    reason: str


class EngineStopped(Event):
    """The engine was stopped and can be resumed."""

    reason: str


class EngineFailed(Event):
    """The engine could not go on."""

    reason: str


# The world.


class SupportsStarted(Event):
    """The piles are being settled, to find which models rest on which; only if that takes more than
    a second.
    """


class Supports(Event):
    """The first model of each pair rests on the second once the whole world has settled; `why` that
    is unknown. The first model of each tie would move by itself without the second; None if that is
    unknown.
    """

    pairs: tuple[Pair, ...]
    ties: tuple[Pair, ...] | None = None
    why: str = ""


class Still(Event):
    """Nothing in the world moves by itself: there are no ties."""


class Noted(Event):
    """A sentence about something that is wrong with the whole world; one `about` each thing."""

    about: str
    words: str


class EnvironmentNamed(Event):
    """These models are environment number `environment`, from 0; the whole world is number 0
    without an event.
    """

    environment: Number
    models: Models


# Tests.


@dataclass(frozen=True, slots=True, kw_only=True)
class TestStart:
    """Run number `run` of an environment, with a seed of its own. `phase` says what for: the
    baseline, a `candidate` of a round, the user's `trial` ("hand"), an audit of a slice, a
    certificate ("certify": with a fresh seed, `without` a model if it is given) or an isolation.
    """

    test: Number
    environment: Natural
    run: Natural
    seed: Natural
    phase: Phase
    round: Number | None = None
    candidate: Natural | None = None
    trial: Number | None = None
    without: Natural | None = None


class TestStarted(TestStart, Event):
    """A test starts. It `audits` the test that implies it."""

    audits: Number | None = None


class Implied(TestStart, Event):
    """A test starts and ends at once: the result is that of the test `by`, which has its
    trajectories.
    """

    by: Number


class TestFinished(Event):
    """How a test ended; its trajectories stand beside it.

    `distance` is from the robot's end to that of f, m; `end_pose` is x, y, z m, qw, qx, qy, qz.
    `failure` is a key of `DEEDS`, or why the simulation broke. `first_sensed` and `first_touched`
    have (model, s). `cut`: it ended early. `took_part` are the models that can have changed a bit
    of it. `taken` is the run whose result was copied.
    """

    test: Number
    outcome: Outcome
    failure: str
    distance: Real | None
    end_pose: Pose | None
    simulated_seconds: Seconds
    wall_seconds: Seconds
    first_sensed: tuple[tuple[Natural, Seconds], ...] = ()
    first_touched: tuple[tuple[Natural, Seconds], ...] = ()
    cut: bool = False
    took_part: Models | None = None
    taken: str = ""


class TestLost(Event):
    """A test was running when the engine ended."""

    test: Number


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Tests that are judged anew, by their ids: their outcomes, and how far from f they ended,
    m.
    """

    outcomes: dict[Natural, Outcome]
    distances: dict[Natural, Real]


@dataclass(frozen=True, slots=True)
class SeenFailure:
    """A failure that runs of the whole world showed: in `runs` of them, and `test` is the one in
    their middle. `kinds` say how the robot failed, the most frequent one first. `position` is where
    `test` ended, x, y, z m.
    """

    test: Number
    runs: Natural
    kinds: Names
    position: Place

    @property
    def name(self) -> str:
        return named(self.kinds, self.position)


class BaselineFinished(Event):
    """f is fixed by the runs of the whole world: `failure_test` is the test whose end is f.

    `failures` of `runs` showed f, at a `rate` of which `low`..`high` is Wilson's 95 % interval;
    `broken` more broke, and say nothing. The first `chose` runs are not among these: they chose f,
    which was lucky in them. `seen` are all failures of the runs that chose, the most frequent
    first, in the numbers of the setting `failure`. `miss_chance` is (1-p)^(1+iterations), the
    chance that all tests of a candidate miss f; `iterations_95` is the number of iterations for a
    95 % chance of seeing f. `position` is f's end, x, y, z m. `wall_limit` is what a later test may
    take in real time by the speed of these runs, s, None if unknown. It is the one thing here that
    differs from machine to machine. `alike`: several runs were made, and all of them show f and
    have the same bits.
    """

    runs: Natural
    failures: Natural
    rate: Share
    low: Share
    high: Share
    failure_test: Number
    position: Place
    miss_chance: Share
    iterations_95: Natural
    judged: Outcomes
    broken: Natural = 0
    wall_limit: Seconds | None = field(default=None, compare=False)
    seen: tuple[SeenFailure, ...] = ()
    chose: Natural = 0
    alike: bool = False

    @property
    def others(self) -> tuple[tuple[int, SeenFailure], ...]:
        """The failures that are not f, each with its number."""
        return tuple(
            (number, one)
            for number, one in enumerate(self.seen, 1)
            if one.test != self.failure_test
        )


# The search.


class LegStarted(Event):
    """A search starts from the current environment, with round number `round`. Its first round has
    `n_partitions`, None for the scenario's. It keeps `keep_rate` of the `rate`; with 0 the first
    run with f decides.
    """

    round: Number
    n_partitions: Number | None = None
    rate: Share = 0.0


class RoundStarted(Event):
    """An environment is split into partitions; candidates are "partition" or "complement", the
    number of the partition, and the distance that ranks it, m, if it is one.
    """

    round: Number
    n_partitions: Natural
    environment: Natural
    partitions: tuple[tuple[Natural, ...], ...]
    candidates: tuple[
        tuple[Annotated[str, OneOf("partition", "complement")], Natural, Real | None], ...
    ]
    pinned: Models = NOTHING


class Forecast(Event):
    """How many more tests of candidates a search of so many models takes, low, likely and high,
    when `tests_done` were finished. In one case of ten fewer than the low number are left, in one
    of ten more than the high one.
    """

    round: Number
    tests: tuple[Natural, Natural, Natural]
    tests_done: Natural


@dataclass(frozen=True, slots=True)
class OfCandidate:
    """Which candidate of the current round an event is about."""

    round: Number
    candidate: Natural


class CandidateJudged(OfCandidate, Event):
    """The verdict on a candidate, by these tests. Earlier versions also wrote how many were `known`
    before.
    """

    verdict: Annotated[str, OneOf("similar", "missed", "dissimilar", "unknown")]
    tests: tuple[Number, ...]
    known: Natural = 0


class Waiting(OfCandidate, Event):
    """A candidate showed f, and waits for the user."""


class Decided(OfCandidate, Event):
    """The user accepts or rejects it."""

    decision: Annotated[str, OneOf("accept", "reject")]


class Reduced(OfCandidate, Event):
    """A candidate becomes the environment; `evidence_test` is a run of it that showed f."""

    environment: Natural
    evidence_test: Number


class RoundFinished(Event):
    """A round is over."""

    round: Number


class Sliced(Event):
    """The environment is cut down to what took part in these tests. `audit`: one of them is
    simulated there, too.
    """

    environment: Natural
    tests: tuple[Number, ...]
    evidence_test: Number
    audit: bool = False


class SlicesRefuted(Event):
    """The audit `test` does not repeat the test `by`, which implies it. Slices are no longer used,
    implied tests are void, and the run goes back to a node.
    """

    test: Number
    by: Number
    node: Natural


class EarlyStopEnded(Event):
    """From here on all tests run to their end: the tests that led to what a `certificate` refutes
    ended early; or the test `by` shows to its end another verdict than `test`, which ended early.
    """

    certificate: Number | None = None
    test: Number | None = None
    by: Number | None = None


# Certificates.


class CertificateStarted(Event):
    """Full runs with fresh seeds follow, from run number `run` on. They have to show that what is
    left keeps `certify_rate` of the rate of f, which was estimated as `rate`; the search aimed at
    `keep_rate`. Before there was a `certify_rate`, they were one.

    With `seeds`, on which what is left shows f, chosen runs were reduced exactly, and fresh ones
    only say how often f shows.
    """

    certificate: Number
    run: Natural
    rate: Share
    keep_rate: Part
    error: Part
    at_least: Natural
    certify_rate: Part | None = None
    seeds: tuple[Natural, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ClaimMade:
    """A claim about an environment: about what is left, or, if `without` is a model, about that
    without it.

    `shown` of `runs` showed f, `low`..`high` is their interval; `outcomes` counts all of them. What
    is left keeps at least `bound` of the rate; without a model f shows at most `bound` times as
    often as with it. A claim about the runs themselves, not about a rate, has their share as both
    ends of the interval.
    """

    without: Natural | None
    environment: Natural
    verdict: Annotated[
        str,
        OneOf(
            "kept",
            "lost",
            "exact",
            "needed",
            "helps",
            "rarer",
            "not needed",
            "not shown",
            "unknown",
        ),
    ]
    shown: Natural
    runs: Natural
    low: Share
    high: Share
    outcomes: dict[str, Natural]
    bound: Share | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class EndsElsewhere:
    """Of the ends of f, `whole` of `of_whole` in the baseline are in a group, and `left` of
    `of_left` fresh ones of what is left. Other groups are `apart` from it, m; an `epsilon` that
    tells them apart, m.
    """

    apart: Positive
    epsilon: Positive
    whole: Natural
    of_whole: Natural
    left: Natural
    of_left: Natural


class CertificateFinished(Event):
    """What fresh runs show; the claims rest on these tests. `elsewhere`: what is left ends
    elsewhere within epsilon.
    """

    claims: tuple[ClaimMade, ...]
    tests: tuple[Number, ...]
    elsewhere: EndsElsewhere | None = None


class RateLost(Event):
    """The run goes back to `node`, since what is left lost the rate; the node `lost` after it is
    not taken again. The groups `again` are left out at once, or in halves.
    """

    node: Natural
    lost: Natural
    again: tuple[tuple[Natural, ...], ...]
    tests: tuple[Number, ...]


class LeftOut(Event):
    """A certificate showed that a model is not needed; `by_user`: that it only helps, and the user
    left it out.
    """

    without: Natural
    environment: Natural
    evidence_test: Number
    by_user: bool = False


# Isolation.


class IsolationStarted(Event):
    """The fewest models are sought that have to go from the whole world so that the robot reaches
    its goal.

    Fresh runs begin at number `run`; each check has `block` of them. A world passes at the rate
    `wanted` rather than `rather_than`. The `suspects` go first to last, at first `size` of them.
    `before` is why the reduction had ended. With `chosen` runs a world passes if the robot reaches
    its goal in each of them, and fresh runs only say how often it does.
    """

    isolation: Number
    run: Natural
    block: Number
    wanted: Share
    rather_than: Share
    keep_rate: Share
    error: Part
    at_least: Natural
    suspects: tuple[Natural, ...]
    size: Natural
    before: str
    chosen: tuple[Natural, ...] = ()


class RemovalJudged(Event):
    """What the search says of an environment of isolation."""

    environment: Natural
    verdict: Annotated[str, OneOf("passes", "fails", "unknown")]
    tests: tuple[Number, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReturnedMade:
    """A claim of a check: about a world that passes, or, if `back` is a model, about that with it
    put back.
    """

    back: Natural | None
    verdict: Annotated[
        str, OneOf("passes", "fails", "needed", "not needed", "not shown", "unknown")
    ]
    reached: Natural
    runs: Natural
    low: Share
    high: Share


class IsolationChecked(Event):
    """What fresh runs show of an environment; the claims rest on these tests."""

    environment: Natural
    claims: tuple[ReturnedMade, ...]
    tests: tuple[Number, ...]


class IsolationFinished(Event):
    """The environment in which the robot passes; None if there is none."""

    environment: Natural | None


class IsolationGivenUp(Event):
    """The user ends it."""


# Margins.


@dataclass(frozen=True, slots=True, kw_only=True)
class NumberAsked:
    """A number of the world or of the scenario, such as "barrel_02.y": its value `now`, and the
    `low`est and `high`est to try. A change is measured as a share of `scale`; less than
    `resolution` does not matter. All are in `unit`, "" for a plain number. Numbers that are changed
    `together`, in %, have each a name, the present value and that at 100 %.
    """

    name: str
    now: Real
    low: Real
    high: Real
    scale: Positive
    resolution: Positive
    unit: str = ""
    together: tuple[tuple[str, Real, Real], ...] = ()


class MarginsStarted(Event):
    """A search for how far each of the `numbers` may change in an environment where f shows at
    `rate`, with at most `budget` runs. Each verdict on a value is wrong with a probability of at
    most `error`. `certified`: fresh runs have shown the rate. `status` and `before` are how the
    reduction stood, and why.
    """

    numbers: tuple[NumberAsked, ...]
    environment: Natural
    rate: Share
    error: Part
    budget: Number
    certified: bool
    status: Annotated[str, OneOf("finished", "stopped")]
    before: str


class MarginRan(Event):
    """How a run ended in which the number `name` had a `value`; outcome, failure, distance and end
    as in `TestFinished`.
    """

    name: str
    value: Real
    run: Natural
    seed: Natural
    outcome: Outcome
    failure: str
    distance: Real | None
    end_pose: Pose | None
    wall_seconds: Seconds


class MarginImpossible(Event):
    """The number `name` cannot have this `value`, and `why`."""

    name: str
    value: Real
    why: str


class MarginsFinished(Event):
    """All numbers that were asked for are looked at, or the budget is used up."""


# Decisions of the user.


class AcceptModeChanged(Event):
    """Reductions are made at once, or wait for the user."""

    mode: Annotated[str, OneOf("automatic", "ask")]


class Vetoed(OfCandidate, Event):
    """A candidate is left out; `again`: because the same models were refused before."""

    verdict: Annotated[str, OneOf("vetoed", "rejected", "undone")] = "vetoed"
    again: bool = False


class Unvetoed(OfCandidate, Event):
    """It is tried after all."""


class Pinned(Event):
    """These models always stay."""

    models: tuple[Natural, ...]


class Unpinned(Event):
    """These models may go again."""

    models: tuple[Natural, ...]


class TrialStarted(Event):
    """The user tries a selection."""

    trial: Number
    environment: Natural


class TrialJudged(Event):
    """Its verdict, as of a candidate."""

    trial: Number
    verdict: Verdict
    tests: tuple[Number, ...]
    known: Natural = 0


class Adopted(Event):
    """A try becomes the environment."""

    trial: Number
    environment: Natural
    evidence_test: Number


class AcceptedOther(Event):
    """The failure of a test counts as f from here on; `what` names it. `instead`: in a branch, in
    place of what was f.
    """

    test: Number
    what: str
    environment: Natural
    judged: Outcomes
    trial: Number | None = None
    instead: bool = False


class WentBack(Event):
    """A node is the current one again; `rejected` is the node that is undone. `judged` if other
    failures count as f there.
    """

    node: Natural
    rejected: Natural | None = None
    judged: Outcomes | None = None


class Changed(Event):
    """New values of settings. Where they say anew which failures are the same, `baseline` is fixed
    again, and judges all tests.
    """

    settings: Data
    baseline: BaselineFinished | None = None


class CommandRefused(Event):
    """A command was not possible."""

    why: str


class CommandHandled(Event):
    """A command caused no other event."""


# By their names in a file: `RoundStarted` is `round_started`.
KINDS: dict[str, type[Event]] = {
    snake_case(name): kind
    for name, kind in list(globals().items())
    if isinstance(kind, type) and issubclass(kind, Event) and kind is not Event
}
NAMES: dict[type[Event], str] = {kind: name for name, kind in KINDS.items()}
