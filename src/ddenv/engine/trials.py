"""Sub-environments of the user's own making: which tests they still need, and what those add up to."""

from __future__ import annotations

from ddenv.engine.journal import Journal, Keep
from ddenv.reduction.verdict import standing
from ddenv.runfile.guiding import Trial

Hand = tuple[Keep, int, int]


def open_trials(journal: Journal) -> list[Trial]:
    """Those without a verdict, in the order in which they were asked for."""
    return [trial for trial in journal.state.trials if not trial.verdict]


def judge_trials(journal: Journal) -> list[Hand]:
    """Writes the verdicts that are due; returns the tests still needed as (models, run, trial), the first asked for first."""
    wanted: list[Hand] = []
    iterations = journal.state.scenario["reduction"]["iterations"]
    for trial in open_trials(journal):
        keep = frozenset(trial.models)
        now = standing([keep], journal.is_similar, iterations)
        if now.verdicts[0]:
            _judge(journal, trial, keep, now.verdicts[0], iterations)
        else:
            wanted += [(keep, run, trial.number) for _, run in now.wanted]
    return wanted


def _judge(journal: Journal, trial: Trial, keep: Keep, verdict: str, iterations: int) -> None:
    tests = journal.tests_of(keep, iterations)
    known = sum(journal.state.tests[test - 1].trial != trial.number for test in tests)
    journal.record("trial_judged", trial=trial.number, verdict=verdict, tests=tests, known=known)
