"""Folds the events of isolation: which models are removed from the whole world in turn, and what fresh runs show of the end."""

from __future__ import annotations

from dataclasses import replace

from ddenv.runfile import working
from ddenv.runfile.events import Changes, Data, chance, names, one_of, whole
from ddenv.runfile.removals import Check, Isolation, Removal, Returned
from ddenv.runfile.state import ISOLATE, RunState


def isolation_started(state: RunState, data: Data, _: float) -> Changes:
    one = Isolation(
        number=whole(data["isolation"]),
        first_run=whole(data["run"]),
        block=whole(data["block"]),
        wanted=chance(data["wanted"]),
        rather_than=chance(data["rather_than"]),
        keep_rate=chance(data["keep_rate"]),
        error=chance(data["error"]),
        at_least=whole(data["at_least"]),
        suspects=names(state.elements, data["suspects"]),
        size=whole(data["size"]),
        before=str(data["before"]),
    )
    sound = 0 < one.rather_than < one.wanted < 1 and one.error > 0 and one.first_run >= 0 and one.at_least >= 0
    if one.number != len(state.isolations) + 1 or not sound or state.baseline is None:
        raise ValueError(one.number)
    return {"isolations": (*without_open(state), one)}


def removal_tried(state: RunState, data: Data, _: float) -> Changes:
    models = names(state.elements, data["models"])
    if whole(data["removal"]) != len(state.removals) + 1 or len(set(models)) != len(models):
        raise ValueError(data["removal"])
    return {"removals": state.removals.added(Removal(models))}


def removal_judged(state: RunState, data: Data, _: float) -> Changes:
    number = _removal(state, data["removal"])
    verdict = one_of(data["verdict"], "passes", "fails", "unknown")
    after = replace(state.removals[number - 1], verdict=verdict, tests=_tests(state, data))
    return {"removals": state.removals.changed(number - 1, after)}


def isolation_checked(state: RunState, data: Data, _: float) -> Changes:
    _tests(state, data)
    last = _open(state)
    check = Check(_removal(state, data["removal"]), tuple(_returned(state, claim) for claim in data["claims"]))
    if not check.claims or check.claims[0].back is not None:
        raise ValueError(data)
    return _changed(state, replace(last, checks=(*last.checks, check)))


def isolation_finished(state: RunState, data: Data, at: float) -> Changes:
    last, found = _open(state), data["removal"]
    if found is not None and (not last.checks or last.checks[-1].removal != found):
        raise ValueError(found)
    return {**_changed(state, replace(last, ended=True, found=found)), **_as_it_was(state, last, at)}


def isolation_given_up(state: RunState, _: Data, at: float) -> Changes:
    return {"isolations": without_open(state), **_as_it_was(state, _open(state), at)}


def _as_it_was(state: RunState, last: Isolation, at: float) -> Changes:
    """The reduction is as it was before the isolation."""
    return {**working.stopped(state, at), "status": "finished", "reason": last.before, "paused": False}


def without_open(state: RunState) -> tuple[Isolation, ...]:
    """All isolations; the one that is under way, if there is one, is broken off."""
    last = state.isolating
    return state.isolations if last is None else (*state.isolations[:-1], replace(last, broken_off=True))


HANDLERS = {
    "isolation_started": isolation_started,
    "removal_tried": removal_tried,
    "removal_judged": removal_judged,
    "isolation_checked": isolation_checked,
    "isolation_finished": isolation_finished,
    "isolation_given_up": isolation_given_up,
}


def removal_of(state: RunState, data: Data) -> int | None:
    """The number of the removal that a test is started for; None for all other tests. Raises IndexError if there is none."""
    if str(data["phase"]) != ISOLATE:
        return None
    return _removal(state, data["removal"])


def _returned(state: RunState, data: Data) -> Returned:
    back, reached, runs = data["back"], whole(data["reached"]), whole(data["runs"])
    if not 0 <= reached <= runs:
        raise ValueError(reached)
    words = ("passes", "fails") if back is None else ("needed", "not needed")
    return Returned(
        back=None if back is None else names(state.elements, [back])[0],
        verdict=one_of(data["verdict"], *words, "not shown", "unknown"),
        reached=reached,
        runs=runs,
        low=chance(data["low"]),
        high=chance(data["high"]),
    )


def _open(state: RunState) -> Isolation:
    """The isolation that is under way. Raises ValueError if there is none."""
    last = state.isolating
    if last is None:
        raise ValueError("no isolation")
    return last


def _changed(state: RunState, last: Isolation) -> Changes:
    return {"isolations": (*state.isolations[:-1], last)}


def _removal(state: RunState, number: int) -> int:
    if type(number) is not int or not 0 < number <= len(state.removals):
        raise IndexError(number)
    return number


def _tests(state: RunState, data: Data) -> tuple[int, ...]:
    """The tests that it rests on have to be there."""
    tests = tuple(map(whole, data["tests"]))
    if not all(0 < test <= len(state.tests) for test in tests):
        raise ValueError(tests)
    return tests
