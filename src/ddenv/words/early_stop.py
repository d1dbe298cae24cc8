"""What is said of tests that ended early, and how a test that is made again stands beside its record."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ddenv.runfile.state import RunState, Test
from ddenv.text import count
from ddenv.words.signs import metres

WHY = "the robot was at rest for good, so that more time could not change the verdict"
_OFF = "from here on all tests run to their end"


def ended_early(test: Test) -> str:
    """That a test ended early, and when (simulated s); "" if it did not."""
    return f"ended early at {test.simulated_seconds:.1f} s" if test.cut else ""


def early_among(tests: Iterable[Test]) -> str:
    """How many of some tests ended early, such as "4 early"; "" if none did."""
    early = sum(test.cut for test in tests)
    return f"{early} early" if early else ""


def why_off(state: RunState) -> str:
    """Why no test of a run ends early any more, in one sentence without a full stop; "" where that did not happen."""
    ended = state.early_stop_ended
    if ended is None:
        return ""
    if ended.certificate is not None:
        return f"certificate {ended.certificate} refutes what tests that ended early accepted: {_OFF}"
    return f"test {ended.test} ended early, and test {ended.by}, the same to its end, has another verdict: {_OFF}"


def record_of(test: Test, repeats: bool | None) -> dict[str, Any]:
    """What is known of a test that is made again, as plain data. `repeats`: every bit of its trajectory is the same; None if it
    has none.
    """
    kept = ("outcome", "failure", "distance", "simulated_seconds")
    return {"test": test.id, "early": test.cut, "repeats": repeats} | {name: getattr(test, name) for name in kept}


def beside_record(now: Mapping[str, Any]) -> str:
    """How a test that was made again, in full, compares with its `recorded` result; one sentence without a full stop."""
    record = now["recorded"]
    then = f"recorded as test {record['test']}: {_ending(record)}"
    if record["early"]:
        then += f", ended early at {record['simulated_seconds']:.1f} s"
    if not record["repeats"]:
        differs = (
            "nothing to compare bits with" if record["repeats"] is None else "the trajectory differs from the record"
        )
        return f"{then}; now: {_ending(now)}; {differs}"
    if record["early"]:
        return f"{then}; up to there every bit is the same; in full: {_ending(now)}"
    same = all(record[name] == now[name] for name in ("outcome", "failure"))
    return f"{then}; every bit is the same" if same else f"{then}; now: {_ending(now)}, with the same bits"


def contradicts(now: Mapping[str, Any]) -> bool:
    """Whether a test that was made again has another verdict than its record."""
    record = now.get("recorded")
    return record is not None and bool(record["outcome"] != now["outcome"])


def contradictions(number: int) -> str:
    return f"{count(number, 'run')} with another verdict than the record" if number else ""


def _ending(result: Mapping[str, Any]) -> str:
    """How a test ended, in words: "similar, stuck, 0.33 m from f"."""
    away = metres(result["distance"], 2)
    parts = (result["outcome"], result["failure"], f"{away} from f" if away else "")
    return ", ".join(part for part in parts if part)
