"""What a run has found so far, as plain frozen data: its certificates, how many tests are left, and its sizes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Certificate:
    """What fresh runs show of the environment of `node`; number 1 is the run's first certificate.

    `first_run` is the number of its first run. What is left must keep `keep_rate` of the whole world's rate, which was estimated as
    `rate`; all claims together are wrong with a probability of at most `error`. What is left is run `at_least` so often. `claims`
    are empty while its tests are made. `past`: a search began since. `branch`: the environment is in a branch whose f is another
    failure, so that the rate where that branch begins stands for the whole world's.
    """

    number: int
    node: int
    first_run: int
    keep_rate: float
    rate: float
    error: float
    at_least: int
    claims: tuple[Claim, ...] = ()
    past: bool = False
    branch: bool = False


@dataclass(frozen=True, slots=True)
class Claim:
    """One claim of a certificate: about what is left, or, if `without` is a model, about that without it.

    `verdict`: what is left is "kept" (it keeps the rate) or "lost"; a model is "needed" (without it the rate falls below what must
    be kept) or "not needed"; "not shown" if the runs do not decide, "unknown" if they broke. `shown` of `runs` showed f; `outcomes`
    has the number of each outcome. `low`..`high` is Wilson's 95 % interval of the rate, 0..1 without runs.
    """

    without: str | None
    verdict: str
    shown: int
    runs: int
    low: float
    high: float
    outcomes: tuple[tuple[str, int], ...] = ()


@dataclass(frozen=True, slots=True)
class Forecast:
    """How many tests of candidates the engine expected to be left when `tests_done` were finished.

    In one case of ten fewer than `low` are left, in one of ten more than `high`.
    """

    low: int
    likely: int
    high: int
    tests_done: int


@dataclass(frozen=True, slots=True)
class Point:
    """The size of the environment after `tests` finished tests; at least `needed` of its models were known to be needed."""

    tests: int
    models: int
    needed: int = 0
