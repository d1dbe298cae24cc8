"""Folds what runs show: certificates, isolation, margins, and slices with their audits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ddenv.runfile import events as e
from ddenv.runfile.fold_decisions import (
    arrived,
    at_node,
    decision,
    listed,
    origin,
    searched_anew,
    without_open,
)
from ddenv.runfile.fold_tests import Changes, shared, with_node, with_removal, with_test
from ddenv.runfile.progress import (
    Certificate,
    Check,
    Claim,
    Isolation,
    Margins,
    Node,
    NumberTried,
    Returned,
)
from ddenv.runfile.state import OUTCOMES, PersistentTuple, RunState


def certificate_started(state: RunState, event: e.CertificateStarted, _: float) -> Changes:
    special = {
        "number": event.certificate,
        "node": state.node,
        "first_run": event.run,
        "certify_rate": event.certify_rate or event.keep_rate,
        "branch": origin(state, state.node).parent is not None,
    }
    certificate = Certificate(**shared(event, Certificate) | special)
    if certificate.number != len(state.certificates) + 1:
        raise ValueError(certificate.number)
    fresh = PersistentTuple.of(test for test in state.fresh if state.test(test).run >= event.run)
    return {"confirming": True, "certificates": (*state.certificates, certificate), "fresh": fresh}


def certificate_finished(state: RunState, event: e.CertificateFinished, _: float) -> Changes:
    _check_tests(state, event.tests)
    claims = []
    for made in event.claims:
        known = made.environment < len(state.environments) and all(
            outcome in OUTCOMES for outcome in made.outcomes
        )
        if not known or made.shown > made.runs or (made.verdict == "lost" and not made.runs):
            raise ValueError(made)
        special = {"without": _name(state, made.without), "outcomes": tuple(made.outcomes.items())}
        claims.append(Claim(**shared(made, Claim) | special))
    last = replace(state.certificates[-1], claims=tuple(claims), elsewhere=event.elsewhere)
    unknown = any(claim.verdict == "unknown" for claim in claims)
    return {
        "certificates": (*state.certificates[:-1], last),
        "left_unknown": state.left_unknown or unknown,
    }


def _name(state: RunState, model: int | None) -> str | None:
    if model is None:
        return None
    return state.elements[model]


def _check_tests(state: RunState, tests: Sequence[int]) -> None:
    if max(tests, default=0) > len(state.tests):
        raise ValueError(tests)


def rate_lost(state: RunState, event: e.RateLost, _: float) -> Changes:
    """What is left shows f too rarely: the run goes back to the last environment not shown to."""
    _check_tests(state, event.tests)
    node = state.nodes[event.node]
    lost = state.nodes[event.lost]
    if any(model >= len(state.elements) for group in event.again for model in group):
        raise ValueError(event.again)
    return {
        **searched_anew(state),
        "nodes": with_node(state.nodes, replace(lost, lost_rate=True)),
        "lost": (*state.lost, (state.failures, state.environments[lost.id])),
        "steps_back": state.steps_back + 1,
        "again": event.again,
        **at_node(state, node),
    }


def left_out(state: RunState, event: e.LeftOut, at: float) -> Changes:
    without = state.elements[event.without]
    runs = [test.id for test in state.confirm_tests if test.environment == event.environment]
    what = f"without {listed([without])}"
    how = "left_out" if event.by_user else "certified"
    if event.by_user:
        said = decision(state, at, "leave_out", f"left out {listed([without])}, which only helped")
    else:
        said = {}
    return arrived(state, event.environment, event.evidence_test, at, how, what, runs) | said


def isolation_started(state: RunState, event: e.IsolationStarted, _: float) -> Changes:
    sound = 0 < event.rather_than < event.wanted < 1
    if event.isolation != len(state.isolations) + 1 or not sound or state.baseline is None:
        raise ValueError(event.isolation)
    if max(event.suspects, default=0) >= len(state.elements):
        raise ValueError("suspects")
    return {"isolations": (*without_open(state), Isolation(asked=event))}


def removal_judged(state: RunState, event: e.RemovalJudged, _: float) -> Changes:
    _check_tests(state, event.tests)
    removals, number = with_removal(state, event.environment)
    after = replace(removals[number - 1], verdict=event.verdict, tests=event.tests)
    return {"removals": removals.changed(number - 1, after)}


def isolation_checked(state: RunState, event: e.IsolationChecked, _: float) -> Changes:
    _check_tests(state, event.tests)
    last = _open(state)
    removals, number = with_removal(state, event.environment)
    claims = []
    for made in event.claims:
        of_others = ("needed", "not needed") if made.back is None else ("passes", "fails")
        if made.reached > made.runs or made.verdict in of_others:
            raise ValueError(made)
        claims.append(Returned(**shared(made, Returned) | {"back": _name(state, made.back)}))
    check = Check(number, tuple(claims))
    if not check.claims or check.claims[0].back is not None:
        raise ValueError(event)
    return {
        "removals": removals,
        "isolations": (*state.isolations[:-1], replace(last, checks=(*last.checks, check))),
    }


def isolation_found(state: RunState, event: e.IsolationFinished) -> Changes:
    last = _open(state)
    removal = None if event.environment is None else with_removal(state, event.environment)[1]
    if removal is not None and (not last.checks or last.checks[-1].removal != removal):
        raise ValueError(removal)
    return {"isolations": (*state.isolations[:-1], replace(last, ended=True, found=removal))}


def _open(state: RunState) -> Isolation:
    """The isolation that is under way. Raises ValueError if there is none."""
    if state.isolating is None:
        raise ValueError("no isolation")
    return state.isolating


def margins_started(state: RunState, event: e.MarginsStarted, _: float) -> Changes:
    """Numbers that were asked for before keep their runs, as long as they are about the same
    models.
    """
    names = tuple(asked.name for asked in event.numbers)
    sound = all(one.low <= one.now <= one.high and one.low < one.high for one in event.numbers)
    if (
        not names
        or len(set(names)) != len(names)
        or not sound
        or not event.rate
        or state.baseline is None
    ):
        raise ValueError(names)
    if event.environment >= len(state.environments):
        raise ValueError(event.environment)
    asked = tuple(NumberTried(one, event.rate, event.error) for one in event.numbers)
    last = state.margins
    if last is None or last.asked.environment != event.environment:
        return {
            "margins": Margins(asked=event, numbers=asked, earlier=0 if last is None else last.made)
        }
    numbers = (*(one for one in last.numbers if one.asked.name not in names), *asked)
    now = replace(
        last,
        asked=event,
        numbers=numbers,
        before_call=len(last.runs),
        ended=False,
        broken_off=False,
    )
    return {"margins": now}


def margin_ran(state: RunState, event: e.MarginRan | e.MarginImpossible, _: float) -> Changes:
    """A run with a changed number has ended, or a number cannot have a value."""
    last = open_margins(state)
    if event.name not in last.wanted:
        raise ValueError(event.name)
    if isinstance(event, e.MarginRan):
        return {"margins": replace(last, runs=(*last.runs, event))}
    return {"margins": replace(last, impossible=(*last.impossible, event))}


def open_margins(state: RunState) -> Margins:
    """The search for margins that is under way. Raises ValueError if there is none."""
    if state.margining is None:
        raise ValueError("no search for margins")
    return state.margining


def sliced(state: RunState, event: e.Sliced, at: float) -> Changes:
    """The environment is cut down to what took part in the runs known there."""
    _check_tests(state, event.tests)
    if not event.tests or any(state.test(test).took_part is None for test in event.tests):
        raise ValueError(event.tests)
    changes = arrived(state, event.environment, event.evidence_test, at, "sliced", "the slice", ())
    *others, last = changes["nodes"]
    return changes | {
        "nodes": (*others, replace(last, sliced_by=event.tests, to_audit=event.audit))
    }


def slices_refuted(state: RunState, event: e.SlicesRefuted, _: float) -> Changes:
    """An implied test, simulated after all, does not have the bits of the run that implies it.

    The results of all implied tests are void. The run goes back to the last environment that rests
    on none.
    """
    audit = state.test(event.test)
    node = state.nodes[event.node]
    path = state.changed(node=node.number).path
    if audit.audits != event.by or any(rests_on_slices(state, earlier) for earlier in path):
        raise ValueError(event.by)
    for test in state.tests:
        if test.implied_by is not None and test.is_finished:
            state = state.changed(**with_test(state, test.id, {"outcome": "lost"}))
    nodes = []
    for reached in state.nodes:
        runs = [test for test in state.tests_of(reached.runs) if test.implied_by is None]
        if len(runs) < len(reached.runs):
            shown = sum(test.shows_f for test in runs)
            reached = replace(reached, runs=tuple(test.id for test in runs), shown=shown)
        nodes.append(reached)
    # Void tests are no longer counted.
    done = state.tests_done
    history = tuple(replace(point, tests=min(point.tests, done)) for point in state.history)
    state = state.changed(nodes=tuple(nodes), history=history)
    return {
        "tests": state.tests,
        "tally": state.tally,
        "trials": tuple(
            replace(trial, verdict="", tests=()) if _any_implied(state, trial.tests) else trial
            for trial in state.trials
        ),
        **searched_anew(state),
        "implied": 0,
        "refuted": (audit.id, event.by),
        **at_node(state, node),
    }


def early_stop_ended(state: RunState, event: e.EarlyStopEnded, _: float) -> Changes:
    return {"early_stop_ended": event}


def rests_on_slices(state: RunState, node: Node) -> bool:
    """Whether a node was reached by implied tests, or by a slice."""
    return node.how == "sliced" or _any_implied(state, (*node.runs, node.evidence_test or 0))


def _any_implied(state: RunState, tests: Sequence[int]) -> bool:
    return any(state.test(test).implied_by is not None for test in tests if test > 0)
