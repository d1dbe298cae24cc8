"""Does what a run has left still fail as it did? Fresh runs say so, as many as it takes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ddenv.amounts import count
from ddenv.engine.single_test import plan, run_trials
from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.evidence.rates import shows_at
from ddenv.runfile.progress import Claim
from ddenv.runfile.state import BROKEN
from ddenv.runfile.store import RunFile
from ddenv.runs.subject import Subject, read_subject
from ddenv.runs.trust import check_trusted, trust, untrusted

# Far from all seeds of a reduction and of its certificates.
FIRST_SEED = 1_000_000_000
# After this number of broken runs nothing is said.
MOST_BROKEN = 5


@dataclass(frozen=True)
class Reproduction:
    """What fresh runs showed so far: `shown` of the `runs` that did not break showed f, `broken` more broke.

    `fails`: f shows at the rate that the run's certificate expects (True), or at less than half of it (False); None if the runs do
    not decide.
    """

    fails: bool | None
    shown: int
    runs: int
    broken: int

    def __str__(self) -> str:
        said = {True: "it fails as it did", False: "it does not fail as it did", None: "the runs do not say"}[
            self.fails
        ]
        return f"{said}: f in {self.shown} of {count(self.runs, 'run')}"


def subject_in(run: Path, folder: Path | None) -> Subject:
    """The world of a run; the user's own controller or simulator is that in `folder`, if given. Raises UserError."""
    with RunFile(run) as file:
        subject = read_subject(file)
    if folder is None:
        return subject
    return replace(subject, scenario=subject.scenario.model_copy(update={"folder": folder.absolute()}))


def last_of(run: Path, folder: Path | None, most: int, jobs: int, trusted: bool) -> Reproduction:
    """What all runs of `reproduce` show together. Raises UserError, also for a program that is not trusted."""
    subject = subject_in(run, folder)
    if trusted and (program := untrusted(subject.scenario)):
        trust(program)
    check_trusted(subject.scenario, run)
    *_, (_, found) = reproduce(subject, expected(subject, run).low, most, jobs)
    return found


def expected(subject: Subject, where: object) -> Claim:
    """What the certificate says of all that is left. Raises UserError where there is none, or where it showed no failure."""
    found = None if subject.state is None else current(subject.state)
    if found is None:
        raise UserError(
            f"{where}: no certificate says how often what is left fails; make one first: ddenv certify {where}"
        )
    if not found.claims[0].low:
        raise UserError(f"{where}: no fresh run of what is left showed f, so there is nothing to reproduce")
    return found.claims[0]


def reproduce(subject: Subject, rate: float, most: int, jobs: int) -> Iterator[tuple[dict[str, Any], Reproduction]]:
    """Runs what is left with fresh seeds, at most `most` times, until it is known whether f shows at `rate`.

    Yields each run's result, and what all of them show together.
    """
    shown: list[bool] = []
    broken = 0
    for result in run_trials(subject, plan(subject, minimal=True, seed=FIRST_SEED, repeat=most), jobs):
        if result["outcome"] in BROKEN:
            broken += 1
        else:
            shown.append(result["outcome"] == "similar")
        fails = shows_at(shown, rate)
        yield result, Reproduction(fails, sum(shown), len(shown), broken)
        if fails is not None or broken > MOST_BROKEN:
            return
