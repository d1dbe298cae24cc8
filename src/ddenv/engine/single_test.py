"""Runs the robot outside of a reduction, judged against a run's f; and asks with fresh runs, as
many as it takes, whether what a run has left still fails as it did.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ddenv.arrays import Floats
from ddenv.engine.judging import failures_of, result_data
from ddenv.engine.pool import Pool
from ddenv.engine.worker import Run
from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.evidence.rates import shows_at
from ddenv.robot.oracle import Failure
from ddenv.robot.result import RunResult
from ddenv.run_numbers import OTHER_SIMULATORS
from ddenv.runfile.progress import Certificate
from ddenv.runfile.state import BROKEN
from ddenv.runfile.state import Test as KnownTest
from ddenv.runfile.store import RunFile
from ddenv.runs.experiment import Experiment, read_subject
from ddenv.runs.playback import table
from ddenv.runs.trust import check_trusted, trust, untrusted
from ddenv.text import Data, Names, count
from ddenv.words.claims import still_fails
from ddenv.words.early_stop import beside_record
from ddenv.world.scenario import Oracle, seed_of


@dataclass(frozen=True)
class Trial:
    """One run to make: the models in the world, the seed, and the model that was left out on
    purpose, if any. It repeats the test `of` of a run.
    """

    keep: frozenset[str]
    seed: int
    without: str | None = None
    of: int | None = None


def in_simulator(subject: Experiment, simulator: Oracle, robot: Path) -> Experiment:
    """The same, in this simulator in place of the scenario's own; it finds the robot in the file
    `robot`.
    """
    there = subject.scenario.robot.model_copy(update={"model": robot})
    return replace(
        subject, scenario=subject.scenario.model_copy(update={"oracle": simulator, "robot": there})
    )


def plan(
    subject: Experiment,
    *,
    keep: list[str] | None = None,
    minimal: bool = False,
    leave_out: list[str] | None = None,
    leave_each_out: bool = False,
    seed: int | None = None,
    repeat: int = 1,
    test: int | None = None,
    first_run: int = 0,
) -> list[Trial]:
    """The runs asked for. Seeds are `seed`, `seed + 1`, ..., or the scenario's from `first_run` on.
    Raises UserError.
    """
    models = _models(subject, keep, minimal)
    if test is not None:
        if minimal or keep is not None or seed is not None:
            raise UserError(
                "--test: has models and a seed of its own; leave out --keep, --minimal and --seed"
            )
        state = subject.state
        if state is None:
            raise UserError("--test: needs a run; a scenario has no tests yet")
        if not 0 < test <= len(state.tests):
            raise UserError(
                f"--test: there is no test {test}; the run has tests 1 to {len(state.tests)}"
            )
        recorded = state.test(test)
        models = state.models_of(recorded)
        seed = recorded.seed
    for name in leave_out or []:
        if name not in models:
            raise UserError(
                f"--leave-out: '{name}' is not one of the {len(models)} models in this world"
            )
    models = tuple(name for name in models if name not in (leave_out or []))
    reduction = subject.scenario.reduction
    seeds = [seed_of(reduction, first_run + place) for place in range(repeat)]
    if seed is not None:
        seeds = [seed + place for place in range(repeat)]
    keeps: list[tuple[frozenset[str], str | None]] = [(frozenset(models), None)]
    if leave_each_out:
        keeps += [(frozenset(models) - {name}, name) for name in models]
    trials = [Trial(there, each, without) for there, without in keeps for each in seeds]
    if test is not None and not leave_out:
        trials[0] = replace(trials[0], of=test)
    return trials


def _models(subject: Experiment, keep: list[str] | None, minimal: bool) -> Names:
    if minimal and subject.state is None:
        raise UserError("--minimal: needs a run; a scenario has no minimal environment yet")
    if minimal and keep is not None:
        raise UserError("--minimal and --keep: give one of them")
    if keep is not None:
        for name in keep:
            if name not in subject.elements:
                raise UserError(f"--keep: the world has no removable model '{name}'")
        return tuple(keep)
    if minimal and subject.state:
        return subject.state.environment
    return subject.elements


def run_trials(subject: Experiment, trials: list[Trial], jobs: int) -> Iterator[Data]:
    """Makes the runs in worker processes; yields the result of each, in order, as plain data.
    Without f a failed run is just "failed".
    """
    failures: tuple[Failure, ...] = ()
    tests: dict[int, tuple[KnownTest, Floats]] = {}
    state = subject.state
    if subject.run is not None and state is not None:
        with RunFile(subject.run) as file:
            failures = failures_of(file, state)
            repeated = state.tests_of(trial.of for trial in trials if trial.of is not None)
            tests = {
                test.id: (test, table(file.motion(test.id) or array("d")))
                for test in repeated
                if test.is_finished
            }
    pool = Pool(subject.scenario, subject.world, subject.robot, max(1, min(jobs, len(trials))))
    results: dict[int, Data] = {}
    started = shown = 0
    try:
        while shown < len(trials):
            while pool.idle and started < len(trials):
                pool.submit(started, Run(keep=trials[started].keep, seed=trials[started].seed))
                started += 1
            for index, result in pool.finished(1.0):
                trial = trials[index]
                asked = {"seed": trial.seed, "without": trial.without, "models": len(trial.keep)}
                results[index] = asked | result_data(result, failures)
                if trial.of is not None and trial.of in tests:
                    test, rows = tests[trial.of]
                    same = isinstance(result, RunResult) and np.array_equal(
                        result.trajectory[: len(rows)], rows
                    )
                    results[index]["recorded"] = beside_record(test, results[index], same)
            while shown in results:
                yield results.pop(shown)
                shown += 1
    finally:
        pool.close()


# After this number of broken runs nothing is said.
MOST_BROKEN = 5


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """What fresh runs showed so far: `shown` of the `runs` that did not break showed f. `fails`: f
    shows at the rate that the certificate expects (True), or at less than half of it (False); None
    while that is open. `said` has it in words.
    """

    fails: bool | None
    shown: int
    runs: int
    broken: int
    said: str

    def __str__(self) -> str:
        return f"{self.said}: f in {self.shown} of {count(self.runs, 'run')}"


def subject_in(run: Path, folder: Path | None) -> Experiment:
    """The world of a run; the user's own controller or simulator is that in `folder`, if given.
    Raises UserError.
    """
    with RunFile(run) as file:
        subject = read_subject(file)
    update = {} if folder is None else {"folder": folder.absolute()}
    return replace(subject, scenario=subject.scenario.model_copy(update=update))


def last_of(run: Path, folder: Path | None, most: int, jobs: int, trusted: bool) -> Reproduction:
    """What all runs of `reproduce` show together. Raises UserError, also for a program that is not
    trusted.
    """
    subject = subject_in(run, folder)
    if trusted and (program := untrusted(subject.scenario)):
        trust(program)
    check_trusted(subject.scenario, run)
    *_, (_, found) = reproduce(subject, expected(subject, run), most, jobs)
    return found


def expected(subject: Experiment, where: object) -> Certificate:
    """The certificate of all that is left. Raises UserError where there is none, or where it showed
    no failure.
    """
    found = None if subject.state is None else current(subject.state)
    if found is None:
        what = "no certificate says how often what is left fails"
        raise UserError(f"{where}: {what}; make one first: ddenv certify {where}")
    if not found.claims[0].low and not found.seeds:
        raise UserError(
            f"{where}: no fresh run of what is left showed f, so there is nothing to reproduce"
        )
    return found


def reproduce(
    subject: Experiment, certificate: Certificate, most: int, jobs: int
) -> Iterator[tuple[Data, Reproduction]]:
    """Runs what is left with fresh seeds, at most `most` times, until it is known whether f shows
    at the rate that its certificate expects; where chosen runs were reduced, with their seeds, of
    which each has to show f. Yields each run's result, and what all of them show together.
    """
    shown: list[bool] = []
    broken = 0
    seeds = certificate.seeds[:most]
    rate = certificate.claims[0].low
    state = subject.state
    trials = plan(subject, minimal=True, first_run=OTHER_SIMULATORS.start, repeat=most)
    if seeds and state is not None:
        # The search has made these runs; how they compare with its records is said, too.
        known = {
            test.seed: test.id for test in state.tests if state.models_of(test) == state.environment
        }
        trials = [trial for seed in seeds for trial in plan(subject, test=known[seed])]
    for result in run_trials(subject, trials, jobs):
        if result["outcome"] in BROKEN:
            broken += 1
        else:
            shown.append(result["outcome"] == "similar")
        exact = None if all(shown) and len(shown) < len(seeds) else all(shown)
        fails = exact if seeds else shows_at(shown, rate)
        yield (
            result,
            Reproduction(
                fails=fails,
                shown=sum(shown),
                runs=len(shown),
                broken=broken,
                said=still_fails(fails, certificate),
            ),
        )
        if fails is not None or broken > MOST_BROKEN:
            return
