"""How a run moves from one environment to another, and how a decision of the user is kept: what several events have in common."""

from __future__ import annotations

from dataclasses import replace

from ddenv.runfile.guiding import Decision, Node
from ddenv.runfile.state import Point, RunState
from ddenv.runfile.values import Changes, Data, names


def decision(state: RunState, at: float, kind: str, words: str) -> Changes:
    """One more decision of the user."""
    one = Decision(at, state.tests_done, state.node, kind, words)
    return {"decisions": (*state.decisions, one)}


def arrived(state: RunState, data: Data, at: float, how: str, what: str) -> Changes:
    """The run comes to another environment, a new node below the current one."""
    environment = names(state.elements, data["environment"])
    reduction = state.scenario.get("reduction", {})
    node = Node(
        number=len(state.nodes),
        parent=state.node,
        how=how,
        what=what,
        environment=environment,
        round=None if state.round is None else state.round.number,
        tests=state.tests_done,
        time=at,
        evidence_test=int(data["evidence_test"]),
        method=f"{reduction.get('algorithm', '')} {reduction.get('pair', '')}".strip(),
    )
    inside = set(environment) <= set(state.environment)
    # What the other failure needs is not known yet.
    needed = min(state.lower_bound, len(environment)) if inside and how != "accepted" else 0
    changes = {} if how == "reduced" else left_round(state)
    return changes | {
        "nodes": (*state.nodes, node),
        "node": node.number,
        "environment": environment,
        "evidence_test": node.evidence_test,
        "lower_bound": needed,
        "minimal": False,
        "history": (*state.history, Point(state.tests_done, len(environment), needed)),
    }


def failures_at(state: RunState, number: int) -> tuple[int, ...]:
    """The tests whose ends count as f in a node: f's own, and those of other failures that were accepted on the way there."""
    accepted, node = [], state.nodes[number]
    while node.parent is not None:
        if node.how == "accepted":
            accepted.append(node.evidence_test)
        node = state.nodes[node.parent]
    return (*state.failures[:1], *reversed(accepted))


def left_round(state: RunState) -> Changes:
    """The search that was on is over, and so is its round."""
    changes: Changes = {"confirming": False, **waits_no_more(state)}
    if state.round is not None and not state.round.done:
        changes["round"] = replace(state.round, done=True)
    return changes


def waits_no_more(state: RunState) -> Changes:
    """No candidate waits for accept or reject."""
    working = "paused" if state.paused else "running"
    return {"waiting_candidate": None, "status": working if state.status == "waiting" else state.status}


def searched_anew(state: RunState) -> Changes:
    """The search that was on is over; whether a model can be removed is open again."""
    here = state.nodes[state.node]
    nodes = (*state.nodes[: here.number], replace(here, minimal=False), *state.nodes[here.number + 1 :])
    return {**left_round(state), "minimal": False, "nodes": nodes}
