"""What the baseline showed: how often the whole world fails, in which ways, and what that means for flaky candidates."""

from __future__ import annotations

from ddenv.evidence.rates import miss_chance
from ddenv.runfile.deeds import deed
from ddenv.runfile.events import BaselineFinished
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState
from ddenv.text import as_sentence, count, first_of, percent

# A line names so many failures.
MOST_FAILURES = 3


def baseline(state: RunState) -> str:
    """The result in sentences; "" before it is finished."""
    found = state.baseline
    if found is None:
        return ""
    broke = f"; {count(found.broken, 'more run')} broke" if found.broken else ""
    said = [f"Baseline: the robot {failed_in(state, found)} in {how_often(found)}{broke}."]
    if also := other_failures(found):
        said.append(as_sentence(f"{also} (--failure selects another one)"))
    if found.rate < 1.0:
        said.append(as_sentence(missed(state)))
    return " ".join(said)


def how_often(found: BaselineFinished) -> str:
    """How often f showed: "3 of 4 runs (75 %, 95 % interval 30 % to 95 %)"."""
    interval = f"95 % interval {percent(found.low)} to {percent(found.high)}"
    return f"{found.failures} of {count(found.runs, 'run')} ({percent(found.rate)}, {interval})"


def failed_in(state: RunState, found: BaselineFinished) -> str:
    """What the robot did in the f of the baseline; on a branch another failure is f."""
    return next((deed(test.failure) for test in state.tests_of((found.failure_test,))), deed(""))


def other_failures(found: BaselineFinished) -> str:
    """The failures besides f of the runs that chose f, with their numbers, and f itself if these runs only chose it; "" if
    there is none.
    """
    listed = [f"{number}. {one.name} in {count(one.runs, 'run')}" for number, one in found.others]
    if not listed:
        return ""
    others = f"other failures: {first_of(listed, MOST_FAILURES)}"
    f = next((one for one in found.seen if one.test == found.failure_test), None)
    if not found.chose or f is None:
        return others
    return f"the first {count(found.chose, 'run')} served only to choose f: {f.name} in {f.runs} of them; {others}"


def missed(state: RunState) -> str:
    """How likely all runs of a candidate miss f, by the baseline's rate and its interval; without a full stop."""
    base, asked = state.baseline, settings(state)
    if base is None:
        return ""
    if asked.accept_rate == "exact":
        return f"each candidate runs with the seeds of {min(asked.exact_seeds, base.failures)} of these failing runs"
    middle, most = (percent(miss_chance(rate, asked.iterations)) for rate in (base.rate, base.low))
    chance = middle if middle == most else f"{middle} (at most {most})"
    rare = base.iterations_95 > asked.iterations
    enough = f"; for a 95 % chance of seeing f, use --iterations {base.iterations_95}" if rare else ""
    return f"the chance that {count(1 + asked.iterations, 'run')} of a candidate miss f is {chance}{enough}"
