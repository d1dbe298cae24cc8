"""How events name the models of a test: as the whole world, a candidate, a try, or an environment perhaps without one model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ddenv.errors import UserError
from ddenv.runfile.state import AHEAD, FRESH, ISOLATE, Round, RunState, Test
from ddenv.runfile.supports import stack_with

Keep = frozenset[str]
# The sets of so many candidates are held: 10,000 of them would take gigabytes.
HELD = 64


@dataclass(frozen=True)
class Asked:
    """A test that is wanted: run number `run` of the models `keep`, for a candidate of a round, for a try, or as `phase` says.

    In isolation, `candidate` is the number of a removal.
    """

    phase: str
    keep: Keep
    run: int
    round: int | None = None
    candidate: int | None = None
    trial: int | None = None

    def place(self, state: RunState) -> dict[str, Any]:
        """The data of an event with which the test begins. Raises UserError for one of a round that is over."""
        if self.round is not None and self.round != current_round(state).number:
            raise UserError(other_way(self.round))
        candidate = None if self.phase == ISOLATE else self.candidate
        place: dict[str, Any] = {"phase": self.phase, "round": self.round, "candidate": candidate}
        if self.phase == ISOLATE:
            place |= {"removal": self.candidate, "node": 0}
        if self.phase in ("certify", "audit"):
            place |= _node(state, self.keep)
        if self.phase == AHEAD:
            place |= _part(state, self.keep)
        if self.phase == "hand":
            place["trial"] = self.trial
        # All candidates meet the same noise.
        return place | {"run": self.run, "seed": state.scenario["reduction"]["seed"] + self.run}


def other_way(round: int) -> str:
    """The error if a resumed run would not repeat the rounds that it made before."""
    return (
        f"round {round} would now differ: the run was started with other versions of ddenv, scikit-learn or a "
        "package of schemas; continue with those, or start a new run"
    )


def _node(state: RunState, keep: Keep) -> dict[str, int]:
    """How an event names the models of a fresh run, or of an audit: an environment of the run, perhaps without one model."""
    path = [node.number for node in state.path if frozenset(node.environment) == keep]
    if path:
        return {"node": path[-1]}
    gone = next(name for name in state.environment if name not in keep)
    return {"node": state.node, "without": state.elements.index(gone)}


def _part(state: RunState, keep: Keep) -> dict[str, Any]:
    """How an event names the models of a test ahead of its round: what is left out of the environment, or what stays."""
    number = {name: index for index, name in enumerate(state.elements)}
    gone = [number[name] for name in state.environment if name not in keep]
    stays = 0 < len(keep) < len(gone)
    return {"node": state.node, "stays": stays, "part": sorted(number[name] for name in keep) if stays else gone}


class Keeps:
    """The models of tests that have just started, as sets. Runs of one candidate share one: of thousands of models, a set takes a
    while to be made.
    """

    def __init__(self) -> None:
        self._environment: tuple[tuple[str, ...], Keep] = (), frozenset()
        # Of the latest candidates, by round and number.
        self._latest: dict[tuple[int, int], Keep] = {}

    def of(self, state: RunState, test: Test) -> Keep:
        """The models of a test that has just started."""
        if test.phase == "baseline":
            return self._set(state.elements)
        if test.phase in (*FRESH, "audit"):
            environment = state.nodes[test.node].environment
            return self._set(environment).difference(stack_with(state, environment, test.without))
        if test.removal is not None:
            return self._set(state.elements).difference(state.removals[test.removal - 1].models)
        if test.phase == "hand":
            return frozenset(state.trials[(test.trial or 0) - 1].models)
        if test.phase == AHEAD:
            return frozenset(() if test.tried is None else test.tried.models)
        return self.of_candidate(state, test.candidate or 0)

    def of_candidate(self, state: RunState, candidate: int) -> Keep:
        """The models of a candidate of the current round."""
        round = current_round(state)
        key = round.number, candidate
        if key not in self._latest:
            if len(self._latest) >= HELD:
                self._latest.clear()
            one = round.candidates[candidate]
            part = round.partitions[one.partition]
            parts = frozenset(part).union(one.split.pinned)
            self._latest[key] = parts if one.kind == "partition" else self._set(round.environment).difference(part)
        return self._latest[key]

    def _set(self, environment: tuple[str, ...]) -> Keep:
        """The set of an environment, which stays the same for many tests."""
        if self._environment[0] is not environment:
            self._environment = environment, frozenset(environment)
        return self._environment[1]


def current_round(state: RunState) -> Round:
    """The current round. Raises UserError before the first round."""
    if state.round is None:
        raise UserError("damaged run file: there is no round yet")
    return state.round
