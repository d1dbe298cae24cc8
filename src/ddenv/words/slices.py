"""What slices left out, and which tests finished runs imply."""

from __future__ import annotations

from collections.abc import Iterable

from ddenv.environment import Environment
from ddenv.evidence.slices import fresh_chance, met_by
from ddenv.runfile.progress import Node
from ddenv.runfile.state import RunState
from ddenv.text import count, first_of, percent

# What shows in none of n runs shows in less than this over n of all runs, with 95 % (the rule of
# three).
RARE = 3.0
# The maximum number of tests that a word on a candidate names.
NAMED = 2
TEACHING = (
    "Removing models that cannot have affected a run changes no bit of it, so the run without "
    "them is known."
)


def slice_words(state: RunState, node: Node) -> str:
    """What a slice left out, and how likely a fresh run meets any of it, in one sentence without a
    full stop.
    """
    before = 0 if node.parent is None else len(state.nodes[node.parent].environment)
    met = met_by(state, node)
    gone = count(before - len(node.environment), "model")
    runs = f"any of the {len(met)} runs" if len(met) > 1 else "the one run known here"
    return (
        f"{gone} cannot have affected {runs}, so {'it is' if gone == '1 model' else 'they are'} "
        "removed without testing; "
        f"the chance that a fresh run meets a model not met before is {_chance(met)}"
    )


def slice_in_short(state: RunState, node: Node) -> str:
    """The same where there is little room: at most 78 characters."""
    before = 0 if node.parent is None else len(state.nodes[node.parent].environment)
    met = met_by(state, node)
    gone = before - len(node.environment)
    return (
        f"none of {count(len(met), 'run')} met the other {gone}; a fresh run meets one: "
        f"{_chance(met)}"
    )


def _chance(met: list[Environment]) -> str:
    chance = fresh_chance(met)
    if chance:
        return f"about {percent(chance)}"
    return f"probably below {percent(min(1.0, RARE / len(met)))}"


def refuted_words(state: RunState) -> str:
    """That an audit found a difference, in one sentence without a full stop; "" if none did."""
    if state.refuted is None:
        return ""
    audit, source = state.refuted
    return (
        f"test {audit} does not repeat test {source}, which implied it: slices are no longer used "
        "in this run, and all that relied on them is tested again"
    )


def implied_words(state: RunState, tests: Iterable[int]) -> str:
    """Which runs imply the tests of a candidate, such as "implied by test 4"; "" if all were
    simulated.
    """
    found = dict.fromkeys(test.implied_by for test in state.tests_of(tests))
    sources = [str(one) for one in found if one is not None]
    if sources:
        return f"implied by test{'s' * (len(sources) > 1)} {first_of(sources, NAMED)}"
    return ""
