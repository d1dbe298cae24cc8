"""What the baseline showed: how often the whole world fails, in which ways, and what that means for
flaky candidates.
"""

from __future__ import annotations

from ddenv.evidence.rates import miss_chance
from ddenv.runfile.events import BaselineFinished
from ddenv.runfile.failure_words import deed
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
    interval = f"95 % interval {percent(found.low)} to {percent(found.high)}"
    often = f"{found.failures} of {count(found.runs, 'run')} ({percent(found.rate)}, {interval})"
    said = [f"Baseline: the robot {failed_in(state, found)} in {often}{broke}."]
    if found.alike and found.runs < settings(state).baseline_runs:
        said.append("These runs are alike to the last bit, so no more were made.")
    if listed := [
        f"{number}. {one.name} in {count(one.runs, 'run')}" for number, one in found.others
    ]:
        others = f"other failures: {first_of(listed, MOST_FAILURES)}"
        f = next((one for one in found.seen if one.test == found.failure_test), None)
        if found.chose and f is not None:
            chose = f"the first {count(found.chose, 'run')} served only to choose f"
            others = f"{chose}: {f.name} in {f.runs} of them; {others}"
        said.append(as_sentence(f"{others} (--failure selects another one)"))
    if found.rate < 1.0:
        said.append(as_sentence(missed(state)))
    return " ".join(said)


def failed_in(state: RunState, found: BaselineFinished) -> str:
    """What the robot did in the f of the baseline; on a branch another failure is f."""
    return next((deed(test.failure) for test in state.tests_of((found.failure_test,))), deed(""))


def missed(state: RunState) -> str:
    """How likely all runs of a candidate miss f, by the baseline's rate and its interval; without a
    full stop.
    """
    base = state.baseline
    asked = settings(state)
    if base is None:
        return ""
    if asked.accept_rate == "exact":
        return (
            f"each candidate runs with the seeds of {min(asked.exact_seeds, base.failures)} of "
            "these failing runs"
        )
    middle, most = (percent(miss_chance(rate, asked.iterations)) for rate in (base.rate, base.low))
    chance = middle if middle == most else f"{middle} (at most {most})"
    rare = base.iterations_95 > asked.iterations
    if rare:
        enough = f"; for a 95 % chance of seeing f, use --iterations {base.iterations_95}"
    else:
        enough = ""
    return (
        f"the chance that {count(1 + asked.iterations, 'run')} of a candidate miss f is "
        f"{chance}{enough}"
    )
