"""What a user who does something else wants to know of a run: the title of the terminal, and when the run needs a look."""

from __future__ import annotations

from ddenv.claims import ended
from ddenv.runs.tests_left import remaining
from ddenv.text import plain, shortened
from ddenv.workbench.shared.poll import Snapshot
from ddenv.workbench.shared.wording import STATUS, count

# Which states end with a notification: the first one of these that follows another state.
WORTH = ("finished", "failed", "lost", "waiting", "stopped")
# The title goes in steps of so many per cent: each change is sent to the terminal.
STEP = 5


def title(snapshot: Snapshot) -> str:
    """The run, its state and how far it is, as short as a tab's title has to be."""
    state = snapshot.state
    name = shortened(plain(state.scenario.get("name", "")), 40)
    if not state.elements:
        return f"ddenv {name}"
    sign, word = STATUS.get(snapshot.status, ("·", snapshot.status))
    models = f"{len(state.environment)} of {count(len(state.elements), 'model')}"
    said = "" if snapshot.status in ("running", "baseline") else f", {word}"
    return f"{sign} {_done(snapshot)}{name}: {models}{said}"


def _done(snapshot: Snapshot) -> str:
    left = remaining(snapshot.state, snapshot.engine == "alive")
    if left is None:
        return ""
    done = snapshot.state.tests_done
    part = 100 * done / max(1, done + left.tests[1])
    return f"{STEP * int(part / STEP)} % "


def worth_a_look(before: Snapshot, now: Snapshot) -> str:
    """Why the user should look at the run now, if that is new since `before`; or ""."""
    status = now.status
    if status == before.status or status not in WORTH or before.behind or now.behind:
        return ""
    state = now.state
    models = f"{len(state.environment)} of {count(len(state.elements), 'model')} left"
    if status == "finished":
        return f"{models}; {plain(ended(state))}"
    if status == "waiting":
        return "a reduction waits for you: accept or reject it"
    return f"{STATUS[status][1]}{f', {plain(state.reason)}' if state.reason else ''}; {models}"
