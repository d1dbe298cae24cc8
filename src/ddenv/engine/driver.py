"""Carries a reduction through: baseline, rounds, end. What is tested is the algorithm's choice, how is the bench's."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import islice

import numpy as np

from ddenv.engine.baseline import fix_failure
from ddenv.engine.bench import Bench, Wanted
from ddenv.engine.confirm import Confirmation
from ddenv.engine.control import Control
from ddenv.engine.evidence import Sight
from ddenv.engine.journal import Journal, Keep, other_way
from ddenv.errors import UserError
from ddenv.reduction.evidence import Evidence, Trial
from ddenv.reduction.guide import Guide, make_guide, search
from ddenv.reduction.round import Candidate, Round
from ddenv.reduction.verdict import Standing, standing
from ddenv.robot.oracle import Failure
from ddenv.runfile.store import COLUMNS
from ddenv.schemas import split_pair
from ddenv.world.model import World
from ddenv.world.scenario import Scenario

# No machine has more idle workers than this: further candidates need not be looked at.
ENOUGH = 2048


class Driver:
    """One engine's work on one run. Everything it decides follows from the journal: a resumed run takes the same way."""

    def __init__(self, scenario: Scenario, world: World, journal: Journal, bench: Bench, control: Control) -> None:
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
        # How many candidates of the round have their verdict, and were without f.
        self._judged = 0

    def reduce(self) -> None:
        """The whole run. Raises Stopped, and UserError when it cannot go on."""
        guide = self._guide()
        algorithm = search(self._reduction.algorithm, self._journal.state.elements, guide)
        reason = self._baseline()
        if reason:
            self._end(False, reason)
            return
        number, winner = 0, None
        try:
            while True:
                round = algorithm.send(winner)
                number += 1
                winner = self._round(number, round)
        except StopIteration as end:
            self._finish(end.value)

    def _guide(self) -> Guide:
        """The schemas that the scenario names. Raises UserError where there are none of these names."""
        asked = self._reduction
        partitioning, prioritization = split_pair(asked.pair)
        return make_guide(
            partitioning,
            prioritization,
            lambda: replace(self._evidence, trials=self._trials),
            prior=asked.prior,
            n_partitions=asked.n_partitions,
            candidates=asked.candidates,
            complement_order=asked.complement_order,
            growth=asked.growth,
            skip=asked.skip,
        )

    def _finish(self, kept: Keep) -> None:
        # Each model must have been left out, in tests and without success; a veto or a reject leaves that open.
        untried = [name for name in kept if not self._is_dissimilar(kept - {name})]
        reason = "no single model can be removed" if kept else "f needs none of the models that can be removed"
        if untried:
            why = "vetoed or rejected" if self._journal.refused else f"candidates: {self._reduction.candidates}"
            reason = f"{len(untried)} of the {len(kept)} models left were not left out in a test ({why})"
        tried = [name for name in self._journal.state.elements if name in kept and name not in untried]
        doubt = self._confirm(kept, tried) if self._failure_spec.early_stop else ""
        runs = range(1 + self._reduction.iterations)
        broken = [name for name in kept if self._journal.only_broke(kept - {name}, runs)]
        if broken and not untried:
            reason = f"{len(broken)} of the {len(kept)} models left may not be needed: all tests without them broke"
        self._end(not untried and not broken and not doubt, doubt or reason)

    def _confirm(self, kept: Keep, tried: list[str]) -> str:
        """Makes the full runs that the end still lacks; returns what they contradict, or ""."""
        self._journal.record_once("confirm_started")
        confirmation = Confirmation(self._journal, kept, tried, self._reduction.iterations, ENOUGH)
        self._bench.work("confirm", None, confirmation.wanted)
        return confirmation.doubt()

    def _end(self, minimal: bool, reason: str) -> None:
        # What ran ahead of time is not needed any more.
        self._journal.lose_running()
        self._journal.record("finished", minimal=minimal, reason=reason)

    def _is_dissimilar(self, keep: Keep) -> bool:
        return standing([keep], self._journal.is_similar, self._reduction.iterations).verdicts[0] == "dissimilar"

    def _baseline(self) -> str:
        """Runs the whole world and fixes f; returns why there is nothing to reduce, or ""."""
        journal, everything = self._journal, frozenset(self._journal.state.elements)
        runs = range(self._reduction.baseline_runs)

        def wanted() -> Wanted:
            return [(everything, run, None) for run in runs if (everything, run, False) not in journal.ledger]

        self._bench.work("baseline", None, wanted)
        if journal.state.baseline is None:
            tests = [journal.state.tests[journal.ledger[everything, run, False] - 1] for run in runs]
            trajectories = {test.id: self._trajectory(test.id) for test in tests if test.outcome == "failed"}
            found = fix_failure(tests, trajectories, self._failure_spec, self._reduction.iterations)
            if isinstance(found, str):
                return found
            journal.record("baseline_finished", **found)
            self._control.round_finished()
        f = journal.state.baseline
        spec = self._failure_spec
        self._bench.failure = Failure(f.position, self._trajectory(f.failure_test), spec.epsilon, spec.similarity)
        self._look_at(f.failure_test)
        return ""

    def _round(self, number: int, round: Round) -> Candidate | None:
        """Tests the candidates of a round until one is similar (and accepted); returns it, or None."""
        self._announce(number, round)
        self._judged = 0
        winner = self._judge(number, round)
        while winner is not None and not self._is_accepted(number, winner):
            winner = self._judge(number, round)
        self._learn(number, round, winner)
        if winner is not None:
            self._take(number, round, winner)
        if not self._journal.has("round_finished", number):
            self._journal.record_once("round_finished", number)
            self._control.round_finished()
        return None if winner is None else round.candidates[winner]

    def _announce(self, number: int, round: Round) -> None:
        # The scores of such schemas are distances in m, which is worth showing.
        shown = self._reduction.algorithm == "ddenv" and self._reduction.pair.endswith("-proximal")

        def distance(candidate: Candidate) -> float | None:
            return float(f"{round.scores[candidate.partition]:.3f}") if shown else None

        partitions = [self._numbers(partition) for partition in round.partitions]
        self._journal.record_once(
            "round_started",
            number,
            n_partitions=round.n_partitions,
            environment=self._numbers(round.environment),
            partitions=partitions,
            candidates=[[one.kind, one.partition, distance(one)] for one in round.candidates],
        )
        if self._journal.partitions[number] != partitions:
            raise UserError(other_way(number))
        if self._journal.state.round.number != number:
            return
        for index, one in enumerate(round.candidates) if self._journal.refused else ():
            if verdict := self._journal.refused.get(one.models):
                self._journal.record_once("vetoed", number, index, verdict=verdict)

    def _judge(self, number: int, round: Round) -> int | None:
        """The index of the first similar candidate that was not rejected, or None when all are judged."""

        def wanted() -> Wanted:
            now = self._standing(round)
            self._record_verdicts(number, round, now.verdicts)
            return [(round.candidates[index].models, run, index) for index, run in now.wanted]

        self._bench.work("round", number, wanted)
        return self._standing(round).winner

    def _standing(self, round: Round) -> Standing:
        """Of the candidates that have no verdict yet."""
        open_ones = (candidate.models for candidate in islice(round.candidates, self._judged, None))
        similar, refused = self._journal.is_similar, self._journal.refused
        return standing(open_ones, similar, self._reduction.iterations, refused, first=self._judged, enough=ENOUGH)

    def _record_verdicts(self, number: int, round: Round, verdicts: tuple[str, ...]) -> None:
        """Tells verdicts in the order of candidates: what was run ahead of time is told when its turn has come."""
        for verdict in verdicts:
            if not verdict:
                return
            models = round.candidates[self._judged].models
            if models not in self._journal.refused:
                tests = self._tests_of(models)
                known = sum(self._journal.state.tests[test - 1].round != number for test in tests)
                self._journal.record_once(
                    "candidate_judged", number, self._judged, verdict=verdict, tests=tests, known=known
                )
            if verdict == "similar":
                return
            self._judged += 1

    def _learn(self, number: int, round: Round, winner: int | None) -> None:
        """What the round's verdicts rest on, each test once, for schemas that learn.

        Never what only ran ahead of time, and never what was refused in this round: a resumed run must see the same.
        """
        last = len(round.candidates) if winner is None else winner + 1
        journal = self._journal
        for index, candidate in enumerate(round.candidates[:last]):
            rejected = journal.decisions.get((number, index)) == "reject"
            if rejected or not journal.has("candidate_judged", number, index):
                continue
            models = candidate.models
            for test in self._tests_of(models):
                if test not in self._learnt:
                    self._learnt.add(test)
                    self._trials.append(Trial(models, journal.state.tests[test - 1].outcome == "similar"))

    def _tests_of(self, keep: Keep) -> list[int]:
        """The tests that a candidate's verdict rests on, in the order of runs."""
        tests = []
        for run in range(1 + self._reduction.iterations):
            tests.append(self._journal.ledger[keep, run, False])
            if self._journal.state.tests[tests[-1] - 1].outcome == "similar":
                break
        return tests

    def _is_accepted(self, number: int, winner: int) -> bool:
        """In accept mode `ask`, waits for the user."""
        journal, key = self._journal, (number, winner)
        if journal.has("reduced", number, winner):
            return True
        if journal.state.accept_mode == "ask" and key not in journal.decisions:
            journal.record("waiting", round=number, candidate=winner)
            while journal.state.accept_mode == "ask" and key not in journal.decisions:
                self._bench.tick()
            if key not in journal.decisions:
                journal.record("decided", round=number, candidate=winner, decision="accept")
        return journal.decisions.get(key, "accept") == "accept"

    def _take(self, number: int, round: Round, winner: int) -> None:
        """The winner becomes the environment; its similar run is what the next rounds look at."""
        models = round.candidates[winner].models
        test = self._tests_of(models)[-1]
        environment = self._numbers(name for name in round.environment if name in models)
        self._journal.record_once("reduced", number, winner, environment=environment, evidence_test=test)
        self._look_at(test)

    def _look_at(self, test: int) -> None:
        """The schemas see `test`, the last similar run."""
        self._evidence = self._sight.evidence(self._journal.state, test, self._trajectory(test), self._trials)

    def _trajectory(self, test: int) -> np.ndarray:
        return np.array(self._journal.file.trajectory(test)).reshape(-1, COLUMNS)

    def _numbers(self, names: Iterable[str]) -> list[int]:
        """In the order of the world, which is not always the algorithm's."""
        return sorted(self._number[name] for name in names)
