"""What went or was known without a test, in sentences."""

from __future__ import annotations

from ddenv.runfile.state import RunState
from ddenv.text import plain
from ddenv.took_part import TEACHING, refuted_words, slice_words


def sliced(state: RunState) -> tuple[str, ...]:
    """How the environment was cut down to its slice, until the next test is made."""
    here = state.here
    if here is None or here.how != "sliced" or here.tests != state.tests_done:
        return ()
    words = plain(slice_words(state, here))
    return (TEACHING, f"{words}. u takes it back.")


def implied(state: RunState) -> tuple[str, ...]:
    """That the last test that ended was not simulated."""
    last = next((test for test in reversed(state.tests) if test.is_finished), None)
    if last is None or last.implied_by is None or state.ended:
        return ()
    return (f"Test {last.id} is implied by test {last.implied_by}: nothing that it lacks took part there.",)


def refuted(state: RunState) -> tuple[str, ...]:
    """That slices are wrong here."""
    words = refuted_words(state)
    return (f"{words[:1].upper()}{words[1:]}.",) if words else ()
