"""The engine's memory: it writes each event once, and knows every finished test again after a restart."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ddenv.errors import UserError
from ddenv.runfile.fold import apply
from ddenv.runfile.state import RunState, Test
from ddenv.runfile.store import Event, RunFile

Keep = frozenset[str]


def other_way(round: int) -> str:
    """What to tell where a resumed run would leave the way that it took before."""
    return (
        f"round {round} would now be another one: the run was begun with other versions of ddenv, scikit-learn or a "
        "package of schemas; go on with those, or begin a new run"
    )


class Journal:
    """The events of a run, `state` folded from them, and what a resumed engine needs of them.

    `ledger` holds each finished test as (models, run, full) -> its id; a test in it is never made again. What the algorithm asked
    for is there with full False, what ran to its end with full True, most tests as both: `early_stop` only changes runs that
    it cuts. What only confirms stays out of the algorithm's sight, so that a resumed run takes the same way.
    `decisions` are the user's accepts and rejects by (round, candidate), `refused` the sub-environments vetoed or rejected:
    they stay refused in later rounds, whatever is known of them. `partitions` are those of each round, as numbers of models.
    """

    def __init__(self, file: RunFile) -> None:
        self.file = file
        self.state = RunState()
        self.ledger: dict[tuple[Keep, int, bool], int] = {}
        self.decisions: dict[tuple[int, int], str] = {}
        self.refused: dict[Keep, str] = {}
        self.partitions: dict[int, list[list[int]]] = {}
        self._keeps: dict[int, Keep] = {}
        self._seen: set[tuple[str, int | None, int | None]] = set()
        for event in file.events():
            self._take(event)

    def record(self, kind: str, motions: dict[str, bytes] | None = None, **data: Any) -> None:
        """Writes an event."""
        self._take(self.file.append(kind, data, motions))

    def record_once(self, kind: str, round: int | None = None, candidate: int | None = None, **data: Any) -> None:
        """Writes an event of a round or a candidate unless it was written before the engine was last stopped."""
        if self.has(kind, round, candidate):
            return
        if candidate is not None:
            data["candidate"] = candidate
        self.record(kind, round=round, **data)

    def is_similar(self, keep: Keep, run: int, full: bool = False) -> bool | None:
        """Whether a finished test showed f; None where it is not made yet. With `full` only a run to the end counts."""
        test = self.ledger.get((keep, run, full))
        return None if test is None else self.state.tests[test - 1].outcome == "similar"

    def only_broke(self, keep: Keep, runs: Iterable[int]) -> bool:
        """Whether the full runs of `keep` say nothing, since none of them came to its end."""
        tests = [self.ledger.get((keep, run, True)) for run in runs]
        outcomes = {self.state.tests[test - 1].outcome for test in tests if test is not None}
        return bool(outcomes) and outcomes <= {"error", "timeout"}

    def is_full(self, phase: str) -> bool:
        """Whether tests of this phase run to the end even where the robot is stuck for good."""
        return phase != "round" or not self.state.scenario["failure"].get("early_stop", False)

    def start_test(self, phase: str, keep: Keep, run: int, round: int | None, candidate: int | None) -> int:
        """Writes that a test starts; returns its id. Its seed is base + run: all candidates meet the same noise.

        Raises UserError for a test of a round that is over: the file must not hold what makes no sense.
        """
        if round is not None and round != self.state.round.number:
            raise UserError(other_way(round))
        test = len(self.state.tests) + 1
        self._keeps[test] = keep
        seed = self.state.scenario["reduction"]["seed"] + run
        place = {"round": round, "candidate": candidate}
        if phase == "confirm":
            left_out = [name for name in self.state.environment if name not in keep]
            place["without"] = self.state.elements.index(left_out[0]) if left_out else None
        self.record("test_started", test=test, phase=phase, **place, run=run, seed=seed)
        return test

    def lose_running(self) -> None:
        """Writes of the tests that were started and never ended that they are lost."""
        for test in self.state.tests:
            if test.outcome == "running":
                self.record("test_lost", test=test.id)

    def has(self, kind: str, round: int | None = None, candidate: int | None = None) -> bool:
        """Whether an event of a round or a candidate is written already."""
        return (kind, round, candidate) in self._seen

    def _take(self, event: Event) -> None:
        self.state = apply(self.state, event)
        data = event.data
        round, candidate = data.get("round"), data.get("candidate")
        self._seen.add((event.kind, round, candidate))
        if event.kind == "round_started":
            self.partitions[round] = data["partitions"]
        elif event.kind == "test_started":
            self._keeps.setdefault(data["test"], self._keep_of_test(self.state.tests[-1]))
        elif event.kind == "test_finished":
            self._enter(self.state.tests[data["test"] - 1])
        elif event.kind == "decided":
            self.decisions[round, candidate] = data["decision"]
            if data["decision"] == "reject":
                self.refused[self._keep_of(candidate)] = "rejected"
        elif event.kind == "vetoed":
            self.refused.setdefault(self._keep_of(candidate), data["verdict"])

    def _enter(self, test: Test) -> None:
        keep = self._keeps[test.id]
        if test.phase != "confirm":
            self.ledger[keep, test.run, False] = test.id
        if not test.cut:
            self.ledger[keep, test.run, True] = test.id

    def _keep_of_test(self, test: Test) -> Keep:
        """The models of a test that has just started."""
        if test.phase == "baseline":
            return frozenset(self.state.elements)
        if test.phase == "confirm":
            return frozenset(self.state.environment) - {test.without}
        return self._keep_of(test.candidate)

    def _keep_of(self, candidate: int) -> Keep:
        """The models of a candidate of the current round."""
        return frozenset(self.state.round.candidates[candidate].models)
