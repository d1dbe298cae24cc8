"""What a run has found so far, as plain frozen data: searches, environments, certificates,
decisions of the user, isolation, margins; and what its tests were computed with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ddenv.environment import Environment, Numbers
from ddenv.text import Data, Names

if TYPE_CHECKING:
    from ddenv.runfile import events as e


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """The start of a search: the number of its first round, the node that it starts from, and what
    was known then. `n_partitions` is None for the scenario's value. `tests` are those that verdicts
    rested on, for schemas that learn. A candidate has to keep the `rate` of f, 0 if its first run
    with f decides; the search had gone back so many `steps_back`. The groups `again` are left out
    first. `past` are its rounds that are over.
    """

    first_round: int
    node: int
    n_partitions: int | None
    pinned: frozenset[str]
    evidence_test: int
    settings: Data
    rate: float = 0.0
    steps_back: int = 0
    tests: Numbers = ()
    again: tuple[Numbers, ...] = ()
    past: tuple[PastRound, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PastRound:
    """A round of the current search that is over: a `digest` of its partitions, its winner, and the
    tests of its verdicts. `evidence_test` is the run of the winner that guides the next rounds;
    tests of the candidates `unknown` broke.
    """

    digest: int
    winner: int | None
    evidence_test: int | None
    tests: Numbers
    unknown: Numbers = ()


@dataclass(frozen=True, slots=True)
class Refusal:
    """The user refused an environment in round number `round`: it is "vetoed", "rejected" or
    "undone".
    """

    environment: Environment
    verdict: str
    round: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """An environment that the run has reached, in the tree of its reductions; number 0 is the whole
    world, without parent.

    `id` is the number of its environment. The last round in it had `n_partitions`, None before one.

    `how` is "start", "reduced" (a candidate showed f), "adopted" (a trial did), "accepted" (the
    user accepted another failure, too), "instead" (from here on another failure is f), "certified"
    (its certificate showed that one more model can go), "left_out" (the user left out one that only
    helped) or "sliced" (what went did not affect the runs `sliced_by`); `what` names the
    candidate, trial or test. `tests` is the number of tests finished by then, `own_tests` of them
    were made on the way to it, not for other branches; `time` is Unix time, s, `round` the round
    that ended in it. `evidence_test` is the run in it that guides the next rounds, None before f is
    known. `method` is the algorithm and pair. `minimal`: the reduction ended here; `rejected`: it
    was taken back; `lost_rate`: fresh runs showed that f is too rare in it. `runs` are the tests of
    its environment that ended and did not break; `shown` of them showed f. Those that chose a slice
    are not among them: they would show its rate as too high. `to_audit`: one of these is simulated
    in the slice, too.
    """

    number: int
    parent: int | None
    how: str
    what: str
    environment: Names
    id: int = 0
    n_partitions: int | None = None
    round: int | None = None
    tests: int = 0
    own_tests: int = 0
    time: float = 0.0
    evidence_test: int | None = None
    method: str = ""
    minimal: bool = False
    rejected: bool = False
    lost_rate: bool = False
    runs: Numbers = ()
    shown: int = 0
    sliced_by: Numbers = ()
    to_audit: bool = False


def path(nodes: Sequence[Node], number: int | None) -> tuple[Node, ...]:
    """The nodes from the whole world to one of them, both included."""
    found: list[Node] = []
    while number is not None and number < len(nodes):
        found.append(nodes[number])
        number = nodes[number].parent
    return tuple(reversed(found))


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """What fresh runs show of the environment of `node`; number 1 is the run's first certificate.
    Its terms are those of `CertificateStarted`, and `first_run` is the number of its first run.
    `claims` are empty while its tests are made. `past`: a search began since. `branch`: f is
    another failure there, so the rate where that branch begins stands for the whole world's.
    `elsewhere`: its runs end elsewhere than f, within epsilon.
    """

    number: int
    node: int
    first_run: int
    keep_rate: float
    rate: float
    error: float
    at_least: int
    certify_rate: float
    claims: tuple[Claim, ...] = ()
    past: bool = False
    branch: bool = False
    seeds: Numbers = ()
    elsewhere: e.EndsElsewhere | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """One claim of a certificate, as in `ClaimMade`: about what is left, or, if `without` is a
    model, about that without it. `verdict`: what is left is "kept" (it keeps the rate), "lost", or
    "exact" (its rate was only measured); a model is "needed" (without it f is rare enough), "helps"
    (f is rarer, but not that rare), "rarer" (by how much is not shown) or "not needed" (f seems to
    show as often); "not shown" if the runs do not decide, "unknown" if they broke. A claim that
    `is_exact` is about these runs of the search, and about no rate.
    """

    without: str | None
    verdict: str
    shown: int
    runs: int
    low: float
    high: float
    outcomes: tuple[tuple[str, int], ...] = ()
    environment: int = 0
    bound: float | None = None

    @property
    def is_exact(self) -> bool:
        return self.low == self.high


@dataclass(frozen=True, slots=True)
class Point:
    """The size of the environment after `tests` finished tests; at least `needed` of its models
    were known to be needed.
    """

    tests: int
    models: int
    needed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """A decision of the user: `kind` is the event's, `words` describe it; at Unix `time`, s, after
    `tests` tests, in `node`.
    """

    time: float
    tests: int
    node: int
    kind: str
    words: str


@dataclass(frozen=True, slots=True)
class Removal:
    """The whole world without `models` was tried. `verdict` is "" while it is open, then "passes",
    "fails" or "unknown" (its tests broke), by the `tests` with these ids.
    """

    models: Names
    environment: int
    verdict: str = ""
    tests: Numbers = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Returned:
    """What fresh runs show of a world that passes; or, if `back` is a model, of that with it (and
    its stack) put back. `verdict`: the world "passes" or "fails"; a model has to go ("needed") or
    not ("not needed"); "not shown" if the runs do not decide, "unknown" if they broke.
    """

    back: str | None
    verdict: str
    reached: int
    runs: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Check:
    """Fresh runs of removal number `removal` (from 1), and of it with each model put back."""

    removal: int
    claims: tuple[Returned, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Isolation:
    """A search for the fewest models that have to go from the whole world so that the robot reaches
    its goal, as it was `asked`. `checks` are fresh runs of what the search found; a check that
    shows something else sends it on. `ended`: `found` is the removal after which the robot passes,
    None if there is none. `broken_off`: the user gave it up, or ended it by another decision.
    """

    asked: e.IsolationStarted
    checks: tuple[Check, ...] = ()
    ended: bool = False
    found: int | None = None
    broken_off: bool = False


@dataclass(frozen=True, slots=True)
class NumberTried:
    """A number whose values are tried where f shows at `rate`; each verdict is wrong with a
    probability of at most `error`.
    """

    asked: e.NumberAsked
    rate: float
    error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """How far numbers may change in the environment that was asked for, as `runs` and values that
    are `impossible` show. The last call is as it was `asked`, after the first `before_call` runs,
    and `earlier` runs in other environments. `ended`: the search is over; `broken_off`: a decision
    of the user ended it.
    """

    asked: e.MarginsStarted
    numbers: tuple[NumberTried, ...]
    before_call: int = 0
    earlier: int = 0
    runs: tuple[e.MarginRan, ...] = ()
    impossible: tuple[e.MarginImpossible, ...] = ()
    ended: bool = False
    broken_off: bool = False

    @property
    def wanted(self) -> Names:
        """The names of the numbers that the last call asks for."""
        return tuple(one.name for one in self.asked.numbers)

    @property
    def made(self) -> int:
        """How many runs with a changed number the file has. The motion of the latest one has the
        number -made.
        """
        return self.earlier + len(self.runs)


@dataclass(frozen=True, slots=True)
class Physics:
    """What the tests were computed with: only the same software on the same processor gives the
    same bits. `now` is what the last engine computes with, `proven` what gave the same bits as the
    tests before it, both in words, "" before the first engine. `mixed` has a sentence for each time
    that the user went on although the bits differ.
    """

    now: str = ""
    proven: str = ""
    mixed: Names = ()

    def started(self, engine: e.EngineStarted, tests: int) -> Physics:
        """After the start of an engine, when `tests` tests were finished."""
        words = (f"ddenv {engine.version}", engine.simulator, engine.machine)
        now = ", ".join(each for each in words if each)
        return replace(self, now=now, proven=self.proven if tests else now)

    def compared(self, same: bool) -> Physics:
        """After a test was made again, with the same bits or not."""
        mixed = self.mixed if same else (*self.mixed, f"first {self.proven}, then {self.now}")
        return replace(self, proven=self.now, mixed=mixed)
