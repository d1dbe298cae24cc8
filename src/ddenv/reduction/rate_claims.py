"""The claims of one certificate, in the order in which they are made: about what is left, then about each model of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from ddenv.rates import wilson_interval
from ddenv.reduction.certificate import Claim, Subject, Terms, Verdict, falls, keeps, settle


@dataclass(frozen=True)
class RateClaim:
    """A claim about what is left, or, if `without` is an element, about that without it.

    `verdict`: what is left is "kept" (it keeps the rate) or "lost"; an element is "needed" (without it the rate falls below what
    must be kept) or "not needed"; "not shown" if the runs do not decide. `shown` of `runs` fresh runs showed the failure;
    `low`..`high` is Wilson's 95 % interval of the rate.
    """

    without: str | None
    verdict: Verdict
    shown: int
    runs: int
    low: float
    high: float


def certified(
    left: Sequence[str],
    whole: Subject,
    terms: Terms,
    shown: Callable[[Subject, int], bool],
    may_go: Callable[[Subject], bool] = lambda _: False,
) -> tuple[RateClaim, ...]:
    """The claims about `left`, by runs that are made when they are asked for; `terms.error` is that of all of them together.

    The last claim is one after which the search goes on, if there is one: what is left has lost the rate, or an element of it is
    not needed, and what is left without it is a selection that `may_go` on.
    """
    kept, half = frozenset(left), replace(terms, error=terms.error / 2)
    claims = [_claim(None, kept, settle(keeps(kept, whole, half), shown), shown)]
    each = replace(half, error=half.error / max(1, len(kept)))
    for name in left if claims[0].verdict != "lost" else ():
        rest = kept - {name}
        claims.append(_claim(name, rest, settle(falls(rest, whole, each), shown), shown))
        if claims[-1].verdict == "not needed" and may_go(rest):
            break
    return tuple(claims)


def _claim(without: str | None, subject: Subject, claim: Claim, shown: Callable[[Subject, int], bool]) -> RateClaim:
    hits = sum(shown(subject, run) for run in range(claim.runs))
    low, high = wilson_interval(hits, claim.runs) if claim.runs else (0.0, 1.0)
    return RateClaim(without, claim.verdict, hits, claim.runs, low, high)
