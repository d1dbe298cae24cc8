"""What happens while fresh runs show what the result of the rounds is worth, or find the nearest world that passes."""

from __future__ import annotations

from ddenv.evidence.claims import fresh_runs, fresh_runs_made
from ddenv.runfile.progress import Certificate
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import RunState, Test
from ddenv.text import percent, plain
from ddenv.words.claims import environment_named, of_runs, terms, usual_runs
from ddenv.words.margins import finding
from ddenv.words.news import isolating
from ddenv.words.signs import bar


def certifying(snapshot: Snapshot) -> tuple[str, ...]:
    """Fresh runs show what the result of the rounds is worth."""
    state = snapshot.state
    if state.isolating is not None:
        now = plain(isolating(state))
        return (
            "Isolation: removing as few models as possible from the whole world so that the robot reaches its goal.",
            f"Now {now}. The result of the reduction does not change.",
        )
    if state.margining is not None:
        return (
            "Margins: each number is changed in turn, to see how far it can go before f disappears.",
            f"Now {plain(finding(state))}. The result of the reduction does not change.",
        )
    certificate = state.certificate
    if certificate is None:
        return ("The rounds are over.",)
    if certificate.claims:
        return (_after(certificate), *_now(snapshot, certificate))
    made = fresh_runs_made(state, certificate)
    done = f"{made} {'is' if made == 1 else 'are'} done"
    return (
        *(() if certificate.seeds else (_bar(state, certificate),)),
        f"Full runs with fresh seeds check the result: {terms(certificate, len(state.pinned.intersection(state.environment)))}.",
        f"By the rate of the whole world, this takes about {usual_runs(state, certificate)}; {done}.",
        *_so_far(state),
        *_now(snapshot, certificate),
    )


def _so_far(state: RunState) -> tuple[str, ...]:
    """How often f showed in what is left and in the whole world."""
    rows = fresh_runs(state)
    if not rows or not rows[0].runs:
        return ()
    left, whole = rows[0], rows[-1]
    beside = ""
    if whole.without is None and whole.runs and len(rows) > 1 and not whole.is_chosen:
        beside = f", and in {of_runs(whole.shown, whole.runs)} of {environment_named(whole.node)}"
    return (f"So far f shows in {of_runs(left.shown, left.runs)} of what is left{beside}.",)


def _bar(state: RunState, certificate: Certificate) -> str:
    """What is shown to be kept by now, and where it has to come."""
    shown = fresh_runs(state)[0].bound or 0.0
    kept = f"at least {percent(shown)} is kept" if shown else "nothing is shown yet"
    return f"{bar(shown, certificate.certify_rate)} {kept}, aim {percent(certificate.certify_rate)}"


def _now(snapshot: Snapshot, certificate: Certificate) -> tuple[str, ...]:
    # A test of the certificate before may still run.
    running = [test for test in snapshot.running if test.phase == "certify" and test.run >= certificate.first_run]
    if not running:
        return ()
    return (f"Now: run {running[0].run - certificate.first_run + 1} of {_what(running[0], certificate)}.",)


def _what(test: Test, certificate: Certificate) -> str:
    if test.without is not None:
        return f"everything that is left except {plain(test.without)}"
    if test.node == certificate.node:
        return "everything that is left"
    return environment_named(test.node)


def _after(certificate: Certificate) -> str:
    if certificate.claims[0].verdict == "lost":
        return "What is left keeps too little of the rate. Earlier ones are run to find the last one not shown to have lost it."
    return "The certificate is finished."
