"""How likely each test is to be wanted, before the tests that decide it have ended: of a candidate, and of a certificate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from random import Random

from ddenv.reduction.acceptance import HIGHEST_RATE, SPURIOUS, Acceptance
from ddenv.reduction.certificate import Procedure, Subject, Verdict, settle
from ddenv.reduction.round import Candidate
from ddenv.reduction.verdict import Shown

# So many runs of a candidate are looked at that are not made, and none that is reached with a lower probability than this.
MOST_RUNS, LEAST = 12, 0.01
# Before any candidate of a kind is judged: how many were similar, and dissimilar. What leaves out one model is mostly the last try.
BEFORE = {"partition": (0.5, 1.5), "complement": (1.0, 1.0), "one": (0.3, 1.7)}
# How likely a model of a certificate is not needed after all.
NOT_NEEDED = 0.1
# How often a certificate is played: less often where many runs are known, since each play passes through them.
PLAYS, FEWEST_PLAYS, RUNS = 12, 3, 500


class Experience:
    """How often candidates of each kind were similar so far."""

    def __init__(self) -> None:
        self._similar: Counter[str] = Counter()
        self._judged: Counter[str] = Counter()

    def see(self, candidate: Candidate, similar: bool) -> None:
        """Another candidate was judged."""
        self._judged[_kind(candidate)] += 1
        self._similar[_kind(candidate)] += similar

    def chance(self, candidate: Candidate) -> float:
        """The probability that a candidate is similar, in hundredths."""
        kind = _kind(candidate)
        hits, misses = BEFORE[kind]
        return round((hits + self._similar[kind]) / (hits + misses + self._judged[kind]), 2)


def _kind(candidate: Candidate) -> str:
    return "one" if candidate.kind == "complement" and len(candidate.part) == 1 else candidate.kind


@dataclass(frozen=True)
class Runs:
    """The runs that a candidate still needs, as (run, probability that it is reached), and the probability that it is similar."""

    reached: tuple[tuple[int, float], ...]
    similar: float


@lru_cache(maxsize=65_536)
def runs_ahead(rule: Acceptance, rate: float, chance: float, known: tuple[Shown, ...]) -> Runs:
    """What `rule` may ask of a candidate. `known` are its runs so far, None for those that are not finished.

    It has all that f needs with a probability of `chance`, and then shows f at `rate`; otherwise at `SPURIOUS`.
    """
    kept = min(rate, HIGHEST_RATE)
    # The weights of both cases, by the runs with f and without it.
    open_ones = {(0, 0): (chance, 1.0 - chance)}
    reached: list[tuple[int, float]] = []
    similar = 0.0
    for run, shown in enumerate(known):
        after: dict[tuple[int, int], tuple[float, float]] = {}
        here = 0.0
        for (hits, misses), weights in open_ones.items():
            verdict = rule.verdict(hits, misses)
            if verdict:
                similar += sum(weights) * (verdict == "similar")
                continue
            here += sum(weights)
            for hit, factors in ((1, (kept, SPURIOUS)), (0, (1.0 - kept, 1.0 - SPURIOUS))):
                if shown is None or shown is bool(hit):
                    place = hits + hit, misses + 1 - hit
                    more = (weights[0] * factors[0], weights[1] * factors[1])
                    before = after.get(place, (0.0, 0.0))
                    after[place] = before[0] + more[0], before[1] + more[1]
        total = sum(map(sum, after.values()))
        if here < LEAST or shown == "broken" or not total:
            return Runs(tuple(reached), similar)
        if shown is None:
            reached.append((run, min(1.0, here)))
        open_ones = {place: (one * here / total, other * here / total) for place, (one, other) in after.items()}
    rest = sum(map(sum, open_ones.values()))
    return Runs(tuple(reached), similar + rest * chance)


def certificate_ahead(
    claims: Sequence[Callable[[], Procedure]],
    ends: Callable[[int, Verdict], bool],
    shown: Callable[[Subject, int], Shown],
    rates: Mapping[Subject, float],
    without: Mapping[Subject, float],
    most: int,
    known: int = 0,
) -> dict[tuple[Subject, int], float]:
    """How likely each run of a certificate that is not finished is to be wanted, by (subject, run).

    `claims` begin each claim anew, in their order; after claim number i with a verdict it is over if `ends(i, verdict)`. It is
    played up to `PLAYS` times, with the finished runs as they are. A subject shows f at its rate; those `without` a model show it
    at the highest of these with a probability of their own, as if the model were not needed, and otherwise hardly ever. A play
    ends after `most` runs; there are fewer plays the more runs are `known`.
    """
    wanted: Counter[tuple[Subject, int]] = Counter()
    usual = max(rates.values(), default=HIGHEST_RATE)
    plays = min(PLAYS, max(FEWEST_PLAYS, RUNS // (1 + known)))
    for play in range(plays):
        random = Random(play)
        needed = {one: usual if random.random() < chance else SPURIOUS for one, chance in without.items()}
        drawn: dict[tuple[Subject, int], bool] = {}

        def result(
            subject: Subject,
            run: int,
            rate: Mapping[Subject, float] = {**needed, **rates},
            random: Random = random,
            drawn: dict[tuple[Subject, int], bool] = drawn,
        ) -> Shown:
            known = shown(subject, run)
            if known is not None:
                return known
            if (subject, run) not in drawn:
                if len(drawn) >= most:
                    return None
                drawn[subject, run] = random.random() < rate[subject]
            return drawn[subject, run]

        for number, begin in enumerate(claims):
            if ends(number, settle(begin(), result).verdict):
                break
        wanted.update(drawn.keys())
    return {test: count / plays for test, count in wanted.items()}


def not_needed(rate: float, shown: int, missed: int) -> float:
    """How likely a model of a certificate is not needed, after runs without it; f shows at `rate` where it is not."""
    rate = min(rate, HIGHEST_RATE)
    as_needed = (1.0 - NOT_NEEDED) * SPURIOUS**shown * (1.0 - SPURIOUS) ** missed
    as_not = NOT_NEEDED * rate**shown * (1.0 - rate) ** missed
    return as_not / (as_not + as_needed)
