"""What is said of tests that ended early, and how a test that is made again stands beside its
record.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ddenv.runfile.state import RunState, Test
from ddenv.words.signs import metres

WHY = (
    "the controller had stopped, the robot was at rest, and its end was well inside or outside "
    "epsilon"
)
_OFF = "from here on all tests run to their end"


def ended_early(test: Test) -> str:
    """That a test ended early, and when (simulated s); "" if it did not."""
    if test.cut:
        return f"ended early at {test.simulated_seconds:.1f} s"
    return ""


def early_among(tests: Iterable[Test]) -> str:
    """How many of some tests ended early, such as "4 early"; "" if none did."""
    early = sum(test.cut for test in tests)
    if early:
        return f"{early} early"
    return ""


def why_off(state: RunState) -> str:
    """Why no test of a run ends early any more, in one sentence without a full stop; "" where that
    did not happen.
    """
    ended = state.early_stop_ended
    if ended is None:
        return ""
    if ended.certificate is not None:
        return (
            f"certificate {ended.certificate} refutes what tests that ended early accepted: {_OFF}"
        )
    return (
        f"test {ended.test} ended early, and test {ended.by}, the same to its end, has another "
        f"verdict: {_OFF}"
    )


def beside_record(test: Test, now: Mapping[str, Any], repeats: bool) -> str:
    """How a test that was made again, in full, compares with its record; one sentence without a
    full stop. `repeats`: its trajectory begins with the recorded one, to the last bit.
    """
    then = ", ".join(
        filter(None, (_ending(test.outcome, test.failure, test.distance), ended_early(test)))
    )
    ends = _ending(now["outcome"], now["failure"], now["distance"])
    if not repeats:
        differs = f"the trajectory differs; now: {ends}"
    elif test.cut or test.outcome != now["outcome"]:
        differs = f"up to there every bit is the same; in full: {ends}"
    else:
        differs = "every bit is the same"
    return f"recorded as test {test.id}: {then}; {differs}"


def _ending(outcome: str, failure: str, distance: float | None) -> str:
    """How a test ended, in words: "similar, stuck, 0.33 m from f"."""
    away = metres(distance, 2)
    return ", ".join(filter(None, (outcome, failure, away and f"{away} from f")))
