"""Runs the robot outside of a reduction: in a whole scenario, or in any part of a run's world, judged against the run's f."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ddenv.engine.judging import failures_of, result_data
from ddenv.engine.pool import Pool
from ddenv.errors import UserError
from ddenv.robot.oracle import Failure
from ddenv.runfile.store import RunFile
from ddenv.runs.subject import Subject
from ddenv.world.scenario import Oracle


@dataclass(frozen=True)
class Trial:
    """One run to make: the models in the world, the seed, and the model that was left out on purpose, if any."""

    keep: frozenset[str]
    seed: int
    without: str | None = None


def in_simulator(subject: Subject, simulator: Oracle, robot: Path) -> Subject:
    """The same, in this simulator in place of the scenario's own; it finds the robot in the file `robot`."""
    there = subject.scenario.robot.model_copy(update={"model": robot})
    return replace(subject, scenario=subject.scenario.model_copy(update={"oracle": simulator, "robot": there}))


def plan(
    subject: Subject,
    *,
    keep: list[str] | None = None,
    minimal: bool = False,
    leave_out: list[str] | None = None,
    leave_each_out: bool = False,
    seed: int | None = None,
    repeat: int = 1,
    test: int | None = None,
) -> list[Trial]:
    """The runs asked for. Seeds are `seed`, `seed + 1`, ... (the scenario's own by default). Raises UserError."""
    models = _models(subject, keep, minimal)
    if test is not None:
        if minimal or keep is not None or seed is not None:
            raise UserError("--test: has models and a seed of its own; leave out --keep, --minimal and --seed")
        models, seed = _of_test(subject, test)
    for name in leave_out or []:
        if name not in models:
            raise UserError(f"--leave-out: '{name}' is not one of the {len(models)} models in this world")
    models = tuple(name for name in models if name not in (leave_out or []))
    base = subject.scenario.reduction.seed if seed is None else seed
    keeps: list[tuple[frozenset[str], str | None]] = [(frozenset(models), None)]
    if leave_each_out:
        keeps += [(frozenset(models) - {name}, name) for name in models]
    return [Trial(there, base + run, without) for there, without in keeps for run in range(repeat)]


def _models(subject: Subject, keep: list[str] | None, minimal: bool) -> tuple[str, ...]:
    if minimal and subject.state is None:
        raise UserError("--minimal: needs a run; a scenario has no minimal environment yet")
    if minimal and keep is not None:
        raise UserError("--minimal and --keep: give one of them")
    if keep is not None:
        for name in keep:
            if name not in subject.elements:
                raise UserError(f"--keep: the world has no removable model '{name}'")
        return tuple(keep)
    return subject.state.environment if minimal and subject.state else subject.elements


def _of_test(subject: Subject, number: int) -> tuple[tuple[str, ...], int]:
    """The models and the seed of a test of the run."""
    if subject.position is None:
        raise UserError("--test: needs a run; a scenario has no tests yet")
    state = subject.position.end
    if not 0 < number <= len(state.tests):
        raise UserError(f"--test: there is no test {number}; the run has tests 1 to {len(state.tests)}")
    test = state.tests[number - 1]
    return state.models_of(test), test.seed


def run_trials(subject: Subject, trials: list[Trial], jobs: int) -> Iterator[dict[str, Any]]:
    """Makes the runs in worker processes; yields the result of each, in order, as plain data.

    In a run whose baseline is done they are judged by its f; else a failed run is just "failed".
    """
    failures = _failures(subject)
    pool = Pool(subject.scenario, subject.world, subject.robot, max(1, min(jobs, len(trials))))
    results: dict[int, dict[str, Any]] = {}
    started = shown = 0
    try:
        while shown < len(trials):
            while pool.idle and started < len(trials):
                pool.submit(started, trials[started].keep, trials[started].seed, full=True)
                started += 1
            for index, result in pool.finished(1.0):
                trial = trials[index]
                asked = {"seed": trial.seed, "without": trial.without, "models": len(trial.keep)}
                results[index] = asked | result_data(result, failures)
            while shown in results:
                yield results.pop(shown)
                shown += 1
    finally:
        pool.close()


def _failures(subject: Subject) -> tuple[Failure, ...]:
    """What counts as f."""
    if subject.run is None or subject.state is None:
        return ()
    with RunFile(subject.run) as file:
        return failures_of(file, subject.state, subject.scenario.failure)
