"""Who took part in the runs of a run file, what slices left out and why, in words and numbers for all views."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from ddenv.environment import NOTHING, Environment
from ddenv.evidence.slices import fresh_chance, reasons
from ddenv.runfile.progress import Node
from ddenv.runfile.state import BROKEN, CERTIFY, ISOLATE, RunState
from ddenv.text import count, first_of, percent

# What shows in none of n runs shows in less than this over n of all runs, with 95 % (the rule of three).
RARE = 3.0
# The maximum number of tests that a word on a candidate names.
NAMED = 2
TEACHING = "What took no part in a run can go without changing a bit of it, so the run without it is known."


def in_whole_world(state: RunState) -> tuple[Counter[str], int]:
    """In how many of the baseline runs each model took part, empty where that is unknown; and how many runs these are."""
    runs = [test for test in state.tests if test.phase == "baseline" and test.outcome not in BROKEN]
    return Counter(name for test in runs for name in (test.took_part or NOTHING).names(state.elements)), len(runs)


def in_last(state: RunState) -> Environment | None:
    """The models that took part in the last similar run; None where that is unknown."""
    test = state.evidence_test
    return state.tests[test - 1].took_part if test is not None and 0 < test <= len(state.tests) else None


def met_by(state: RunState, node: Node) -> list[Environment]:
    """What took part in each of the runs by which the environment of a node was cut down to its slice, by seed."""
    met: dict[int, Environment] = {}
    for number in node.sliced_by:
        test = state.tests[number - 1]
        met[test.run] = met.get(test.run, NOTHING) | (test.took_part or NOTHING)
    return list(met.values())


def why_sliced(state: RunState, node: Node) -> dict[str, str]:
    """Why each model of the environment before stays in a slice or goes, in the order of the world."""
    before = NOTHING if node.parent is None else state.environments[state.nodes[node.parent].id]
    pinned = Environment.of(model for model, name in enumerate(state.elements) if name in state.pinned)
    return reasons(state.elements, before, state.environments[node.id], met_by(state, node), pinned)


def slice_words(state: RunState, node: Node) -> str:
    """What a slice left out, and how likely a fresh run meets any of it, in one sentence without a full stop."""
    before = 0 if node.parent is None else len(state.nodes[node.parent].environment)
    met = met_by(state, node)
    gone = count(before - len(node.environment), "model")
    runs = f"took part in none of {len(met)} runs" if len(met) > 1 else "took no part in the one run known here"
    return (
        f"{gone} {runs}, so {'it goes' if gone == '1 model' else 'they go'} without a test; "
        f"the chance that a fresh run meets a model that no run met is {_chance(met)}"
    )


def slice_in_short(state: RunState, node: Node) -> str:
    """The same where there is little room: at most 78 characters."""
    before = 0 if node.parent is None else len(state.nodes[node.parent].environment)
    met, gone = met_by(state, node), before - len(node.environment)
    return f"none of {count(len(met), 'run')} met the other {gone}; a fresh run meets one: {_chance(met)}"


def _chance(met: list[Environment]) -> str:
    chance = fresh_chance(met)
    return f"at most about {percent(chance)}" if chance else f"probably below {percent(min(1.0, RARE / len(met)))}"


def refuted_words(state: RunState) -> str:
    """That an audit found a difference, in one sentence without a full stop; "" if none did."""
    if state.refuted is None:
        return ""
    audit, source = state.refuted
    return (
        f"test {audit} does not repeat test {source}, which implied it: slices are no longer used in this run, and what rested on "
        "them is tested again"
    )


def implied_words(state: RunState, tests: Iterable[int]) -> str:
    """Which runs imply the tests of a candidate, such as "implied by test 4"; "" if all were simulated."""
    found = (state.tests[test - 1].implied_by for test in tests if 0 < test <= len(state.tests))
    sources = [str(one) for one in dict.fromkeys(found) if one is not None]
    if not sources:
        return ""
    return f"implied by test{'s' * (len(sources) > 1)} {first_of(sources, NAMED)}"


def simulated(state: RunState) -> int:
    """How many tests of the search were simulated, the baseline included, certificates and isolation apart."""
    made = (test for test in state.tests if test.is_finished and test.implied_by is None)
    return sum(test.phase not in (CERTIFY, ISOLATE) for test in made)
