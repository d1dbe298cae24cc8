"""Folds the user's decisions: pins, selections tried by hand, changed settings, going back and branches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from ddenv.amounts import count
from ddenv.runfile.events import Changes, Data, names, number, one_of, whole
from ddenv.runfile.fold_isolation import without_open
from ddenv.runfile.fold_rates import counted_again, same_runs, seen
from ddenv.runfile.progress import Point
from ddenv.runfile.state import Decision, Node, RunState, Test, Trial

# Maximum number of models that a decision names, and maximum length of a name.
NAMED, LONGEST = 3, 40


def pinned(state: RunState, data: Data, at: float) -> Changes:
    models = names(state.elements, data["models"])
    words = f"pinned {listed(models)}{_cut_short(state)}"
    return {**searched_anew(state), "pinned": state.pinned.union(models), **decision(state, at, "pin", words)}


def unpinned(state: RunState, data: Data, at: float) -> Changes:
    models = names(state.elements, data["models"])
    words = f"unpinned {listed(models)}{_cut_short(state)}"
    return {**searched_anew(state), "pinned": state.pinned.difference(models), **decision(state, at, "unpin", words)}


def _cut_short(state: RunState) -> str:
    """That the round ends with candidates that were not tried, or that the certificate is not finished."""
    now = state.certificate
    if now is not None and state.confirming and not now.claims:
        return f"; certificate {now.number} broken off"
    untried = 0 if state.round is None else len(state.round.untried)
    return f"; round {state.round.number} ended with {untried} untried" if state.round and untried else ""


def trial_started(state: RunState, data: Data, at: float) -> Changes:
    trial = Trial(whole(data["trial"]), names(state.elements, data["models"]), state.node)
    if trial.number != len(state.trials) + 1 or len(set(trial.models)) != len(trial.models):
        raise ValueError(trial.number)
    inside = frozenset(trial.models)
    without = [name for name in state.environment if name not in inside]
    what = f"without {listed(without)}" if 0 < len(without) <= trial.size else f"with {listed(trial.models)} alone"
    words = f"tried {trial.size} of {len(state.environment)} models ({trial.label}): {what}"
    return {"trials": (*state.trials, trial), **decision(state, at, "try", words)}


def trial_judged(state: RunState, data: Data, _: float) -> Changes:
    tests = tuple(map(whole, data["tests"]))
    trial, verdict = tried(state, data["trial"]), one_of(data["verdict"], "similar", "dissimilar", "unknown")
    return _with_trial(state, replace(trial, verdict=verdict, tests=tests, known=whole(data["known"])))


def adopted(state: RunState, data: Data, at: float) -> Changes:
    trial = replace(tried(state, data["trial"]), adopted=True)
    words = f"adopted {trial.label}: {count(trial.size, 'model')}"
    return {
        **_with_trial(state, trial),
        **arrived(state, data, at, "adopted", trial.label, trial.tests),
        **decision(state, at, "adopt", words),
    }


def accepted_other(state: RunState, data: Data, at: float) -> Changes:
    """Another failure counts as f from now on, and the environment that showed it becomes the current one."""
    test = state.tests[_index(data["test"])]
    # A trial has a number; otherwise `what` names the candidate.
    trial = None if data.get("trial") is None else tried(state, data["trial"])
    what = trial.label if trial else str(data["what"])
    judged = with_outcomes(state, data)
    judged = judged.changed(nodes=counted_again(judged.nodes, judged.tests))
    if data.get("instead"):
        return _branched(judged, test, data, at, what)
    changes = {} if trial is None else _with_trial(state, replace(trial, adopted=True))
    return {
        "tests": judged.tests,
        "tally": judged.tally,
        "failures": (*state.failures, test.id),
        **changes,
        **arrived(judged, {**data, "evidence_test": test.id}, at, "accepted", what, same_runs(judged, test)),
        **decision(state, at, "accept_other", f"accepted another failure as f: {what}, test {test.id}"),
    }


def _branched(state: RunState, test: Test, data: Data, at: float, what: str) -> Changes:
    """Another failure is f from now on, in place of what was f, in the environment that showed it."""
    arrival = arrived(
        state, {**data, "evidence_test": test.id}, at, "instead", what, same_runs(state, test), below=test.node
    )
    gone = state.pinned.difference(arrival["environment"])
    words = f"branched to another failure, now f: {what}{_unpinned(state, gone)}"
    return {
        "tests": state.tests,
        "tally": state.tally,
        "failures": (test.id,),
        "pinned": state.pinned - gone,
        **arrival,
        **decision(state, at, "accept_other", words),
    }


def _unpinned(state: RunState, gone: frozenset[str]) -> str:
    """Models that are not in the new environment cannot stay pinned."""
    return f"; unpinned {listed([name for name in state.elements if name in gone])}" if gone else ""


def went_back(state: RunState, data: Data, at: float) -> Changes:
    node = here(state, data["node"])
    undone = data.get("rejected")
    nodes = list(state.nodes)
    nodes[node.number] = replace(node, rejected=False, lost_rate=False)
    if undone is None:
        words = f"went to {place(node)}"
    else:
        last = nodes[here(state, undone).number]
        nodes[last.number] = replace(last, rejected=True)
        words = f"took back {last.what}: {count(len(node.environment), 'model')} again"
    gone = state.pinned.difference(node.environment)
    words += _unpinned(state, gone)
    # A failure accepted after this node does not count as f here.
    judged = state
    if "outcomes" in data:
        judged = with_outcomes(state, data)
        nodes = list(counted_again(nodes, judged.tests))
    return {
        **left_round(state),
        "tests": judged.tests,
        "tally": judged.tally,
        "failures": failures_at(state, node.number),
        "nodes": tuple(nodes),
        "node": node.number,
        "came_at": state.tests_done,
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
    words = ", ".join(f"{key} from {_limit(before.get(key))} to {_limit(value)}" for key, value in settings.items())
    scenario = {**state.scenario, "reduction": before | settings}
    # The budget does not affect the search.
    anew = {} if set(settings) == {"budget"} else searched_anew(state)
    return {**anew, "scenario": scenario, **decision(state, at, "change", f"changed {words}")}


def leg_started(state: RunState, data: Data, _: float) -> Changes:
    """A new search starts from the current environment."""
    n_partitions = data["n_partitions"]
    if type(data["round"]) is not int or not (n_partitions is None or (type(n_partitions) is int and n_partitions > 0)):
        raise ValueError(data)
    return {**searched_anew(state), "forecast": None}


def command_refused(state: RunState, data: Data, _: float) -> Changes:
    return {"refusal": (whole(data["command"]), str(data["why"]))}


def arrived(
    state: RunState, data: Data, at: float, how: str, what: str, tests: Iterable[int], below: int | None = None
) -> Changes:
    """The run moves to another environment, a new node below the current one, or below node number `below`; `tests` ran it."""
    environment = names(state.elements, data["environment"])
    reduction = state.scenario.get("reduction", {})
    runs, shown = seen(state.tests, tests)
    parent = state.node if below is None else below
    node = Node(
        number=len(state.nodes),
        parent=parent,
        how=how,
        what=what,
        environment=environment,
        round=None if state.round is None else state.round.number,
        tests=state.tests_done,
        own_tests=state.nodes[parent].own_tests + (state.tests_done - state.came_at) * (parent == state.node),
        time=at,
        evidence_test=whole(data["evidence_test"]),
        method=f"{reduction.get('algorithm', '')} {reduction.get('pair', '')}".strip(),
        runs=runs,
        shown=shown,
    )
    inside = set(environment) <= set(state.environment)
    # Nothing is known yet about what another failure needs.
    needed = min(state.lower_bound, len(environment)) if inside and how not in ("accepted", "instead") else 0
    changes = {} if how == "reduced" else left_round(state)
    return changes | {
        "nodes": (*state.nodes, node),
        "node": node.number,
        "came_at": state.tests_done,
        "environment": environment,
        "evidence_test": node.evidence_test,
        "lower_bound": needed,
        "minimal": False,
        "history": (*state.history, Point(state.tests_done, len(environment), needed)),
    }


def decision(state: RunState, at: float, kind: str, words: str) -> Changes:
    """One more decision of the user."""
    one = Decision(at, state.tests_done, state.node, kind, words)
    return {"decisions": (*state.decisions, one)}


def failures_at(state: RunState, number: int) -> tuple[int, ...]:
    """The tests whose failures count as f in a node: that of f in its branch, and those accepted on the way from there."""
    accepted: list[int] = []
    node, first = state.nodes[number], origin(state, number)
    while node.parent is not None and node.number != first.number:
        if node.how == "accepted" and node.evidence_test is not None:
            accepted.append(node.evidence_test)
        node = state.nodes[node.parent]
    f = () if first.evidence_test is None else (first.evidence_test,)
    return (*f, *reversed(accepted))


def origin(state: RunState, number: int) -> Node:
    """Where f in a node was seen first: the whole world, or the start of a branch that reduces another failure."""
    node = state.nodes[number]
    while node.how != "instead" and node.parent is not None:
        node = state.nodes[node.parent]
    return node


def left_round(state: RunState) -> Changes:
    """The current search and its round are over."""
    last = state.certificates[-1:]
    past = (*state.certificates[:-1], *(replace(one, past=True) for one in last))
    changes: Changes = {
        "confirming": False,
        "certificates": past,
        "isolations": without_open(state),
        **waits_no_more(state),
    }
    if state.round is not None and not state.round.done:
        changes["round"] = replace(state.round, done=True)
    return changes


def waits_no_more(state: RunState) -> Changes:
    """No reduction waits for the user any more."""
    working = "paused" if state.paused else "running"
    return {"waiting_candidate": None, "status": working if state.status == "waiting" else state.status}


def searched_anew(state: RunState) -> Changes:
    """The current search is over; the environment may no longer be minimal."""
    here = state.nodes[state.node]
    nodes = (*state.nodes[: here.number], replace(here, minimal=False), *state.nodes[here.number + 1 :])
    return {**left_round(state), "minimal": False, "nodes": nodes}


def with_outcomes(state: RunState, data: Data) -> RunState:
    """The state with the outcomes of tests updated, after f was fixed or another failure began to count as f."""
    for test, outcome in data["outcomes"].items():
        distance = data["distances"].get(test)
        values = {"outcome": str(outcome), "distance": None if distance is None else number(distance)}
        state = state.changed(**with_test(state, int(test), values))
    return state


def with_test(state: RunState, id: int, values: Data) -> Changes:
    if id < 1:
        raise IndexError(id)
    before = state.tests[id - 1]
    after = replace(before, **values)
    return {"tests": state.tests.changed(id - 1, after), **counts(state, before, after)}


def counts(state: RunState, before: Test | None, after: Test) -> Changes:
    tally, reruns = dict(state.tally), state.deflake_runs + after.is_deflake_run
    # An unknown outcome is a KeyError, so that a file cannot make the tally long.
    tally[after.outcome] += 1
    if before is not None:
        tally[before.outcome] -= 1
        reruns -= before.is_deflake_run
    return {"tally": tally, "deflake_runs": reruns}


def place(node: Node) -> str:
    """A node in words."""
    models = count(len(node.environment), "model")
    return f"the whole world, {models}" if node.parent is None else f"{models} ({node.what})"


def listed(models: Sequence[str]) -> str:
    """The first few names of `models`."""
    shown = [name if len(name) <= LONGEST else f"{name[: LONGEST - 1]}…" for name in models[:NAMED]]
    more = f" and {len(models) - NAMED} more" if len(models) > NAMED else ""
    return ", ".join(shown) + more


def tried(state: RunState, number: int) -> Trial:
    """The trial with this number. Raises IndexError if there is none."""
    return state.trials[_index(number)]


def _limit(value: object) -> object:
    """A setting in words; a budget may be None."""
    return "no limit" if value is None else value


def _with_trial(state: RunState, trial: Trial) -> Changes:
    trials = list(state.trials)
    trials[trial.number - 1] = trial
    return {"trials": tuple(trials)}


def _index(number: int) -> int:
    if type(number) is not int or number < 1:
        raise IndexError(number)
    return number - 1


def here(state: RunState, number: int) -> Node:
    """The node with this number. Raises IndexError if there is none."""
    if type(number) is not int or not 0 <= number < len(state.nodes):
        raise IndexError(number)
    return state.nodes[number]
