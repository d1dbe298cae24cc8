"""What is happening, in words: the current line of the algorithm, and what the run does there and why."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ddenv.evidence.claims import current, failing_instead, helping
from ddenv.runfile.deeds import DEEDS, deed
from ddenv.runfile.fold_tests import seen
from ddenv.runfile.run_settings import Settings, settings
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import Candidate, Round, RunState, Test
from ddenv.text import as_sentence, count, first_of, plain
from ddenv.words.baseline import baseline
from ddenv.words.certifying import certifying
from ddenv.words.claims import ended, instead, of_passing, of_runs, promise
from ddenv.words.decisions import arrival, by_hand, last_reduction, older_engine, out_of_budget, rarer, to_adopt
from ddenv.words.methods import DDENV, Lines, Step, beginning, follows, fruitless, listing
from ddenv.words.signs import metres
from ddenv.words.slices import TEACHING, refuted_words, slice_words

# Maximum number of kept models that a sentence names.
NAMED = 8
# Maximum number of models whose runs without them a sentence each describes.
NAMED_ENDS = 2
# An end within so many epsilon of f's end may be the same failure to the user.
NEAR = 3
_SETTLING = (
    "Finding models that support others: the piles fall and settle once, without the robot. "
    "This shows which models a removal would drop.",
)


Happening = tuple[Step | None, tuple[str, ...]]


@dataclass(frozen=True, slots=True)
class Explanation:
    """`line` is the number of the current one of the algorithm's `lines`, None if the run is at none of them."""

    line: int | None
    sentences: tuple[str, ...]
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
        first = (*older_engine(snapshot), *refuted(state), *rarer(state), *to_adopt(state))
        sentences = (*first, *sentences, *implied(state), *_offered(state), *by_hand(state))
    line = None if step is None else shown.line(step, state.round)
    return Explanation(line, sentences, shown.lines)


def _offered(state: RunState) -> tuple[str, ...]:
    """What a rare f costs, and would cost in another way, until something is left out."""
    rare = dict(state.notes).get("rare", "")
    return (f"{as_sentence(plain(rare))} Press c to change it.",) if rare and not state.node and not state.ended else ()


def _happening(snapshot: Snapshot) -> Happening:
    """The step the run is at, and the sentences on it."""
    state, options = snapshot.state, settings(snapshot.state)
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
        return _with_pause(state, ("returned", certifying(snapshot)))
    if state.round is None or state.round.done:
        return _with_pause(state, ("split", _between(snapshot, options)))
    if state.waiting_candidate is not None:
        return "waiting", _waiting(state, state.round.candidates[state.waiting_candidate], options)
    return _with_pause(state, _testing(snapshot, state.round, options))


def _with_pause(state: RunState, happening: Happening) -> Happening:
    step, sentences = happening
    if state.needs_room and not state.ended:
        free = f"{state.needs_room / 1e6:.0f} MB"
        return step, (f"The disk is full: no new test starts until {free} are free. Nothing is lost.", *sentences)
    if not state.paused:
        return happening
    rest = "running tests finish first" if state.tally["running"] else "none is running"
    first = f"Paused: no new test starts; {rest}. space resumes, s runs one test."
    return step, (first, *sentences)


def _standing(state: RunState, status: str) -> tuple[str, ...]:
    """Why the run stands still, and what goes on from there; none if it does not."""
    reason = plain(state.reason).rstrip(".")
    match status:
        case "starting":
            return ("The engine starts. It is a separate process: it goes on when this screen closes.",)
        case "created":
            return ("No engine has worked on this run yet. r starts one.",)
        case "failed":
            return (f"The engine could not go on: {reason}.", "Everything so far is kept; r tries again.")
        case "stopped":
            said = reason if reason.startswith("stopped") else f"stopped: {reason}" if reason else "stopped"
            then = out_of_budget(state) or ("Everything so far is kept; r resumes.",)
            return (f"The engine was {said}.", *then)
        case "lost":
            unfinished = state.tally["running"]
            lost = f" Only {count(unfinished, 'unfinished test')} must run again." if unfinished else ""
            return (f"The engine is not running: it was killed, or its machine went down. r resumes.{lost}",)
    return ()


def _baseline_so_far(state: RunState, options: Settings) -> tuple[str, ...]:
    tests = state.finished_tests
    reached = sum(test.outcome == "pass" for test in tests)
    failed = sum(test.outcome == "failed" for test in tests)
    first = (
        f"The robot runs in the whole world {count(options.baseline_runs, 'time')}, each with its own seed. f is the "
        "failure that most runs end in: only worlds that show it are kept."
    )
    if any(test.run >= options.baseline_runs for test in state.tests):
        first = "Few runs of the whole world show f, or they show several failures, so more runs are made."
    # The last one first: that the world is slow.
    noted = tuple(as_sentence(plain(words)) for _, words in reversed(state.notes))
    if not tests:
        return (*noted, first)
    return (*noted, first, f"Of {count(len(tests), 'run')} so far {failed} failed and {reached} reached the goal.")


