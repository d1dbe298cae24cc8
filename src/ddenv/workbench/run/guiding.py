"""What a key means for the run as it is: the command that is sent, with the words for it, or why there is none. Pure."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any

from ddenv.errors import UserError
from ddenv.map.names import shortened
from ddenv.runfile.events import deed
from ddenv.runfile.settings import settings
from ddenv.runfile.state import Candidate, Node, RunState, Test, Trial
from ddenv.words import first_of
from ddenv.workbench.wording import count, metres, plain

# These go on from somewhere else: where no engine works, one is started for them.
GOES_ON = ("try", "adopt", "accept_other", "undo", "go_back", "change")
# So many models are named, each in so many columns.
NAMED, LONGEST = 2, 32
NO_FAILURE = "f is not known yet: the baseline comes first"


@dataclass(frozen=True, slots=True)
class Ask:
    """A command for the engine: its `kind` and `data`, what is `said` when it is sent, and a `question` before that, or ""."""

    kind: str
    data: dict[str, Any]
    said: str
    question: str = ""


def named(names: Iterable[str]) -> str:
    """The first names of some models, fit for a line."""
    return first_of([shortened(name, LONGEST) for name in names], NAMED)


def decide(state: RunState, decision: str) -> Ask:
    """Accept or reject the reduction that waits. Raises UserError."""
    if state.waiting_candidate is None or state.round is None:
        raise UserError(f"nothing waits for {decision}")
    one = state.round.candidates[state.waiting_candidate]
    said = f"{one.label} is {decision}ed"
    return Ask(decision, {"round": state.round.number, "candidate": one.index}, said)


def accept(state: RunState, row: Candidate | Trial | None) -> Ask:
    """Accept what waits, or else what is under the cursor. Raises UserError."""
    if state.waiting_candidate is not None:
        return decide(state, "accept")
    if row is None:
        raise UserError("nothing waits for accept")
    if isinstance(row, Trial) and row.verdict == "similar":
        return _adopt(state, row)
    if row.verdict == "similar":
        raise UserError(f"{row.label} is accepted already; nothing waits for accept")
    return _accept_other(state, row)


def _adopt(state: RunState, trial: Trial) -> Ask:
    if trial.adopted and trial.models == state.environment:
        raise UserError(f"{trial.label} is the environment already")
    _check_pins(state, trial.models, trial.label)
    said = f"{trial.label} is adopted: E becomes its {count(trial.size, 'model')}"
    return Ask("adopt", {"trial": trial.number}, said)


def _accept_other(state: RunState, row: Candidate | Trial) -> Ask:
    test = nearest_other(state, row)
    if test is None:
        why = f"is {row.verdict}" if row.verdict else "is not judged yet"
        raise UserError(f"nothing waits for accept; {row.label} {why}, and shows no other failure to take for as good")
    if not set(row.models) < set(state.environment):
        raise UserError(f"{row.label} is no part of the environment as it is now")
    _check_pins(state, row.models, row.label)
    said = f"the other failure of {row.label} counts as f, too"
    return Ask("accept_other", {"test": test.id}, said, other_failure(state, row, test))


def nearest_other(state: RunState, row: Candidate | Trial) -> Test | None:
    """The test of a candidate or trial that ended in another failure, the one whose end is nearest to f's."""
    tests = [state.tests[id - 1] for id in row.tests if 0 < id <= len(state.tests)]
    others = [test for test in tests if test.outcome == "other" and test.end_pose is not None]
    return min(others, key=lambda test: (test.distance is None, test.distance or 0.0), default=None)


def other_failure(state: RunState, row: Candidate | Trial, test: Test) -> str:
    """What happened in the test, beside f."""
    away = metres(test.distance, 2)
    apart = f", {away} from f's end" if away else ""
    place = _position(test.end_pose)
    f = "" if state.baseline is None else f"\nIn f it {deed(state.failure)} at {_position(state.baseline.position)}."
    return (
        f"In {row.label} ({count(row.size, 'model')}) the robot {deed(test.failure)} at {place}{apart}.{f}\n\n"
        "Take this for as good as f? Then this failure counts as f too from now on, and these models are the environment. "
        "u takes it back."
    )


def _position(pose: tuple[float, ...] | None) -> str:
    return "an unknown place" if pose is None else "({:.2f}, {:.2f}, {:.2f}) m".format(*pose[:3])


def veto(state: RunState, row: Candidate | Trial | None) -> Ask:
    """Leave out a candidate, or try it after all. Raises UserError."""
    current = state.round
    if state.confirming and not state.ended:
        raise UserError("the rounds are over")
    if isinstance(row, Trial):
        raise UserError(f"{row.label} is your own selection; only candidates of the round can be vetoed")
    if current is None or row is None:
        raise UserError("there are no candidates yet")
    if current.done or current.winner is not None:
        raise UserError("this round is over")
    if row.index == state.waiting_candidate:
        raise UserError(f"{row.label} showed f and waits: reject it with x")
    where = {"round": current.number, "candidate": row.index}
    if row.verdict in ("vetoed", "rejected"):
        return Ask("unveto", where, f"{row.label} is no longer {row.verdict}: it is tried after all")
    if row.verdict:
        raise UserError(f"{row.label} is {row.verdict} already")
    return Ask("veto", where, f"{row.label} is vetoed: it is not tried; v again takes that back")


