"""The engine's memory: writes each event once, and finds every finished test again after a restart."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from ddenv.engine.known_tests import KnownTests
from ddenv.engine.subjects import Asked, Keep, Keeps, current_round
from ddenv.reduction.verdict import Acceptance, estimated_rate
from ddenv.reduction.stepping_back import Refused
from ddenv.reduction.verdict import Shown, decided_by
from ddenv.runfile.fold import apply
from ddenv.runfile.fold_decisions import origin
from ddenv.runfile.state import AHEAD, BROKEN, FIRST_FRESH_RUN, FRESH, FRESH_RUNS, ISOLATE, Round, RunState, Test
from ddenv.runfile.store import ROBOT, Event, Motions, RunFile, uncollected
from ddenv.runfile.supports import stack_with

# After these events the search starts again from what the user left.
STEERED = (
    "pinned",
    "unpinned",
    "adopted",
    "accepted_other",
    "went_back",
    "rate_lost",
    "left_out",
    "sliced",
    "slices_refuted",
)


@dataclass(frozen=True)
class Leg:
    """The start of a search: the number of its first round, its n, and the environment that it starts from.

    `n_partitions` is None for the scenario's value. `tests` are those known before, for schemas that learn. `rule` says when a
    candidate is taken. The groups `again` are left out first.
    """

    first_round: int
    n_partitions: int | None
    environment: tuple[str, ...]
    pinned: Keep
    evidence_test: int | None
    settings: dict[str, Any]
    rule: Acceptance
    tests: tuple[int, ...] = ()
    again: tuple[tuple[str, ...], ...] = ()


class Journal:
    """The events of a run, `state` folded from them, and what a resumed engine needs of them.

    `ledger` holds each finished test as (models, run, full) -> its id; a test in it is never made again, except that one that
    broke is made twice, and anew by the next engine. Tests that the algorithm asked for have full False, tests that ran to their
    end full True, most tests both: `early_stop` only changes runs that it cuts. `decisions` are the user's accepts and rejects by
    (round, candidate), `refused` the sub-environments vetoed or rejected: they stay refused in later rounds, as those do that
    lose the rate; `refusals` counts how often that changed. `partitions` are those of each round, as numbers of models. `leg` is
    the current search; once `steered`, a new one has to start. While a user's `command` is obeyed, events hold its number.
    """

    def __init__(self, file: RunFile) -> None:
        self.file = file
        self.state = RunState()
        self.ledger: dict[tuple[Keep, int, bool], int] = {}
        self.decisions: dict[tuple[int, int], str] = {}
        self.refused, self.refusals = Refused(), 0
        self.steered = False
        self.leg: Leg | None = None
        self.command: int | None = None
        self.partitions: dict[int, list[list[int]]] = {}
        self._keeps: dict[int, Keep] = {}
        self._sets = Keeps()
        self._refused_in: dict[Keep, int | None] = {}
        # n of the last round in each node.
        self._fineness: dict[int, int] = {}
        self._seen: set[tuple[str, int | None, int | None]] = set()
        self._broke: dict[tuple[Keep, int, bool], int] = {}
        # In the order of verdicts: that of tests, and which of them are made, depend on the number of workers.
        self._behind_verdicts: dict[int, None] = {}
        self.known = KnownTests()
        self._steps_back = 0
        self._again: tuple[tuple[str, ...], ...] = ()
        # Of thousands of models, a set that is made anew takes a while to be found in the ledger.
        self._whole: tuple[tuple[str, ...], Keep] = (), frozenset()
        with uncollected():
            for event in file.events():
                self._take(event)

    def record(self, kind: str, motions: Motions | None = None, **data: Any) -> None:
        """Writes an event."""
        if self.command is not None:
            data["command"] = self.command
        self._take(self.file.append(kind, data, motions))

    def record_once(self, kind: str, round: int | None = None, candidate: int | None = None, **data: Any) -> None:
        """Writes an event of a round or a candidate, unless an earlier engine has written it."""
        if self.has(kind, round, candidate):
            return
        if candidate is not None:
            data["candidate"] = candidate
        self.record(kind, round=round, **data)

    def shown(self, keep: Keep, run: int, full: bool = False) -> Shown:
        """Whether a finished test showed f; None if it is not made yet. With `full` only a run to the end counts."""
        test = self.ledger.get((keep, run, full))
        if test is None:
            return None
        outcome = self.state.tests[test - 1].outcome
        return "broken" if outcome in BROKEN else outcome == "similar"

    def tests_of(self, keep: Keep, rule: Acceptance) -> list[int]:
        """The tests behind the verdict on `keep`, in the order of runs."""
        return [self.ledger[keep, run, False] for run in range(decided_by(lambda run: self.shown(keep, run), rule))]

    def evidence_of(self, tests: Iterable[int]) -> int:
        """The first of `tests` that showed f."""
        return next(test for test in tests if self.state.tests[test - 1].outcome == "similar")

    @property
    def rule(self) -> Acceptance:
        """When a candidate is taken in the current search."""
        return self._rule() if self.leg is None else self.leg.rule

    def _rule(self) -> Acceptance:
        """By what is known of the whole world now; in the first search, by the baseline alone."""
        reduction, baseline = self.state.scenario["reduction"], self.state.baseline
        most_misses = 1 + reduction["iterations"]
        if reduction["accept_rate"] == "first" or baseline is None:
            return Acceptance(most_misses)
        first = self.leg is None and not self.steered
        rate = estimated_rate(baseline.failures, baseline.runs) if first else self.rate_of_whole()
        return Acceptance(most_misses, rate, reduction["keep_rate"], self._steps_back)

    def rate_of_whole(self) -> float:
        """The estimated rate of f in the whole world, or where a branch begins whose f is another failure."""
        # Fresh runs that only ran ahead of time would make it depend on the number of workers.
        named = (test for test in self.state.tests if test.phase not in (*FRESH, ISOLATE) or self._rests_on(test))
        tests = [test for test in named if self.keep_of_test(test.id) == self.whole]
        sound = [test for test in tests if test.is_finished and test.outcome not in BROKEN]
        return estimated_rate(sum(test.outcome == "similar" for test in sound), len(sound))

    @property
    def whole(self) -> Keep:
        """The models in the world that f was seen in: what is left has to keep its rate."""
        environment = origin(self.state, self.state.node).environment
        if self._whole[0] is not environment:
            self._whole = environment, frozenset(environment)
        return self._whole[1]

    @property
    def has_broken(self) -> bool:
        """Whether tests broke twice, so that a verdict or a claim is unknown."""
        return any(self._leaves_unknown(self.state.tests[test - 1]) for test in self.ledger.values())

    def _leaves_unknown(self, test: Test) -> bool:
        """A baseline that is done, and a certificate, may do without a few runs that broke."""
        if test.outcome not in BROKEN or test.phase == ISOLATE:
            return False
        if test.phase == "baseline":
            return self.state.baseline is None
        last = self.state.certificates[-1:]
        return test.phase not in FRESH or any(claim.verdict == "unknown" for one in last for claim in one.claims)

    @property
    def fresh_run(self) -> int:
        """The number of the first run of the next certificate, whose seed chose nothing so far."""
        if not self.state.certificates:
            return FIRST_FRESH_RUN
        last = self.state.certificates[-1]
        return last.first_run + max(FRESH_RUNS, 2 * last.at_least)

    @property
    def steps_back(self) -> int:
        """How often the search went back because what was left had lost the rate."""
        return self._steps_back

    @property
    def rested_on(self) -> tuple[int, ...]:
        """The tests that decisions rest on, without those that only ran ahead of time."""
        tests, began = self.state.tests, self.state.baseline is not None
        return tuple(test.id for test in tests if self._rests_on(test) or (began and test.phase == "baseline"))

    def _rests_on(self, test: Test) -> bool:
        return bool(self.state.rests_on >> test.id & 1)

    def keep_of_test(self, test: int) -> Keep:
        """The models in a test's world."""
        return self._keeps[test]

    def begin_leg(self) -> Leg:
        """The current search, or a new one if the user changed something. It starts with the last n used here."""
        if self.steered:
            first = max(self.partitions, default=0) + 1
            self.record("leg_started", round=first, n_partitions=self._fineness.get(self.state.node))
        if self.leg is None:
            state = self.state
            f = None if state.baseline is None else state.baseline.failure_test
            self.leg = Leg(1, None, state.elements, frozenset(), f, state.scenario["reduction"], self._rule())
        return self.leg

    def _leg(self, first_round: int, n_partitions: int | None) -> Leg:
        state = self.state
        known = tuple(test for test in self._behind_verdicts if state.tests[test - 1].is_finished)
        return Leg(
            first_round,
            n_partitions,
            state.environment,
            state.pinned,
            state.evidence_test,
            state.scenario["reduction"],
            self._rule(),
            known,
            self._again,
        )

    def is_full(self, phase: str) -> bool:
        """Whether tests of this phase run to the end even if the robot is stuck for good."""
        return phase not in ("round", AHEAD, "hand", "audit") or not self.state.scenario["reduction"].get(
            "early_stop", False
        )

    def start_test(self, asked: Asked, audits: int | None = None) -> int:
        """Writes that a test starts, although the test `audits` implies it; returns its id. Raises as `Asked.place`."""
        return self._begin("test_started", asked, None, {} if audits is None else {"audits": audits})

    def imply(self, asked: Asked, source: int) -> int:
        """Writes the result of a test that the finished test `source` implies; returns its id. Raises as `Asked.place`."""
        return self._begin("implied", asked, {ROBOT: source}, {"by": source})

    def _begin(self, kind: str, asked: Asked, motions: Motions | None, more: dict[str, int]) -> int:
        place, test = asked.place(self.state), len(self.state.tests) + 1
        self._keeps[test] = asked.keep
        self.record(kind, motions, test=test, **place, **more)
        return test

    def implying(self, keep: Keep, run: int, full: bool) -> int | None:
        """The finished test that implies this one, if there is one."""
        return self.known.implying(self.state, keep, run, full)

    def without(self, name: str) -> Keep:
        """The environment without a model, or without all of its stack."""
        environment = self.state.environment
        return frozenset(environment) - frozenset(stack_with(self.state, environment, name))

    def lose_running(self) -> None:
        """Records tests that were started and never ended as lost."""
        for test in self.state.tests:
            if test.outcome == "running":
                self.record("test_lost", test=test.id)

    @property
    def current(self) -> Round:
        """The current round. Raises UserError before the first round."""
        return current_round(self.state)

    def has(self, kind: str, round: int | None = None, candidate: int | None = None) -> bool:
        """Whether an event of a round or a candidate is already written."""
        return (kind, round, candidate) in self._seen

    def _take(self, event: Event) -> None:
        self.state = apply(self.state, event)
        data = event.data
        self._seen.add((event.kind, data.get("round"), data.get("candidate")))
        follow = _FOLLOWED.get(event.kind)
        if follow is not None:
            follow(self, data)
        if event.kind in STEERED:
            self.steered = True
        self.refused.count_as_f(self.state.failures)

    def _round_started(self, data: dict[str, Any]) -> None:
        self.partitions[data["round"]] = data["partitions"]
        self._fineness[self.state.node] = data["n_partitions"]

    def _arrived(self, _: dict[str, Any]) -> None:
        if (round := self.state.round) is not None:
            self._fineness[self.state.node] = round.n_partitions

    def _leg_started(self, data: dict[str, Any]) -> None:
        self.leg, self.steered = self._leg(data["round"], data["n_partitions"]), False
        self._again = ()

    def _engine_started(self, _: dict[str, Any]) -> None:
        """Tests that broke are made again; verdicts that rest on them may change, so the search starts again."""
        broke = {key: test for key, id in self.ledger.items() if (test := self.state.tests[id - 1]).outcome in BROKEN}
        again = [test for test in broke.values() if self._leaves_unknown(test)]
        for key in [key for key, test in broke.items() if test in again or test.phase == ISOLATE]:
            del self.ledger[key]
        self._broke.clear()
        if again and self.state.baseline is not None:
            self.steered = True

    def _compared(self, data: dict[str, Any]) -> None:
        """What was made with something else implies nothing of tests that are made now."""
        if not data["same"]:
            self.known = KnownTests()

    def _slices_refuted(self, _: dict[str, Any]) -> None:
        """What was implied is wanted again."""
        tests = self.state.tests
        self.ledger = {key: test for key, test in self.ledger.items() if tests[test - 1].implied_by is None}

    def _rate_lost(self, data: dict[str, Any]) -> None:
        """What has lost the rate, and all parts of it, are not taken again."""
        elements = self.state.elements
        self._steps_back += 1
        self._again = tuple(tuple(elements[model] for model in group) for group in data["again"])
        self.refused.lose(frozenset(self.state.nodes[data["lost"]].environment))

    def _test_started(self, data: dict[str, Any]) -> None:
        self._keeps.setdefault(data["test"], self._sets.of(self.state, self.state.tests[-1]))

    def _test_finished(self, data: dict[str, Any]) -> None:
        self._enter(self.state.tests[data["test"] - 1])

    def _implied(self, data: dict[str, Any]) -> None:
        self._test_started(data)
        self._test_finished(data)

    def _decided(self, data: dict[str, Any]) -> None:
        round, candidate = data["round"], data["candidate"]
        self.decisions[round, candidate] = data["decision"]
        if data["decision"] == "reject":
            self._refuse(self._sets.of_candidate(self.state, candidate), "rejected", round)

    def _verdict_on(self, data: dict[str, Any]) -> None:
        self._behind_verdicts |= dict.fromkeys(data["tests"])

    def _vetoed(self, data: dict[str, Any]) -> None:
        self._refuse(self._sets.of_candidate(self.state, data["candidate"]), data["verdict"], data.get("round"))

    def _unvetoed(self, data: dict[str, Any]) -> None:
        """A refusal in an earlier round has blocked candidates since, so the search starts again."""
        keep, round = self._sets.of_candidate(self.state, data["candidate"]), data["round"]
        self.refused.pop(keep, None)
        self.decisions.pop((round, data["candidate"]), None)
        # A rejected candidate was judged, and is judged again.
        self._seen.discard(("candidate_judged", round, data["candidate"]))
        self.refusals += 1
        if self._refused_in.pop(keep, None) != round:
            self.steered = True

    def _refuse(self, keep: Keep, verdict: str, round: int | None = None) -> None:
        self.refused.setdefault(keep, verdict)
        self._refused_in.setdefault(keep, round)
        self.refusals += 1

    def _changed(self, data: dict[str, Any]) -> None:
        """The budget does not change the order of a search."""
        if set(data["settings"]) != {"budget"}:
            self.steered = True

    def _went_back(self, data: dict[str, Any]) -> None:
        """An undone reduction is not accepted again; an environment that the user goes to is wanted."""
        nodes = self.state.nodes
        wanted = frozenset(nodes[data["node"]].environment)
        self.refused.allow(wanted)
        self._refused_in.pop(wanted, None)
        if data.get("rejected") is not None:
            self._refuse(frozenset(nodes[data["rejected"]].environment), "undone")

    def _enter(self, test: Test) -> None:
        keep = self._keeps[test.id]
        if test.outcome in BROKEN:
            full = self.is_full(test.phase)
            self._broke[keep, test.run, full] = broken = self._broke.get((keep, test.run, full), 0) + 1
            if broken < 2:
                return
        for full, holds in ((False, test.phase not in FRESH), (True, not test.cut)):
            if holds:
                self.ledger[keep, test.run, full] = test.id
                self.known.enter(test, keep, full)


_FOLLOWED: dict[str, Callable[[Journal, dict[str, Any]], None]] = {
    "engine_started": Journal._engine_started,
    "compared": Journal._compared,
    "rate_lost": Journal._rate_lost,
    "candidate_judged": Journal._verdict_on,
    "trial_judged": Journal._verdict_on,
    "round_started": Journal._round_started,
    "reduced": Journal._arrived,
    "adopted": Journal._arrived,
    "left_out": Journal._arrived,
    "sliced": Journal._arrived,
    "slices_refuted": Journal._slices_refuted,
    "accepted_other": Journal._arrived,
    "leg_started": Journal._leg_started,
    "test_started": Journal._test_started,
    "test_finished": Journal._test_finished,
    "implied": Journal._implied,
    "decided": Journal._decided,
    "vetoed": Journal._vetoed,
    "unvetoed": Journal._unvetoed,
    "went_back": Journal._went_back,
    "changed": Journal._changed,
}