def _between(snapshot: Snapshot, options: Settings) -> tuple[str, ...]:
    state = snapshot.state
    number = 1 if state.round is None else state.round.number + 1
    first = f"Round {number}: {beginning(options, len(state.environment))}"
    if free := sliced(state):
        # An earlier moment says itself what the slice left out, and nothing can be taken back there.
        return (*(free[:1] if snapshot.past else free), first)
    arrived = arrival(state)
    if arrived:
        return (arrived, first)
    then = baseline(state) if state.round is None else follows(options, state.round)
    return (first, then) if then else (first,)


def _waiting(state: RunState, candidate: Candidate, options: Settings) -> tuple[str, ...]:
    before, after = len(state.environment), candidate.size
    return (
        f"{candidate.label} shows f: {_ended(state, candidate, options)}",
        f"The reduction waits for you: a accepts it ({before} → {count(after, 'model')}), x rejects it and goes on.",
    )


def _ended(state: RunState, candidate: Candidate, options: Settings) -> str:
    test = _last(state, candidate, "similar")
    if test is None or not metres(test.distance, 2):
        return "the robot failed as in f."
    did = deed(test.failure) if test.failure in DEEDS else "ended"
    return f"the robot {did} {metres(test.distance, 2)} from f's end (up to {options.epsilon:g} m is similar)."


def _testing(snapshot: Snapshot, current: Round, options: Settings) -> Happening:
    state = snapshot.state
    if current.winner is not None:
        return _reduced(state, current.candidates[current.winner], options)
    candidate = snapshot.focus
    if candidate is None or candidate.verdict:
        candidate = next((each for each in current.candidates if not each.verdict), None)
    if shown := next((each for each in current.candidates if each.verdict == "similar"), None):
        words = f"{shown.label} shows f: {_ended(state, shown, options)}"
        return "waiting", (words, "The first candidate that shows f becomes E, and the round ends.")
    if candidate is None:
        return "nothing", _nothing_found(state, current, options)
    running = [test for test in snapshot.running if test.round == current.number and test.candidate == candidate.index]
    ahead = len({test.candidate for test in snapshot.running if test.round == current.number} - {candidate.index})
    place = _place(candidate, current)
    if not running:
        return "next", (*last_reduction(state), _next(state, candidate, place, options))
    # Speculation may run several tests of one candidate at once; the earliest is the one the algorithm is at.
    test = running[0]
    first = not _number(candidate, test)
    sentences = _first_run(place, options) if first else _rerun(state, candidate, test, place, options)
    if beside := len(running) - 1:
        sentences = (*sentences, f"Idle workers make {count(beside, 're-run')} of it at the same time.")
    if ahead:
        sentences = (*sentences, f"Idle workers test {count(ahead, 'later candidate')} at the same time.")
    return "test" if first else "rerun", sentences


def _next(state: RunState, candidate: Candidate, place: str, options: Settings) -> str:
    if shown := _shown_of(state, candidate):
        if options.accept_rate != "kept" and _last(state, candidate) == _last(state, candidate, "similar"):
            return f"{place}: {shown}, and once is enough."
        return f"Next is one more run of {place}: {shown}."
    if not candidate.tests:
        return f"Next is {place}."
    if len(candidate.tests) >= options.most_runs:
        return f"f did not show in {count(len(candidate.tests), 'test')} of {place}."
    again = _why_again(_last(state, candidate))
    return f"Next is re-run {len(candidate.tests)} of {options.most_runs - 1} of {place}: {again}"


def _place(candidate: Candidate, current: Round) -> str:
    """A candidate, and its place among the others."""
    place = f"candidate {candidate.index + 1} of {len(current.candidates)}"
    return f"{candidate.label} ({count(candidate.size, 'model')}), {place}"


def _first_run(place: str, options: Settings) -> tuple[str, ...]:
    return (
        f"First run of {place}.",
        f"It shows f if the goal is not reached in {options.timeout:g} s and the robot ends within {options.epsilon:g} m of "
        "f's end.",
    )


def _rerun(state: RunState, candidate: Candidate, test: Test, place: str, options: Settings) -> tuple[str, ...]:
    if shown := _shown_of(state, candidate):
        return (
            f"Run {_number(candidate, test) + 1} of {place}: {shown}.",
            "It is accepted once its runs show that it keeps the rate of f, and dropped once that is unlikely.",
        )
    before = _last(state, candidate)
    return (
        f"Re-run {_number(candidate, test)} of {options.most_runs - 1} of {place}: {_why_again(before)}",
        f"A failure can be flaky: a candidate is dissimilar after at most {count(options.most_runs, 'test')} without f.",
    )


def _number(candidate: Candidate, test: Test) -> int:
    """The place of a test among those of its candidate, from 0. Its run number differs where chosen runs are repeated."""
    return candidate.tests.index(test.id) if test.id in candidate.tests else test.run


