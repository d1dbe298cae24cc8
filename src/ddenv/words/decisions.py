"""What the user's decisions lead to: tries, pins, going back, other settings; and how a run came to an environment."""

from __future__ import annotations

from ddenv.evidence.claims import has_dropped
from ddenv.runfile.progress import Node
from ddenv.runfile.run_settings import settings
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import RunState, Trial
from ddenv.runfile.tested import adoptable
from ddenv.text import as_sentence, count, first_of, plain, shortened
from ddenv.words.claims import drift

# The maximum number of pinned models that a sentence names, and the maximum width of each name in cells.
NAMED, LONGEST = 2, 32
# How a run came to an environment, by the `how` of its node: in few words, and in a line.
CAME_BY = {
    "start": ("", "where the run began"),
    "reduced": ("", "reduced to what shows f"),
    "adopted": ("adopted by hand", "a try by hand that showed f"),
    "accepted": ("another failure, accepted by hand", "another failure, accepted as f, too"),
    "instead": ("a branch to its failure", "a branch: the failure of this test is f here"),
    "certified": ("by a certificate", "reduced by a certificate: fresh runs show f as often"),
    "left_out": ("left out by hand", "left out by hand: it only helped (certificate)"),
    "sliced": ("without a test", "reduced to the models that affected runs"),
}
# Decisions that change the environment or the search.
_CHANGES = ("go_back", "undo", "pin", "unpin", "change", "adopt", "leave_out", "accept_other")


def to_adopt(state: RunState) -> tuple[str, ...]:
    """The last try that showed f and could become the environment."""
    last = adoptable(state)
    return () if last is None else (f"{shows_f(last)}: a adopts it.",)


def shows_f(trial: Trial) -> str:
    """That a try showed f, without a full stop."""
    return f"{trial.label} shows f with {count(trial.size, 'model')}"


def by_hand(state: RunState) -> tuple[str, ...]:
    """Tries that are not judged yet, and models that are pinned."""
    sentences = [_under_way(state, trial) for trial in state.trials if not trial.verdict]
    pinned = [shortened(name, LONGEST) for name in state.environment if name in state.pinned]
    # What has just been pinned is said by how the search began.
    if pinned and not state.ended and not (arrival(state) and state.decisions[-1].kind == "pin"):
        sentences.append(f"Pinned, and so in every candidate: {first_of(pinned, NAMED)}.")
    return tuple(sentences)


def last_reduction(state: RunState) -> tuple[str, ...]:
    """The last reduction, until the next test is made: a step shows its result."""
    here = state.here
    if here is None or here.how != "reduced" or here.parent is None or here.tests != state.tests_done:
        return ()
    return (f"{here.what} showed f: {_sizes(state, here)}.",)


def _under_way(state: RunState, trial: Trial) -> str:
    running = [test.outcome == "running" for test in state.tests_of(trial.tests)]
    what = f"{trial.label} ({count(trial.size, 'model')})"
    if not any(running):
        return f"{what} is tested next, before the round goes on."
    number = running.index(True)
    again = f"re-run {number} of {settings(state).most_runs - 1}" if number else "first run"
    return f"{what} is being tested: {again}."


def rarer(state: RunState) -> tuple[str, ...]:
    """A warning where f shows clearly less often than in the whole world."""
    here = state.here
    if not (has_dropped(state) and drift(state)) or here is None or here.parent is None:
        return ()
    before = count(len(state.nodes[here.parent].environment), "model")
    return (f"f is rarer than it was: {drift(state)[0]}. u goes back to {before}.",)


def arrival(state: RunState) -> str:
    """How the user's last decision led to this environment; "" if there is none, or a test was made since."""
    here = state.here
    last = state.decisions[-1] if state.decisions else None
    if here is None or last is None or last.tests != state.tests_done:
        return ""
    return as_sentence(plain(last.words)) if last.kind in _CHANGES else ""


def _sizes(state: RunState, here: Node) -> str:
    before = 0 if here.parent is None else len(state.nodes[here.parent].environment)
    return f"{before} → {count(len(here.environment), 'model')}"


def out_of_budget(state: RunState) -> tuple[str, ...]:
    """What to do when all tests of the budget were made."""
    budget = state.budget
    if budget is None or state.made < budget:
        return ()
    return (f"The budget of {count(budget, 'test')} is used up: c raises it, and the run goes on.",)


def older_engine(snapshot: Snapshot) -> tuple[str, ...]:
    """A warning where another version of ddenv works on the run."""
    version = snapshot.older_engine
    if not version or snapshot.engine != "alive":
        return ()
    return (
        f"Another version of ddenv works on this run ({plain(version)}): it may not know all commands of this version.",
    )
