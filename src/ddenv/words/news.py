"""One line of text for each event of a run, and what else is said of it without a screen."""

from __future__ import annotations

import shutil
import time
from collections import Counter

from ddenv.evidence.claims import in_the_making, never_left_out
from ddenv.runfile.events import DEEDS, Implied, TestFinished, TestLost, TestStarted
from ddenv.runfile.position import Moment
from ddenv.runfile.progress import Removal
from ddenv.runfile.state import ISOLATE, Candidate, RunState, Test, Trial
from ddenv.runfile.tested import purpose
from ddenv.text import count, first_of, plain
from ddenv.words.baseline import baseline
from ddenv.words.claims import made_of_usual, of_passing, smaller_known, usual_runs, verdict_on
from ddenv.words.signs import SETTLING, outcome
from ddenv.words.slices import implied_words, refuted_words, slice_words

ISOLATING = "finding the nearest world that passes"
CONFIRMING = "certifying what is left with fresh runs"
# A line names so many of the models that a removal leaves out.
MOST_NAMES = 3
# Events whose text is always the same.
SAID = {
    "paused": "paused",
    "resumed": "resumed",
    "supports_started": SETTLING,
}
# Hints for readers who see only these lines.
HINTS = {
    "paused": " from a workbench; to resume, attach with 'ddenv open'",
    "waiting": ": attach with 'ddenv open'",
}


def headline(state: RunState, simulated: float | None = None) -> str:
    """The state in one line, cut to the terminal's width. The running test that is farthest has `simulated` so much time, s."""
    models = f"{len(state.environment)} of {len(state.elements)} models"
    running = state.tally["running"]
    status = "waits for room on the disk" if state.needs_room and not state.ended else state.status
    line = f"{status} · {_where(state)} · {models} · {state.tests_done} tests, {running} running"
    if running and simulated is not None:
        line += f", {simulated:.1f} s simulated"
    return line[: shutil.get_terminal_size().columns - 1]


def _where(state: RunState) -> str:
    if state.confirming and not state.ended:
        now = in_the_making(state)
        return CONFIRMING if now is None else f"certificate: {made_of_usual(state, now)}"
    if state.settling and not state.ended:
        return SETTLING
    if state.isolating is not None and not state.ended:
        return isolating(state)
    return "baseline" if state.round is None else f"round {state.round.number}, n {state.round.n_partitions}"


def isolating(state: RunState) -> str:
    """How far an isolation is: what it tries, or which world fresh runs judge."""
    running, now = state.running_tests, state.isolating
    last = next((test.removal for test in running if test.removal is not None), None)
    if last is None or now is None:
        return ISOLATING
    gone = count(len(state.removals[last - 1].models), "model")
    made = sum(test.run >= now.first_run and test.is_finished for test in state.tests if test.phase == ISOLATE)
    return f"{ISOLATING}: without {gone}{f', {made} fresh runs' if made else ''}"


def news(kind: str, before: RunState, after: RunState, attached: bool = False) -> str:
    """What one event changed, or "" if it is not worth a line; with a hint how to attach unless the reader is `attached`."""
    line = _news(kind, before, after)
    return line if attached or not line else f"{line}{HINTS.get(kind, '')}"


def _news(kind: str, before: RunState, after: RunState) -> str:
    match kind:
        case "baseline_finished":
            return baseline(after)
        case "round_started" if (round := after.round) is not None:
            return (
                f"round {round.number}: {count(len(round.environment), 'model')} in "
                f"{count(len(round.partitions), 'partition')}, {count(len(round.candidates), 'candidate')}"
            )
        case "candidate_judged" if after.round is not None and before.round is not None:
            changed = after.round.candidates.changed_since(before.round.candidates)
            return "".join(_judged(after, one) for one in changed)
        case "waiting" if after.round is not None and after.waiting_candidate is not None:
            waiting = after.round.candidates[after.waiting_candidate]
            return f"  {waiting.label} shows f and waits for accept or reject"
        case "reduced":
            return f"  reduced to {count(len(after.environment), 'model')} after {after.tests_done} tests"
        case "sliced" | "slices_refuted":
            return _slices(kind, after)
        case "certificate_started" | "certificate_finished" | "rate_lost" | "left_out":
            return _certificate(kind, after)
        case "engine_started" | "comparing" | "compared" | "cluster":
            return _engine(kind, before, after)
        case "finished" | "engine_stopped" | "engine_failed":
            known = smaller_known(after)
            return f"{after.status}: {after.reason}{f'; {known}' if known else ''}"
    return _night(kind, before, after) or _isolation(kind, before, after) or _news_by_hand(kind, before, after)


def _slices(kind: str, after: RunState) -> str:
    """What went without a test, or why nothing goes so any more."""
    if kind == "slices_refuted":
        return refuted_words(after)
    models = count(len(after.environment), "model")
    return f"  reduced to {models} without a test: {slice_words(after, after.nodes[after.node])}"


def _engine(kind: str, before: RunState, after: RunState) -> str:
    """What an engine does before it goes on."""
    match kind:
        case "engine_started":
            resumed = " again" if before.tests else ""
            # A cluster says later how many there are.
            workers = f" with {count(after.jobs, 'worker')}" if after.jobs else ""
            return f"engine started{resumed}{workers}; {count(len(after.elements), 'model')} can be removed"
        case "cluster":
            return after.cluster
        case "comparing" if after.physics.now == after.physics.proven:
            return "a failing run is made again with its seed, to see whether it repeats"
        case "comparing":
            return (
                f"made with {after.physics.before}, now {after.physics.after}: the first run is made again and compared"
            )
        case "compared":
            same = after.physics.mixed == before.physics.mixed
            return f"  {'the same bits' if same else 'other bits: from here on the tests are mixed'}"
    return ""