def _shown_of(state: RunState, candidate: Candidate) -> str:
    """How often f showed in a candidate that has no verdict yet although f showed in it; "" if it did not."""
    _, shown = seen(state.tests, candidate.tests)
    done = sum(test.is_finished for test in state.tests_of(candidate.tests))
    return f"f showed in {of_runs(shown, done)} so far" if shown else ""


def _why_again(before: Test | None) -> str:
    if before is None:
        return "another seed is tried at the same time."
    reasons = {
        "pass": "the goal was reached.",
        "other": _otherwise(before),
        "error": "the simulation broke.",
        "timeout": "the test took too long on the clock.",
    }
    return f"last time {reasons.get(before.outcome, 'f was not seen.')}"


def _otherwise(test: Test) -> str:
    away = metres(test.distance)
    if not away:
        return f"the robot {deed(test.failure)}, but not as in f."
    return f"the robot {deed(test.failure)}{'' if test.failure in DEEDS else ' elsewhere,'} {away} from f's end."


def _reduced(state: RunState, candidate: Candidate, options: Settings) -> Happening:
    before, after = len(candidate.split.environment), candidate.size
    gone = "f shows without the others" if before - after > 1 else "f shows without the other one"
    return "reduced", (
        f"{candidate.label} shows f: {_ended(state, candidate, options)}",
        f"E is now {candidate.label}: {before} → {count(after, 'model')}; {gone}.",
    )


def _nothing_found(state: RunState, current: Round, options: Settings) -> tuple[str, ...]:
    first = f"No candidate of round {current.number} showed f."
    return (first, fruitless(options, current, len(state.environment)))


def _finished(state: RunState) -> Happening:
    kept = count(len(state.environment), "model")
    if state.baseline is None:
        return None, (_reason(state, "The run ended in the baseline."),)
    base = baseline(state)
    if not state.certified:
        left = f"{kept} left: {first_of([plain(name) for name in state.environment], NAMED)}."
        helps = () if (found := current(state)) is None else helping(found)
        out = (f"{plain(helps[0])} only helps: press H to leave it out and search again.",) if helps else ()
        return "returned", (_reason(state, "The run ended early."), *out, *out_of_budget(state), left)
    if not state.environment:
        none = "f shows without any removable model: look at the robot, its goal and the models that always stay."
        return "returned", ("Minimal: no model left.", _reason(state, ""), none, base)
    stays = ("p unpins.",) if state.pinned.intersection(state.environment) else ()
    certificate = current(state)
    means = () if certificate is None else (as_sentence(promise(state, certificate)),)
    passing = (
        () if state.isolated is None else (f"{as_sentence(plain(of_passing(state, state.isolated)))} W shows it.",)
    )
    return "returned", (
        *passing,
        f"Minimal: {kept} left. {_reason(state, '')}",
        *_instead_of_f(state),
        f"Kept: {first_of([plain(name) for name in state.environment], NAMED)}.",
        *means,
        *stays,
        base,
    )


def _instead_of_f(state: RunState) -> tuple[str, ...]:
    """What the robot does without models that f needs, where it mostly fails in another way; and what can be done about it."""
    if (certificate := current(state)) is None:
        return ()
    ends = {claim: end for claim in certificate.claims if (end := failing_instead(state, certificate, claim))}
    said = [f"Without {plain(str(claim.without))} {instead(state, certificate, claim)}." for claim in ends][:NAMED_ENDS]
    epsilon = settings(state).epsilon
    # Where no distance is known, it is not near.
    farthest = min((end.farthest for end in ends.values() if end.farthest <= NEAR * epsilon), default=None)
    if farthest is not None:
        wider = math.floor(farthest * 10 + 1) / 10
        said.append(f"To count that as f, too, start again with epsilon {wider:g} m (now {epsilon:g} m).")
    if ends:
        passing = "" if state.isolated is not None else ", i finds a nearest world that passes"
        said.append(f"f lists all other failures and reduces one in a branch{passing}.")
    return tuple(said)


def _reason(state: RunState, otherwise: str) -> str:
    return as_sentence(plain(ended(state)) or otherwise)


def _last(state: RunState, candidate: Candidate, outcome: str | None = None) -> Test | None:
    tests = reversed(state.tests_of(candidate.tests))
    return next((test for test in tests if test.outcome == outcome or (outcome is None and test.is_finished)), None)


def sliced(state: RunState) -> tuple[str, ...]:
    """How the environment was cut down to its slice, until the next test is made."""
    here = state.here
    if here is None or here.how != "sliced" or here.tests != state.tests_done:
        return ()
    words = plain(slice_words(state, here))
    return (TEACHING, f"{words}. u takes it back.")


def implied(state: RunState) -> tuple[str, ...]:
    last = next((test for test in reversed(state.tests) if test.is_finished), None)
    if last is None or last.implied_by is None or state.ended:
        return ()
    return (f"Test {last.id} is implied by test {last.implied_by}: no model it lacks affected that run.",)


def refuted(state: RunState) -> tuple[str, ...]:
    words = refuted_words(state)
    return (as_sentence(words),) if words else ()
