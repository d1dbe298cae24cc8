"""Slices in a run: the environment is cut down, without a test, to what took part in the runs known
there. Some of what is implied is simulated all the same, and has to have the same bits.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import takewhile

from ddenv.engine.journal import Journal
from ddenv.environment import NOTHING, Environment
from ddenv.evidence.slices import fresh_chance, implies
from ddenv.reduction.procedure import Test as Wanted
from ddenv.reduction.round import Stacks
from ddenv.runfile.events import Sliced, SlicesRefuted
from ddenv.runfile.fold_claims import rests_on_slices
from ddenv.runfile.fold_decisions import exact_runs, rested_on
from ddenv.runfile.state import CERTIFY, RunState, Test
from ddenv.runfile.supports import stacks_of
from ddenv.settings import SETTINGS, read

# All that a certificate would take as implied is simulated, while that is at most this part of all
# simulated time.
CHEAP = 0.1


def slice_environment(journal: Journal) -> bool:
    """Cuts the environment down, with an event, where every run known there allows it; returns
    whether it did. Other seeds may meet what went: with `accept_rate: kept` it is done after a
    reduction only if the chance of that is at most what may be lost of the rate. In accept mode
    `ask` it is not done.
    """
    state = journal.state
    there = journal.environment
    tests, met = _known(journal, there)
    if state.accept_mode == "ask" or not any(test.shows_f for test in tests):
        return False
    reduction = state.scenario["reduction"]
    if (
        state.node
        and reduction["accept_rate"] == "kept"
        and fresh_chance(met) > 1.0 - reduction["keep_rate"]
    ):
        return False
    left = journal.pinned
    for models in met:
        left |= models
    # With what goes together with them.
    ties = journal.ties
    before = NOTHING
    assert ties is not None
    together = Stacks.of(map(journal.models, stacks_of(state, state.environment)))
    while left != before:
        before = left
        left = together.of_any(ties.closed(left, there))
    if left == there or journal.is_refused(left) or state.evidence_test is None:
        return False
    audit = audit_is_due(state)
    chose = tuple(test.id for test in tests)
    journal.record(
        Sliced(
            environment=journal.number(left),
            tests=chose,
            evidence_test=state.evidence_test,
            audit=audit,
        )
    )
    return True


def slice_audit(journal: Journal) -> tuple[Wanted, ...]:
    """The last similar run, to be simulated in the slice that the environment was cut down to, if
    that is due and not made yet.
    """
    state = journal.state
    here = journal.state.here
    if here is None or not here.to_audit or here.evidence_test is None or state.refuted is not None:
        return ()
    environment = journal.environment
    run = state.test(here.evidence_test).run
    if journal.test(environment, run) is not None:
        return ()
    return (Wanted(environment=environment, run=run, why="audit"),)


def _known(journal: Journal, there: Environment) -> tuple[list[Test], list[Environment]]:
    """The runs known of the models `there` that decisions rest on, and what took part in each
    seed's; of chosen runs only those that show f. None where slices may not be used, or where it is
    unknown what took part in one.
    """
    tests: list[Test] = []
    met: dict[int, Environment] = {}
    ties = journal.ties
    exact = exact_runs(journal.state)
    for test in rested_on(journal.state):
        if not test.is_sound:
            continue
        if exact and (test.run not in exact or not test.shows_f):
            continue
        environment = journal.state.environments[test.environment]
        if (
            ties is not None
            and test.took_part is not None
            and implies(test.took_part, environment, there, ties)
        ):
            tests.append(test)
            met[test.run] = met.get(test.run, NOTHING) | test.took_part
        elif environment == there:
            return [], []
    return tests, list(met.values())


def audit_is_due(state: RunState, phase: str = "") -> bool:
    """Whether the next implied test has to be simulated: one in `audit`; in the `phase` of a
    certificate each, while cheap.
    """
    if phase == CERTIFY:
        made = [test for test in state.finished_tests if test.implied_by is None]
        audits = sum(
            test.simulated_seconds
            for test in made
            if test.audits is not None and test.phase == CERTIFY
        )
        if audits <= CHEAP * sum(test.simulated_seconds for test in made):
            return True
    every = read(state.scenario, SETTINGS["audit"])
    known = state.implied + sum(len(node.sliced_by) for node in state.nodes)
    return isinstance(every, int) and state.audits * every <= known + state.audits


def compare(journal: Journal, audits: Iterable[Test]) -> None:
    """Ends the use of slices if one of the finished `audits` differs from the run that implies
    it.
    """
    state = journal.state
    wrong = next((test for test in audits if not repeats(journal, test)), None)
    if wrong is None or wrong.audits is None or state.refuted is not None:
        return
    sound = takewhile(lambda node: not rests_on_slices(state, node), state.path)
    journal.record(
        SlicesRefuted(test=wrong.id, by=wrong.audits, node=[node.number for node in sound][-1])
    )


def repeats(journal: Journal, audit: Test) -> bool:
    """Whether a finished audit has the bits of the run that implies it; True for one without bits,
    since its worker died.
    """
    if audit.audits is None or not (again := journal.file.motions(audit.id)):
        return True
    state = journal.state
    source = state.test(audit.audits)
    # Models that did not affect a run may have moved by themselves.
    gone = (state.environments[0] - state.environments[audit.environment]).names(state.elements)
    first = {
        name: rows for name, rows in journal.file.motions(source.id).items() if name not in gone
    }
    took_part = frozenset((source.took_part or NOTHING).names(state.elements))
    same_end = _end(source, took_part) == _end(audit, took_part) and first.keys() == again.keys()
    return same_end and all(first[name].tobytes() == again[name].tobytes() for name in first)


def _end(test: Test, seen: frozenset[str]) -> tuple[bool, str, bool, dict[str, float]]:
    sensed = {name: at for name, at in test.first_sensed if name in seen}
    return test.outcome == "pass", test.failure, test.cut, sensed
