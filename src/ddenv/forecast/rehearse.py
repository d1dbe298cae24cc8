"""The ddenv algorithm played on numbers alone: how many tests it would make if certain models were the needed ones.

The models of an environment stand in a line, by default the nearest to f first, and are known by their places. Parts are
neighbours in it. f is taken to show wherever all needed models are, in a share of the runs.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random

# Tests that each worker but the first makes ahead of time, and that nobody needs once a candidate shows f.
WASTED = 0.5
# Of what is known of groups of models, the latest is remembered: the others hardly matter any more.
REMEMBERED = 10
# How far a part's end is from where equal parts would have it, in parts: clusters are not of equal size.
UNEVEN = 0.9
# Of spans of time, so many have models that come apart: the robot passed them.
PASSED = 3
# Runs that go on for longer tell nothing new.
MOST_ROUNDS = 1500


@dataclass(frozen=True, slots=True)
class Method:
    """How a world is reduced. `rate` is how often f shows where all needed models are; `near` that parts are tried in the line's
    order, `by_time` that they are what the robot was near in spans of time: then there are fewer than wanted.
    """

    algorithm: str = "ddenv"
    iterations: int = 3
    rate: float = 1.0
    near: bool = True
    growth: str = "paper"
    skip: str = "known"
    candidates: str = "both"
    far_first: bool = False
    jobs: int = 1
    by_time: bool = False

    @property
    def full(self) -> int:
        """Tests of a candidate without f."""
        return 1 + self.iterations


@dataclass(frozen=True, slots=True)
class Begun:
    """A round that is under way: the `sizes` of its parts in the order they are tried, and the candidates that are `closed`, each
    its kind and part. `alone` says that the needed models were tried alone before.
    """

    sizes: tuple[int, ...]
    closed: frozenset[tuple[str, int]] = frozenset()
    alone: bool = False


@dataclass(slots=True)
class Play:
    """A reduction on its way, in an environment of `size` models of which those at the places `needed`, sorted, are needed.

    From place to place, `groups` hold a needed model each, and `poor` parts lack one. `alone` are the needed models that were
    tried alone, by their rank among the needed. The first `still` models are those near where the robot stood still.
    """

    random: Random
    method: Method
    size: int
    needed: list[int]
    n: int = 2
    tests: float = 0.0
    rounds: int = 0
    alone: set[int] = field(default_factory=set)
    still: int = 0
    groups: list[tuple[int, int]] = field(default_factory=list)
    poor: list[tuple[int, int]] = field(default_factory=list)

    def shows(self) -> bool:
        """A candidate with all that is needed is run until it shows f, or seems to be without."""
        self.tests += WASTED * (self.method.jobs - 1)
        for _ in range(self.method.full):
            self.tests += 1
            if self.random.random() < self.method.rate:
                return True
        return False

    def fails(self) -> None:
        """A candidate without something that is needed."""
        self.tests += self.method.full

    def keep(self, begin: int, end: int) -> None:
        """Only the models from `begin` up to `end` stay."""
        self.needed = [place - begin for place in self.needed]
        self.still = min(max(self.still - begin, 0), end - begin)
        self._move(lambda place: min(max(place - begin, 0), end - begin))
        self.size = end - begin

    def drop(self, begin: int, end: int) -> None:
        """The models from `begin` up to `end` go."""
        gone = end - begin
        self.needed = [place - gone if place >= end else place for place in self.needed]
        self._move(lambda place: place if place <= begin else max(begin, place - gone))
        self.still -= max(0, min(end, self.still) - begin)
        self.size -= gone

    def _move(self, to: Callable[[int], int]) -> None:
        moved = [[(to(begin), to(end)) for begin, end in known[-REMEMBERED:]] for known in (self.groups, self.poor)]
        self.groups, self.poor = ([each for each in known if each[0] < each[1]] for known in moved)


def ddenv(play: Play, begun: Begun | None = None) -> float:
    """Tests up to the end, from the middle of a round on if one is `begun`."""
    if begun is not None and begun.alone:
        play.alone.update(range(len(play.needed)))
    while play.size and play.rounds < MOST_ROUNDS:
        play.rounds += 1
        play.n = min(play.n, play.size)
        ends = _ends(play, begun)
        won = _round(play, ends, begun)
        if not won and len(ends) - 1 == play.size:
            break
        if not won and play.method.by_time and play.method.growth == "paper":
            # Finer spans of time give the same parts again, and those are known.
            play.n = play.size
        elif not won or play.method.growth == "paper":
            play.n += 1
        begun = None
    return play.tests


def _ends(play: Play, begun: Begun | None) -> Sequence[int]:
    """Where the parts begin, and the end of the last."""
    if begun is not None:
        return running_sum(begun.sizes)
    size, n, random = play.size, play.n, play.random.random
    if n == size:
        return range(size + 1)
    if not play.method.by_time or play.method.growth != "paper":
        return _cut(random, 0, size, n)
    # The models near where the robot stood still do not come apart before each is a part of its own.
    still = min(play.still, size - 1)
    rest = _cut(random, still, size, min(n - 1, size - still, PASSED))
    return [0, *rest] if still else rest


def _cut(random: Callable[[], float], begin: int, end: int, n: int) -> list[int]:
    """Where n parts of the models from `begin` up to `end` are."""
    n, size, ends = max(1, n), end - begin, [begin]
    for part in range(1, n):
        wanted = begin + round(size * (part + UNEVEN * (random() - 0.5)) / n)
        ends.append(min(max(wanted, ends[-1] + 1), end - n + part))
    return [*ends, end]


def running_sum(sizes: Sequence[int]) -> list[int]:
    """Where parts of these sizes begin, and the end of the last."""
    ends = [0]
    for size in sizes:
        ends.append(ends[-1] + size)
    return ends


def _round(play: Play, ends: Sequence[int], begun: Begun | None) -> bool:
    """Tries p0, c0, p1, c1, ... and takes the first that shows f."""
    method, count = play.method, len(ends) - 1
    held = {bisect_right(ends, place) - 1 for place in play.needed}
    order = range(count) if method.near or begun is not None else play.random.sample(range(count), count)
    closed = begun.closed if begun is not None else ()
    # Of two parts each is the other's complement.
    for turn in range(1 if count == 2 else count):
        part = order[turn]
        wanted = method.candidates != "complements" and count > 1 and ("partition", part) not in closed
        if wanted and _partition(play, ends, part, held):
            return True
        part = order[count - 1 - turn] if method.far_first else part
        wanted = method.candidates != "partitions" and ("complement", part) not in closed
        if wanted and _complement(play, ends, part, held):
            return True
    return False


def _partition(play: Play, ends: Sequence[int], part: int, held: set[int]) -> bool:
    begin, end = ends[part], ends[part + 1]
    implied = play.method.skip == "implied"
    if implied and _is_poor(play, begin, end):
        return False
    if held == {part}:
        shown = play.shows()
        if shown:
            play.keep(begin, end)
        return shown
    if _was_alone(play, begin, end, part in held):
        return False
    play.fails()
    if implied:
        play.poor.append((begin, end))
    return False


def _is_poor(play: Play, begin: int, end: int) -> bool:
    """Whether it is known already that this part alone lacks something."""
    if any(first <= begin and end <= last for first, last in play.poor):
        return True
    return any(last <= begin or end <= first for first, last in play.groups)


def _was_alone(play: Play, begin: int, end: int, is_needed: bool) -> bool:
    """Whether the part is one needed model that was tried alone before; it is from now on."""
    if not is_needed or end - begin > 1:
        return False
    which = bisect_left(play.needed, begin)
    known = which in play.alone
    play.alone.add(which)
    return known


def _complement(play: Play, ends: Sequence[int], part: int, held: set[int]) -> bool:
    begin, end = ends[part], ends[part + 1]
    implied = play.method.skip == "implied"
    if implied and end - begin > 1 and any(begin <= first and last <= end for first, last in play.groups):
        return False
    if part not in held:
        shown = play.shows()
        if shown:
            play.drop(begin, end)
        return shown
    # Of two single models, the other one alone.
    if len(ends) == 3 and _was_alone(play, ends[1 - part], ends[2 - part], 1 - part in held):
        return False
    play.fails()
    if implied:
        play.groups.append((begin, end))
    return False
