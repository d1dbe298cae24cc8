"""Who took part in the runs of a run file."""

from __future__ import annotations

from collections import Counter

from ddenv.environment import NOTHING, Environment
from ddenv.runfile.progress import Node
from ddenv.runfile.state import BROKEN, CERTIFY, ISOLATE, RunState


def in_whole_world(state: RunState) -> tuple[Counter[str], int]:
    """In how many of the baseline runs each model took part, empty where that is unknown; and how many runs these are."""
    runs = [test for test in state.tests if test.phase == "baseline" and test.outcome not in BROKEN]
    return Counter(name for test in runs for name in (test.took_part or NOTHING).names(state.elements)), len(runs)


def in_last(state: RunState) -> Environment | None:
    """The models that took part in the last similar run; None where that is unknown."""
    return None if state.evidence is None else state.evidence.took_part


def met_by(state: RunState, node: Node) -> list[Environment]:
    """What took part in each of the runs by which the environment of a node was cut down to its slice, by seed."""
    met: dict[int, Environment] = {}
    for number in node.sliced_by:
        test = state.tests[number - 1]
        met[test.run] = met.get(test.run, NOTHING) | (test.took_part or NOTHING)
    return list(met.values())


def simulated(state: RunState) -> int:
    """How many tests of the search were simulated, the baseline included, certificates and isolation apart."""
    made = (test for test in state.tests if test.is_finished and test.implied_by is None)
    return sum(test.phase not in (CERTIFY, ISOLATE) for test in made)
