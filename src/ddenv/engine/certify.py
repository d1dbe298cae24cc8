"""Makes a certificate of what is left: full runs with seeds that the search did not use, and what they show."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count, islice, takewhile
from typing import Any

from ddenv.engine.bench import Bench, Wanted
from ddenv.engine.control import Stopped
from ddenv.engine.journal import Journal
from ddenv.engine.subjects import Asked, Keep
from ddenv.evidence.rates import wilson_interval
from ddenv.evidence.certificate import Claim, Procedure, Terms, Verdict, error_of, falls, good_enough, keeps, settle
from ddenv.reduction.chances_ahead import certificate_ahead, not_needed
from ddenv.reduction.stepping_back import groups_again, last_good
from ddenv.reduction.verdict import Shown
from ddenv.runfile.progress import Certificate
from ddenv.runfile.state import BROKEN, FRESH_RUNS

# After this many steps back what is left stays as it is, and is not called minimal.
MOST_STEPS_BACK = 14
# Up to so many workers take the next runs of each claim. With more, plays find what is likely to be wanted, as much more rarely.
WORKERS_A_LOOK = 8
CHANGED = "a decision of the user ended the certificate; resume the run to go on from there"


@dataclass
class _Look:
    """The claims as they are known now, and how likely fresh runs were to be wanted when so many `tests` had ended."""

    claims: list[tuple[str | None, Claim]] = field(default_factory=list)
    tests: int = -1
    chances: dict[tuple[Keep, int], float] = field(default_factory=dict)


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
    _look: _Look = field(default_factory=_Look)

    def certify(self, at_least: int, anew: bool = False) -> None:
        """Makes the certificate, unless this search has one already and no other is asked for. Raises as `Bench.work`."""
        journal, last = self.journal, self.journal.state.certificate
        if last is None or (anew and last.claims):
            self._start(at_least)
        if not self._certificate.claims:
            self.bench.work("certify", None, self._wanted, likely=self._likely)
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
        new = self.foreseen(at_least)
        self.journal.record(
            "certificate_started",
            certificate=new.number,
            run=new.first_run,
            rate=new.rate,
            keep_rate=new.keep_rate,
            error=new.error,
            at_least=at_least,
        )

    def _claims(self, ahead: int = 1) -> list[tuple[str | None, Claim]]:
        """What is known so far: of what is left, then of each model; up to a claim that ends the certificate."""
        claims: list[tuple[str | None, Claim]] = []
        for name in (None, *self.free):
            claims.append((name, self._settle(self._procedure(name, self._certificate), ahead)))
            if self._ends(name, claims[-1][1].verdict):
                break
        return claims

    def _procedure(self, name: str | None, now: Certificate) -> Procedure:
        """What shows the claim of what is left, or of the model `name`."""
        left, whole, error = self._left, self.journal.whole, now.error / 2
        if name is None:
            return keeps(left, whole, Terms(now.keep_rate, now.rate, error, now.at_least))
        terms = Terms(now.keep_rate, now.rate, error / len(self.free), now.at_least)
        return falls(self.journal.without(name), whole, terms)

    def _ends(self, name: str | None, verdict: Verdict) -> bool:
        """Whether no later claim is made."""
        if name is None:
            return verdict == "lost"
        return self.moves and verdict == "not needed" and self._can_go(name)

    def _can_go(self, name: str) -> bool:
        return self.journal.without(name) not in self.journal.refused

    def _settle(self, procedure: Procedure, ahead: int = 1) -> Claim:
        return settle(procedure, self._shown(self._certificate.first_run), ahead)

    def _shown(self, first: int) -> Callable[[Keep, int], Shown]:
        return lambda keep, run: self.journal.shown(keep, first + run, full=True)

    def ahead(self, now: Certificate, names: Sequence[str | None]) -> dict[tuple[Keep, int], float]:
        """How likely each fresh run is to be wanted that is not made yet, by (models, run), for the claims of `names`."""
        journal, shown, whole = self.journal, self._shown(now.first_run), self.journal.whole
        begin = [partial(self._procedure, name, now) for name in names]
        rates = {whole: now.rate, self._left: now.rate}
        without = {journal.without(name) for name in names if name is not None} - rates.keys()
        counts = {keep: self._counts(keep, now) for keep in (self._left, *without)}
        spared = {keep: not_needed(now.rate, *counts[keep]) for keep in without}
        most, known = 4 * journal.state.jobs, sum(map(sum, counts.values()))

        def ends(number: int, verdict: Verdict) -> bool:
            return self._ends(names[number], verdict)

        chances = certificate_ahead(begin, ends, shown, rates, spared, most, known)
        return {(keep, now.first_run + run): chance for (keep, run), chance in chances.items()}

    def _counts(self, keep: Keep, now: Certificate) -> tuple[int, int]:
        """How many of the first fresh runs of `keep` showed f, and how many missed it."""
        shown = list(takewhile(lambda one: one is not None, map(partial(self._shown(now.first_run), keep), count())))
        return shown.count(True), shown.count(False)

    def foreseen(self, at_least: int) -> Certificate:
        """The certificate that comes next, if the search ends here."""
        journal, number = self.journal, len(self.journal.state.certificates) + 1
        keep_rate: float = journal.state.scenario["reduction"]["keep_rate"]
        rate = journal.rate_of_whole()
        return Certificate(number, journal.state.node, journal.fresh_run, keep_rate, rate, error_of(number), at_least)

    def _likely(self, most: int, is_started: Callable[[Asked], bool]) -> list[Asked]:
        """As `Bench.work` wants it. What is sure to be wanted needs no play."""
        state = self.journal.state
        due: dict[Asked, None] = {}
        for ahead in (1, state.jobs) if state.jobs <= WORKERS_A_LOOK else (1,):
            claims = self._look.claims if ahead == 1 else self._claims(ahead)
            undecided = [claim for claim in claims if not claim[1].verdict]
            # With many workers only the first claim is sure to be made.
            sure = undecided if state.jobs <= WORKERS_A_LOOK else undecided[:1]
            due |= {one: None for keep, run, _ in self._wanted_by(sure) if not is_started(one := _asked(keep, run))}
            if len(due) >= most or ahead > 1:
                return list(islice(due, most))
        look, made, shown = self._look, state.tests_done, self.journal.shown

        def found() -> list[Asked]:
            likely = (_asked(*test) for test in sorted(look.chances, key=lambda test: -look.chances[test]))
            new = (one for one in likely if shown(one.keep, one.run, True) is None and not is_started(one))
            return list(islice(new, most))

        # A look takes some ms, and one test more changes little where there are many.
        soon = look.tests >= 0 and made - look.tests <= state.jobs // WORKERS_A_LOOK
        if soon and (known := found()):
            return known
        if made != look.tests:
            look.tests, look.chances = made, self.ahead(self._certificate, [name for name, _ in undecided])
        return found()

    def _wanted(self) -> Wanted:
        self._look.claims = self._claims()
        return self._wanted_by(self._look.claims)

    def _wanted_by(self, claims: Iterable[tuple[str | None, Claim]]) -> Wanted:
        wanted = dict.fromkeys(test for _, claim in claims for test in self._in_order(claim))
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
            procedure = good_enough(keep, now.rate, now.keep_rate, lost_rate)
            judged_last[keep] = self._settle(procedure, max(1, journal.state.jobs))
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


def _asked(keep: Keep, run: int) -> Asked:
    return Asked("certify", keep, run)
