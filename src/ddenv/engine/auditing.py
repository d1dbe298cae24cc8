"""Audits slices: some implied tests are simulated all the same, and have to repeat the run that implies them to the last bit."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import takewhile

from ddenv.engine.journal import Journal
from ddenv.runfile.fold_slices import rests_on_slices
from ddenv.runfile.state import FRESH, RunState, Test
from ddenv.settings import SETTINGS, read

# All that a certificate would take as implied is simulated, while that is at most this part of all simulated time.
CHEAP = 0.1


def audit_is_due(state: RunState, phase: str = "") -> bool:
    """Whether the next implied test has to be simulated: the first one, and then one in so many as the setting says.

    In the `phase` of a certificate each of them, while that is cheap. That a run repeats in a slice which it chose is implied, too.
    """
    if phase in FRESH and _is_cheap(state):
        return True
    every = read(state.scenario, SETTINGS["audit"])
    known = state.implied + sum(len(node.sliced_by) for node in state.nodes)
    return isinstance(every, int) and state.audits * every <= known + state.audits


def _is_cheap(state: RunState) -> bool:
    made = [test for test in state.finished_tests if test.implied_by is None]
    audits = sum(test.simulated_seconds for test in made if test.audits is not None and test.phase in FRESH)
    return audits <= CHEAP * sum(test.simulated_seconds for test in made)


def compare(journal: Journal, audits: Iterable[Test]) -> None:
    """Ends the use of slices if one of the finished `audits` differs from the run that implies it."""
    state = journal.state
    wrong = next((test for test in audits if not repeats(journal, test)), None)
    if wrong is None or state.refuted is not None:
        return
    sound = takewhile(lambda node: not rests_on_slices(state, node), state.path)
    journal.record("slices_refuted", test=wrong.id, by=wrong.audits, node=[node.number for node in sound][-1])


def repeats(journal: Journal, audit: Test) -> bool:
    """Whether a finished audit has the bits of the run that implies it; True for one that has none, since its worker died."""
    if audit.audits is None or not (again := journal.file.motions(audit.id)):
        return True
    source, state = journal.state.tests[audit.audits - 1], journal.state
    # What took no part may have moved by itself.
    gone = frozenset(state.elements) - journal.keep_of_test(audit.id)
    first = {name: rows for name, rows in journal.file.motions(source.id).items() if name not in gone}
    same_end = _end(source) == _end(audit) and first.keys() == again.keys()
    return same_end and all(first[name].tobytes() == again[name].tobytes() for name in first)


def _end(test: Test) -> tuple[bool, str, bool]:
    return test.outcome == "pass", test.failure, test.cut
