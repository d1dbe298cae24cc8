"""What the footer of the run screen says of its keys at a moment: those that would do nothing are not shown."""

from __future__ import annotations

from ddenv.errors import UserError
from ddenv.runfile.guiding import Trial
from ddenv.runfile.state import Candidate
from ddenv.workbench import guiding
from ddenv.workbench.poll import Snapshot

Row = Candidate | Trial | None
ACCEPT = {"accept": "accept", "adopt": "adopt", "accept_other": "take as f"}


def footer_words(snapshot: Snapshot, row: Row, follows: bool) -> dict[str, str]:
    """The words for the keys by id, "" for a key that is not shown. `row` is under the cursor, which `follows` the run."""
    state = snapshot.state
    known, waits = state.baseline is not None, state.waiting_candidate is not None
    here = state.here
    return {
        "run.pause": _pause(snapshot),
        "run.step": "step" if snapshot.engine == "alive" and not waits and snapshot.status != "finished" else "",
        "run.accept": _accept(snapshot, row, follows),
        "run.reject": "reject" if waits else "",
        "run.veto": _veto(snapshot, row),
        "run.without": "try without" if known else "",
        "run.only": "try only" if known else "",
        "run.undo": "undo" if here is not None and here.parent is not None else "",
    }


def _pause(snapshot: Snapshot) -> str:
    if snapshot.status == "finished":
        return ""
    if snapshot.engine == "absent":
        return "start"
    return "resume" if snapshot.state.paused else "pause"


def _accept(snapshot: Snapshot, row: Row, follows: bool) -> str:
    """While the cursor follows the run, other failures come and go: they are offered where somebody looks at them."""
    state = snapshot.state
    if state.waiting_candidate is None and follows and not (isinstance(row, Trial) or state.paused):
        return ""
    try:
        return ACCEPT[guiding.accept(state, row).kind]
    except UserError:
        return ""


def _veto(snapshot: Snapshot, row: Row) -> str:
    current = snapshot.state.round
    over = current is not None and current.done and snapshot.state.paused
    if current is None or over or snapshot.status == "finished":
        return ""
    return "take back" if isinstance(row, Candidate) and row.verdict in ("vetoed", "rejected") else "veto"
