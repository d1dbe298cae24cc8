"""Folds the events of certificates: what fresh runs show, and where the run goes on by them."""

from __future__ import annotations

from dataclasses import replace

from ddenv.runfile.events import Changes, Data, chance, names, one_of, whole
from ddenv.runfile.fold_decisions import arrived, here, listed, origin, searched_anew
from ddenv.runfile.persistent import PersistentTuple
from ddenv.runfile.progress import Certificate, Claim, Point
from ddenv.runfile.state import FRESH, OUTCOMES, RunState, Test


def certificate_started(state: RunState, data: Data, _: float) -> Changes:
    one = Certificate(
        number=whole(data["certificate"]),
        node=state.node,
        first_run=whole(data["run"]),
        keep_rate=chance(data["keep_rate"]),
        rate=chance(data["rate"]),
        error=chance(data["error"]),
        at_least=whole(data["at_least"]),
        branch=origin(state, state.node).parent is not None,
    )
    if one.number != len(state.certificates) + 1 or not one.error or one.first_run < 0 or one.at_least < 0:
        raise ValueError(one.number)
    now = state.changed(certificates=(*state.certificates, one))
    # Some may have been made ahead of time.
    fresh = PersistentTuple.of(test for test in state.fresh if _is_of_last(now, state.tests[test - 1]))
    return {"confirming": True, "certificates": now.certificates, "fresh": fresh}


def with_fresh(state: RunState, test: Test) -> Changes:
    """A test starts that may be one of a certificate."""
    return {"fresh": state.fresh.added(test.id)} if _is_of_last(state, test) else {}


def _is_of_last(state: RunState, test: Test) -> bool:
    """Whether it is a test of the last certificate, or of the first one that may come."""
    return test.phase in FRESH and (not state.certificates or test.run >= state.certificates[-1].first_run)


def certificate_finished(state: RunState, data: Data, _: float) -> Changes:
    _check_tests(state, data)
    claims = tuple(_claim(state, claim) for claim in data["claims"])
    last = replace(state.certificates[-1], claims=claims)
    return {"certificates": (*state.certificates[:-1], last)}


def _claim(state: RunState, data: Data) -> Claim:
    without, shown, runs = data["without"], whole(data["shown"]), whole(data["runs"])
    if not 0 <= shown <= runs or (data["verdict"] == "lost" and not runs):
        raise ValueError(shown)
    return Claim(
        without=None if without is None else names(state.elements, [without])[0],
        verdict=one_of(data["verdict"], "kept", "lost", "needed", "not needed", "not shown", "unknown"),
        shown=shown,
        runs=runs,
        low=chance(data["low"]),
        high=chance(data["high"]),
        outcomes=tuple((one_of(outcome, *OUTCOMES), int(number)) for outcome, number in data["outcomes"].items()),
    )


def _check_tests(state: RunState, data: Data) -> None:
    """The tests that it rests on have to be there."""
    for test in data.get("tests", ()):
        if not 0 < test <= len(state.tests):
            raise ValueError(test)


def rate_lost(state: RunState, data: Data, _: float) -> Changes:
    """What is left shows f too rarely: the run goes back to the last environment that keeps the rate."""
    _check_tests(state, data)
    node, lost = here(state, data["node"]), here(state, data["lost"])
    for group in data["again"]:
        names(state.elements, group)
    nodes = list(state.nodes)
    nodes[lost.number] = replace(lost, lost_rate=True)
    return {
        **searched_anew(state),
        "nodes": tuple(nodes),
        "node": node.number,
        "came_at": state.tests_done,
        "environment": node.environment,
        "evidence_test": node.evidence_test,
        "lower_bound": 0,
        "history": (*state.history, Point(state.tests_done, len(node.environment))),
    }


def left_out(state: RunState, data: Data, at: float) -> Changes:
    without = names(state.elements, [data["without"]])[0]
    runs = [test.id for test in state.confirm_tests if (test.node, test.without) == (state.node, without)]
    return arrived(state, data, at, "certified", f"without {listed([without])}", runs)
