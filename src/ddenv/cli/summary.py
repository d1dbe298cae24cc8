"""What a run came to, as plain data for `--json` and as lines for people."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ddenv.errors import printable
from ddenv.runfile.state import RunState
from ddenv.words import count

# More names than this are not read by anyone in a line.
MOST_NAMES = 12


def summary(state: RunState, path: Path) -> dict[str, Any]:
    """The object that `--json` prints. Durations are in s."""
    return {
        "models_before": len(state.elements),
        "models_after": len(state.environment),
        "kept": list(state.environment),
        "tests": state.tests_done,
        "outcomes": state.outcomes(),
        "deflake_runs": state.deflake_runs,
        "ended_early": state.cut_tests,
        "rounds": state.rounds_done,
        "minimal": state.minimal,
        "failure": state.failure or None,
        "failure_rate": None if state.baseline is None else state.baseline.rate,
        "wall_seconds": round(state.working_seconds, 3),
        "status": state.status,
        "reason": state.reason,
        "run_file": str(path),
    }


def lines(state: RunState, path: Path) -> list[str]:
    """The same for people."""
    before, after = len(state.elements), len(state.environment)
    if state.baseline is None:
        return [f"run file: {path}"]
    what = "minimal environment" if state.minimal else "environment so far"
    tests = ", ".join(f"{number} {outcome}" for outcome, number in state.outcomes().items() if number)
    early = f"; {state.cut_tests} ended early" if state.cut_tests else ""
    told = [
        f"{what}: {after} of {count(before, 'model')} ({1 - after / before:.0%} smaller): {names(state)}",
        f"{state.tests_done} tests ({tests}; {state.deflake_runs} re-runs{early}) in {count(state.rounds_done, 'round')}, "
        f"{state.working_seconds:.0f} s",
        *broken(state),
        f"run file: {path}",
    ]
    return [printable(line) for line in told]


def broken(state: RunState) -> list[str]:
    """Why the last test that broke did, if one did: such tests count as tests without the failure."""
    tests = [test for test in state.tests if test.outcome in ("error", "timeout")]
    return [f"{count(len(tests), 'test')} broke, the last one: {tests[-1].failure}"] if tests else []


def names(state: RunState) -> str:
    """The models that are left, the first ones if there are many."""
    kept = state.environment
    more = f" and {len(kept) - MOST_NAMES} more" if len(kept) > MOST_NAMES else ""
    return ", ".join(kept[:MOST_NAMES]) + more
