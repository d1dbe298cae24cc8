"""Which runs show the same failure; and the failures other than f that tests of a run met: grouped
by end and kind, each with the smallest environment that showed it.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import combinations

from ddenv.environment import Numbers
from ddenv.runfile.events import Place
from ddenv.runfile.failure_words import named
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState

# Tests grouped at a time: the first ones find the centres of frequent failures, and most of the
# later ones are close to these.
CHUNK = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherFailure:
    """A failure f' that `tests` showed, in order. `position` (x, y, z m) is the end in their
    middle.

    `smallest` is the first of the tests with the fewest models, `size` the number of these.
    """

    kind: str
    position: Place
    tests: Numbers
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
    found = []
    for kind, ends in kinds.items():
        for position, tests in _by_end(ends, epsilon):
            sizes = {test: len(state.environments[state.test(test).environment]) for test in tests}
            smallest = min(tests, key=lambda test: (sizes[test], test))
            found.append(
                OtherFailure(
                    kind=kind,
                    position=position,
                    tests=tuple(sorted(tests)),
                    smallest=smallest,
                    size=sizes[smallest],
                )
            )
    return tuple(sorted(found, key=lambda one: (-len(one.tests), one.tests)))


def _by_end(ends: list[tuple[int, Place]], epsilon: float) -> Iterable[tuple[Place, list[int]]]:
    """Centres, each with the tests around it."""
    groups: list[tuple[Place, list[int]]] = []
    for start in range(0, len(ends), CHUNK):
        rest: list[tuple[int, Place]] = []
        for test, end in ends[start : start + CHUNK]:
            apart = ((math.dist(end, centre), tests) for centre, tests in groups)
            distance, around = min(apart, default=(math.inf, []))
            if distance <= epsilon:
                around.append(test)
            else:
                rest.append((test, end))
        for group in alike([end for _, end in rest], epsilon):
            groups.append((rest[group[0]][1], [rest[one][0] for one in group]))
    return groups


def grouped(number: int, apart: Callable[[int, int], float | None]) -> list[list[int]]:
    """Runs 0 to `number` - 1 in groups that show the same failure; in each group its centre is the
    first.

    `apart(i, j)` is how far apart two ends are (m), None if they show different failures; it is
    asked once for each pair i < j. The first centre is the run that shares its failure with most
    others (ties: with the least sum of distances to these, then the earliest), and its group are
    these; the next one is found in the same way among the rest.
    """
    near: dict[int, dict[int, float]] = {one: {} for one in range(number)}
    for first, second in combinations(range(number), 2):
        distance = apart(first, second)
        if distance is not None:
            near[first][second] = near[second][first] = distance

    def rank(one: int) -> tuple[int, float, int]:
        return -len(near[one]), math.fsum(near[one].values()), one

    groups = []
    while near:
        centre = min(near, key=rank)
        groups.append([centre, *sorted(near[centre])])
        for member in groups[-1]:
            for other in near.pop(member):
                del near[other][member]
    return groups


def alike(ends: list[Place], epsilon: float) -> list[list[int]]:
    """The ends (m) in groups around centres, as `grouped` has them: an end belongs to a centre
    within `epsilon` (m).
    """

    def apart(first: int, second: int) -> float | None:
        distance = math.dist(ends[first], ends[second])
        if distance <= epsilon:
            return distance
        return None

    return grouped(len(ends), apart)
