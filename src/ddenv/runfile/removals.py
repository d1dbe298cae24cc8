"""What isolation has found so far, as plain frozen data: which models were removed from the whole world, and what that showed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Removal:
    """The whole world without `models` was tried.

    `verdict` is "" while it is open, then "passes", "fails" or "unknown" (its tests broke), by the `tests` with these ids.
    """

    models: tuple[str, ...]
    verdict: str = ""
    tests: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Returned:
    """What fresh runs show of a world that passes; or, if `back` is a model, of that with it (and its stack) put back.

    `verdict`: the world "passes" or "fails"; a model has to go ("needed") or not ("not needed"); "not shown" if the runs do not
    decide, "unknown" if they broke. The robot reached its goal in `reached` of `runs`; `low`..`high` is Wilson's 95 % interval of
    that rate, 0..1 without runs.
    """

    back: str | None
    verdict: str
    reached: int
    runs: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Check:
    """Fresh runs of removal number `removal` (from 1), and of it with each model put back."""

    removal: int
    claims: tuple[Returned, ...]


@dataclass(frozen=True, slots=True)
class Isolation:
    """A search for the fewest models that have to go from the whole world so that the robot reaches its goal.

    It passes if it reaches it at the rate `wanted` rather than at `rather_than`; of a world with a model put back, the rate has to
    fall below `keep_rate` of what it is without it. All claims are wrong with a probability of at most `error`. `first_run` is the
    number of the first run with a fresh seed; each check has `block` of them. The `suspects` are removed first to last, at first
    `size` of them: what the reduction left. `before` is why the reduction had ended.
    `checks` are fresh runs of what the search found; a check that shows something else sends it on. `ended`: the last word is
    spoken; `found` is then the removal after which the robot passes, None if there is none. `broken_off`: the user
    gave it up, or ended it by another decision.
    """

    number: int
    first_run: int
    block: int
    wanted: float
    rather_than: float
    keep_rate: float
    error: float
    at_least: int
    suspects: tuple[str, ...]
    size: int
    before: str
    checks: tuple[Check, ...] = ()
    ended: bool = False
    found: int | None = None
    broken_off: bool = False
