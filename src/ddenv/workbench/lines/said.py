"""What lines say of a run when they are asked: all in words, without signs and colours."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ddenv.amounts import first_of, rounded
from ddenv.evidence.claims import drift
from ddenv.runfile.state import Candidate, RunState, Trial
from ddenv.runs.fresh_runs import fresh_runs
from ddenv.runs.tests_left import remaining
from ddenv.words.news import headline
from ddenv.workbench.run.certificate_rows import name_of
from ddenv.workbench.run.explain import explain
from ddenv.workbench.run.poll import Snapshot
from ddenv.workbench.wording import about, count, percent, plain

# The maximum number of models that a line names.
NAMED = 50
# The tries that are listed, the latest ones.
TRIES = 5


def status(snapshot: Snapshot) -> Iterator[str]:
    """Where the run is."""
    state = snapshot.state
    yield headline(state)
    if forms := drift(state):
        yield forms[0]
    left = remaining(state, snapshot.engine == "alive")
    if left is not None:
        time = f", about {about(*left.seconds)}" if left.seconds else ""
        yield f"about {count(rounded(left.tests[1]), 'test')} left{time}"
    yield {"alive": "an engine is at work", "starting": "the engine starts"}.get(
        snapshot.engine, "no engine is running"
    )


def why(snapshot: Snapshot) -> Iterator[str]:
    """What is happening."""
    yield from explain(snapshot).sentences


def table(snapshot: Snapshot) -> Iterator[str]:
    """The tries and the candidates of the round, or the rows of the certificate."""
    state = snapshot.state
    for trial in state.trials[-TRIES:]:
        yield _row(state, trial)
    if state.certificate is not None:
        for fresh in fresh_runs(state):
            yield f"{plain(name_of(fresh))}: f in {fresh.shown} of {count(fresh.runs, 'run')}"
    elif state.round is not None:
        yield from (_row(state, candidate) for candidate in state.round.candidates)
    else:
        yield "there is no round yet"


def _row(state: RunState, row: Candidate | Trial) -> str:
    running = any(state.tests[id - 1].outcome == "running" for id in row.tests if 0 < id <= len(state.tests))
    verdict = row.verdict or ("in test" if running else "not judged yet")
    distance = row.distance if isinstance(row, Candidate) else None
    away = "" if distance is None else f", ranked by {distance:.1f}"
    return f"{row.label}: {count(row.size, 'model')}, {verdict}, {count(len(row.tests), 'test')}{away}"


def models(snapshot: Snapshot) -> Iterator[str]:
    """The models that are left."""
    state = snapshot.state
    names = [f"{plain(name)}{' (pinned)' if name in state.pinned else ''}" for name in state.environment]
    yield f"{count(len(names), 'model')} left: {first_of(names, NAMED) or 'none'}"


def decisions(snapshot: Snapshot) -> Iterator[str]:
    """What the user decided."""
    yield from (plain(each.words) for each in snapshot.state.decisions)
    if not snapshot.state.decisions:
        yield "you decided nothing yet"


def baseline(snapshot: Snapshot) -> Iterator[str]:
    """How often the whole world fails."""
    base = snapshot.state.baseline
    yield (
        "the baseline is not finished"
        if base is None
        else f"f in {base.failures} of {base.runs} runs, {percent(base.rate)}"
    )


QUESTIONS: dict[str, tuple[Callable[[Snapshot], Iterator[str]], str]] = {
    "status": (status, "where the run is"),
    "why": (why, "what is happening, and why"),
    "table": (table, "the candidates of this round with their verdicts"),
    "models": (models, "the models that are left"),
    "baseline": (baseline, "how often the whole world fails"),
    "decisions": (decisions, "what you decided"),
}