def _night(kind: str, before: RunState, after: RunState) -> str:
    """What came to an engine from outside."""
    if kind == "clock_jumped":
        return "  the machine slept, or its clock was set: that time does not count"
    if kind == "disk_space" and after.needs_room:
        return f"  no room on the disk: waits until {after.needs_room / 1e6:.0f} MB are free"
    return "  there is room on the disk again" if kind == "disk_space" and before.needs_room else ""


def _certificate(kind: str, after: RunState) -> str:
    """What a certificate does, and what follows from it."""
    last, models = after.certificates[-1], count(len(after.environment), "model")
    match kind:
        case "certificate_started":
            what = f"fresh runs of what is left ({models}), without each model, and of the whole world"
            if last.seeds:
                what = f"the chosen seeds show what is left ({models}); fresh runs show how often f shows with others"
            return f"certificate {last.number}: {what}; about {usual_runs(after, last)}"
        case "certificate_finished":
            return f"  certificate {last.number}: {verdict_on(last, never_left_out(after, last))}"
        case "rate_lost":
            return f"  back to {models}, the last environment not shown to have lost the rate"
    return (
        f"  reduced to {models} after {after.tests_done} tests: {after.nodes[after.node].what} f shows about as often"
    )


def _isolation(kind: str, before: RunState, after: RunState) -> str:
    """What isolation does, and what it finds."""
    match kind:
        case "isolation_started":
            return (
                f"{ISOLATING}: as few models as can be removed from the whole world so that the robot reaches its goal"
            )
        case "removal_judged":
            return "".join(_removal(after, each) for each in after.removals.changed_since(before.removals))
        case "isolation_checked":
            first = after.isolations[-1].checks[-1].claims[0]
            return f"  fresh runs: the robot reaches its goal in {first.reached} of {first.runs}: {first.verdict}"
        case "isolation_given_up":
            return "the search for the nearest world that passes is given up; the reduction is as it was"
        case "isolation_finished":
            return of_passing(after, after.isolations[-1])
    return ""


def _removal(state: RunState, one: Removal) -> str:
    what = f"the whole world without {count(len(one.models), 'model')} ({first_of(one.models, MOST_NAMES)})"
    return f"  {what}: {_verdict(state, one)}"


def _news_by_hand(kind: str, before: RunState, after: RunState) -> str:
    if kind == "trial_judged":
        changed = (one for one, was in zip(after.trials, before.trials, strict=True) if one != was)
        return "".join(_judged(after, one) for one in changed)
    if kind == "supports":
        return _supports(after)
    if kind == "noted":
        return after.notes[-1][1]
    if kind == "command_refused":
        return f"not done: {after.refusal[1]}"
    # All other decisions of the user carry their own words.
    if len(after.decisions) > len(before.decisions):
        return after.decisions[-1].words
    return SAID.get(kind, "")


def _supports(state: RunState) -> str:
    if state.unsettled:
        return f"it is not known which models rest on which: {state.unsettled}"
    resting = len({upper for upper, _ in state.supports})
    return f"{count(resting, 'model')} of the world {'rests' if resting == 1 else 'rest'} on others" if resting else ""


def _judged(state: RunState, one: Candidate | Trial) -> str:
    return f"  {one.label} ({count(one.size, 'model')}): {_verdict(state, one)}"


def _verdict(state: RunState, one: Candidate | Trial | Removal) -> str:
    """A verdict, and how its tests ended: "dissimilar after 4 tests (2 pass, 1 stuck, 1 tipped over), implied by test 3"."""
    tests, implied = [test for test in state.tests_of(one.tests) if test.is_finished], implied_words(state, one.tests)
    endings = Counter(test.failure if test.failure in DEEDS else test.outcome for test in tests)
    ways = f" ({', '.join(f'{number} {ending}' for ending, number in endings.items())})" if endings else ""
    return f"{one.verdict} after {count(len(one.tests), 'test')}{ways}{f', {implied}' if implied else ''}"


def happened(moment: Moment) -> str:
    """What happened in a moment, with its time of day."""
    at = time.strftime("%H:%M:%S", time.localtime(moment.recorded.time))
    return f"{at}, after {count(moment.after.tests_done, 'test')}: {what_happened(moment)}."


def what_happened(moment: Moment) -> str:
    """The same in a few words, without the time."""
    kind, event, state = moment.recorded.kind, moment.recorded.event, moment.after
    if isinstance(event, TestStarted | TestFinished | TestLost | Implied):
        return _of_test(state, state.tests[event.test - 1])
    if kind == "created":
        return "the run was made"
    if kind == "finished":
        # With what result is explained beside it.
        return "the run ended"
    return plain(news(kind, moment.before, state, attached=True)).rstrip(".") or kind.replace("_", " ")


def _of_test(state: RunState, test: Test) -> str:
    what = f"test {test.id} ({purpose(state, test)}, seed {test.seed})"
    if test.implied_by is not None:
        return f"{what} follows from test {test.implied_by}: {outcome(test)}"
    return f"{what} starts" if test.outcome == "running" else f"{what}: {outcome(test) or test.outcome}"
