"""One line of text for each event of a run, and what else is said of it without a screen."""

from __future__ import annotations

import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterable

from ddenv.evidence.claims import in_the_making, never_left_out
from ddenv.runfile.events import Implied, TestFinished, TestLost, TestStarted
from ddenv.runfile.failure_words import DEEDS
from ddenv.runfile.position import Moment
from ddenv.runfile.progress import Removal
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import ISOLATE, Candidate, RunState, Test, Trial
from ddenv.runfile.tested import purpose
from ddenv.text import count, first_of, plain
from ddenv.words import margins
from ddenv.words.baseline import baseline
from ddenv.words.claims import made_of_usual, of_passing, smaller_known, usual_runs, verdict_on
from ddenv.words.early_stop import early_among, ended_early, why_off
from ddenv.words.signs import SETTLING, outcome
from ddenv.words.slices import implied_words, refuted_words, slice_words

ISOLATING = "finding the nearest world that passes"
CONFIRMING = "certifying what is left with fresh runs"
# A line names so many of the models that a removal leaves out.
MOST_NAMES = 3
# Events whose text is always the same.
SAID = {"paused": "paused", "resumed": "resumed", "supports_started": SETTLING}
# Hints for readers who see only these lines.
HINTS = {
    "paused": " from a workbench; to resume, attach with 'ddenv open'",
    "waiting": ": attach with 'ddenv open'",
}


def headline(state: RunState, simulated: float | None = None) -> str:
    """The state in one line, cut to the terminal's width. The running test that is farthest has
    `simulated` so much time, s.
    """
    models = f"{len(state.environment)} of {len(state.elements)} models"
    running = state.tally["running"]
    status = "waiting for disk space" if state.needs_room and not state.ended else state.status
    line = f"{status} · {_where(state)} · {models} · {state.tests_done} tests, {running} running"
    if running and simulated is not None:
        line += f", {simulated:.1f} s simulated"
    return line[: shutil.get_terminal_size().columns - 1]


def _where(state: RunState) -> str:
    if state.confirming and not state.ended:
        now = in_the_making(state)
        if now is None:
            return CONFIRMING
        return f"certificate: {made_of_usual(state, now)}"
    if state.settling and not state.ended:
        return SETTLING
    if state.isolating is not None and not state.ended:
        return isolating(state)
    if state.margining is not None and not state.ended:
        return margins.finding(state)
    if state.round is None:
        return "baseline"
    return f"round {state.round.number}, n {state.round.n_partitions}"


def isolating(state: RunState) -> str:
    """How far an isolation is: what it tries, or which world fresh runs judge."""
    running = state.running_tests
    now = state.isolating
    last = next((test.removal for test in running if test.removal is not None), None)
    if last is None or now is None:
        return ISOLATING
    gone = state.removals[last - 1].models
    if gone:
        tried = f"without {count(len(gone), 'model')}"
    else:
        tried = "whether the whole world still fails"
    made = sum(
        test.run >= now.asked.run and test.is_finished
        for test in state.tests
        if test.phase == ISOLATE
    )
    return f"{ISOLATING}: {tried}{f', {made} fresh runs' if made else ''}"


def news(kind: str, before: RunState, after: RunState, attached: bool = False) -> str:
    """What one event changed, or "" if it is not worth a line; with a hint how to attach unless the
    reader is `attached`.
    """
    if kind in NEWS:
        line = NEWS[kind](before, after)
    else:
        # All other decisions of the user carry their own words.
        if len(after.decisions) > len(before.decisions):
            line = after.decisions[-1].words
        else:
            line = SAID.get(kind, "")
    if attached or not line:
        return line
    return f"{line}{HINTS.get(kind, '')}"


def _engine_started(before: RunState, after: RunState) -> str:
    resumed = " again" if before.tests else ""
    # A cluster says later how many there are.
    workers = f" with {count(after.jobs, 'worker')}" if after.jobs else ""
    return f"engine started{resumed}{workers}; {count(len(after.elements), 'model')} can be removed"


