"""When a candidate is taken, and when it is given up: by its runs in their order, whichever of them
finish first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import count
from typing import Literal, NamedTuple, Protocol

from ddenv.environment import Environment, Numbers
from ddenv.evidence.rates import HIGHEST_RATE, SPURIOUS, Shown, ShownIn

Verdict = Literal["", "similar", "dissimilar", "unknown"]

# The baseline goes on to this many runs with f, for up to so many runs, where f is rare.
FEWEST_SHOWN = 3
LONGEST_BASELINE = 60
# Where all runs of a candidate miss f by chance no more often than this, a miss is looked at again
# only by a certificate.
FEW_MISSED = 0.003
# After this many runs the likelier side counts.
MOST_RUNS = 40
# A run that broke is passed over while no more than one in so many runs of its candidate broke.
BREAKS_RARELY = 4


class Rule(Protocol):
    """Decides from the runs of a candidate, one after the other."""

    def verdict(self, shown: int, missed: int) -> Verdict:
        """The verdict after `shown` runs that showed what is looked for and `missed` that did not;
        "" while it is open.
        """

    def run(self, place: int) -> int:
        """The number of the run at this place, from 0."""

    def passes_over(self, broken: int, runs: int) -> bool:
        """Whether a candidate stays open after `broken` of its first `runs` runs broke; else it is
        unknown.
        """


@dataclass(frozen=True, kw_only=True)
class Acceptance:
    """The rule of a search. A candidate is dissimilar after `most_misses` runs without f and none
    with it.

    With `rate` 0 the first run with f makes it similar, as in the paper. Otherwise `rate` is the
    estimated rate of f in the whole world, and Bayes decides between three rates of the candidate:
    that one, one clearly below `keep_rate` of it, and `SPURIOUS`; stricter after each of
    `steps_back`. It bounds no error by itself, the certificate does. With `exact` the runs of these
    numbers decide, and no others. Else the runs `broke`, ascending, are left out: they broke in the
    whole world, so they would leave each candidate unknown. The certificate counts such runs
    against its claims.
    """

    most_misses: int
    rate: float = 0.0
    keep_rate: float = 0.8
    steps_back: int = 0
    exact: Numbers = ()
    broke: Numbers = ()

    def run(self, place: int) -> int:
        """The number of the run at this place, from 0."""
        if self.exact:
            return self.exact[place]
        for broken in self.broke:
            place += broken <= place
        return place

    def passes_over(self, broken: int, runs: int) -> bool:
        """Few broken runs stop no search: the certificate counts such runs against its claims. None
        of the exact runs may miss.
        """
        return not self.exact and BREAKS_RARELY * broken <= runs

    def verdict(self, shown: int, missed: int) -> Verdict:
        """The verdict after `shown` runs with f and `missed` without it, if no fewer of them
        decided; "" while it is open.
        """
        if not shown and missed >= self.most_misses:
            return "dissimilar"
        if not self.rate:
            if shown:
                return "similar"
            return ""
        return _by_bayes(self.rate, self.keep_rate, self.steps_back, shown, missed)

    def within(self, runs: int | None) -> Acceptance:
        """The same rule, by which `runs` runs without f and none with it are enough; None leaves it
        as it is.
        """
        if runs is None:
            return self
        return replace(self, most_misses=min(runs, self.most_misses))

    @property
    def misses(self) -> int:
        """How many runs without f, and none with it, make a candidate dissimilar."""
        return next(runs for runs in range(1, self.most_misses + 1) if self.verdict(0, runs))

    @property
    def proves(self) -> bool:
        """Whether a search has to show by itself that its end is minimal; else the certificate
        alone does, with fewer runs in all. Where many misses are chance, that would cost another
        certificate.
        """
        return not self.rate or self.steps_back > 0 or (1.0 - self.rate) ** self.misses > FEW_MISSED


@lru_cache(maxsize=4096)
def _by_bayes(rate: float, keep_rate: float, steps_back: int, shown: int, missed: int) -> Verdict:
    kept = min(rate, HIGHEST_RATE)
    # Nearer to the rate that must be kept, the stricter the rule is.
    lower = kept * (0.5, 0.65, 0.8)[min(steps_back, 2)] * keep_rate / 0.8
    priors = (0.5, 0.1, 0.4) if steps_back == 0 else (0.5, 0.25, 0.25)
    rates = zip(priors, (kept, lower, SPURIOUS), strict=True)
    weights = [prior * candidate**shown * (1.0 - candidate) ** missed for prior, candidate in rates]
    keeps = weights[0] / sum(weights)
    is_open = shown + missed < MOST_RUNS
    if keeps >= (0.85 if steps_back == 0 else 0.94) or (keeps > 0.5 and not is_open):
        return "similar"
    if is_open and keeps > 0.03:
        return ""
    return "dissimilar"


class Decision(NamedTuple):
    """The verdict of a candidate if no `missing` run shows f, and the runs it rests on: how many,
    with f, and broken.
    """

    verdict: Verdict
    missing: Sequence[int]
    runs: int
    shown: int
    broken: int

    @property
    def missed(self) -> int:
        """How many runs ended without f."""
        return self.runs - self.shown - self.broken


REFUSED = Decision("dissimilar", (), runs=0, shown=0, broken=0)


def standing(
    candidates: Iterable[Environment],
    shown: ShownIn,
    rule: Rule,
    refused: Callable[[Environment], bool] = lambda _: False,
    *,
    first: int = 0,
    enough: int | None = None,
) -> tuple[list[Verdict], list[tuple[int, int]]]:
    """Where a round stands (paper, Algorithm 1 lines 4 to 13): the verdict of each candidate, ""
    while it is open, and the tests still needed, as (candidate, run), in the order in which a
    single worker would make them if none showed f.

    `shown(candidate, run)` returns whether a finished run showed f. The rule decides from the runs
    of a candidate, in their order; where too many broke it is unknown. `refused` candidates count
    as dissimilar. `candidates` begin with number `first`. They are looked at up to the first one
    that is sure to be similar, since no later one is worth a test, or until there are `enough`
    tests.
    """
    verdicts: list[Verdict] = []
    wanted: list[tuple[int, int]] = []
    for index, candidate in enumerate(candidates, first):
        decision = REFUSED if refused(candidate) else decided_by(shown, candidate, rule)
        verdicts.append("" if decision.missing else decision.verdict)
        wanted += [(index, run) for run in decision.missing]
        if decision.verdict == "similar" or (enough is not None and len(wanted) >= enough):
            break
    return verdicts, wanted


def decided_by(shown: ShownIn, candidate: Environment, rule: Rule) -> Decision:
    """The decision of `rule` on a candidate, by its runs in their order.

    A later run that showed f decides nothing while an earlier one is open: else the verdict would
    depend on timing.
    """
    missing: list[int] = []
    runs = hits = broken = 0
    while not (verdict := rule.verdict(hits, runs - hits - broken)):
        known = shown(candidate, rule.run(runs))
        if known is None:
            missing.append(rule.run(runs))
        runs += 1
        broken += known == "broken"
        if known == "broken" and not rule.passes_over(broken, runs):
            verdict = "unknown"
            break
        hits += known is True
    return Decision(verdict, missing, runs, hits, broken)


def unproven(shown: Callable[..., Shown], candidate: Environment, rule: Rule) -> int | None:
    """The first run with f of a similar candidate, if that has ended early and its end is still to
    be made.
    """
    run = next(run for run in map(rule.run, count()) if shown(candidate, run) is True)
    if shown(candidate, run, full=True) is None:
        return run
    return None
