"""What is happening, in words: the line of Algorithm 1 a run is at, and what it does there and why. Pure text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ddenv.runfile.state import Candidate, Round, RunState, Test
from ddenv.workbench.poll import Snapshot
from ddenv.workbench.settings import Settings, settings
from ddenv.workbench.wording import count, metres, percent, plain

# Line 0 is ours: it fixes f before the paper's algorithm begins. The other numbers are the paper's.
ALGORITHM: tuple[tuple[int, str], ...] = (
    (0, "f ← failure of R(E, goal, timeout), several runs"),
    (1, "while E' not reached do"),
    (2, " subenvironments ← partition(E, f, n_partitions)"),
    (3, " subenvironments ← prioritization(subenvironments)"),
    (4, " for s in subenvironments do"),
    (5, "   result ← R(s, f, timeout)"),
    (6, "   if is_new_failure(result) or is_success(result)"),
    (7, "     results ← deflake(s, R, iterations, timeout)"),
    (8, "     result ← find_similar_failure(results, f)"),
    (10, "   if is_similar_failure(result, f) then"),
    (11, "     E ← s; break"),
    (15, " n_partitions ← n_partitions + 1"),
    (16, " if nothing similar and n_partitions = E.size then"),
    (17, "   E' ← E; break"),
    (21, "return E'"),
)
# A list of kept models longer than this is cut, so that the sentence stays one.
NAMED = 8


@dataclass(frozen=True, slots=True)
class Explanation:
    """`line` is a line number of `ALGORITHM`, or None when the algorithm stands nowhere."""

    line: int | None
    sentences: tuple[str, ...]


def explain(snapshot: Snapshot) -> Explanation:
    """What happens now, and why."""
    state, options = snapshot.state, settings(snapshot.state)
    if snapshot.error:
        return Explanation(None, (snapshot.error,))
    if snapshot.status == "finished":
        return _finished(state)
    if snapshot.status in STANDING:
        return Explanation(None, STANDING[snapshot.status](state))
    if state.baseline is None:
        return _with_pause(state, Explanation(0, _baseline_so_far(state, options)))
    if state.round is None or state.round.done:
        return _with_pause(state, _between(state, options))
    if state.waiting_candidate is not None:
        return Explanation(10, _waiting(state, state.round, options))
    return _with_pause(state, _testing(snapshot, state.round, options))


def baseline_sentence(state: RunState, iterations: int) -> str:
    """How often the whole world fails, with Wilson's interval, and what that means for flaky candidates."""
    base = state.baseline
    if base is None:
        return ""
    sentence = (
        f"Baseline: {base.failures} of {count(base.runs, 'run')} failed "
        f"({percent(base.rate)}, 95 % interval {percent(base.low)} to {percent(base.high)})."
    )
    if base.rate >= 1.0:
        return sentence
    tests = count(1 + iterations, "test")
    need = "" if base.iterations_95 <= iterations else f"; for 95 % certainty set iterations to {base.iterations_95}"
    return f"{sentence} The chance that {tests} of a candidate all miss f is {percent(base.miss_chance)}{need}."


def _with_pause(state: RunState, explanation: Explanation) -> Explanation:
    if not state.paused:
        return explanation
    running = any(test.outcome == "running" for test in state.tests)
    rest = "what runs now is finished first" if running else "nothing runs now"
    first = f"Paused: no new test is started; {rest}. space resumes, s runs one test."
    return Explanation(explanation.line, (first, *explanation.sentences))


def _starting(_: RunState) -> tuple[str, ...]:
    return ("The engine starts. It works in a process of its own and outlives this screen.",)


def _created(_: RunState) -> tuple[str, ...]:
    return ("No engine has worked on this run yet. r starts one.",)


def _failed(state: RunState) -> tuple[str, ...]:
    return (
        f"The engine could not go on: {plain(state.reason).rstrip('.')}.",
        "Everything so far is kept; r tries again.",
    )


def _stopped(state: RunState) -> tuple[str, ...]:
    why = f": {plain(state.reason).rstrip('.')}" if state.reason else ""
    return (f"The engine was stopped{why}.", "Everything so far is kept; r resumes.")


def _lost(state: RunState) -> tuple[str, ...]:
    flying = sum(test.outcome == "running" for test in state.tests)
    lost = f" Only {count(flying, 'test')} that ran then must run again." if flying else ""
    return (f"The engine is not running: it was killed, or its machine went down. r resumes.{lost}",)


# Nothing moves in these states.
STANDING: dict[str, Callable[[RunState], tuple[str, ...]]] = {
    "starting": _starting,
    "created": _created,
    "failed": _failed,
    "stopped": _stopped,
    "lost": _lost,
}


def _baseline_so_far(state: RunState, options: Settings) -> tuple[str, ...]:
    tests = state.finished_tests
    reached = sum(test.outcome == "pass" for test in tests)
    failed = sum(test.outcome == "failed" for test in tests)
    first = (
        f"The whole world is run {count(options.baseline_runs, 'time')}, each with its own seed, to fix the failure f."
    )
    if not tests:
        return (first,)
    return (first, f"Of {count(len(tests), 'run')} so far {failed} failed and {reached} reached the goal.")


def _between(state: RunState, options: Settings) -> Explanation:
    partitioning, _, prioritization = options.pair.partition("/")
    number = state.rounds_done + 1
    kept = count(len(state.environment), "model")
    sentences = [f"Round {number}: the {kept} of E are split by {partitioning}, then put in order by {prioritization}."]
    if state.round is None:
        sentences.append(baseline_sentence(state, options.iterations))
    elif state.round.winner is None:
        sentences.append("Nothing showed f in the last round, so the parts get smaller.")
    return Explanation(2, tuple(sentences))


