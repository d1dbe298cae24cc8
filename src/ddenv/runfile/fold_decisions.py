"""Folds the user's decisions: pins, selections tried by hand, changed settings, going back and
branches; and each arrival.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ddenv.environment import Environment, Numbers
from ddenv.run_numbers import CERTIFICATES
from ddenv.runfile.fold_tests import (
    Changes,
    baseline_finished,
    counted_again,
    same_runs,
    seen,
    with_node,
    with_outcomes,
    with_trial,
)
from ddenv.runfile.progress import Decision, Isolation, Node, Point, Refusal, Search, path
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState, Test, Trial
from ddenv.settings import SETTINGS, read
from ddenv.text import Data, count, first_of, plain, truncated

if TYPE_CHECKING:
    from ddenv.runfile import events as e

# Maximum number of models that a decision names, and maximum length of a name.
NAMED = 3
LONGEST = 40


def pinned(state: RunState, event: e.Pinned, at: float) -> Changes:
    models = [state.elements[model] for model in event.models]
    said = decision(state, at, "pin", f"pinned {listed(models)}")
    return {**searched_anew(state), "pinned": state.pinned.union(models), **said}


def unpinned(state: RunState, event: e.Unpinned, at: float) -> Changes:
    models = [state.elements[model] for model in event.models]
    said = decision(state, at, "unpin", f"unpinned {listed(models)}")
    return {**searched_anew(state), "pinned": state.pinned.difference(models), **said}


def trial_started(state: RunState, event: e.TrialStarted, at: float) -> Changes:
    names = state.environments[event.environment].names(state.elements)
    trial = Trial(number=event.trial, models=names, node=state.node, environment=event.environment)
    if trial.number != len(state.trials) + 1:
        raise ValueError(trial.number)
    inside = frozenset(names)
    without = [name for name in state.environment if name not in inside]
    if 0 < len(without) <= trial.size:
        what = f"without {listed(without)}"
    else:
        what = f"with {listed(names)} alone"
    words = f"tried {trial.size} of {len(state.environment)} models ({trial.label}): {what}"
    return {"trials": (*state.trials, trial), **decision(state, at, "try", words)}


def trial_judged(state: RunState, event: e.TrialJudged, _: float) -> Changes:
    trial = state.trials[event.trial - 1]
    judged = replace(trial, verdict=event.verdict, tests=event.tests)
    return with_trial(state, judged) | {
        "left_unknown": state.left_unknown or event.verdict == "unknown"
    }


def adopted(state: RunState, event: e.Adopted, at: float) -> Changes:
    trial = replace(state.trials[event.trial - 1], adopted=True)
    said = decision(state, at, "adopt", f"adopted {trial.label}: {count(trial.size, 'model')}")
    there = arrived(
        state, event.environment, event.evidence_test, at, "adopted", trial.label, trial.tests
    )
    return with_trial(state, trial) | there | said


def accepted_other(state: RunState, event: e.AcceptedOther, at: float) -> Changes:
    """Another failure counts as f from now on, and the environment that showed it becomes the
    current one.
    """
    test = state.test(event.test)
    # A trial has a number; otherwise `what` names the candidate.
    trial = None if event.trial is None else state.trials[event.trial - 1]
    what = event.what if trial is None else trial.label
    changes = with_outcomes(state, event.judged)
    judged = state.changed(**changes, nodes=counted_again(state.nodes, changes["tests"]))
    runs = same_runs(judged, test)
    if event.instead:
        # In place of what was f, in a branch.
        changes |= arrived(
            judged, event.environment, test.id, at, "instead", what, runs, below=test.node
        )
        gone = state.pinned.difference(changes["environment"])
        changes |= {"failures": (test.id,), "pinned": state.pinned - gone}
        words = f"branched to another failure, now f: {what}{_unpinned(state, gone)}"
    else:
        changes |= arrived(judged, event.environment, test.id, at, "accepted", what, runs)
        changes |= {"failures": (*state.failures, test.id)}
        changes |= {} if trial is None else with_trial(state, replace(trial, adopted=True))
        words = f"accepted another failure as f: {what}, test {test.id}"
    return changes | decision(state, at, "accept_other", words)


def _unpinned(state: RunState, gone: frozenset[str]) -> str:
    """Models that are not in the new environment cannot stay pinned."""
    if gone:
        return f"; unpinned {listed([name for name in state.elements if name in gone])}"
    return ""


def went_back(state: RunState, event: e.WentBack, at: float) -> Changes:
    """An undone reduction is not accepted again; an environment that the user goes to is wanted."""
    node = state.nodes[event.node]
    wanted = state.environments[node.id]
    changes: Changes = {
        "refused": tuple(refusal for refusal in state.refused if refusal.environment != wanted),
        "lost": tuple(
            one for one in state.lost if one[0] != state.failures or not wanted <= one[1]
        ),
    }
    state = state.changed(**changes)
    nodes = with_node(state.nodes, replace(node, rejected=False, lost_rate=False))
    kind = "go_back"
    words = f"went to {place(node)}"
    if event.rejected is not None:
        last = nodes[event.rejected]
        nodes = with_node(nodes, replace(last, rejected=True))
        kind = "undo"
        words = f"took back {last.what}: {count(len(node.environment), 'model')} again"
        changes |= refused(state, state.environments[last.id], "undone", None)
    gone = state.pinned.difference(node.environment)
    words += _unpinned(state, gone)
    # A failure accepted after this node does not count as f here.
    if event.judged is not None:
        changes |= with_outcomes(state, event.judged)
        nodes = counted_again(nodes, changes["tests"])
    return {
        **changes,
        **left_round(state),
        "search_due": True,
        "failures": failures_at(state, node.number),
        "nodes": nodes,
        "pinned": state.pinned - gone,
        **at_node(state, node),
        **decision(state, at, kind, words),
    }


def changed(state: RunState, event: e.Changed, at: float) -> Changes:
    said = {
        key: [read(state.scenario, SETTINGS[key]), value] for key, value in event.settings.items()
    }
    limits = {
        key: ["no limit" if one is None else one for one in both] for key, both in said.items()
    }
    words = ", ".join(f"{key} from {old} to {new}" for key, (old, new) in limits.items())
    changes: Changes = {"scenario": with_settings(state.scenario, event.settings)}
    changes |= decision(state, at, "change", f"changed {words}")
    if event.baseline is not None:
        return changes | _judged_anew(state, event.baseline, at)
    # The budget does not affect the search.
    if set(event.settings) == {"budget"}:
        return changes
    return changes | searched_anew(state)


def with_settings(scenario: Data, new: Mapping[str, Any]) -> Data:
    """A scenario as plain data with new values of settings. Raises KeyError for a setting that
    there is not.
    """
    sections = {SETTINGS[name].section for name in new}
    return scenario | {
        section: scenario[section]
        | {name: one for name, one in new.items() if SETTINGS[name].section == section}
        for section in sections
    }


def _judged_anew(state: RunState, baseline: e.BaselineFinished, at: float) -> Changes:
    """Other runs show f now, so the search begins from the whole world again; tests keep their
    ends.
    """
    changes = left_round(state)
    changes |= baseline_finished(state.changed(**changes), baseline, at)
    state = state.changed(**changes)
    nodes = counted_again(state.nodes, state.tests)
    return {
        **changes,
        **at_node(state, nodes[0]),
        "nodes": nodes,
        "search_due": True,
        "lost": (),
        "steps_back": 0,
        "again": (),
    }


def leg_started(state: RunState, event: e.LegStarted, _: float) -> Changes:
    """A search starts from the current environment."""
    if state.evidence_test is None:
        raise ValueError("f is not known")
    search = Search(
        first_round=event.round,
        node=state.node,
        n_partitions=event.n_partitions,
        pinned=state.pinned,
        evidence_test=state.evidence_test,
        settings=state.scenario["reduction"],
        rate=event.rate,
        steps_back=state.steps_back,
        tests=tuple(test for test in state.judged if state.test(test).is_finished),
        again=state.again,
    )
    return {
        **searched_anew(state),
        "search_due": False,
        "forecast": None,
        "search": search,
        "again": (),
    }


def arrived(
    state: RunState,
    number: int,
    evidence_test: int,
    at: float,
    how: str,
    what: str,
    tests: Iterable[int],
    below: int = -1,
) -> Changes:
    """The run moves to environment `number`, a new node below the current one, or below node number
    `below`; `tests` ran it.
    """
    environment = state.environments[number].names(state.elements)
    reduction = state.scenario.get("reduction", {})
    runs, shown = seen(state.tests, tests)
    parent = state.node if below < 0 else below
    node = Node(
        number=len(state.nodes),
        parent=parent,
        how=how,
        what=what,
        environment=environment,
        id=number,
        n_partitions=None if state.round is None else state.round.n_partitions,
        round=None if state.round is None else state.round.number,
        tests=state.tests_done,
        own_tests=state.nodes[parent].own_tests
        + (state.tests_done - state.came_at) * (parent == state.node),
        time=at,
        evidence_test=evidence_test,
        method=f"{reduction.get('algorithm', '')} {reduction.get('pair', '')}".strip(),
        runs=runs,
        shown=shown,
    )
    inside = state.environments[number] <= state.environments[state.nodes[state.node].id]
    # Nothing is known yet about what another failure needs.
    if inside and how not in ("accepted", "instead"):
        needed = min(state.lower_bound, len(environment))
    else:
        needed = 0
    changes = {} if how == "reduced" else left_round(state) | {"search_due": True}
    return changes | at_node(state, node, needed) | {"nodes": (*state.nodes, node)}


def at_node(state: RunState, node: Node, needed: int = 0) -> Changes:
    """The run is at a node from now on; at least `needed` of its models are known to be needed."""
    return {
        "node": node.number,
        "came_at": state.tests_done,
        "environment": node.environment,
        "evidence_test": node.evidence_test,
        "lower_bound": needed,
        "minimal": False,
        "history": (*state.history, Point(state.tests_done, len(node.environment), needed)),
    }


def decision(state: RunState, at: float, kind: str, words: str) -> Changes:
    """One more decision of the user."""
    return {
        "decisions": (
            *state.decisions,
            Decision(time=at, tests=state.tests_done, node=state.node, kind=kind, words=words),
        )
    }


def refused(state: RunState, environment: Environment, verdict: str, round: int | None) -> Changes:
    """An environment is not taken any more, because of a decision in this round."""
    known = any(refusal.environment == environment for refusal in state.refused)
    more = () if known else (Refusal(environment, verdict, round),)
    return {"refused": (*state.refused, *more), "refusals": state.refusals + 1}


def failures_at(state: RunState, number: int) -> Numbers:
    """The tests whose failures count as f in a node: that of f in its branch, and those accepted on
    the way from there.
    """
    way = path(state.nodes, number)
    first = origin(state, number)
    counted = (node for node in way[way.index(first) :] if node is first or node.how == "accepted")
    return tuple(node.evidence_test for node in counted if node.evidence_test is not None)


def origin(state: RunState, number: int) -> Node:
    """Where f in a node was seen first: the whole world, or the start of a branch that reduces
    another failure.
    """
    way = path(state.nodes, number)
    return next((node for node in reversed(way) if node.how == "instead"), way[0])


def exact_runs(state: RunState) -> Numbers:
    """The runs that `accept_rate: exact` reduces: the first ones that showed f where it was seen.
    None with other rules.
    """
    asked = settings(state)
    whole = origin(state, state.node).id
    if asked.accept_rate != "exact":
        return ()
    tests = (test for test in rested_on(state) if test.environment == whole and test.shows_f)
    return tuple(
        sorted({test.run for test in tests if test.run < CERTIFICATES.start})[: asked.exact_seeds]
    )


def stands_for_all(state: RunState) -> bool:
    """Whether a single run is reduced exactly that has the same bits with any seed, as far as the
    baseline shows.
    """
    return state.baseline is not None and state.baseline.alike and settings(state).reduces_one_run


def broken_runs(state: RunState) -> Numbers:
    """The runs of the baseline that broke each time, ascending."""
    runs: dict[int, bool] = {}
    for test in state.tests:
        if test.phase == "baseline" and test.is_finished:
            runs[test.run] = runs.get(test.run, True) and test.broke
    return tuple(sorted(run for run, broke in runs.items() if broke))


def rested_on(state: RunState) -> tuple[Test, ...]:
    """The tests that decisions rest on, without those that only ran ahead of time."""
    began = state.baseline is not None
    return tuple(
        test
        for test in state.tests
        if state.rests_on >> test.id & 1 or (began and test.phase == "baseline")
    )


def left_round(state: RunState) -> Changes:
    """The current search and its round are over."""
    past = tuple(replace(certificate, past=True) for certificate in state.certificates)
    return {
        "confirming": False,
        "certificates": past,
        "isolations": without_open(state),
        "margins": None
        if state.margins is None
        else replace(state.margins, broken_off=not state.margins.ended),
        "round": None if state.round is None else replace(state.round, done=True),
        **waits_no_more(state),
    }


def without_open(state: RunState) -> tuple[Isolation, ...]:
    """All isolations; the one that is under way, if there is one, is broken off."""
    last = state.isolating
    if last is None:
        return state.isolations
    return (*state.isolations[:-1], replace(last, broken_off=True))


def waits_no_more(state: RunState) -> Changes:
    """No reduction waits for the user any more."""
    working = "paused" if state.paused else "running"
    return {
        "waiting_candidate": None,
        "status": working if state.status == "waiting" else state.status,
    }


def searched_anew(state: RunState) -> Changes:
    """The current search is over; the environment may no longer be minimal."""
    nodes = with_node(state.nodes, replace(state.nodes[state.node], minimal=False))
    return {**left_round(state), "search_due": True, "minimal": False, "nodes": nodes}


def place(node: Node) -> str:
    """A node in words."""
    models = count(len(node.environment), "model")
    return (
        f"the whole world ({models})"
        if node.parent is None
        else f"{models} (#{node.number}, {plain(node.what)})"
    )


def listed(models: Sequence[str]) -> str:
    """The first few names of `models`."""
    return first_of([truncated(name, LONGEST) for name in models], NAMED)
