"""What the user's decisions change in a run's state: pins, selections tried by hand, other settings, the way back and branches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ddenv.runfile.fold_nodes import arrived, decision, failures_at, left_round, searched_anew
from ddenv.runfile.fold_tests import with_outcomes
from ddenv.runfile.guiding import Node, Trial, many
from ddenv.runfile.state import Point, RunState
from ddenv.runfile.values import Changes, Data, names, one_of

# A decision names so many models, each with so many letters.
NAMED, LONGEST = 3, 40


def pinned(state: RunState, data: Data, at: float) -> Changes:
    models = names(state.elements, data["models"])
    words = f"pinned {told(models)}"
    return {**searched_anew(state), "pinned": state.pinned.union(models), **decision(state, at, "pin", words)}


def unpinned(state: RunState, data: Data, at: float) -> Changes:
    models = names(state.elements, data["models"])
    words = f"unpinned {told(models)}"
    return {**searched_anew(state), "pinned": state.pinned.difference(models), **decision(state, at, "unpin", words)}


def trial_started(state: RunState, data: Data, at: float) -> Changes:
    trial = Trial(int(data["trial"]), names(state.elements, data["models"]), state.node)
    if trial.number != len(state.trials) + 1 or len(set(trial.models)) != len(trial.models):
        raise ValueError(trial.number)
    inside = frozenset(trial.models)
    without = [name for name in state.environment if name not in inside]
    what = f"without {told(without)}" if 0 < len(without) <= trial.size else f"with {told(trial.models)} alone"
    words = f"tried {trial.size} of {len(state.environment)} models ({trial.label}): {what}"
    return {"trials": (*state.trials, trial), **decision(state, at, "try", words)}


def trial_judged(state: RunState, data: Data, _: float) -> Changes:
    tests = tuple(map(int, data["tests"]))
    trial, verdict = tried(state, data["trial"]), one_of(data["verdict"], "similar", "dissimilar")
    return _with_trial(state, replace(trial, verdict=verdict, tests=tests, known=int(data["known"])))


def adopted(state: RunState, data: Data, at: float) -> Changes:
    trial = replace(tried(state, data["trial"]), adopted=True)
    words = f"adopted {trial.label}: {many(trial.size)}"
    return {
        **_with_trial(state, trial),
        **arrived(state, data, at, "adopted", trial.label),
        **decision(state, at, "adopt", words),
    }


def accepted_other(state: RunState, data: Data, at: float) -> Changes:
    """Another failure counts as f from here on, and where it showed becomes the environment."""
    test = state.tests[_index(data["test"])]
    # A trial that led there is known by its number; else it was a candidate.
    trial = None if data.get("trial") is None else tried(state, data["trial"])
    what = trial.label if trial else str(data["what"])
    judged = with_outcomes(state, data)
    changes = {} if trial is None else _with_trial(state, replace(trial, adopted=True))
    return {
        "tests": judged.tests,
        "tally": judged.tally,
        "failures": (*state.failures, test.id),
        **changes,
        **arrived(judged, {**data, "evidence_test": test.id}, at, "accepted", what),
        **decision(state, at, "accept_other", f"took another failure for as good: {what}, test {test.id}"),
    }


def went_back(state: RunState, data: Data, at: float) -> Changes:
    node = state.nodes[_node(state, data["node"])]
    undone = data.get("rejected")
    nodes = list(state.nodes)
    nodes[node.number] = replace(node, rejected=False)
    if undone is None:
        words = f"went to {place(node)}"
    else:
        last = nodes[_node(state, undone)]
        nodes[last.number] = replace(last, rejected=True)
        words = f"took back {last.what}: {many(len(node.environment))} again"
    # What is not there cannot stay.
    gone = state.pinned.difference(node.environment)
    if gone:
        words += f"; unpinned {told([name for name in state.elements if name in gone])}"
    # Where another failure was accepted in between, it counts there alone.
    judged = with_outcomes(state, data) if "outcomes" in data else state
    return {
        **left_round(state),
        "tests": judged.tests,
        "tally": judged.tally,
        "failures": failures_at(state, node.number),
        "nodes": tuple(nodes),
        "node": node.number,
        "environment": node.environment,
        "pinned": state.pinned - gone,
        "evidence_test": node.evidence_test,
        "lower_bound": 0,
        "minimal": False,
        "history": (*state.history, Point(state.tests_done, len(node.environment))),
        **decision(state, at, "undo" if undone is not None else "go_back", words),
    }


def changed(state: RunState, data: Data, at: float) -> Changes:
    settings = dict(data["settings"])
    before = dict(state.scenario["reduction"])
    words = ", ".join(f"{key} {_limit(before.get(key))} to {_limit(value)}" for key, value in settings.items())
    scenario = {**state.scenario, "reduction": before | settings}
    # A search goes the same way whatever its budget is.
    anew = {} if set(settings) == {"budget"} else searched_anew(state)
    return {**anew, "scenario": scenario, **decision(state, at, "change", f"changed {words}")}


def leg_started(state: RunState, data: Data, _: float) -> Changes:
    """A new search begins from the environment as it is."""
    n_partitions = data["n_partitions"]
    if type(data["round"]) is not int or not (n_partitions is None or (type(n_partitions) is int and n_partitions > 0)):
        raise ValueError(data)
    return searched_anew(state)


def command_refused(state: RunState, data: Data, _: float) -> Changes:
    return {"refusal": (int(data["command"]), str(data["why"]))}


def tried(state: RunState, number: int) -> Trial:
    """The trial of this number. Raises IndexError if there is none."""
    return state.trials[_index(number)]


def told(models: Sequence[str]) -> str:
    """The first names of some models."""
    shown = [name if len(name) <= LONGEST else f"{name[: LONGEST - 1]}…" for name in models[:NAMED]]
    more = f" and {len(models) - NAMED} more" if len(models) > NAMED else ""
    return ", ".join(shown) + more


def place(node: Node) -> str:
    """A node in words."""
    models = many(len(node.environment))
    return f"the whole world, {models}" if node.parent is None else f"{models} ({node.what})"


def _limit(value: object) -> object:
    """A setting in words: a budget may be none."""
    return "no limit" if value is None else value


def _with_trial(state: RunState, trial: Trial) -> Changes:
    trials = list(state.trials)
    trials[trial.number - 1] = trial
    return {"trials": tuple(trials)}


def _index(number: int) -> int:
    if type(number) is not int or number < 1:
        raise IndexError(number)
    return number - 1


def _node(state: RunState, number: int) -> int:
    if type(number) is not int or not 0 <= number < len(state.nodes):
        raise IndexError(number)
    return number
