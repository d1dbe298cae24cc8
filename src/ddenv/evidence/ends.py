"""Where runs that failed ended: whether their ends form groups, scatter around one place, or lie
elsewhere than other ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import pdist

from ddenv.environment import Numbers
from ddenv.runfile.events import EndsElsewhere, Place
from ddenv.runfile.state import RunState, Test

# Groups of ends are so many times farther apart than each is wide: a cloud of ends hardly ever
# falls apart like that by chance.
APART = 3.0
# Nearer than this part of epsilon, groups are noise.
NEAR = 0.25
# With fewer ends nothing is said; more of them take too long. Of fewer than `FEW` ends nobody knows
# how wide their group is.
FEWEST = 5
MOST = 100
FEW = 2
# Ends farther than so many epsilons from each of them are not those of one failure.
ONE_PLACE = 4.0
# The chance that ends from one distribution are said to lie elsewhere.
ERROR = 0.05


def ends_of(tests: Iterable[Test], *outcomes: str) -> list[Place]:
    """Where those of some tests with one of these outcomes ended, in their order."""
    poses = (test.end_pose for test in tests if test.outcome in outcomes)
    return [(pose[0], pose[1], pose[2]) for pose in poses if pose is not None]


def of_baseline(state: RunState) -> list[Test]:
    """The runs of the baseline."""
    return [test for test in state.tests if test.phase == "baseline"]


@dataclass(frozen=True)
class Groups:
    """Ends in groups, by their places in a list, the largest group first; no two groups are nearer
    than `apart`, m.
    """

    groups: tuple[Numbers, ...]
    apart: float

    @property
    def epsilon(self) -> float:
        """It tells these groups apart, m."""
        return float(f"{self.apart / 2:.2g}")


def groups_of(ends: Sequence[Place], epsilon: float) -> Groups | None:
    """The coarsest groups of ends (m) that are far apart; None if the ends form a single one."""
    places = np.array(ends[:MOST])
    if len(places) < FEWEST:
        return None
    joins = linkage(places, method="single")
    # The last join is of the two groups that are farthest apart.
    for apart in joins[::-1, 2]:
        if apart < NEAR * epsilon:
            return None
        labels = fcluster(joins, np.nextafter(apart, 0), criterion="distance")
        groups = [np.flatnonzero(labels == label) for label in range(1, labels.max() + 1)]
        large = [group for group in groups if len(group) >= FEW]
        if len(large) > 1 and apart >= APART * max(pdist(places[group]).max() for group in large):
            by_size = sorted(
                (tuple(group.tolist()) for group in large), key=lambda group: (-len(group), group)
            )
            return Groups(tuple(by_size), float(apart))
    return None


def one_place(ends: Sequence[Place], epsilon: float) -> float | None:
    """How far the others are from one of these ends at most, m, where they scatter around it by
    more than epsilon.
    """
    ends = ends[:MOST]
    if len(ends) < FEWEST or groups_of(ends, epsilon):
        return None
    reach = min(max(math.dist(end, centre) for end in ends) for centre in ends)
    if epsilon < reach <= ONE_PLACE * epsilon:
        return reach
    return None


def joining(reach: float) -> float:
    """An epsilon that joins ends which scatter by so much, m: a little more, since other runs may
    end a little farther off.
    """
    more = 1.1 * reach
    step = 10.0 ** -max(1, -math.floor(math.log10(more)))
    return float(f"{math.ceil(more / step - 1e-9) * step:.3g}")


def elsewhere(
    whole: Sequence[Place], left: Sequence[Place], epsilon: float
) -> EndsElsewhere | None:
    """Where the runs of the whole world often ended with f, and those of what is left hardly do;
    None if there is no such place.

    For each group of all these ends the exact test of Fisher compares how many of both are in it.
    """
    whole = whole[: MOST // 2]
    left = left[: MOST // 2]
    found = groups_of((*whole, *left), epsilon)
    if found is None:
        return None
    for group in found.groups:
        there = sum(one < len(whole) for one in group)
        here = len(group) - there
        # By chance no more than `here` of the ends in this group would be of what is left.
        ways = sum(
            math.comb(len(left), one) * math.comb(len(whole), len(group) - one)
            for one in range(here + 1)
        )
        if ways / math.comb(len(whole) + len(left), len(group)) <= ERROR / len(found.groups):
            return EndsElsewhere(
                apart=found.apart,
                epsilon=found.epsilon,
                whole=there,
                of_whole=len(whole),
                left=here,
                of_left=len(left),
            )
    return None
