"""Stepping back: what a search tries first, and what it does not take again, after its end had lost the rate of f."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ddenv.environment import Environment
from ddenv.evidence.certificate import Claim
from ddenv.reduction.guide import Search
from ddenv.reduction.round import Partition, left_out


def groups_again(good: Environment, bad: Environment, end: Environment) -> list[Partition]:
    """What to leave out of `good` at once: all that went after `bad`, then halves of what went from `good` to `bad`."""
    later, step = tuple(bad - end), tuple(good - bad)
    halves = [step[: len(step) // 2], step[len(step) // 2 :]] if len(step) > 1 else []
    return [group for group in (later, *halves) if group]


def tried_again(environment: Partition, groups: Sequence[Partition], search: Callable[[Partition], Search]) -> Search:
    """Leaves out each group, or halves of it where that fails; then searches what is left."""
    waiting = list(reversed(groups))
    while waiting:
        inside = frozenset(environment)
        group = tuple(model for model in waiting.pop() if model in inside)
        if not group or len(group) == len(environment):
            continue
        winner = yield left_out(group, environment)
        if winner is not None:
            gone = frozenset(group)
            environment = tuple(model for model in environment if model not in gone)
        elif len(group) > 1:
            waiting += [group[len(group) // 2 :], group[: len(group) // 2]]
    return (yield from search(environment))


def last_good(
    chain: Sequence[Environment], judged: Callable[[Environment], Claim]
) -> int | tuple[tuple[Environment, int], ...]:
    """The place of the last environment of `chain` not shown to have lost the rate, or the tests (models, run) needed to know it.

    `chain` begins with the whole world and ends with what has lost the rate. `judged` carries `good_enough` as far as the
    finished runs go. By bisection: it assumes that the rate falls along the chain. The next one has been judged, too, and lost it.
    """
    good, bad = 0, len(chain) - 1
    while bad - good > 1:
        place = (good + bad) // 2
        claim = judged(chain[place])
        if not claim.verdict:
            return claim.wanted + claim.later
        good, bad = (place, bad) if claim.verdict == "kept" else (good, place)
    return good