def _comparing(_: RunState, after: RunState) -> str:
    if after.physics.now == after.physics.proven:
        return "a run is made again with its seed, to see whether it repeats exactly"
    return (
        f"made with {after.physics.proven}, now {after.physics.now}: the first run is repeated "
        "and compared"
    )


def _compared(before: RunState, after: RunState) -> str:
    same = after.physics.mixed == before.physics.mixed
    return f"  {'identical bits' if same else 'different bits: from here on the tests are mixed'}"


def _disk_space(before: RunState, after: RunState) -> str:
    if after.needs_room:
        if after.file_is_full:
            return (
                "  the run file is as large as a file may be (ulimit -f): waiting until that "
                "limit is raised"
            )
        return f"  out of disk space: waiting until {after.needs_room / 1e6:.0f} MB are free"
    if before.needs_room:
        return "  there is disk space again"
    return ""


def _supports(_: RunState, after: RunState) -> str:
    if after.unsettled:
        return f"it is unknown which models support others: {after.unsettled}"
    resting = len({upper for upper, _ in after.supports})
    if resting:
        rests = "rests" if resting == 1 else "rest"
        return f"{count(resting, 'model')} of the world {rests} on others"
    return ""


def _round_started(_: RunState, after: RunState) -> str:
    round = after.round
    if round is None:
        return ""
    models = count(len(round.environment), "model")
    parts = count(len(round.partitions), "partition")
    return f"round {round.number}: {models} in {parts}, {count(len(round.candidates), 'candidate')}"


def _candidate_judged(before: RunState, after: RunState) -> str:
    if before.round is None or after.round is None:
        return ""
    return _judged(after, after.round.candidates.changed_since(before.round.candidates))


def _judged(state: RunState, judged: Iterable[Candidate | Trial | Removal]) -> str:
    """Verdicts, and how the tests ended: "part A (3 models): dissimilar after 4 tests (2 pass, 2
    stuck), implied by test 3".
    """
    said = []
    for one in judged:
        if isinstance(one, Removal):
            what = (
                f"the whole world without {count(len(one.models), 'model')} "
                f"({first_of(one.models, MOST_NAMES)})"
            )
        else:
            what = f"{one.label} ({count(one.size, 'model')})"
        endings = Counter(
            _ending(state, test) for test in state.tests_of(one.tests) if test.is_finished
        )
        if endings:
            ways = f" ({', '.join(f'{number} {ending}' for ending, number in endings.items())})"
        else:
            ways = ""
        implied = f", {words}" if (words := implied_words(state, one.tests)) else ""
        early = f", {words}" if (words := early_among(state.tests_of(one.tests))) else ""
        said.append(
            f"  {what}: {one.verdict} after {count(len(one.tests), 'test')}{ways}{early}{implied}"
        )
    return "".join(said)


def _ending(state: RunState, test: Test) -> str:
    """How a test ended: "stuck"; "stuck elsewhere" if f is to get stuck, but this is another
    failure.
    """
    if test.failure not in DEEDS:
        return test.outcome
    seen = () if state.baseline is None else state.baseline.seen
    f = {kind for one in seen if one.test in state.failures for kind in one.kinds}
    if test.outcome != "other" or test.failure not in f:
        return test.failure
    return (
        f"{test.failure} "
        f"{'elsewhere' if settings(state).similarity == 'end-pose' else 'differently'}"
    )


def _waiting(_: RunState, after: RunState) -> str:
    if after.round is None or after.waiting_candidate is None:
        return ""
    return (
        f"  {after.round.candidates[after.waiting_candidate].label} shows f and waits for accept "
        "or reject"
    )


def _left(state: RunState) -> str:
    return count(len(state.environment), "model")


def _certificate_started(_: RunState, after: RunState) -> str:
    last = after.certificates[-1]
    what = (
        f"fresh runs of what is left ({_left(after)}), without each model, and of the whole world"
    )
    if last.seeds:
        what = (
            f"the chosen seeds check what is left ({_left(after)}); fresh runs measure how often "
            "others show f"
        )
    return f"certificate {last.number}: {what}; about {usual_runs(after, last)}"