def _waiting(state: RunState, current: Round, options: Settings) -> tuple[str, ...]:
    candidate = current.candidates[state.waiting_candidate]
    before, after = len(state.environment), len(candidate.models)
    return (
        f"{candidate.label} shows f: {_ended(state, candidate, options)}",
        f"The reduction waits for you: a accepts it ({before} → {count(after, 'model')}), x rejects it and goes on.",
    )


def _ended(state: RunState, candidate: Candidate, options: Settings) -> str:
    test = _last(state, candidate, "similar")
    if test is None or not metres(test.distance, 2):
        return "the robot failed as in f."
    return f"the robot ended {metres(test.distance, 2)} from f's end (similar is up to {options.epsilon:g} m)."


def _testing(snapshot: Snapshot, current: Round, options: Settings) -> Explanation:
    state = snapshot.state
    if current.winner is not None:
        return _reduced(state, current, options)
    candidate = snapshot.focus or next((each for each in current.candidates if not each.verdict), None)
    if candidate is None:
        return Explanation(15, _nothing_found(state, current))
    running = [test for test in snapshot.running if test.round == current.number and test.candidate == candidate.index]
    ahead = len({test.candidate for test in snapshot.running if test.round == current.number} - {candidate.index})
    models = count(len(candidate.models), "model")
    place = f"{candidate.label} ({models}), candidate {candidate.index + 1} of {len(current.candidates)}"
    if not running:
        return Explanation(4, (f"Next is {place}.",))
    # Speculation may run several tests of one candidate at once; the earliest is the one the algorithm is at.
    test = running[0]
    sentences = _first_run(place, options) if test.run == 0 else _rerun(state, candidate, test, place, options)
    if ahead:
        sentences = (*sentences, f"Idle workers run ahead: {count(ahead, 'later candidate')} at the same time.")
    return Explanation(5 if test.run == 0 else 7, sentences)


def _first_run(place: str, options: Settings) -> tuple[str, ...]:
    return (
        f"First run of {place}.",
        f"f again means: goal not reached in {options.timeout:g} s, and the end within {options.epsilon:g} m of f's end.",
    )


def _rerun(state: RunState, candidate: Candidate, test: Test, place: str, options: Settings) -> tuple[str, ...]:
    before = _last(state, candidate)
    return (
        f"Re-run {test.run} of {options.iterations} of {place}: {_why_again(before)}",
        f"A failure can be flaky: only {count(1 + options.iterations, 'test')} without f make it dissimilar.",
    )


def _why_again(before: Test | None) -> str:
    if before is None:
        return "another seed is tried at the same time."
    reasons = {
        "pass": "the goal was reached.",
        "other": f"the robot failed elsewhere, {metres(before.distance)} from f's end."
        if metres(before.distance)
        else "the robot failed, but not as in f.",
        "error": "the simulation broke.",
        "timeout": "the test took too long on the clock.",
    }
    return f"last time {reasons.get(before.outcome, 'f was not seen.')}"


def _reduced(state: RunState, current: Round, options: Settings) -> Explanation:
    candidate = current.candidates[current.winner]
    before, after = len(current.environment), len(candidate.models)
    gone = "the others take no part in f" if before - after > 1 else "the other one takes no part in f"
    return Explanation(
        11,
        (
            f"{candidate.label} shows f: {_ended(state, candidate, options)}",
            f"E is now {candidate.label}: {before} → {count(after, 'model')}; {gone}.",
        ),
    )


def _nothing_found(state: RunState, current: Round) -> tuple[str, ...]:
    first = f"No candidate of round {current.number} showed f."
    if current.n_partitions >= len(state.environment):
        return (first, "The parts were single models already: nothing more can be removed.")
    return (first, "E stays as it is; the next round splits it into smaller parts.")


def _finished(state: RunState) -> Explanation:
    options, kept = settings(state), count(len(state.environment), "model")
    if state.baseline is None:
        return Explanation(None, (_reason(state, "The run ended in the baseline."),))
    if not state.minimal:
        return Explanation(21, (_reason(state, "The run ended early."), f"{kept} left: {_names(state)}."))
    if not state.environment:
        none = "f is seen without any of the models that can be removed: look at the robot, its goal and what always stays."
        return Explanation(21, ("Minimal: no model left.", none, baseline_sentence(state, options.iterations)))
    single = len(state.environment) == 1
    proof = f"without {'it' if single else 'any one of them'} f is not seen again"
    return Explanation(
        21,
        (
            f"Minimal: {kept} left, and {proof}.",
            f"Kept: {_names(state)}.",
            baseline_sentence(state, options.iterations),
        ),
    )


def _reason(state: RunState, otherwise: str) -> str:
    text = plain(state.reason) or otherwise
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def _names(state: RunState) -> str:
    names = [plain(name) for name in state.environment]
    if len(names) <= NAMED:
        return ", ".join(names)
    return f"{', '.join(names[:NAMED])} and {len(names) - NAMED} more"


def _last(state: RunState, candidate: Candidate, outcome: str | None = None) -> Test | None:
    tests = [state.tests[id - 1] for id in candidate.tests if 0 < id <= len(state.tests)]
    for test in reversed(tests):
        if test.outcome == outcome or (outcome is None and test.outcome not in ("running", "lost")):
            return test
    return None
