"""Cuts the environment down to its slice: what took part in the runs known there, and what that is tied to. It needs no test."""

from __future__ import annotations

from ddenv.engine.auditing import audit_is_due
from ddenv.engine.bench import Bench
from ddenv.engine.journal import Journal
from ddenv.engine.subjects import Keep
from ddenv.reduction.stacks import Stacks
from ddenv.runfile.state import BROKEN, Test
from ddenv.runfile.supports import stacks_of
from ddenv.evidence.slices import fresh_chance


def slice_environment(journal: Journal) -> bool:
    """Cuts the environment down, with an event, where every run known there allows it; returns whether it did.

    Every known run keeps its bits; other seeds may meet what went. So with `accept_rate: kept` it is done after a reduction only
    if the chance that a fresh run meets any of it is at most what may be lost of the rate; and after the baseline in any case.
    In accept mode `ask`, where each reduction waits for the user, it is not done.
    """
    state = journal.state
    there = frozenset(state.environment)
    tests, met = _known(journal, there)
    if state.accept_mode == "ask" or not any(test.outcome == "similar" for test in tests):
        return False
    reduction = state.scenario["reduction"]
    if state.node and reduction["accept_rate"] == "kept" and fresh_chance(met) > 1.0 - reduction["keep_rate"]:
        return False
    left = _closed(journal, frozenset[str]().union(*met, state.pinned), there)
    evidence = state.evidence_test
    if left == there or left in journal.refused or evidence is None:
        return False
    environment = [number for number, name in enumerate(state.elements) if name in left]
    chose, audit = [test.id for test in tests], audit_is_due(state)
    journal.record("sliced", environment=environment, tests=chose, evidence_test=evidence, audit=audit)
    return True


def audit_slice(journal: Journal, bench: Bench) -> None:
    """Simulates the last similar run in the slice that the environment was cut down to, if that is due. Raises as `Bench.work`."""
    state, here = journal.state, journal.state.here
    if here is None or not here.to_audit or here.evidence_test is None or state.refuted is not None:
        return
    keep, run = frozenset(here.environment), state.tests[here.evidence_test - 1].run
    bench.work("audit", None, lambda: [] if (keep, run, False) in journal.ledger else [(keep, run, None)])


def _known(journal: Journal, there: Keep) -> tuple[list[Test], list[Keep]]:
    """The runs known of the models `there`, of those that decisions rest on, and what took part in each seed's.

    None where slices may not be used, or where it is unknown what took part in one of them.
    """
    state, found, met = journal.state, list[Test](), dict[int, Keep]()
    for number in journal.rested_on:
        test = state.tests[number - 1]
        if not test.is_finished or test.outcome in BROKEN:
            continue
        took_part = journal.known.took_part(state, test, journal.keep_of_test(number), there)
        if took_part is not None:
            found.append(test)
            met[test.run] = met.get(test.run, frozenset()) | took_part
        elif journal.keep_of_test(number) == there:
            return [], []
    return found, list(met.values())


def _closed(journal: Journal, models: Keep, there: Keep) -> Keep:
    """`models`, with what goes together with them."""
    ties, state = journal.known.ties(journal.state), journal.state
    assert ties is not None
    together, before = Stacks.of(stacks_of(state, state.environment)), frozenset[str]()
    while models != before:
        before = models
        models = together.of_any(ties.closed(models, there))
    return models
