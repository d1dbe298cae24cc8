"""Slices: what is known of a run because nothing that it lacks took part in another one.

Tests share their seeds, and a simulation repeats bit for bit where models that did not affect it
are removed. So a finished run of models E1 implies the run of E2 with the same seed if E2 is a part
of E1, has all that took part, and breaks no tie. It implies nothing for other seeds. In programs
this is dynamic slicing.

Who uses this keeps to three rules, so that neither workers nor kills change a result:

- An implied test has the outcome that a simulation would have. So verdicts, which follow from the
  outcomes of tests in their order,
  are the same whichever tests are implied.
- An environment is cut down to its slice by the runs that decisions rest on, and by no run that
only ran ahead of time.
- That a slice was taken, or found to be wrong, is an event. What follows from it follows from the
event.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from ddenv.environment import NOTHING, Environment
from ddenv.runfile.progress import Node
from ddenv.runfile.state import CERTIFY, ISOLATE, RunState


@dataclass(frozen=True)
class Ties:
    """What each model is tied to: without one of these it would move by itself, so without a test
    it stays with them, or goes.

    `of` has these models by number; `on` has, by number, the models that are tied to each.
    """

    of: Mapping[int, Environment]
    on: Mapping[int, Environment]

    @classmethod
    def among(cls, pairs: Iterable[tuple[int, int]]) -> Ties:
        """The ties `pairs` of a model and one that it is tied to."""
        of = defaultdict[int, set[int]](set)
        on = defaultdict[int, set[int]](set)
        for model, other in pairs:
            of[model].add(other)
            on[other].add(model)
        both = (
            {model: Environment.of(others) for model, others in each.items()} for each in (of, on)
        )
        return cls(*both)

    def breaks(self, there: Environment, keep: Environment) -> bool:
        """Whether a tie of the models `there` is broken where only `keep`, a part of them, stay."""
        removed = there - keep
        # Of thousands of models few stay, or few go.
        if len(keep) < len(removed):
            return any(not removed.isdisjoint(self.of.get(model, NOTHING)) for model in keep)
        return any(not keep.isdisjoint(self.on.get(model, NOTHING)) for model in removed)

    def closed(self, models: Environment, there: Environment) -> Environment:
        """`models`, with all models `there` that they are tied to, directly or by others."""
        found = models
        new = models
        while new:
            tied = NOTHING
            for model in new:
                tied |= self.of.get(model, NOTHING)
            new = (tied & there) - found
            found |= new
        return found


def implies(took_part: Environment, there: Environment, keep: Environment, ties: Ties) -> bool:
    """Whether a run of the models `there` implies the run of `keep` with the same seed."""
    return took_part <= keep <= there and not ties.breaks(there, keep)


def fresh_chance(met: Sequence[Environment]) -> float:
    """About the chance that a fresh run meets a model that none of these runs `met`: the share of
    them that met one which no other met (leaving each out in turn; after Good, 1953).
    """
    once = NOTHING
    more = NOTHING
    for models in met:
        more |= once & models
        once = (once | models) - more
    if met:
        return sum(not once.isdisjoint(models) for models in met) / len(met)
    return 1.0


# Who took part in the runs of a run file.


def in_whole_world(state: RunState) -> tuple[Counter[str], int]:
    """In how many of the baseline runs each model took part, empty where that is unknown; and how
    many runs these are.
    """
    runs = [test for test in state.tests if test.phase == "baseline" and not test.broke]
    return Counter(
        name for test in runs for name in (test.took_part or NOTHING).names(state.elements)
    ), len(runs)


def in_last(state: RunState) -> Environment | None:
    """The models that took part in the last similar run; None where that is unknown."""
    if state.evidence is None:
        return None
    return state.evidence.took_part


def met_by(state: RunState, node: Node) -> list[Environment]:
    """What took part in each of the runs by which the environment of a node was cut down to its
    slice, by seed.
    """
    met: dict[int, Environment] = {}
    for number in node.sliced_by:
        test = state.test(number)
        met[test.run] = met.get(test.run, NOTHING) | (test.took_part or NOTHING)
    return list(met.values())


def simulated(state: RunState) -> int:
    """How many tests of the search were simulated, the baseline included, certificates and
    isolation apart.
    """
    made = (test for test in state.tests if test.is_finished and test.implied_by is None)
    return sum(test.phase not in (CERTIFY, ISOLATE) for test in made)
