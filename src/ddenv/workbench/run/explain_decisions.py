"""The user's decisions that affect what happens now, in sentences: tries, pins, going back, other settings."""

from __future__ import annotations

from ddenv.evidence.claims import drift, has_dropped
from ddenv.guiding.situation import named
from ddenv.runfile.progress import Node
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState, Trial
from ddenv.text import plain
from ddenv.workbench.shared.poll import Snapshot
from ddenv.workbench.shared.wording import count

HOW = {
    "adopted": "You adopted {what}",
    "left_out": "You went on {what}",
    "accepted": "You accepted the other failure of {what} as f",
    "instead": "You branched: the failure of {what} is f here",
}


def to_adopt(state: RunState) -> tuple[str, ...]:
    """The last try that showed f and could become the environment."""
    similar = [trial for trial in state.trials if _can_be_adopted(state, trial)]
    if not similar:
        return ()
    return (f"{similar[-1].label} shows f with {count(similar[-1].size, 'model')}: a on its row adopts it.",)


def by_hand(state: RunState) -> tuple[str, ...]:
    """Tries that are not judged yet, and models that are pinned."""
    sentences = [_under_way(state, trial) for trial in state.trials if not trial.verdict]
    pinned = [name for name in state.environment if name in state.pinned]
    if pinned and not state.ended:
        sentences.append(f"Pinned, and so in every candidate: {named(pinned)}.")
    return tuple(sentences)


def last_reduction(state: RunState) -> tuple[str, ...]:
    """The last reduction, until the next test is made: a step shows its result."""
    here = state.here
    if here is None or here.how != "reduced" or here.parent is None or here.tests != state.tests_done:
        return ()
    return (f"{here.what} showed f: {_sizes(state, here)}.",)


def _can_be_adopted(state: RunState, trial: Trial) -> bool:
    return trial.verdict == "similar" and not trial.adopted and trial.node == state.node


def _under_way(state: RunState, trial: Trial) -> str:
    most = settings(state).most_runs
    tests = [state.tests[id - 1] for id in trial.tests if 0 < id <= len(state.tests)]
    running = next((test for test in tests if test.outcome == "running"), None)
    what = f"{trial.label} ({count(trial.size, 'model')})"
    if running is None:
        return f"{what} is the next test, before the round goes on."
    number = tests.index(running)
    again = f"re-run {number} of {most - 1}" if number else "first run"
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
    if last.kind in ("go_back", "undo"):
        return f"{_capital(plain(last.words))}."
    if last.kind == "change":
        return f"{_capital(plain(last.words))}, from this round on."
    if here.how in HOW and last.kind in ("adopt", "leave_out", "accept_other"):
        return f"{HOW[here.how].format(what=here.what)}: {_sizes(state, here)}."
    return ""


def _sizes(state: RunState, here: Node) -> str:
    before = 0 if here.parent is None else len(state.nodes[here.parent].environment)
    return f"{before} → {count(len(here.environment), 'model')}"


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


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
        f"Another version of ddenv works on this run ({plain(version)}): it may not know every command of this one.",
    )
