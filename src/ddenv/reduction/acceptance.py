"""When a candidate is taken, and when it is given up: a rule on its runs so far, in their order."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, Protocol

Verdict = Literal["", "similar", "dissimilar", "unknown"]

# The baseline goes on to this many runs with f, for up to so many runs, where f is rare.
FEWEST_SHOWN, LONGEST_BASELINE = 3, 60
# Few runs never show that f is certain.
HIGHEST_RATE = 0.985
# The rate of f where something that it needs is missing: another failure may end in the same place by chance.
SPURIOUS = 0.03
# After this many runs the likelier side counts.
MOST_RUNS = 40


class Rule(Protocol):
    """Decides from the runs of a candidate, one after the other."""

    def verdict(self, shown: int, missed: int) -> Verdict:
        """The verdict after `shown` runs that showed what is looked for and `missed` that did not; "" while it is open."""
        ...


@dataclass(frozen=True)
class Acceptance:
    """The rule of a search. A candidate is dissimilar after `most_misses` runs without f and none with it.

    With `rate` 0 the first run with f makes it similar, as in the paper. Otherwise `rate` is the estimated rate of f in the whole
    world, and Bayes decides between three rates of the candidate: that one, one that is clearly below `keep_rate` of it, and
    `SPURIOUS`. After each of `steps_back` the rule is stricter: the search has taken worlds where f is rarer. It bounds no error
    by itself, the certificate does; it makes a refuted certificate rare.
    """

    most_misses: int
    rate: float = 0.0
    keep_rate: float = 0.8
    steps_back: int = 0

    def verdict(self, shown: int, missed: int) -> Verdict:
        """The verdict after `shown` runs with f and `missed` without it, if no fewer of them decided; "" while it is open."""
        if not shown and missed >= self.most_misses:
            return "dissimilar"
        if not self.rate:
            return "similar" if shown else ""
        return _by_bayes(self.rate, self.keep_rate, self.steps_back, shown, missed)

    def within(self, runs: int | None) -> Acceptance:
        """The same rule, by which `runs` runs without f and none with it are enough; None leaves it as it is."""
        return self if runs is None else replace(self, most_misses=min(runs, self.most_misses))

    @property
    def misses(self) -> int:
        """How many runs without f, and none with it, make a candidate dissimilar."""
        return next(runs for runs in range(1, self.most_misses + 1) if self.verdict(0, runs))


@lru_cache(maxsize=4096)
def _by_bayes(rate: float, keep_rate: float, steps_back: int, shown: int, missed: int) -> Verdict:
    kept = min(rate, HIGHEST_RATE)
    # Nearer to the rate that must be kept, the stricter the rule is.
    lower = kept * (0.5, 0.65, 0.8)[min(steps_back, 2)] * keep_rate / 0.8
    priors = (0.5, 0.1, 0.4) if steps_back == 0 else (0.5, 0.25, 0.25)
    weights = [
        prior * each**shown * (1.0 - each) ** missed
        for prior, each in zip(priors, (kept, lower, SPURIOUS), strict=True)
    ]
    keeps = weights[0] / sum(weights)
    if keeps >= (0.85 if steps_back == 0 else 0.94):
        return "similar"
    if keeps <= 0.03:
        return "dissimilar"
    if shown + missed < MOST_RUNS:
        return ""
    return "similar" if keeps > 0.5 else "dissimilar"


def estimated_rate(shown: int, runs: int) -> float:
    """The rate of a failure that `shown` of `runs` showed, never 0 or 1."""
    return (shown + 0.5) / (runs + 1)
