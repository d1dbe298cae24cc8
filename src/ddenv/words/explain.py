"""What is happening, in words: the current line of the algorithm, and what the run does there and
why.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ddenv.evidence.claims import (
    FreshRuns,
    current,
    failing_instead,
    fresh_runs,
    fresh_runs_made,
    has_dropped,
    only_helping,
)
from ddenv.runfile.failure_words import DEEDS, deed
from ddenv.runfile.fold_tests import seen
from ddenv.runfile.progress import Certificate
from ddenv.runfile.run_settings import Settings, settings
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import Candidate, Round, RunState, Test
from ddenv.runfile.tested import adoptable
from ddenv.text import (
    Sentences,
    as_sentence,
    count,
    first_of,
    percent,
    percent_at_least,
    plain,
    shortened,
)
from ddenv.words.baseline import baseline
from ddenv.words.claims import (
    drift,
    ended,
    environment_named,
    instead,
    of_passing,
    of_runs,
    promise,
    terms,
    usual_runs,
)
from ddenv.words.margins import finding
from ddenv.words.methods import DDENV, Lines, Step, beginning, follows, fruitless, listing
from ddenv.words.news import isolating
from ddenv.words.signs import bar, metres
from ddenv.words.slices import TEACHING, refuted_words, slice_words

# Maximum number of kept models that a sentence names.
NAMED = 8
# Maximum number of models whose runs without them a sentence each describes.
NAMED_ENDS = 2
# An end within so many epsilon of f's end may be the same failure to the user.
NEAR = 3
# The maximum number of pinned models that a sentence names, and the maximum width of each name in
# cells.
PINNED = 2
LONGEST = 32
# Decisions that change the environment or the search.
_CHANGES = ("go_back", "undo", "pin", "unpin", "change", "adopt", "leave_out", "accept_other")
_SETTLING = (
    "Finding models that support others: the piles fall and settle once, without the robot. "
    "This shows which models a removal would drop.",
)


Happening = tuple[Step | None, Sentences]


@dataclass(frozen=True, slots=True)
class Explanation:
    """`line` is the number of the current one of the algorithm's `lines`, None if the run is at
    none of them.
    """

    line: int | None
    sentences: Sentences
    lines: Lines = DDENV.lines


def explain(snapshot: Snapshot) -> Explanation:
    """What happens now, and why."""
    state = snapshot.state
    options = settings(state)
    shown = listing(options.algorithm, options.growth)
    step, sentences = _happening(snapshot)
    if snapshot.past:
        sentences = (snapshot.happened, *sentences)
    elif not snapshot.error:
        sentences = (
            *_warnings(snapshot),
            *sentences,
            *_implied(state),
            *_offered(state),
            *_by_hand(state),
        )
    line = None if step is None else shown.line(step, state.round)
    return Explanation(line, sentences, shown.lines)


def _warnings(snapshot: Snapshot) -> Sentences:
    """What the user has to know before anything else, and a try that could become the
    environment.
    """
    state = snapshot.state
    said = []
    if snapshot.older_engine and snapshot.engine == "alive":
        version = plain(snapshot.older_engine)
        said.append(
            f"Another version of ddenv works on this run ({version}): it may not know all "
            "commands of this version."
        )
    if words := refuted_words(state):
        said.append(as_sentence(words))
    here = state.here
    rates = drift(state)
    if has_dropped(state) and rates and here is not None and here.parent is not None:
        before = count(len(state.nodes[here.parent].environment), "model")
        said.append(f"f is rarer than it was: {rates[0]}. u goes back to {before}.")
    if (last := adoptable(state)) is not None:
        said.append(f"{last.label} shows f with {count(last.size, 'model')}: a adopts it.")
    return tuple(said)


def _implied(state: RunState) -> Sentences:
    last = next((test for test in reversed(state.tests) if test.is_finished), None)
    if last is None or last.implied_by is None or state.ended:
        return ()
    return (
        (
            f"Test {last.id} is implied by test {last.implied_by}: no model it lacks affected that "
            "run."
        ),
    )


def _offered(state: RunState) -> Sentences:
    """Another way for an f that is rare, never differs, or whose ends scatter, until something is
    left out.
    """
    notes = dict(state.notes)
    offers = [notes[about] for about in ("scatter", "rare", "alike") if about in notes]
    if state.node or state.ended:
        return ()
    return tuple(f"{as_sentence(plain(offer))} Press c to change it." for offer in offers)


def _by_hand(state: RunState) -> Sentences:
    said = []
    for trial in (one for one in state.trials if not one.verdict):
        what = f"{trial.label} ({count(trial.size, 'model')})"
        running = [test.outcome == "running" for test in state.tests_of(trial.tests)]
        if any(running):
            number = running.index(True)
            again = f"re-run {number} of {settings(state).most_runs - 1}" if number else "first run"
            said.append(f"{what} is being tested: {again}.")
        else:
            said.append(f"{what} is tested next, before the round goes on.")
    pinned = [shortened(name, LONGEST) for name in state.environment if name in state.pinned]
    # What has just been pinned is said by how the search began.
    if pinned and not state.ended and not (_arrival(state) and state.decisions[-1].kind == "pin"):
        said.append(f"Pinned, and so in every candidate: {first_of(pinned, PINNED)}.")
    return tuple(said)


def _arrival(state: RunState) -> str:
    """How the user's last decision led to this environment; "" if there is none, or a test was made
    since.
    """
    last = state.decisions[-1] if state.decisions else None
    if (
        state.here is None
        or last is None
        or last.tests != state.tests_done
        or last.kind not in _CHANGES
    ):
        return ""
    return as_sentence(plain(last.words))


def _happening(snapshot: Snapshot) -> Happening:
    state = snapshot.state
    options = settings(snapshot.state)
    if snapshot.gone:
        return None, (
            f"{plain(snapshot.error)}.",
            "You can no longer guide this run: y copies names, R lists the runs, q leaves.",
        )
    if snapshot.error:
        return None, (snapshot.error,)
    if snapshot.status == "finished":
        return _finished(state)
    if standing := _standing(state, snapshot.status):
        return None, standing
    if state.settling:
        return _with_pause(state, ("baseline", _SETTLING))
    if state.baseline is None:
        return _with_pause(state, ("baseline", _baseline_so_far(state, options)))
    if state.confirming or state.isolating is not None or state.margining is not None:
        return _with_pause(state, ("returned", _certifying(snapshot)))
    if state.round is None or state.round.done:
        return _with_pause(state, ("split", _between(snapshot, options)))
    if state.waiting_candidate is not None:
        candidate = state.round.candidates[state.waiting_candidate]
        before = len(state.environment)
        after = count(candidate.size, "model")
        return "waiting", (
            f"{candidate.label} shows f: {_ended(state, candidate, options)}",
            (
                f"The reduction waits for you: a accepts it ({before} → {after}), x rejects it and "
                "goes on."
            ),
        )
    return _with_pause(state, _testing(snapshot, state.round, options))


def _with_pause(state: RunState, happening: Happening) -> Happening:
    step, sentences = happening
    if state.needs_room and not state.ended:
        free = f"{state.needs_room / 1e6:.0f} MB"
        full = f"The disk is full: no new test starts until {free} are free."
        if state.file_is_full:
            full = (
                "The run file is as large as a file may be (ulimit -f): no new test starts until "
                "that limit is raised."
            )
        return step, (f"{full} Nothing is lost.", *sentences)
    if not state.paused:
        return happening
    rest = "running tests finish first" if state.tally["running"] else "none is running"
    first = f"Paused: no new test starts; {rest}. space resumes, s runs one test."
    return step, (first, *sentences)


def _standing(state: RunState, status: str) -> Sentences:
    reason = plain(state.reason).rstrip(".")
    match status:
        case "starting":
            return (
                "The engine starts. It is a separate process: it goes on when this screen closes.",
            )
        case "created":
            return ("No engine has worked on this run yet. r starts one.",)
        case "failed":
            return (
                f"The engine could not go on: {reason}.",
                "Everything so far is kept; r tries again.",
            )
        case "stopped":
            if reason.startswith("stopped"):
                said = reason
            elif reason:
                said = f"stopped: {reason}"
            else:
                said = "stopped"
            then = _out_of_budget(state) or ("Everything so far is kept; r resumes.",)
            return (f"The engine was {said}.", *then)
        case "lost":
            unfinished = state.tally["running"]
            if unfinished:
                lost = f" Only {count(unfinished, 'unfinished test')} must run again."
            else:
                lost = ""
            return (
                (
                    "The engine is not running: it was killed, or its machine went down. r "
                    f"resumes.{lost}"
                ),
            )
    return ()


def _out_of_budget(state: RunState) -> Sentences:
    budget = state.budget
    if budget is None or state.made < budget:
        return ()
    return (f"The budget of {count(budget, 'test')} is used up: c raises it, and the run goes on.",)


def _baseline_so_far(state: RunState, options: Settings) -> Sentences:
    tests = state.finished_tests
    times = count(options.baseline_runs, "time")
    if options.reduces_one_run:
        times = f"twice, or {times} if these two runs differ"
    first = (
        f"The robot runs in the whole world {times}, each with its own seed. f is the failure "
        "that most runs end in: only worlds that show it are kept."
    )
    if any(test.run >= options.baseline_runs for test in state.tests):
        first = (
            "Few runs of the whole world show f, or they show several failures, so more runs are "
            "made."
        )
    # The last one first: that the world is slow.
    said = [*(as_sentence(plain(words)) for _, words in reversed(state.notes)), first]
    if tests:
        reached, failed = (
            sum(test.outcome == outcome for test in tests) for outcome in ("pass", "failed")
        )
        said.append(
            f"Of {count(len(tests), 'run')} so far {failed} failed and {reached} reached the goal."
        )
    return tuple(said)


def _between(snapshot: Snapshot, options: Settings) -> Sentences:
    state = snapshot.state
    here = snapshot.state.here
    number = 1 if state.round is None else state.round.number + 1
    first = f"Round {number}: {beginning(options, len(state.environment))}"
    # How the environment was cut down to its slice, until the next test is made.
    if here is not None and here.how == "sliced" and here.tests == state.tests_done:
        # An earlier moment says itself what the slice left out, and nothing can be taken back
        # there.
        free = () if snapshot.past else (f"{plain(slice_words(state, here))}. u takes it back.",)
        return (TEACHING, *free, first)
    if arrived := _arrival(state):
        return (arrived, first)
    then = baseline(state) if state.round is None else follows(options, state.round)
    if then:
        return (first, then)
    return (first,)


def _ended(state: RunState, candidate: Candidate, options: Settings) -> str:
    test = _last(state, candidate, "similar")
    if test is None or not metres(test.distance, 2):
        return "the robot failed as in f."
    did = deed(test.failure) if test.failure in DEEDS else "ended"
    return (
        f"the robot {did} {metres(test.distance, 2)} from f's end (up to {options.epsilon:g} m "
        "is similar)."
    )


def _testing(snapshot: Snapshot, current: Round, options: Settings) -> Happening:
    state = snapshot.state
    if current.winner is not None:
        won = current.candidates[current.winner]
        gone = len(won.split.environment) - won.size
        return "reduced", (
            f"{won.label} shows f: {_ended(state, won, options)}",
            f"E is now {won.label}: {gone + won.size} → {count(won.size, 'model')}; "
            f"f shows without the other{'s' if gone > 1 else ' one'}.",
        )
    candidate = snapshot.focus
    if candidate is None or candidate.verdict:
        candidate = next((each for each in current.candidates if not each.verdict), None)
    if shown := next((each for each in current.candidates if each.verdict == "similar"), None):
        words = f"{shown.label} shows f: {_ended(state, shown, options)}"
        return "waiting", (words, "The first candidate that shows f becomes E, and the round ends.")
    if candidate is None:
        first = f"No candidate of round {current.number} showed f."
        return "nothing", (first, fruitless(options, current, len(state.environment)))
    running = [
        test
        for test in snapshot.running
        if test.round == current.number and test.candidate == candidate.index
    ]
    ahead = len(
        {test.candidate for test in snapshot.running if test.round == current.number}
        - {candidate.index}
    )
    place = f"candidate {candidate.index + 1} of {len(current.candidates)}"
    place = f"{candidate.label} ({count(candidate.size, 'model')}), {place}"
    if not running:
        return "next", (*_last_reduction(state), _next(state, candidate, place, options))
    # Speculation may run several tests of one candidate at once; the earliest is the one the
    # algorithm is at.
    test = running[0]
    # Its run number differs where chosen runs are repeated.
    number = candidate.tests.index(test.id) if test.id in candidate.tests else test.run
    sentences = _of_run(state, candidate, number, place, options)
    if beside := len(running) - 1:
        sentences += (f"Idle workers make {count(beside, 're-run')} of it at the same time.",)
    if ahead:
        sentences += (f"Idle workers test {count(ahead, 'later candidate')} at the same time.",)
    return "rerun" if number else "test", sentences


def _last_reduction(state: RunState) -> Sentences:
    """The last reduction, until the next test is made: a step shows its result."""
    here = state.here
    if (
        here is None
        or here.how != "reduced"
        or here.parent is None
        or here.tests != state.tests_done
    ):
        return ()
    before = len(state.nodes[here.parent].environment)
    return (f"{here.what} showed f: {before} → {count(len(here.environment), 'model')}.",)


def _next(state: RunState, candidate: Candidate, place: str, options: Settings) -> str:
    if shown := _shown_of(state, candidate):
        if options.accept_rate != "kept" and _last(state, candidate) == _last(
            state, candidate, "similar"
        ):
            return f"{place}: {shown}, and once is enough."
        return f"Next is one more run of {place}: {shown}."
    if not candidate.tests:
        return f"Next is {place}."
    if len(candidate.tests) >= options.most_runs:
        return f"f did not show in {count(len(candidate.tests), 'test')} of {place}."
    again = _why_again(_last(state, candidate))
    return f"Next is re-run {len(candidate.tests)} of {options.most_runs - 1} of {place}: {again}"


def _of_run(
    state: RunState, candidate: Candidate, number: int, place: str, options: Settings
) -> Sentences:
    """What a run of a candidate is for, its `number` counted from 0."""
    if not number:
        return (
            f"First run of {place}.",
            f"It shows f if the goal is not reached in {options.timeout:g} s and the robot ends "
            "within "
            f"{options.epsilon:g} m of f's end.",
        )
    if shown := _shown_of(state, candidate):
        return (
            f"Run {number + 1} of {place}: {shown}.",
            (
                "It is accepted once its runs show that it keeps the rate of f, and dropped once "
                "that is unlikely."
            ),
        )
    return (
        (
            f"Re-run {number} of {options.most_runs - 1} of {place}: "
            f"{_why_again(_last(state, candidate))}"
        ),
        (
            "A failure can be flaky: a candidate is dissimilar after at most "
            f"{count(options.most_runs, 'test')} without f."
        ),
    )


def _shown_of(state: RunState, candidate: Candidate) -> str:
    """How often f showed in a candidate that has no verdict yet although f showed in it; "" if it
    did not.
    """
    _, shown = seen(state.tests, candidate.tests)
    done = sum(test.is_finished for test in state.tests_of(candidate.tests))
    if shown:
        return f"f showed in {of_runs(shown, done)} so far"
    return ""


def _why_again(before: Test | None) -> str:
    if before is None:
        return "another seed is tried at the same time."
    away = metres(before.distance)
    if away:
        how = f"{'' if before.failure in DEEDS else ' elsewhere,'} {away} from f's end"
    else:
        how = ", but not as in f"
    reasons = {
        "pass": "the goal was reached.",
        "other": f"the robot {deed(before.failure)}{how}.",
        "error": "the simulation broke.",
        "timeout": "the test took too long on the clock.",
    }
    return f"last time {reasons.get(before.outcome, 'f was not seen.')}"


def _finished(state: RunState) -> Happening:
    kept = count(len(state.environment), "model")
    if state.baseline is None:
        return None, (_reason(state, "The run ended in the baseline."),)
    base = baseline(state)
    if not state.certified:
        left = f"{kept} left: {first_of([plain(name) for name in state.environment], NAMED)}."
        helps = () if (found := current(state)) is None else only_helping(found)
        out: tuple[str, ...] = ()
        if helps:
            out = (f"{plain(helps[0])} only helps: press H to leave it out and search again.",)
        return "returned", (
            _reason(state, "The run ended early."),
            *out,
            *_out_of_budget(state),
            left,
        )
    if not state.environment:
        none = (
            "f shows without any removable model: look at the robot, its goal and the models "
            "that always stay."
        )
        return "returned", ("Minimal: no model left.", _reason(state, ""), none, base)
    stays = ("p unpins.",) if state.pinned.intersection(state.environment) else ()
    certificate = current(state)
    means = () if certificate is None else (as_sentence(promise(state, certificate)),)
    passing: tuple[str, ...] = ()
    if state.isolated is not None:
        passing = (f"{as_sentence(plain(of_passing(state, state.isolated)))} W shows it.",)
    return "returned", (
        *passing,
        f"Minimal: {kept} left. {_reason(state, '')}",
        *_instead_of_f(state),
        f"Kept: {first_of([plain(name) for name in state.environment], NAMED)}.",
        *means,
        *stays,
        base,
    )


def _instead_of_f(state: RunState) -> Sentences:
    """What the robot does without models that f needs, where it mostly fails in another way; and
    what can be done about it.
    """
    if (certificate := current(state)) is None:
        return ()
    ends = {
        claim: end
        for claim in certificate.claims
        if (end := failing_instead(state, certificate, claim))
    }
    said = [
        f"Without {plain(str(claim.without))} {instead(state, certificate, claim)}."
        for claim in ends
    ][:NAMED_ENDS]
    epsilon = settings(state).epsilon
    # Where no distance is known, it is not near.
    farthest = min(
        (end.farthest for end in ends.values() if end.farthest <= NEAR * epsilon), default=None
    )
    if farthest is not None:
        wider = math.floor(farthest * 10 + 1) / 10
        said.append(
            f"To count that as f, too, start again with epsilon {wider:g} m (now {epsilon:g} m)."
        )
    if ends:
        passing = "" if state.isolated is not None else ", i finds a nearest world that passes"
        said.append(f"f lists all other failures and reduces one in a branch{passing}.")
    return tuple(said)


def _reason(state: RunState, otherwise: str) -> str:
    return as_sentence(plain(ended(state)) or otherwise)


def _last(state: RunState, candidate: Candidate, outcome: str | None = None) -> Test | None:
    tests = reversed(state.tests_of(candidate.tests))
    return next(
        (
            test
            for test in tests
            if test.outcome == outcome or (outcome is None and test.is_finished)
        ),
        None,
    )


# While fresh runs show what the result of the rounds is worth, or find the nearest world that
# passes.


def _certifying(snapshot: Snapshot) -> Sentences:
    state = snapshot.state
    if state.isolating is not None:
        return (
            (
                "Isolation: removing as few models as possible from the whole world so that the "
                "robot reaches its goal."
            ),
            f"Now {plain(isolating(state))}. The result of the reduction does not change.",
        )
    if state.margining is not None:
        return (
            (
                "Margins: each number is changed in turn, to see how far it can go before f "
                "disappears."
            ),
            f"Now {plain(finding(state))}. The result of the reduction does not change.",
        )
    certificate = state.certificate
    if certificate is None:
        return ("The rounds are over.",)
    if certificate.claims:
        over = "The certificate is finished."
        if certificate.claims[0].verdict == "lost":
            over = (
                "What is left keeps too little of the rate. Earlier ones are run to find the "
                "last one not shown to have lost it."
            )
        return (over, *_now(snapshot, certificate))
    made = fresh_runs_made(state, certificate)
    done = f"{made} {'is' if made == 1 else 'are'} done"
    rows = fresh_runs(state)
    aim = certificate.certify_rate
    shown = (rows[0].claim.bound or 0.0) if rows else 0.0
    kept = f"at least {percent_at_least(shown)} is kept" if shown else "nothing is shown yet"
    return (
        *(() if certificate.seeds else (f"{bar(shown, aim)} {kept}, aim {percent(aim)}",)),
        (
            "Full runs with fresh seeds check the result: "
            f"{terms(certificate, len(state.pinned.intersection(state.environment)))}."
        ),
        f"By the rates seen so far, this takes about {usual_runs(state, certificate)}; {done}.",
        *_so_far(rows),
        *_now(snapshot, certificate),
    )


def _so_far(rows: Sequence[FreshRuns]) -> Sentences:
    if not rows or not rows[0].claim.runs:
        return ()
    left = rows[0].claim
    last = rows[-1]
    beside = ""
    if last.without is None and last.has_rate and len(rows) > 1:
        whole = of_runs(last.claim.shown, last.claim.runs)
        beside = f", and in {whole} of {environment_named(last.node)}"
    return (f"So far f shows in {of_runs(left.shown, left.runs)} of what is left{beside}.",)


def _now(snapshot: Snapshot, certificate: Certificate) -> Sentences:
    # A test of the certificate before may still run.
    running = [
        test
        for test in snapshot.running
        if test.phase == "certify" and test.run >= certificate.first_run
    ]
    if not running:
        return ()
    test = running[0]
    if test.node == certificate.node:
        what = "everything that is left"
    else:
        what = environment_named(test.node)
    if test.without is not None:
        what = f"everything that is left except {plain(test.without)}"
    return (f"Now: run {test.run - certificate.first_run + 1} of {what}.",)
