"""Carries a reduction through: baseline, rounds, end. The algorithm chooses what to test, the bench makes the tests."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice

from ddenv.evidence.claims import current, is_minimal, verdict_on
from ddenv.engine.ahead import Ahead, Now
from ddenv.engine.announcing import announce
from ddenv.engine.auditing import compare
from ddenv.engine.baseline import run_baseline
from ddenv.engine.bench import Bench, Wanted
from ddenv.engine.certify import CHANGED, Certifier
from ddenv.engine.control import Control, Steered, Stopped
from ddenv.engine.forecasting import forecasting
from ddenv.engine.journal import Journal
from ddenv.engine.judging import known_failure, rows_of
from ddenv.engine.settle import settle
from ddenv.engine.sight import Sight
from ddenv.engine.slicing import audit_slice, slice_environment
from ddenv.engine.subjects import Asked, Keep
from ddenv.engine.wall_limit import limit_after
from ddenv.reduction.verdict import MOST_RUNS, Acceptance
from ddenv.reduction.evidence import Evidence, Trial
from ddenv.reduction.forecast import Memory, Moment
from ddenv.reduction.guide import Guide, Search, make_guide, search
from ddenv.reduction.round import Candidate, Round
from ddenv.reduction.rounds_ahead import Path, RoundsAhead, foreseeing
from ddenv.reduction.stacks import Stacks
from ddenv.reduction.stepping_back import tried_again
from ddenv.reduction.verdict import Standing, standing
from ddenv.runfile.state import BROKEN
from ddenv.runfile.supports import stacks_of
from ddenv.schemas import split_pair
from ddenv.words import count
from ddenv.world.model import World
from ddenv.world.scenario import Reduction, Scenario

# Of larger environments, only so many claims of a certificate are foreseen.
MOST_CLAIMS = 20
# The sets of models of so many candidates are held: with thousands of models, one takes a while to make and to find in the ledger,
# and 10,000 of them would take gigabytes.
HELD = 64


class Driver:
    """One engine's work on one run. All decisions follow from the journal, so a resumed run continues in the same way."""

    def __init__(self, scenario: Scenario, world: World, journal: Journal, bench: Bench, control: Control) -> None:
        self._scenario, self._world = scenario, world
        self._reduction = scenario.reduction
        self._failure_spec = scenario.failure
        self._journal = journal
        self._bench = bench
        self._control = control
        self._sight = Sight(world, journal.state.elements, self._reduction.delta, self._reduction.seed)
        self._evidence: Evidence | None = None
        self._trials: list[Trial] = []
        self._learnt: set[int] = set()
        self._number = {name: index for index, name in enumerate(journal.state.elements)}
        self._pinned: Keep = frozenset()
        # The winners of this search's rounds so far.
        self._path: Path = ()
        # By the identities of candidates, which live as long as they are held here.
        self._keeps: dict[int, tuple[Candidate, Keep]] = {}
        # How many candidates of the round were dissimilar, and how many refusals there were at that time.
        self._judged = 0
        self._refusals = 0

    def reduce(self) -> None:
        """The whole run. Raises Stopped, and UserError when it cannot go on."""
        # Unknown names are refused before a robot runs.
        self._stack(self._journal.state.elements, frozenset())
        self._begin(self._reduction)
        settle(self._scenario, self._world, self._journal, self._bench)
        reason = self._baseline()
        if reason:
            self._end(False, reason)
            return
        self._control.search_begins()
        # An engine that was killed may not have compared its last one.
        compare(self._journal, self._journal.state.finished_tests)
        # The user may have gone back before this engine started; then it pauses there.
        with suppress(Steered):
            while self._journal.steered:
                self._bench.tick()
        while True:
            try:
                slice_environment(self._journal)
                self._search()
                return
            except Steered:
                continue

    def certify(self, at_least: int) -> None:
        """Makes one more certificate of the current environment, and goes neither back nor on. Raises as `reduce`."""
        # A search that is due would begin at the end.
        self._journal.begin_leg()
        state = self._journal.state
        self._stack(state.environment, state.pinned)
        self._certify(list(self._stacks.representatives), at_least, moves=False, anew=True)

    def _search(self) -> None:
        """Searches from the current environment to the end. Raises Steered if the user changes something."""
        leg = self._journal.begin_leg()
        self._reduction = Reduction.model_validate(leg.settings)
        self._learnt = set(leg.tests)
        self._trials = [
            self._learnt_from(test) for test in leg.tests if self._journal.state.tests[test - 1].outcome not in BROKEN
        ]
        self._look_at(leg.evidence_test)
        self._stack(leg.environment, leg.pinned)
        algorithm = self._begin(self._reduction, leg.n_partitions, leg.again)
        number, winner = leg.first_round, None
        try:
            while True:
                winner = self._round(number, algorithm.send(winner))
                number += 1
        except StopIteration as end:
            self._finish(end.value | self._pinned)

    def _stack(self, environment: tuple[str, ...], pinned: Keep) -> None:
        """What the search may leave out of `environment`: whole stacks, and none with a model that is pinned."""
        together = Stacks.of(stacks_of(self._journal.state, environment))
        self._pinned = pinned | together.of_any(pinned)
        self._keeps.clear()
        free = (stack for stack in together.by_first.values() if self._pinned.isdisjoint(stack))
        self._stacks = Stacks.of(free)

    def _begin(
        self, asked: Reduction, n_partitions: int | None = None, again: tuple[tuple[str, ...], ...] = ()
    ) -> Search:
        """The algorithm and the schemas by name; first it leaves out the groups `again`. Raises UserError for unknown names."""
        partitioning, prioritization = split_pair(asked.pair)
        elements, self._memory, self._foreseen = self._stacks.representatives, Memory(), Memory()
        self._guide = make_guide(
            partitioning,
            prioritization,
            self._known,
            prior=asked.prior,
            n_partitions=n_partitions or asked.n_partitions,
            candidates=asked.candidates,
            complement_order=asked.complement_order,
            growth=asked.growth,
            skip=asked.skip,
            rate=self._rate,
            runs=lambda: self._journal.rule.misses,
        )
        guide = replace(self._guide, broke=self._broke)

        def begin(guide: Guide) -> Search:
            if not again:
                return self._stacks.expand(search(asked.algorithm, elements, guide))
            searched = partial(search, asked.algorithm, guide=guide)
            return self._stacks.expand(tried_again(elements, again, searched))

        rounds = RoundsAhead(lambda: begin(foreseeing(guide, self._memory, self._foreseen, asked.pair)))
        self._path = ()
        self._ahead = Ahead(self._journal, rounds, self._pinned, self._certifier, asked.baseline_runs)
        return begin(self._memory.of(guide))

    def _known(self) -> Evidence:
        """The evidence for the schemas; only rounds use it, after the first similar run."""
        assert self._evidence is not None
        return replace(self._evidence, trials=self._trials)

    def _rate(self) -> float:
        """The rate of f in the whole world, as it was known when this search began."""
        return self._journal.rule.rate or known_failure(self._journal.state).rate

    def _broke(self, candidate: Candidate) -> bool:
        """Whether a test of a candidate of the algorithm, which knows one model of each stack, broke for good."""
        tally = self._journal.state.tally
        if not any(tally[outcome] for outcome in BROKEN):
            return False
        keep = self._pinned.union(self._stacks.expanded(candidate.models))
        return any(self._journal.shown(keep, run) == "broken" for run in range(MOST_RUNS))

    def _rule(self, round: Round) -> Acceptance:
        return self._journal.rule.within(round.runs)

    def _keep(self, candidate: Candidate) -> Keep:
        """All models that are in the world when a candidate is tested."""
        held = self._keeps.get(id(candidate))
        if held is None:
            if len(self._keeps) >= HELD:
                self._keeps.clear()
            held = self._keeps[id(candidate)] = candidate, candidate.models | self._pinned
        return held[1]

    def _finish(self, kept: Keep) -> None:
        audit_slice(self._journal, self._bench)
        # Their results count, too.
        self._bench.finish_trials()
        free = [name for name in self._stacks.representatives if name in kept]
        self._certify(free, self._reduction.baseline_runs, self._moves)

    @property
    def _moves(self) -> bool:
        """Whether the run goes on by a certificate. Whoever accepts each reduction by hand also goes back by hand."""
        return self._reduction.accept_rate == "kept" and self._journal.state.accept_mode == "automatic"

    def _certifier(self) -> Certifier:
        """For the environment as it is now, if that has only so many claims."""
        there = frozenset(self._journal.state.environment)
        free = islice((name for name in self._stacks.representatives if name in there), MOST_CLAIMS)
        return Certifier(self._journal, self._bench, list(free), self._moves)

    def _certify(self, free: list[str], at_least: int, moves: bool, anew: bool = False) -> None:
        """Ends the run with a certificate. Raises Steered if the certificate changes the environment."""
        journal = self._journal
        Certifier(journal, self._bench, free, moves).certify(at_least, anew)
        while journal.steered and not anew:
            self._bench.tick()
        certificate = current(journal.state)
        if certificate is None or journal.steered:
            raise Stopped(CHANGED)
        together = self._reduction.keep_supports
        reason = verdict_on(certificate, len(self._pinned), "stack" if together else "single model")
        spare = [claim.without for claim in certificate.claims if claim.verdict == "not needed"]
        if any(journal.refused.get(journal.without(name)) for name in spare if name is not None):
            reason += "; to leave it out was vetoed or rejected"
        if together:
            stacks = stacks_of(journal.state, journal.state.environment)
            reason += f"; stacks were kept together ({count(len(stacks), 'stack')})"
        self._end(is_minimal(certificate), reason)

    def _end(self, minimal: bool, reason: str) -> None:
        self._bench.finish_trials()
        # Tests that ran ahead of time are no longer needed.
        self._journal.lose_running()
        self._journal.record("finished", minimal=minimal, reason=reason)

    def _baseline(self) -> str:
        """Runs the whole world and fixes f; returns why there is nothing to reduce, or ""."""
        if self._journal.state.baseline is not None:
            return ""
        found = run_baseline(self._journal, self._bench, self._reduction, self._failure_spec)
        if isinstance(found, str):
            return found
        limit = limit_after(self._journal.state, self._failure_spec.timeout)
        self._journal.record("baseline_finished", **found, wall_limit=limit)
        self._control.round_finished()
        return ""

    def _round(self, number: int, round: Round) -> Candidate | None:
        """Tests the candidates of a round until one is similar (and accepted); returns it, or None."""
        self._announce(number, round)
        # Whoever waits before the first test of a round sees its candidates.
        audit_slice(self._journal, self._bench)
        self._judged = 0
        forecast = forecasting(self._journal, number, self._moment(round))
        winner = self._judge(number, round, forecast)
        while winner is not None and not self._is_accepted(number, winner):
            winner = self._judge(number, round, forecast)
        self._learn(number, round, winner)
        if winner is not None:
            self._take(number, round, winner)
        if not self._journal.has("round_finished", number):
            self._journal.record_once("round_finished", number)
            self._control.round_finished()
        if winner is not None and self._journal.current.number == number and slice_environment(self._journal):
            # The search goes on in the slice.
            raise Steered
        self._path = (*self._path, winner)
        return None if winner is None else round.candidates[winner]

    def _announce(self, number: int, round: Round) -> None:
        # These schemas score by distance in m, which is useful to show.
        shown = self._reduction.algorithm == "ddenv" and self._reduction.pair.endswith("-proximal")
        announce(self._journal, number, round, self._pinned, shown)
        if self._journal.current.number != number:
            return
        for index, one in enumerate(round.candidates) if self._journal.refused else ():
            if verdict := self._journal.refused.get(self._keep(one)):
                self._journal.record_once("vetoed", number, index, verdict=verdict, again=True)

    def _moment(self, round: Round) -> Moment:
        """The state of the search when a round begins."""
        return Moment(
            self._reduction.algorithm,
            self._reduction.pair,
            self._stacks.representatives,
            self._stacks.collapsed(round.environment),
            self._guide,
            self._memory,
            replace(self._known(), trials=tuple(self._trials)),
            self._journal.rule,
            known_failure(self._journal.state).rate,
            max(1, self._journal.state.jobs),
        )

    def _judge(self, number: int, round: Round, forecast: Iterator[object]) -> int | None:
        """The index of the first similar candidate that was not rejected, or None when all are judged."""

        def wanted() -> Wanted:
            if self._refusals != self._journal.refusals:
                # The user may want a candidate that was passed over after all.
                self._refusals, self._judged = self._journal.refusals, 0
            now = self._standing(round)
            self._record_verdicts(number, round, now.verdicts)
            return [(self._keep(round.candidates[index]), run, index) for index, run in now.wanted]

        def likely(most: int, is_started: Callable[[Asked], bool]) -> list[Asked]:
            beyond = not self._control.ends_with_round()
            return self._ahead.likely(Now(self._path, number, round, self._judged, beyond), most, is_started)

        self._bench.work("round", number, wanted, forecast, likely)
        return self._standing(round).winner

    def _standing(self, round: Round) -> Standing:
        """Tests of the candidates that have no verdict yet."""
        open_ones = (self._keep(candidate) for candidate in islice(round.candidates, self._judged, None))
        shown, rule, refused = self._journal.shown, self._rule(round), self._journal.refused
        return standing(open_ones, shown, rule, refused, first=self._judged, enough=1)

    def _record_verdicts(self, number: int, round: Round, verdicts: tuple[str, ...]) -> None:
        """Records verdicts in the order of candidates: tests that ran ahead of time wait for their turn."""
        for verdict in verdicts:
            if not verdict:
                return
            models = self._keep(round.candidates[self._judged])
            if self._journal.refused.get(models) is None:
                # What has lost the rate is not tested.
                lost = models in self._journal.refused
                tests = [] if lost else self._journal.tests_of(models, self._rule(round))
                # By these tests alone: more of them may have been made ahead of time.
                shown = sum(self._journal.state.tests[test - 1].outcome == "similar" for test in tests)
                if verdict == "dissimilar" and not self._journal.rule.verdict(shown, len(tests) - shown):
                    verdict = "missed"
                known = sum(self._journal.state.tests[test - 1].round != number for test in tests)
                self._journal.record_once(
                    "candidate_judged", number, self._judged, verdict=verdict, tests=tests, known=known
                )
                self._ahead.judged(round, self._judged, verdict == "similar")
            if verdict == "similar":
                return
            self._judged += 1

    def _learn(self, number: int, round: Round, winner: int | None) -> None:
        """The tests behind the round's verdicts, each once, for schemas that learn.

        Excludes tests that only ran ahead of time or were refused in this round, so that a resumed run sees the same.
        """
        last = len(round.candidates) if winner is None else winner + 1
        journal = self._journal
        for index, candidate in enumerate(round.candidates[:last]):
            rejected = journal.decisions.get((number, index)) == "reject"
            lost = journal.refused.has_lost(self._keep(candidate))
            if rejected or lost or not journal.has("candidate_judged", number, index):
                continue
            for test in journal.tests_of(self._keep(candidate), self._rule(round)):
                if test not in self._learnt and journal.state.tests[test - 1].outcome not in BROKEN:
                    self._learnt.add(test)
                    self._trials.append(self._learnt_from(test))

    def _learnt_from(self, test: int) -> Trial:
        return Trial(self._journal.keep_of_test(test), self._journal.state.tests[test - 1].outcome == "similar")

    def _is_accepted(self, number: int, winner: int) -> bool:
        """In accept mode `ask`, waits for the user, who may also choose an earlier candidate."""
        journal, key = self._journal, (number, winner)
        if journal.has("reduced", number, winner):
            return True
        if journal.state.accept_mode == "ask" and key not in journal.decisions:
            journal.record("waiting", round=number, candidate=winner)
            while journal.state.accept_mode == "ask" and journal.state.waiting_candidate == winner:
                self._bench.tick()
            if journal.state.waiting_candidate == winner:
                journal.record("decided", round=number, candidate=winner, decision="accept")
            if key not in journal.decisions:
                return False
        return journal.decisions.get(key, "accept") == "accept"

    def _take(self, number: int, round: Round, winner: int) -> None:
        """The winner becomes the environment; the next rounds use its similar run."""
        models = self._keep(round.candidates[winner])
        test = self._journal.evidence_of(self._journal.tests_of(models, self._rule(round)))
        environment = self._numbers(models)
        self._journal.record_once("reduced", number, winner, environment=environment, evidence_test=test)
        self._look_at(test)

    def _look_at(self, test: int | None) -> None:
        """The schemas see `test`, the last similar run."""
        assert test is not None
        self._foreseen = Memory()
        self._evidence = self._sight.evidence(
            self._journal.state, test, rows_of(self._journal.file, test), self._trials
        )

    def _numbers(self, names: Iterable[str]) -> list[int]:
        """In the order of the world, which may differ from the algorithm's."""
        return sorted(self._number[name] for name in names)
