"""A search that keeps the rate of the failure, to an end that fresh runs certify."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ddenv.errors import UserError
from ddenv.reduction.acceptance import FEWEST_SHOWN, LONGEST_BASELINE, Acceptance, estimated_rate
from ddenv.reduction.algorithms import sweep
from ddenv.reduction.calls import Calls
from ddenv.reduction.certificate import Claim, Subject, Terms, error_of, good_enough, settle
from ddenv.reduction.evidence import Partition
from ddenv.reduction.rate_claims import RateClaim, certified
from ddenv.reduction.stepping_back import groups_again, last_good, tried_again
from ddenv.reduction.walk import Walk

NOTHING_TO_REDUCE = "the failure does not show with all elements: there is nothing to reduce"
# After this many steps back nothing more is left out.
MOST_STEPS_BACK = 14


@dataclass(frozen=True)
class Keeping:
    """Keeps `keep_rate` of the rate at which `whole` shows the failure. `most_misses` without a hit end a candidate."""

    calls: Calls
    whole: Subject
    keep_rate: float
    most_misses: int
    baseline_runs: int

    def baseline(self) -> None:
        """Runs the whole world. Raises UserError if the failure never shows."""
        shown = runs = 0
        while runs < self.baseline_runs or (shown < FEWEST_SHOWN and runs < LONGEST_BASELINE):
            shown, runs = shown + self.calls.once(self.whole), runs + 1
        if not shown:
            raise UserError(NOTHING_TO_REDUCE)

    @property
    def rate(self) -> float:
        """The estimated rate, from all runs of the whole world so far."""
        return estimated_rate(*self.calls.tally(self.whole))

    def rule(self, steps_back: int = 0) -> Acceptance:
        """When the search takes a candidate after so many steps back."""
        return Acceptance(self.most_misses, self.rate, self.keep_rate, steps_back)

    def carry_on(self, walk: Walk) -> tuple[RateClaim, ...]:
        """Certifies what a search has left, and goes on where a claim fails; returns the claims about the last end."""
        number, steps_back = 1, 0

        def may_go(rest: Subject) -> bool:
            return steps_back <= MOST_STEPS_BACK and rest not in walk.refused

        while True:
            shown = self.calls.fresh()
            terms = Terms(self.keep_rate, self.rate, error_of(number), self.baseline_runs)
            claims = certified(walk.left, self.whole, terms, shown, may_go)
            first, last = claims[0], claims[-1]
            if first.verdict == "lost":
                steps_back += 1
                again = self._step_back(walk, shown, first.shown / first.runs)
                if steps_back <= MOST_STEPS_BACK:
                    walk.search(tried_again(walk.left, again, sweep), self.rule(steps_back))
            elif last.verdict == "not needed" and may_go(rest := walk.chain[-1] - {last.without}):
                walk.take(rest)
                walk.search(sweep(walk.left), self.rule(steps_back))
            else:
                return claims
            number += 1

    def _step_back(self, walk: Walk, shown: Callable[[Subject, int], bool], lost_rate: float) -> list[Partition]:
        """Goes back to the last environment that keeps the rate; returns what to leave out of it then."""

        def judged(earlier: Subject) -> Claim:
            return settle(good_enough(earlier, self.rate, self.keep_rate, lost_rate), shown)

        place = last_good(walk.chain, judged)
        # Runs are made when they are asked for, so none is still needed.
        assert isinstance(place, int)
        good, bad, end = walk.chain[place], walk.chain[place + 1], walk.chain[-1]
        walk.back_to(place)
        return groups_again(good, bad, end, walk.left)
