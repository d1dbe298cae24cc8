"""The variables of Algorithm 1 at a moment of a run, with their values, and which of them just
changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ddenv.runfile.failure_words import DEEDS
from ddenv.runfile.position import Moment
from ddenv.runfile.state import REFUSED, Candidate, RunState, Test
from ddenv.runfile.tested import pointed
from ddenv.text import count

SIGNS = {"similar": "●", "other": "◇", "pass": "○", "error": "✗", "timeout": "◷", "running": "▶"}
VERDICTS = {"similar": "●", "dissimilar": "○", "missed": "○", "unknown": "✗"} | dict.fromkeys(
    REFUSED, "⊘"
)


@dataclass(frozen=True, slots=True)
class Variable:
    """`value` is "" as long as it has none."""

    name: str
    value: str
    changed: bool = False


def variables(moment: Moment) -> tuple[Variable, ...]:
    """E, n_partitions, subenvironments, s, result, results, in the order of the algorithm."""
    candidate = pointed(moment)
    round = moment.before.round
    now = _values(moment.after, candidate)
    earlier = None
    # The candidate as it was before, if it is one of the same round.
    if (
        candidate
        and round
        and round.split is candidate.split
        and candidate.index < len(round.candidates)
    ):
        earlier = round.candidates[candidate.index]
    before = _values(moment.before, earlier)
    return tuple(Variable(name, value, value != before[name]) for name, value in now.items())


def _values(state: RunState, candidate: Candidate | None) -> dict[str, str]:
    round = state.round
    said = []
    tests = [] if candidate is None else state.tests_of(candidate.tests)
    # All candidates in short, with their verdicts; the current one between brackets. `-A` is all
    # without A.
    for one in () if round is None else round.candidates:
        letter = one.label.rpartition(" ")[2]
        words = (
            f"{letter if one.kind == 'partition' else f'-{letter}'}{VERDICTS.get(one.verdict, '')}"
        )
        said.append(
            f"[{words}]" if candidate is not None and one.index == candidate.index else words
        )
    return {
        "E": f"{count(len(state.environment), 'model')}: {_names(state.environment)}"
        if state.nodes
        else "",
        "n_partitions": "" if round is None else str(round.n_partitions),
        "subenvironments": " ".join(said),
        "s": "" if candidate is None else f"{candidate.label} = {_names(candidate.models)}",
        "result": "" if not tests else _result(tests[-1]),
        "results": " ".join(SIGNS.get(test.outcome, "?") for test in tests if test.is_finished),
    }


def _names(names: Sequence[str]) -> str:
    return ", ".join(names) or "no models"


def _result(test: Test) -> str:
    if test.outcome in ("running", "lost"):
        return "..."
    if test.outcome == "pass":
        return "the goal was reached"
    how = test.failure if test.failure in DEEDS else test.outcome
    away = "" if test.distance is None else f", {test.distance:.1f} m from f's end"
    return f"{'f again' if test.shows_f else 'not f'}: {how}{away}"
