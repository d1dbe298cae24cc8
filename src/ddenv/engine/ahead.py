"""What idle workers make ahead of time: the tests likeliest to be wanted, of this round, of later ones, of the certificate.

No result depends on it: the search finds these tests in the journal once it asks for them.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import count, islice

from ddenv.engine.certify import Certifier
from ddenv.engine.journal import Journal
from ddenv.engine.subjects import Asked, Keep
from ddenv.reduction.chances_ahead import MOST_RUNS, Experience, runs_ahead
from ddenv.reduction.round import Round
from ddenv.reduction.rounds_ahead import Path, Place, RoundsAhead
from ddenv.reduction.verdict import Shown
from ddenv.runfile.state import AHEAD

# A test that is wanted with a lower probability is not made: its worker would miss better ones.
LEAST_WORTH = 0.04
# The search may never come to a certificate; if it does, the whole world is run for it, whatever is left.
COMES_TO_CERTIFICATE = 0.9
# No look takes longer than this, s: tests end meanwhile, and commands wait. One step of it, which finds a round, cannot be cut.
LONGEST = 0.1

Test = tuple[Keep, int]


@dataclass(frozen=True)
class Now:
    """The current round, of which the first `judged` candidates have a verdict, and the winners of the rounds before it. Tests
    `beyond` it may be made.
    """

    path: Path
    number: int
    round: Round
    judged: int
    beyond: bool = True


@dataclass(order=True)
class _Branch:
    """A candidate of a round that comes with a probability of `-less`. `come` finds the round, None if that cannot be foreseen; so
    many runs of candidates have `missed` f by then.
    """

    less: float
    order: int
    come: Callable[[], Place | None] = field(compare=False)
    index: int = field(compare=False)
    missed: dict[Keep, int] = field(compare=False)


class _Found:
    """Tests that are not started, by (models, run), and how likely they are to be wanted."""

    def __init__(self, most: int, is_started: Callable[[Asked], bool]) -> None:
        self._most, self._is_started = most, is_started
        self._asked: dict[Test, Asked] = {}
        self._chances: dict[Test, float] = {}

    def add(self, asked: Asked, chance: float) -> None:
        """Another case in which a test is wanted."""
        if not self._is_started(asked):
            test = asked.keep, asked.run
            self._asked.setdefault(test, asked)
            self._chances[test] = self._chances.get(test, 0.0) + chance

    def enough(self, chance: float) -> bool:
        """Whether what is less likely than `chance` cannot be among the best."""
        if len(self._chances) < self._most:
            return False
        return sum(found >= chance for found in self._chances.values()) >= self._most

    def best(self) -> Iterator[Asked]:
        """Those that are worth a worker, the likeliest first."""
        worth = (test for test, chance in self._chances.items() if chance >= LEAST_WORTH)
        return (self._asked[test] for test in sorted(worth, key=lambda test: -self._chances[test]))


class Ahead:
    """Looks ahead in one search. `pinned` models always stay; `certifier()` would certify the current environment, with at least
    `at_least` runs.
    """

    def __init__(
        self, journal: Journal, rounds: RoundsAhead, pinned: Keep, certifier: Callable[[], Certifier], at_least: int
    ) -> None:
        self._journal, self._rounds, self._pinned = journal, rounds, pinned
        self._certifier, self._at_least = certifier, at_least
        self._experience = Experience()
        # The fresh runs of the certificate of a node.
        self._fresh: tuple[int, dict[Test, float]] = -1, {}
        # The last event after which nothing more was worth a worker.
        self._vain = -1
        self._goes_on = False

    def judged(self, round: Round, index: int, similar: bool) -> None:
        """A candidate has its verdict."""
        self._experience.see(round.candidates[index], similar)

    def likely(self, now: Now, most: int, is_started: Callable[[Asked], bool]) -> list[Asked]:
        """Up to `most` tests that are not started, the likeliest to be wanted first."""
        if self._vain == self._journal.state.revision:
            return []
        found, numbers, until = _Found(most, is_started), count(), time.monotonic() + LONGEST
        here, self._goes_on = self._rounds.at(now.path, now.round), now.beyond and self._may_go_on
        here.judged(now.judged)
        branches = [_Branch(-1.0, next(numbers), lambda: here, now.judged, {})]
        if self._goes_on:
            self._add_fresh(found, COMES_TO_CERTIFICATE, only=self._journal.whole)
        slowest, in_time = 0.0, True
        while branches and -branches[0].less >= LEAST_WORTH:
            began = time.monotonic()
            # Of thousands of models a step takes a good part of that time.
            if began + slowest > until:
                in_time = False
                break
            branch = heapq.heappop(branches)
            if found.enough(-branch.less):
                break
            place = branch.come()
            if place is not None:
                for after in self._follow(branch, place, now.number if place is here else None, found):
                    after.order = next(numbers)
                    heapq.heappush(branches, after)
            slowest = max(slowest, time.monotonic() - began)
        best = list(islice((asked for asked in found.best() if self._needs_run(asked)), most))
        if not best and in_time:
            self._vain = self._journal.state.revision
        return best

    @property
    def _may_go_on(self) -> bool:
        """Whether later rounds are looked at: not where each reduction waits for the user, nor where tests are counted."""
        state = self._journal.state
        return state.budget is None and state.accept_mode == "automatic"

    def _needs_run(self, asked: Asked) -> bool:
        """Whether no finished test implies it; in its round it is recorded then, before that it is not."""
        full = self._journal.is_full(asked.phase)
        return asked.phase == "round" or self._journal.implying(asked.keep, asked.run, full) is None

    def _follow(self, branch: _Branch, place: Place, number: int | None, found: _Found) -> Iterator[_Branch]:
        """Looks at one candidate of a round, which has a `number` if it is the current one; yields where that leads."""
        reach, round, index, missed = -branch.less, place.round, branch.index, branch.missed
        if round is None:
            if place.left | self._pinned == frozenset(self._journal.state.environment):
                self._add_fresh(found, reach)
            return
        rule = self._journal.rule.within(round.runs)
        if index == len(round.candidates):
            if self._goes_on:
                missed = missed | dict.fromkeys(place.keeps.values(), rule.misses)
                yield _Branch(-reach, 0, lambda: self._rounds.after(place, None), 0, missed)
            return
        keep = self._keep(place, index)
        if keep in self._journal.refused:
            yield _Branch(-reach, 0, lambda: place, index + 1, missed)
            return
        chance = self._experience.chance(round.candidates[index])
        known = self._known(keep, missed.get(keep, 0))
        runs = runs_ahead(rule, self._journal.rule.rate or 1.0, chance, known)
        for run, reached in runs.reached:
            asked = Asked(AHEAD, keep, run) if number is None else Asked("round", keep, run, number, index)
            found.add(asked, reach * reached)
        yield _Branch(-reach * (1.0 - runs.similar), 0, lambda: place, index + 1, missed)
        if self._goes_on:
            yield _Branch(-reach * runs.similar, 0, lambda: self._rounds.after(place, index), 0, missed)

    def _known(self, keep: Keep, misses: int) -> tuple[Shown, ...]:
        """What runs of a candidate showed, up to some that are not made; the first of them, `misses`, will not have shown f."""
        known: list[Shown] = []
        open_ones = 0
        while open_ones < MOST_RUNS:
            one = self._journal.shown(keep, len(known))
            known.append(False if one is None and len(known) < misses else one)
            open_ones += known[-1] is None
        return tuple(known)

    def _keep(self, place: Place, index: int) -> Keep:
        if index not in place.keeps:
            assert place.round is not None
            place.keeps[index] = place.round.candidates[index].models | self._pinned
        return place.keeps[index]

    def _add_fresh(self, found: _Found, reach: float, only: Keep | None = None) -> None:
        """Adds the runs of the certificate of the current environment, or those of the models `only`."""
        state = self._journal.state
        if self._fresh[0] != state.node:
            certifier = self._certifier()
            self._fresh = state.node, certifier.ahead(certifier.foreseen(self._at_least), (None, *certifier.free))
        for (keep, run), chance in self._fresh[1].items():
            if (only is None or keep == only) and self._journal.shown(keep, run, full=True) is None:
                found.add(Asked("certify", keep, run), reach * chance)
