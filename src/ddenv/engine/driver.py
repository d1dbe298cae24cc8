"""Carries a reduction through: baseline, rounds, end. What is tested is the algorithm's choice, how is the bench's."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ddenv.engine.baseline import fix_failure
from ddenv.engine.bench import Bench, Wanted
from ddenv.engine.control import Control
from ddenv.engine.journal import Journal, Keep
from ddenv.reduction.ddenv import ddenv
from ddenv.reduction.evidence import Evidence
from ddenv.reduction.partitioning import PARTITIONINGS
from ddenv.reduction.prioritization import DISTANCES, PRIORITIZATIONS
from ddenv.reduction.round import Candidate, Round
from ddenv.reduction.verdict import Standing, standing
from ddenv.robot.oracle import Failure
from ddenv.runfile.store import COLUMNS
from ddenv.world.extent import center
from ddenv.world.model import World
from ddenv.world.scenario import Scenario


class Driver:
    """One engine's work on one run. Everything it decides follows from the journal: a resumed run takes the same way."""

    def __init__(self, scenario: Scenario, world: World, journal: Journal, bench: Bench, control: Control) -> None:
        self._reduction = scenario.reduction
        self._failure_spec = scenario.failure
        self._partitioning, self._prioritization = scenario.reduction.pair.split("/")
        self._journal = journal
        self._bench = bench
        self._control = control
        self._evidence: Evidence | None = None
        positions = {model.name: center(model) for model in world.models}
        self._positions = {name: positions[name] for name in journal.state.elements}
        self._number = {name: index for index, name in enumerate(journal.state.elements)}

    def reduce(self) -> None:
        """The whole run. Raises Stopped, and UserError when it cannot go on."""
        reason = self._baseline()
        if reason:
            self._end(False, reason)
            return
        algorithm = ddenv(
            self._journal.state.elements,
            lambda environment, n: PARTITIONINGS[self._partitioning](environment, n, self._evidence),
            lambda partitions: PRIORITIZATIONS[self._prioritization](partitions, self._evidence),
            self._reduction.n_partitions,
            candidates=self._reduction.candidates,
            complement_order=self._reduction.complement_order,
        )
        number, winner = 0, None
        try:
            while True:
                round = algorithm.send(winner)
                number += 1
                winner = self._round(number, round)
        except StopIteration as end:
            self._finish(end.value)

    def _finish(self, kept: Keep) -> None:
        # Each model must have been left out, in tests and without success; a veto or a reject leaves that open.
        untried = [name for name in kept if not self._is_dissimilar(kept - {name})]
        reason = "no single model can be removed" if kept else "f needs none of the models that can be removed"
        if untried:
            why = "vetoed or rejected" if self._journal.refused else f"candidates: {self._reduction.candidates}"
            reason = f"{len(untried)} of the {len(kept)} models left were not left out in a test ({why})"
        self._end(not untried, reason)

    def _end(self, minimal: bool, reason: str) -> None:
        # What ran ahead of time is not needed any more.
        self._journal.lose_running()
        self._journal.record("finished", minimal=minimal, reason=reason)

    def _is_dissimilar(self, keep: Keep) -> bool:
        return standing([keep], self._similar(), self._reduction.iterations).verdicts[0] == "dissimilar"

    def _baseline(self) -> str:
        """Runs the whole world and fixes f; returns why there is nothing to reduce, or ""."""
        journal, everything = self._journal, frozenset(self._journal.state.elements)
        runs = range(self._reduction.baseline_runs)

        def wanted() -> Wanted:
            return [(everything, run, None) for run in runs if (everything, run) not in journal.ledger]

        self._bench.work("baseline", None, wanted)
        if journal.state.baseline is None:
            tests = [journal.state.tests[journal.ledger[everything, run] - 1] for run in runs]
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
        winner = self._judge(number, round)
        while winner is not None and not self._is_accepted(number, winner):
            winner = self._judge(number, round)
        if winner is not None:
            self._take(number, round, winner)
        if not self._journal.has("round_finished", number):
            self._journal.record_once("round_finished", number)
            self._control.round_finished()
        return None if winner is None else round.candidates[winner]

    def _announce(self, number: int, round: Round) -> None:
        def distance(candidate: Candidate) -> float | None:
            return float(f"{round.scores[candidate.partition]:.3f}") if self._prioritization in DISTANCES else None

        self._journal.record_once(
            "round_started",
            number,
            n_partitions=round.n_partitions,
            environment=self._numbers(round.environment),
            partitions=[self._numbers(partition) for partition in round.partitions],
            candidates=[[one.kind, one.partition, distance(one)] for one in round.candidates],
        )
        if self._journal.state.round.number == number:
            for index in self._refused(round):
                verdict = self._journal.refused[round.candidates[index].models]
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
        keeps = [candidate.models for candidate in round.candidates]
        return standing(keeps, self._similar(), self._reduction.iterations, self._refused(round))

    def _refused(self, round: Round) -> frozenset[int]:
        """The candidates that the user vetoed or rejected, in this round or an earlier one."""
        refused = self._journal.refused
        return frozenset(index for index, one in enumerate(round.candidates) if one.models in refused)

    def _record_verdicts(self, number: int, round: Round, verdicts: tuple[str, ...]) -> None:
        """Tells verdicts in the order of candidates: what was run ahead of time is told when its turn has come."""
        refused = self._refused(round)
        for index, verdict in enumerate(verdicts):
            if not verdict:
                return
            if index not in refused:
                tests = self._tests_of(round.candidates[index].models)
                known = sum(self._journal.state.tests[test - 1].round != number for test in tests)
                self._journal.record_once("candidate_judged", number, index, verdict=verdict, tests=tests, known=known)
            if verdict == "similar":
                return

    def _tests_of(self, keep: Keep) -> list[int]:
        """The tests that a candidate's verdict rests on, in the order of runs."""
        tests = []
        for run in range(1 + self._reduction.iterations):
            tests.append(self._journal.ledger[keep, run])
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
        """Partitioning and prioritization see the trajectory of `test`, the last similar run."""
        position = self._journal.state.baseline.position
        self._evidence = Evidence(self._positions, self._trajectory(test), position, self._reduction.seed)

    def _trajectory(self, test: int) -> np.ndarray:
        return np.array(self._journal.file.trajectory(test)).reshape(-1, COLUMNS)

    def _similar(self) -> dict[tuple[Keep, int], bool]:
        tests = self._journal.state.tests
        return {key: tests[test - 1].outcome == "similar" for key, test in self._journal.ledger.items()}

    def _numbers(self, names: Iterable[str]) -> list[int]:
        return [self._number[name] for name in names]
