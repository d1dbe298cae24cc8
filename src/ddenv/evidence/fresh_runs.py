"""The runs of a certificate by the models that they ran: of what is left, of that without each model, and of the whole world."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

from ddenv.evidence.claims import so_far
from ddenv.evidence.rates import anytime_interval
from ddenv.runfile.fold_decisions import origin
from ddenv.runfile.progress import Claim
from ddenv.runfile.state import BROKEN, OUTCOMES, RunState, Test
from ddenv.runfile.supports import stacks_of
from ddenv.text import percent


@dataclass(frozen=True, slots=True)
class FreshRuns:
    """Runs with fresh seeds of the environment of `node`, or of that without the model `without`.

    `shown` of the `runs` that ended and did not break showed f; `outcomes` has the number of each outcome, with broken runs.
    `low`..`high` is the 95 % interval of the rate, 0..1 without runs. `running` are the tests that run now. `is_left`: all that is
    left ran. `claim` is what the certificate says of them, once it is finished; it makes none of the whole world, nor of earlier
    environments. What is left keeps at least `bound` of the rate, by the runs so far; without the model f shows at most `bound`
    times as often. `is_chosen`: the whole world ran only where what is left missed f, so these runs say nothing about its rate.
    """

    node: int
    without: str | None
    shown: int
    runs: int
    low: float
    high: float
    outcomes: tuple[tuple[str, int], ...]
    running: tuple[Test, ...] = ()
    claim: Claim | None = None
    is_left: bool = False
    bound: float | None = None
    is_chosen: bool = False

    @property
    def shows_at_least(self) -> str:
        """What the runs have shown: "≥ 63 %" of the rate is kept, or "≤ 21 %" as often without the model; "" if nothing yet."""
        if self.bound is None or (self.bound >= 1.0 if self.without else self.bound <= 0.0):
            return ""
        return f"{'≤' if self.without else '≥'} {percent(self.bound)}"

    @property
    def shows(self) -> str:
        """The same in words."""
        if self.bound is None or not self.shows_at_least:
            return ""
        return (
            f"at most {percent(self.bound)} as often"
            if self.without
            else f"keeps at least {percent(self.bound)} of the rate"
        )


def fresh_runs(state: RunState) -> tuple[FreshRuns, ...]:
    """The runs of the current environment's certificate: what is left comes first, the world that f was seen in last."""
    certificate = state.certificate
    if certificate is None:
        return ()
    tests: dict[tuple[int, str | None], list[Test]] = {}
    for test in (each for each in state.confirm_tests if each.run >= certificate.first_run):
        tests.setdefault((test.node, test.without), []).append(test)
    claims = {claim.without: claim for claim in certificate.claims}
    # Stacks that are kept together are named by their first models. Where the rate is lost, nothing is claimed of removals.
    free = (stack[0] for stack in stacks_of(state, state.environment) if state.pinned.isdisjoint(stack))
    removals = [name for name in free if name in claims or not (claims or certificate.seeds)]
    keys = [(certificate.node, None), *((certificate.node, name) for name in removals)]
    first = origin(state, certificate.node).number
    earlier = sorted((key for key in tests if key not in keys and key != (first, None)), key=lambda key: -key[0])
    keys += earlier
    # A finished certificate need not have run the whole world.
    if certificate.node != first and (not (claims or certificate.seeds) or (first, None) in tests):
        keys.append((first, None))
    found = [_of(key, tests.get(key, []), claims.get(key[1]) if key[0] == certificate.node else None) for key in keys]
    bounds = {} if claims else {without: claim.bound for without, claim in so_far(state, certificate).items()}
    left_runs, whole_runs = ({test.run for test in tests.get((node, None), [])} for node in (certificate.node, first))
    return tuple(
        replace(
            one,
            is_left=number == 0,
            bound=one.bound if one.claim or one.node != certificate.node else bounds.get(one.without),
            is_chosen=one.node == first != certificate.node and whole_runs < left_runs,
        )
        for number, one in enumerate(found)
    )


def _of(key: tuple[int, str | None], tests: list[Test], claim: Claim | None) -> FreshRuns:
    running = tuple(test for test in tests if test.outcome == "running")
    if claim is not None:
        return FreshRuns(
            *key, claim.shown, claim.runs, claim.low, claim.high, claim.outcomes, running, claim, bound=claim.bound
        )
    counts = Counter(test.outcome for test in tests if test.is_finished)
    outcomes = tuple((outcome, counts[outcome]) for outcome in OUTCOMES if counts[outcome])
    runs, shown = counts.total() - sum(counts[outcome] for outcome in BROKEN), counts["similar"]
    return FreshRuns(*key, shown, runs, *anytime_interval(shown, runs), outcomes, running)
