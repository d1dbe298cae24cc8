"""The words for what happens in a run, one line each."""

from __future__ import annotations

import shutil
from collections.abc import Sequence

from ddenv.runfile.state import RunState


def headline(state: RunState) -> str:
    """The state in one line, cut to the terminal's width."""
    models = f"{len(state.environment)} of {len(state.elements)} models"
    where = "baseline" if state.round is None else f"round {state.round.number}, n {state.round.n_partitions}"
    running = state.tally["running"]
    line = f"{state.status} · {where} · {models} · {state.tests_done} tests, {running} running"
    return line[: shutil.get_terminal_size().columns - 1]


def news(kind: str, before: RunState, after: RunState) -> str:
    """What one event changed, or "" if it is not worth a line."""
    match kind:
        case "engine_started":
            resumed = " again" if before.tests else ""
            return f"engine started{resumed} with {after.jobs} workers; {len(after.elements)} models can be removed"
        case "baseline_finished":
            return baseline(after)
        case "round_started":
            round = after.round
            return (
                f"round {round.number}: {count(len(round.environment), 'model')} in "
                f"{count(len(round.partitions), 'partition')}, {count(len(round.candidates), 'candidate')}"
            )
        case "candidate_judged" if after.round is not None:
            changed = after.round.candidates.changed_since(before.round.candidates)
            return "".join(
                f"  {one.label} ({count(one.size, 'model')}): {one.verdict} after {count(len(one.tests), 'test')}"
                for one in changed
            )
        case "waiting":
            waiting = after.round.candidates[after.waiting_candidate]
            return f"  {waiting.label} shows f and waits for accept or reject: attach with 'ddenv open'"
        case "paused":
            return "paused from a workbench; it resumes from there too: attach with 'ddenv open'"
        case "resumed":
            return "resumed"
        case "reduced":
            return f"  reduced to {count(len(after.environment), 'model')} after {after.tests_done} tests"
        case "finished" | "engine_stopped" | "engine_failed":
            return f"{after.status}: {after.reason}"
    return ""


def baseline(state: RunState) -> str:
    """What the baseline found, and how sure a re-run is to meet the failure."""
    found = state.baseline
    x, y, z = found.position
    return (
        f"baseline: f in {found.failures} of {found.runs} runs ({found.rate:.0%}, 95 % interval {found.low:.0%} to "
        f"{found.high:.0%}), ending at ({x:.2f}, {y:.2f}, {z:.2f}) m; {iterations(state)}"
    )


def iterations(state: RunState) -> str:
    """How likely the re-runs of one candidate all miss f, and how many would be enough."""
    found, given = state.baseline, state.scenario["reduction"]["iterations"]
    line = f"{count(1 + given, 'run')} of a candidate miss it with chance {found.miss_chance:.2g}"
    if found.iterations_95 > given:
        line += f"; 95 % needs --iterations {found.iterations_95}"
    return line


def count(number: int, word: str) -> str:
    """1 model, 2 models."""
    return f"{number} {word}" if number == 1 else f"{number} {word}s"


def first_of(names: Sequence[str], most: int) -> str:
    """a, b and 3 more: not more than `most` of them by name."""
    left = len(names) - most
    return ", ".join(names[:most]) + (f" and {left} more" if left > 0 else "")
