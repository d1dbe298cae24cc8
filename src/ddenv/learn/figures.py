"""The figures in a lesson's texts: `{names}` from a closed set, over the recorded run. Nothing is ever computed from a text."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from ddenv.amounts import first_of
from ddenv.errors import UserError
from ddenv.learn.oracle import Oracle
from ddenv.runfile.events import deed
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState
from ddenv.schemas import nearest

# Terms that contain a digit.
TERMS = ("1-minimal", "Algorithm 1")
_FIGURE = re.compile(r"\{([^{}]*)\}")
_NAMED = 8


def _left_percent(state: RunState) -> str:
    return f"{100 - round(100 * len(state.environment) / max(1, len(state.elements)))} %"


def _search_tests(state: RunState) -> int:
    return sum(test.phase == "round" and test.is_finished for test in state.tests)


# Over the whole run, from its end.
OF_RUN: dict[str, Callable[[RunState], object]] = {
    "models": lambda state: len(state.elements),
    "left": lambda state: len(state.environment),
    "smaller": _left_percent,
    "kept": lambda state: first_of(list(state.environment), _NAMED),
    "tests": lambda state: state.tests_done,
    "baseline_tests": lambda state: sum(test.phase == "baseline" for test in state.tests),
    "search_tests": _search_tests,
    "fresh_tests": lambda state: sum(test.phase == "certify" for test in state.tests),
    "reruns": lambda state: state.deflake_runs,
    "rounds": lambda state: state.rounds_done,
    "reductions": lambda state: sum(node.how == "reduced" for node in state.nodes),
    "failed_runs": lambda state: 0 if state.baseline is None else state.baseline.failures,
    "baseline_runs": lambda state: 0 if state.baseline is None else state.baseline.runs,
    "iterations": lambda state: settings(state).iterations,
    "timeout": lambda state: f"{settings(state).timeout:g} s",
    "epsilon": lambda state: f"{settings(state).epsilon:g} m",
    "failure": lambda state: deed(state.failure),
    "pair": lambda state: settings(state).pair,
    "subsets": lambda state: f"{2 ** len(state.elements):,}" if len(state.elements) < 30 else "countless",
}
# At the place of the step.
HERE: dict[str, Callable[[RunState], object]] = {
    "here_models": lambda state: len(state.environment),
    "here_tests": lambda state: state.tests_done,
    "here_round": lambda state: 0 if state.round is None else state.round.number,
    "here_n": lambda state: 0 if state.round is None else state.round.n_partitions,
    "here_parts": lambda state: 0 if state.round is None else len(state.round.partitions),
    "here_candidates": lambda state: 0 if state.round is None else len(state.round.candidates),
}
# From the oracle that knows every part of the world.
OF_ORACLE: dict[str, Callable[[Oracle], object]] = {
    "failing": lambda oracle: len(oracle.showing),
    "minimal_sets": lambda oracle: len(oracle.minimal),
    "smallest": lambda oracle: min(map(len, oracle.minimal), default=0),
    "smallest_set": lambda oracle: ", ".join(oracle.minimal[0] if oracle.minimal else ()),
}


def names() -> tuple[str, ...]:
    """All names that a text may have between braces."""
    return (*OF_RUN, *HERE, *OF_ORACLE)


def check(text: str) -> None:
    """Raises UserError if `text` has a digit of its own, or a name that is not known."""
    for name in _FIGURE.findall(text):
        if name not in names():
            raise UserError(f"unknown figure '{{{name}}}'{nearest(name, names())}; known are {', '.join(names())}")
    bare = _FIGURE.sub("", text)
    for term in TERMS:
        bare = bare.replace(term, "")
    if found := re.search(r"\S*\d\S*", bare):
        raise UserError(f"'{found[0]}' is a bare figure; write one of the {{names}}, so that it stays true")
    if found := re.search(r"[{}]", bare):
        raise UserError(f"a single '{found[0]}'; figures are {{names}} between braces")


def filled(text: str, values: Mapping[str, str]) -> str:
    """`text` with its figures."""
    return _FIGURE.sub(lambda found: values.get(found[1], found[0]), text)


def values(end: RunState, here: RunState, oracle: Oracle | None) -> dict[str, str]:
    """What the names stand for in a step, given the state at the run's end and at the step's place."""
    found = {name: str(value(end)) for name, value in OF_RUN.items()}
    found |= {name: str(value(here)) for name, value in HERE.items()}
    return found | ({name: str(value(oracle)) for name, value in OF_ORACLE.items()} if oracle else {})
