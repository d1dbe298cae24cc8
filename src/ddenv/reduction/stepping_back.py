"""Stepping back: what a search tries first, and what it does not take again, after its end had lost the rate of f."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

from ddenv.reduction.certificate import Claim
from ddenv.reduction.evidence import Partition
from ddenv.reduction.guide import Search
from ddenv.reduction.round import left_out


class Refused(dict[frozenset[str], str]):
    """Sub-environments that are not taken, with the word for why. Of those that lost the rate of f, no part is taken either."""

    def __init__(self) -> None:
        super().__init__()
        self._lost: list[frozenset[str]] = []
        self._lost_of: dict[Hashable, list[frozenset[str]]] = {}

    def count_as_f(self, failures: Hashable) -> None:
        """From now on f is one of these `failures`: what lost the rate of others may be taken."""
        self._lost = self._lost_of.setdefault(failures, [])

    def lose(self, models: frozenset[str]) -> None:
        """Neither `models` nor a part of them is taken any more."""
        self._lost.append(models)

    def allow(self, models: frozenset[str]) -> None:
        """`models` may be taken again, and parts of them."""
        self.pop(models, None)
        self._lost[:] = [lost for lost in self._lost if not models <= lost]

    def has_lost(self, models: frozenset[str]) -> bool:
        """Whether `models` are part of what lost the rate."""
        return any(models <= lost for lost in self._lost)

    def __contains__(self, models: object) -> bool:
        return super().__contains__(models) or (isinstance(models, frozenset) and self.has_lost(models))


def groups_again(
    good: frozenset[str], bad: frozenset[str], end: frozenset[str], order: Sequence[str]
) -> list[Partition]:
    """What to leave out of `good` at once: all that went after `bad`, then halves of what went from `good` to `bad`."""
    later = tuple(name for name in order if name in bad - end)
    step = tuple(name for name in order if name in good - bad)
    halves = [step[: len(step) // 2], step[len(step) // 2 :]] if len(step) > 1 else []
    return [group for group in (later, *halves) if group]


def tried_again(environment: Partition, groups: Sequence[Partition], search: Callable[[Partition], Search]) -> Search:
    """Leaves out each group, or halves of it where that fails; then searches what is left."""
    waiting = list(reversed(groups))
    while waiting:
        inside = frozenset(environment)
        group = tuple(name for name in waiting.pop() if name in inside)
        if not group or len(group) == len(environment):
            continue
        winner = yield left_out(group, environment)
        if winner is not None:
            gone = frozenset(group)
            environment = tuple(name for name in environment if name not in gone)
        elif len(group) > 1:
            waiting += [group[len(group) // 2 :], group[: len(group) // 2]]
    return (yield from search(environment))


def last_good(
    chain: Sequence[frozenset[str]], judged: Callable[[frozenset[str]], Claim]
) -> int | tuple[tuple[frozenset[str], int], ...]:
    """The place of the last environment of `chain` that keeps the rate, or the tests (models, run) needed to know it.

    `chain` begins with the whole world and ends with what has lost the rate. `judged` carries `good_enough` as far as the
    finished runs go. By bisection: it assumes that the rate falls along the chain.
    """
    good, bad = 0, len(chain) - 1
    while bad - good > 1:
        place = (good + bad) // 2
        claim = judged(chain[place])
        if not claim.verdict:
            return claim.wanted
        good, bad = (place, bad) if claim.verdict == "kept" else (good, place)
    return good
