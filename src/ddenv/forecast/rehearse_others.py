"""The other algorithms played on numbers alone, see `ddenv.forecast.rehearse`."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

from ddenv.forecast.rehearse import MOST_ROUNDS, Play, running_sum

# How many needed models are expected in each e-fold of the rank (as in `ddenv.reduction.chance`).
DENSITY = 0.5
# The share of the line that stays when probdd leaves out the group with the greatest gain to expect; how much it repeats itself.
GAIN, REPEATED = 1.0 / 3.0, 1.3


def ddmin(play: Play) -> float:
    """Tests up to the end. Parts are of equal size."""
    sizes, known = _equal(play.size, 2), False
    while play.size > 1 and play.rounds < MOST_ROUNDS:
        play.rounds += 1
        ends = running_sum(sizes)
        held = {bisect_right(ends, place) - 1 for place in play.needed}
        if not known and _subset(play, ends, held):
            sizes = _equal(play.size, 2)
            continue
        free = _first_free(play, len(sizes), held) if len(sizes) > 2 else None
        if free is None and len(sizes) == play.size:
            return play.tests
        if free is None:
            sizes, known = _equal(play.size, 2 * len(sizes)), False
            continue
        play.drop(ends[free], ends[free + 1])
        # The parts that are left were tried already.
        sizes, known = sizes[:free] + sizes[free + 1 :], True
    play.fails()
    return play.tests


def _equal(size: int, n: int) -> list[int]:
    n = min(n, size)
    return [size * (part + 1) // n - size * part // n for part in range(n)]


def _subset(play: Play, ends: Sequence[int], held: set[int]) -> bool:
    for part in range(len(ends) - 1):
        if held != {part}:
            play.fails()
        elif play.shows():
            play.keep(ends[part], ends[part + 1])
            return True
    return False


def _first_free(play: Play, count: int, held: set[int]) -> int | None:
    """The first part that can go."""
    for part in range(count):
        if part in held:
            play.fails()
        elif play.shows():
            return part
    return None


def splitting(play: Play) -> float:
    """Tests up to the end, of `splitting` and of `probdd`, which is much like it.

    Groups are left out from the far end on, and where f goes with them, halves of them. At the end each model is left out once
    more.
    """
    end, passed, needed = play.size, 0.0, list(play.needed)
    while end > 0 and play.rounds < MOST_ROUNDS:
        play.rounds += 1
        likelier = (1.0 + len(play.needed) - len(needed)) / (1.0 + passed)
        even = math.exp(-math.log(2.0) / (DENSITY * likelier))
        begin = min(end - 1, math.floor(end * (even if play.method.algorithm == "splitting" else GAIN)))
        if not needed or needed[-1] < begin:
            if play.shows():
                passed, end = passed + _expected(begin, end), begin
            continue
        # Leaving out all there is would be no test.
        if begin > 0 or len(needed) < len(play.needed):
            play.fails()
        end = _found(play, needed.pop(), begin, end)
        passed += _expected(end, end + 1)
    repeated = REPEATED if play.method.algorithm == "probdd" else 1.0
    return play.tests * repeated + play.method.full * len(play.needed)


def _found(play: Play, place: int, begin: int, end: int) -> int:
    """Halves a group until the farthest model of it that is needed is found; returns its place."""
    while end - begin > 1:
        middle = min(max(begin + 1, round(math.sqrt((1.0 + begin) * (1.0 + end))) - 1), end - 1)
        if place >= middle:
            play.fails()
            begin = middle
        elif play.shows():
            end = middle
    return begin


def _expected(begin: int, end: int) -> float:
    """How many needed models are expected from place to place."""
    return DENSITY * math.log((1.0 + end) / (1.0 + begin))
