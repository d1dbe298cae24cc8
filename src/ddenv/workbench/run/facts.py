"""The raw facts of one test, in words."""

from __future__ import annotations

import time
from dataclasses import dataclass

from ddenv.amounts import first_of
from ddenv.runfile.position import Position
from ddenv.runfile.state import RunState, Test
from ddenv.runfile.tested import purpose
from ddenv.workbench.wording import OUTCOME, count, metres, plain

# The maximum number of models to name, and of lines of a test's log.
NAMED, LOGGED = 12, 400


@dataclass(frozen=True, slots=True)
class Facts:
    """`title`, then (name, words) of each fact; `log` has (simulated s, words); `command` makes the test again."""

    title: str
    facts: tuple[tuple[str, str], ...]
    log: tuple[tuple[float, str], ...]
    command: str


def facts(position: Position, number: int, run: str) -> Facts | None:
    """The facts of the test with this number, as the run file has them now; None if there is no such test.

    `run` is what a shell calls the run. Raises UserError if the file cannot be read.
    """
    start = position.start_of(number)
    if start is None:
        return None
    state, test = position.end, position.end.tests[number - 1]
    models = state.models_of(test)
    again = f" · re-run {test.run}" if test.phase == "round" and test.run else ""
    said = (
        ("end", _end(test)),
        ("place", _place(test)),
        ("seed", f"{test.seed} (run {test.run})"),
        ("time", _took(test)),
        ("started", time.strftime("%-d %b %Y, %H:%M:%S", time.localtime(start.recorded.time))),
        ("models", f"{len(models)} of {count(len(state.elements), 'model')}: {_names(models)}"),
        ("touched", _names([name for name, _ in test.first_touched])),
        ("counts in", _counts(position, state, test)),
    )
    title = f"Test {number} of {len(state.tests)} · {purpose(start.after, test)}{again}"
    command = f"ddenv test {run} --test {number}"
    return Facts(title, tuple((name, words) for name, words in said if words), log(test), command)


def log(test: Test) -> tuple[tuple[float, str], ...]:
    """What the robot met in a test, and when, simulated s."""
    met = [(at, 0, f"senses {plain(name)}") for name, at in test.first_sensed]
    met += [(at, 1, f"touches {plain(name)}") for name, at in test.first_touched]
    lines = [(at, words) for at, _, words in sorted(met)]
    if len(lines) > LOGGED:
        lines = [*lines[:LOGGED], (lines[LOGGED][0], f"and {len(lines) - LOGGED} more such lines")]
    if test.is_finished:
        lines.append((test.simulated_seconds, _end(test)))
    return ((0.0, "starts"), *lines)


def _end(test: Test) -> str:
    if test.outcome == "running":
        return "▶ it runs"
    why = f": {plain(test.failure)}" if test.failure else ""
    early = ", ended early: it was stuck for good" if test.cut else ""
    return f"{OUTCOME.get(test.outcome, test.outcome)}{why}{early}"


def _place(test: Test) -> str:
    if test.end_pose is None:
        return ""
    x, y, z = test.end_pose[:3]
    away = metres(test.distance, 2)
    return f"({x:.2f}, {y:.2f}, {z:.2f}) m{f', {away} from the end of f' if away else ''}"


def _took(test: Test) -> str:
    if not test.is_finished:
        return ""
    if test.implied_by is not None:
        return f"not simulated: it follows from test {test.implied_by}, in which nothing that it lacks took part"
    computed = "its result was copied from another run" if test.taken else f"{test.wall_seconds:.1f} s of computing"
    return f"{test.simulated_seconds:.1f} s simulated, {computed}"


def _names(models: tuple[str, ...] | list[str]) -> str:
    return first_of([plain(name) for name in models], NAMED) or "none"


def _counts(position: Position, state: RunState, test: Test) -> str:
    """The verdict that the test counts in."""
    if test.trial is not None and 0 < test.trial <= len(state.trials):
        trial = state.trials[test.trial - 1]
        return f"{trial.label}: {trial.verdict or 'not judged yet'}, {count(len(trial.tests), 'test')}"
    if test.round is None or test.candidate is None:
        return ""
    ends = (each.last for each in reversed(position.chapters) if each.kind == "round" and each.number == test.round)
    round = position.state(next(ends, 0)).round
    if round is None or not 0 <= test.candidate < len(round.candidates):
        return ""
    one = round.candidates[test.candidate]
    numbers = ", ".join(map(str, one.tests[:NAMED]))
    return f"{one.label} of round {round.number}: {one.verdict or 'not judged yet'}, tests {numbers}"
