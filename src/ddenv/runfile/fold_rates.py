"""Folds how often f showed in each environment that a run reached: which tests ran it, and how many of them showed f."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from ddenv.runfile.events import Changes
from ddenv.runfile.state import AHEAD, BROKEN, FRESH, Node, RunState, Test


def noted(state: RunState, test: Test) -> Changes:
    """The nodes with a finished test entered where it ran the whole environment of one."""
    number = _node_of(state, test)
    if number is None or not _is_sound(test):
        return {}
    node = state.nodes[number]
    after = replace(node, runs=(*node.runs, test.id), shown=node.shown + (test.outcome == "similar"))
    return {"nodes": (*state.nodes[:number], after, *state.nodes[number + 1 :])}


def _node_of(state: RunState, test: Test) -> int | None:
    if test.phase in FRESH:
        return None if test.without is not None else test.node
    current, here = state.round, state.here
    if current is None or here is None or test.candidate is None or test.round != current.number:
        return None
    # It ran ahead of the verdict that made its candidate the environment.
    return here.number if current.winner == test.candidate and here.round == current.number else None


def same_runs(state: RunState, test: Test) -> tuple[int, ...]:
    """The tests that were made for the same candidate, try or environment as `test`."""
    made_for = _made_for(test)
    return tuple(each.id for each in state.tests if _made_for(each) == made_for)


def _made_for(test: Test) -> tuple[object, ...]:
    alone = test.id if test.phase == AHEAD else None
    return test.phase, test.round, test.candidate, test.trial, test.removal, test.node, test.without, alone


def seen(tests: Sequence[Test], ids: Iterable[int]) -> tuple[tuple[int, ...], int]:
    """Those of some tests that ended and did not break, each once, and how many of them showed f."""
    sound = tuple(id for id in dict.fromkeys(ids) if 0 < id <= len(tests) and _is_sound(tests[id - 1]))
    return sound, sum(tests[id - 1].outcome == "similar" for id in sound)


def counted_again(nodes: Sequence[Node], tests: Sequence[Test]) -> tuple[Node, ...]:
    """The nodes after the outcomes of tests changed."""
    return tuple(replace(node, shown=seen(tests, node.runs)[1]) for node in nodes)


def _is_sound(test: Test) -> bool:
    return test.is_finished and test.outcome not in BROKEN
