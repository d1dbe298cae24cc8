"""The failures other than f that tests of a run met: grouped by end and kind, each with the smallest environment that showed it."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from ddenv.runfile.failures import Place, alike, named
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState

# Tests grouped at a time: the first ones find the centres of frequent failures, and most of the later ones are close to these.
CHUNK = 400


@dataclass(frozen=True, slots=True)
class OtherFailure:
    """A failure f' that `tests` showed, in order. `position` (x, y, z m) is the end in their middle.

    `smallest` is the first of the tests with the fewest models, `size` the number of these.
    """

    kind: str
    position: Place
    tests: tuple[int, ...]
    smallest: int
    size: int

    @property
    def name(self) -> str:
        return named((self.kind,), self.position)


def atlas(state: RunState) -> tuple[OtherFailure, ...]:
    """All failures of tests whose outcome is "other", the most frequent first.

    Two ends are of one failure if they are of one kind and within epsilon of the same centre.
    """
    kinds: dict[str, list[tuple[int, Place]]] = defaultdict(list)
    for test in state.tests if state.tally["other"] else ():
        if test.outcome == "other" and test.end_pose is not None:
            x, y, z = test.end_pose[:3]
            kinds[test.failure].append((test.id, (x, y, z)))
    epsilon = settings(state).epsilon
    found = [
        _failure(state, kind, position, tests)
        for kind, ends in kinds.items()
        for position, tests in _by_end(ends, epsilon)
    ]
    return tuple(sorted(found, key=lambda one: (-len(one.tests), one.tests)))


def _by_end(ends: list[tuple[int, Place]], epsilon: float) -> Iterable[tuple[Place, list[int]]]:
    """Centres, each with the tests around it."""
    groups: list[tuple[Place, list[int]]] = []
    for start in range(0, len(ends), CHUNK):
        rest: list[tuple[int, Place]] = []
        for test, end in ends[start : start + CHUNK]:
            distance, around = min(
                ((math.dist(end, centre), tests) for centre, tests in groups), default=(math.inf, [])
            )
            if distance <= epsilon:
                around.append(test)
            else:
                rest.append((test, end))
        groups += [
            (rest[group[0]][1], [rest[one][0] for one in group]) for group in alike([e for _, e in rest], epsilon)
        ]
    return groups


def _failure(state: RunState, kind: str, position: Place, tests: list[int]) -> OtherFailure:
    sizes = {test: len(state.environments[state.tests[test - 1].environment]) for test in tests}
    smallest = min(tests, key=lambda test: (sizes[test], test))
    return OtherFailure(kind, position, tuple(sorted(tests)), smallest, sizes[smallest])