def _ended(_: RunState, after: RunState) -> str:
    known = smaller_known(after)
    return f"{after.status}: {after.reason}{f'; {known}' if known else ''}"


# The line of each event, from the states before and after it.
NEWS: dict[str, Callable[[RunState, RunState], str]] = {
    "engine_started": _engine_started,
    "cluster": lambda _, after: after.cluster,
    "comparing": _comparing,
    "compared": _compared,
    "clock_jumped": lambda *_: (
        "  the machine slept, or its clock was set: that time does not count"
    ),
    "disk_space": _disk_space,
    "supports": _supports,
    "noted": lambda _, after: after.notes[-1][1],
    "command_refused": lambda _, after: f"not done: {after.refusal[1]}",
    "baseline_finished": lambda _, after: baseline(after),
    "round_started": _round_started,
    "candidate_judged": _candidate_judged,
    "trial_judged": lambda before, after: _judged(
        after, (one for one in after.trials if one not in before.trials)
    ),
    "waiting": _waiting,
    "reduced": lambda _, after: f"  reduced to {_left(after)} after {after.tests_done} tests",
    "sliced": lambda _, after: (
        f"  reduced to {_left(after)}: {slice_words(after, after.nodes[after.node])}"
    ),
    "slices_refuted": lambda _, after: refuted_words(after),
    "early_stop_ended": lambda _, after: f"  {why_off(after)}",
    "certificate_started": _certificate_started,
    "certificate_finished": lambda _, after: (
        f"  certificate {after.certificates[-1].number}: "
        f"{verdict_on(after.certificates[-1], never_left_out(after, after.certificates[-1]))}"
    ),
    "rate_lost": lambda _, after: (
        f"  back to {_left(after)}, the last environment not shown to have lost the rate"
    ),
    "left_out": lambda _, after: (
        f"  reduced to {_left(after)} after {after.tests_done} tests: "
        f"{after.nodes[after.node].what} f seems to show about as often"
    ),
    "isolation_started": lambda *_: (
        f"{ISOLATING}: removing as few models as possible from the whole world so that the robot "
        "reaches its goal"
    ),
    "removal_judged": lambda before, after: _judged(
        after, after.removals.changed_since(before.removals)
    ),
    "isolation_checked": lambda _, after: (
        "  fresh runs: the robot reaches its goal in {0.reached} of {0.runs}: {0.verdict}".format(
            after.isolations[-1].checks[-1].claims[0]
        )
    ),
    "isolation_given_up": lambda *_: (
        "the search for the nearest world that passes is abandoned; the reduction is unchanged"
    ),
    "isolation_finished": lambda _, after: of_passing(after, after.isolations[-1]),
    "margins_started": margins.started,
    "margin_ran": margins.ran,
    "margin_impossible": margins.impossible,
    "margins_finished": lambda *_: "the search for margins is over",
    "finished": _ended,
    "engine_stopped": _ended,
    "engine_failed": _ended,
}


def happened(moment: Moment) -> str:
    """What happened in a moment, with its time of day."""
    at = time.strftime("%H:%M:%S", time.localtime(moment.recorded.time))
    return f"{at}, after {count(moment.after.tests_done, 'test')}: {what_happened(moment)}."


def what_happened(moment: Moment) -> str:
    """The same in a few words, without the time."""
    kind = moment.recorded.kind
    event = moment.recorded.event
    state = moment.after
    if isinstance(event, TestStarted | TestFinished | TestLost | Implied):
        return _of_test(state, state.test(event.test))
    if kind == "created":
        return "the run was created"
    if kind == "finished":
        # With what result is explained beside it.
        return "the run ended"
    return plain(news(kind, moment.before, state, attached=True)).rstrip(".") or kind.replace(
        "_", " "
    )


def _of_test(state: RunState, test: Test) -> str:
    what = f"test {test.id} ({purpose(state, test)}, seed {test.seed})"
    if test.implied_by is not None:
        return f"{what} follows from test {test.implied_by}: {outcome(test)}"
    if test.outcome == "running":
        return f"{what} starts"
    early = f", {ended_early(test)}" if test.cut else ""
    return f"{what}: {outcome(test) or test.outcome}{early}"