def pin(state: RunState, names: Collection[str]) -> Ask:
    """Pin models, or unpin them if all of them are pinned. Raises UserError."""
    _known(state, names)
    if all(name in state.pinned for name in names):
        return Ask("unpin", {"models": _numbers(state, names)}, f"{named(names)} {_are(names)} unpinned")
    kept = frozenset(state.environment)
    gone = next((name for name in names if name not in kept), None)
    if gone is not None:
        raise UserError(
            f"{shortened(gone, LONGEST)} is removed already: go back (h) to where it was there, and pin it then"
        )
    new = [name for name in names if name not in state.pinned]
    said = f"{named(new)} {_are(new)} pinned, and always {'stays' if len(new) == 1 else 'stay'} from the next round on"
    return Ask("pin", {"models": _numbers(state, new)}, said)


def try_without(state: RunState, names: Collection[str]) -> Ask:
    """Test the environment without some models. Raises UserError."""
    _known(state, names)
    out = frozenset(names)
    kept = [name for name in state.environment if name not in out]
    if len(kept) == len(state.environment):
        raise UserError("none of the selected models is left in the environment: there is nothing to leave out")
    return _try(state, kept, f"without {named(name for name in state.environment if name in out)}")


def try_only(state: RunState, names: Collection[str]) -> Ask:
    """Test some models alone. Raises UserError."""
    _known(state, names)
    kept = [name for name in state.elements if name in frozenset(names)]
    if kept == list(state.environment):
        raise UserError("all models of the environment are selected: that is no change")
    return _try(state, kept, f"only {named(kept)}")


def _try(state: RunState, kept: list[str], what: str) -> Ask:
    if state.baseline is None:
        raise UserError(NO_FAILURE)
    said = f"try {len(state.trials) + 1}: {count(len(kept), 'model')}, {what}"
    return Ask("try", {"models": _numbers(state, kept)}, said)


def undo(state: RunState) -> Ask:
    """Take back the last reduction. Raises UserError."""
    here = state.here
    if here is None or here.parent is None:
        raise UserError("there is no reduction to take back")
    before, after = len(here.environment), len(state.nodes[here.parent].environment)
    return Ask("undo", {}, f"{here.what} is taken back: {before} → {count(after, 'model')}; it is not made again")


def go_back(state: RunState, number: int) -> Ask:
    """Make the environment of a node the current one. Raises UserError."""
    if number == state.node:
        raise UserError("the run is there already")
    if state.baseline is None:
        raise UserError(NO_FAILURE)
    node = state.nodes[number]
    question = (
        f"Go on from {place(node)}?\n\nThe run pauses there. Change settings (c), pin (p) or try (w, o), then space goes on. "
        "What was found since then stays in the history, and you can come back to it. No test is made twice."
    )
    return Ask("go_back", {"node": number}, f"back to {place(node)}; the run pauses there", question)


def change(state: RunState, asked: dict[str, Any]) -> Ask:
    """Change some settings from the next round on. Raises UserError."""
    now = settings(state)
    before = {"pair": now.pair, "algorithm": now.algorithm, "iterations": now.iterations, "budget": state.budget}
    new = {key: value for key, value in asked.items() if before[key] != value}
    if not new:
        raise UserError("nothing was changed")
    words = ", ".join(f"{key} {'no limit' if value is None else plain(value)}" for key, value in new.items())
    return Ask("change", {"settings": new}, f"from the next round on: {words}")


def place(node: Node) -> str:
    """A node in words."""
    models = count(len(node.environment), "model")
    return f"the whole world ({models})" if node.parent is None else f"{models} (#{node.number}, {plain(node.what)})"


def _known(state: RunState, names: Collection[str]) -> None:
    if not names:
        raise UserError("no model is selected")
    elements = frozenset(state.elements)
    fixed = next((name for name in names if name not in elements), None)
    if fixed is not None:
        raise UserError(f"{shortened(fixed, LONGEST)} is protected: it always stays")


def _check_pins(state: RunState, models: Iterable[str], label: str) -> None:
    lacking = state.pinned.intersection(state.environment).difference(models)
    if lacking:
        raise UserError(f"{label} is without {named(sorted(lacking))}, which is pinned: unpin it first (p)")


def _are(names: Collection[str]) -> str:
    return "is" if len(names) == 1 else "are"


def _numbers(state: RunState, names: Iterable[str]) -> list[int]:
    number = {name: index for index, name in enumerate(state.elements)}
    return sorted(number[name] for name in names)
