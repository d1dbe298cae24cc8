"""The failures that runs show: which ones are the same, what each is called, and what the whole world showed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import dist, fsum

from ddenv.runfile.events import DEEDS

Place = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class SeenFailure:
    """A failure that runs of the whole world showed: in `runs` of them, and `test` is the one in their middle.

    `kinds` say how the robot failed, the most frequent one first. `position` is where `test` ended, x, y, z m.
    """

    test: int
    runs: int
    kinds: tuple[str, ...]
    position: Place

    @property
    def name(self) -> str:
        return named(self.kinds, self.position)


@dataclass(frozen=True, slots=True)
class Baseline:
    """The runs of the whole world. `failure_test` is the test whose end is f; `low`..`high` is Wilson's 95 % interval.

    `failures` of `runs` showed f; `broken` more broke, and say nothing. `seen` are all failures, the most frequent first, in the
    numbers of the setting `failure`. `miss_chance` is (1-p)^(1+iterations), the chance that all tests of a candidate miss f;
    `iterations_95` is the number of iterations for a 95 % chance of seeing f. `position` is f's end, x, y, z m.
    `wall_limit` is what a later test may take in real time by the speed of these runs, s, None if unknown. It is
    the one thing here that differs from machine to machine.
    """

    runs: int
    failures: int
    rate: float
    low: float
    high: float
    failure_test: int
    position: Place
    miss_chance: float
    iterations_95: int
    broken: int = 0
    wall_limit: float | None = field(default=None, compare=False)
    seen: tuple[SeenFailure, ...] = ()

    @property
    def others(self) -> tuple[tuple[int, SeenFailure], ...]:
        """The failures that are not f, each with its number."""
        return tuple((number, one) for number, one in enumerate(self.seen, 1) if one.test != self.failure_test)


def named(kinds: Sequence[str], position: Sequence[float]) -> str:
    """A failure in words, such as "stuck at (5.42, -0.56)"."""
    how = " or ".join(kind if kind in DEEDS else "failed" for kind in kinds) or "failed"
    # Adding zero makes -0.0 the same as 0.0.
    x, y = (round(value, 2) + 0.0 for value in position[:2])
    return f"{how} at ({x:.2f}, {y:.2f})"


def grouped(number: int, apart: Callable[[int, int], float | None]) -> list[list[int]]:
    """Runs 0 to `number` - 1 in groups that show the same failure; in each group its centre is the first.

    `apart(i, j)` is how far apart two ends are (m), None if they show different failures; it is asked once for each pair i < j. The
    first centre is the run that shares its failure with most others (ties: with the least sum of distances to these, then the
    earliest), and its group are these; the next one is found in the same way among the rest.
    """
    near: dict[int, dict[int, float]] = {one: {} for one in range(number)}
    for first, second in combinations(range(number), 2):
        distance = apart(first, second)
        if distance is not None:
            near[first][second] = near[second][first] = distance

    def rank(one: int) -> tuple[int, float, int]:
        return -len(near[one]), fsum(near[one].values()), one

    groups = []
    while near:
        centre = min(near, key=rank)
        groups.append([centre, *sorted(near[centre])])
        for member in groups[-1]:
            for other in near.pop(member):
                del near[other][member]
    return groups


def alike(ends: list[Place], epsilon: float) -> list[list[int]]:
    """The ends (m) in groups around centres, as `grouped` has them: an end belongs to a centre within `epsilon` (m)."""

    def apart(first: int, second: int) -> float | None:
        distance = dist(ends[first], ends[second])
        return distance if distance <= epsilon else None

    return grouped(len(ends), apart)
