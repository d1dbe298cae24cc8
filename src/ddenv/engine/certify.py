"""Makes a certificate of what is left: full runs with seeds that the search did not use, and what they show."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from ddenv.engine.bench import Bench, Wanted
from ddenv.engine.control import Stopped
from ddenv.engine.journal import Journal
from ddenv.engine.subjects import Keep
from ddenv.rates import wilson_interval
from ddenv.reduction.certificate import Claim, Procedure, Terms, error_of, falls, good_enough, keeps, settle
from ddenv.reduction.stepping_back import groups_again, last_good
from ddenv.runfile.progress import Certificate
from ddenv.runfile.state import BROKEN, FRESH_RUNS

# After this many steps back what is left stays as it is, and is not called minimal.
MOST_STEPS_BACK = 14
CHANGED = "a decision of the user ended the certificate; resume the run to go on from there"


@dataclass(frozen=True)
class Certifier:
    """Certifies the current environment. Each of its tests is made once. `free` are its models that can be left out, or one of
    each stack.

    With `moves` the run goes on where a claim fails: back to the last environment that keeps the rate, or without a model
    that is not needed. Then an event says so, and the journal wants a new search.
    """

    journal: Journal
    bench: Bench
    free: Sequence[str]
    moves: bool

    def certify(self, at_least: int, anew: bool = False) -> None:
        """Makes the certificate, unless this search has one already and no other is asked for. Raises as `Bench.work`."""
        journal, last = self.journal, self.journal.state.certificate
        if last is None or (anew and last.claims):
            self._start(at_least)
        if not self._certificate.claims:
            self.bench.work("certify", None, self._wanted)
            named = [claim for claim in self._claims() if claim[1].verdict]
            tests = self._tests(claim for _, claim in named)
            journal.record("certificate_finished", claims=[self._plain(*claim) for claim in named], tests=tests)
        if self.moves:
            self._move()

    @property
    def _certificate(self) -> Certificate:
        found = self.journal.state.certificate
        if found is None:
            raise Stopped(CHANGED)
        return found

    @property
    def _left(self) -> Keep:
        return frozenset(self.journal.state.environment)

    def _start(self, at_least: int) -> None:
        journal = self.journal
        number = len(journal.state.certificates) + 1
        journal.record(
            "certificate_started",
            certificate=number,
            run=journal.fresh_run,
            rate=journal.rate_of_whole(),
            keep_rate=journal.state.scenario["reduction"]["keep_rate"],
            error=error_of(number),
            at_least=at_least,
        )

    def _claims(self) -> list[tuple[str | None, Claim]]:
        """What is known so far: of what is left, then of each model; up to a claim that ends the certificate."""
        now, left, whole = self._certificate, self._left, self.journal.whole
        error = now.error / 2
        first = self._settle(keeps(left, whole, Terms(now.keep_rate, now.rate, error, now.at_least)))
        claims: list[tuple[str | None, Claim]] = [(None, first)]
        if first.verdict == "lost":
            return claims
        for name in self.free:
            terms = Terms(now.keep_rate, now.rate, error / len(self.free), now.at_least)
            claims.append((name, self._settle(falls(self.journal.without(name), whole, terms))))
            if self.moves and claims[-1][1].verdict == "not needed" and self._can_go(name):
                break
        return claims

    def _can_go(self, name: str) -> bool:
        return self.journal.without(name) not in self.journal.refused

    def _settle(self, procedure: Procedure) -> Claim:
        first, jobs = self._certificate.first_run, max(1, self.journal.state.jobs)
        return settle(procedure, lambda keep, run: self.journal.shown(keep, first + run, full=True), jobs)

    def _wanted(self) -> Wanted:
        wanted = dict.fromkeys(test for _, claim in self._claims() for test in self._in_order(claim))
        return [(keep, self._certificate.first_run + run, None) for keep, run in wanted]

    def _in_order(self, claim: Claim) -> Sequence[tuple[Keep, int]]:
        """Of each pair the larger world first: its run may imply the other one."""
        if self.journal.known.ties(self.journal.state) is None:
            return claim.wanted
        return sorted(claim.wanted, key=lambda test: (test[1], -len(test[0])))

    def _tests(self, claims: Iterable[Claim]) -> list[int]:
        """The tests that claims rest on: without those that only ran ahead of time."""
        first, ledger = self._certificate.first_run, self.journal.ledger
        return sorted({ledger[keep, first + run, True] for claim in claims for keep, run in claim.rests_on})

    def _plain(self, name: str | None, claim: Claim) -> dict[str, Any]:
        """A claim as data of an event."""
        journal, first = self.journal, self._certificate.first_run
        keep = self._left if name is None else journal.without(name)
        tests = [journal.ledger.get((keep, first + run, True)) for run in range(claim.runs)]
        outcomes = Counter(journal.state.tests[test - 1].outcome for test in tests if test is not None)
        runs = sum(number for outcome, number in outcomes.items() if outcome not in BROKEN)
        low, high = wilson_interval(outcomes["similar"], runs) if runs else (0.0, 1.0)
        return {
            "without": None if name is None else journal.state.elements.index(name),
            "verdict": claim.verdict,
            "shown": outcomes["similar"],
            "runs": runs,
            "low": low,
            "high": high,
            "outcomes": dict(outcomes),
        }

    def _move(self) -> None:
        left, *removals = self._certificate.claims
        if left.verdict == "lost":
            if self.journal.steps_back < MOST_STEPS_BACK:
                self._step_back(left.shown / left.runs)
            return
        gone = next((claim.without for claim in removals if claim.verdict == "not needed"), None)
        if gone is not None and self._can_go(gone):
            self._leave_out(gone)

    def _step_back(self, lost_rate: float) -> None:
        journal = self.journal
        # Before another failure counted as f, rates were others.
        path = journal.state.path
        nodes = path[
            max(place for place, node in enumerate(path) if place == 0 or node.how in ("accepted", "instead")) :
        ]
        chain, now = [frozenset(node.environment) for node in nodes], self._certificate
        if len(chain) == 1:
            return

        judged_last: dict[Keep, Claim] = {}

        def judged(keep: Keep) -> Claim:
            judged_last[keep] = self._settle(good_enough(keep, now.rate, now.keep_rate, lost_rate))
            return judged_last[keep]

        def wanted() -> Wanted:
            found = last_good(chain, judged)
            return [] if isinstance(found, int) else [(keep, now.first_run + run, None) for keep, run in found]

        self.bench.work("certify", None, wanted)
        place = last_good(chain, judged)
        assert isinstance(place, int)
        groups = groups_again(chain[place], chain[place + 1], chain[-1], journal.state.elements)
        numbers = {name: index for index, name in enumerate(journal.state.elements)}
        journal.record(
            "rate_lost",
            node=nodes[place].number,
            lost=nodes[place + 1].number,
            again=[[numbers[name] for name in group] for group in groups],
            tests=self._tests(judged_last.values()),
        )

    def _leave_out(self, name: str) -> None:
        journal = self.journal
        state, keep, first = journal.state, journal.without(name), self._certificate.first_run
        runs = range(first, first + FRESH_RUNS)
        tests = [test for run in runs if (test := journal.ledger.get((keep, run, True))) is not None]
        journal.record(
            "left_out",
            without=state.elements.index(name),
            environment=[index for index, each in enumerate(state.elements) if each in keep],
            evidence_test=journal.evidence_of(tests),
        )
