"""Folds tests made ahead of time: the models of those whose round has not come yet, and how many nobody has needed so far."""

from __future__ import annotations

from ddenv.runfile.events import Changes, Data, names, whole
from ddenv.runfile.state import AHEAD, FRESH, Candidate, RunState, Split

# The phases of tests that idle workers may make ahead of time.
MAY_BE_AHEAD = ("round", AHEAD, *FRESH)


def tried(state: RunState, data: Data) -> Candidate | None:
    """The candidate of a later round that a test which starts is made for; None for all other tests."""
    if data["phase"] != AHEAD:
        return None
    environment = state.nodes[whole(data["node"])].environment
    part = names(state.elements, data["part"])
    if not part or not frozenset(environment).issuperset(part) or len(set(part)) != len(part):
        raise ValueError("part")
    return Candidate(0, "partition" if data["stays"] else "complement", 0, Split(environment, (part,)))


def counted(before: RunState, kind: str, data: Data, changes: Changes) -> Changes:
    """`changes` of an event, with the count of the tests that ran ahead."""
    if kind == "test_finished":
        test = before.tests[data["test"] - 1]
        return {**changes, "ahead": before.ahead + 1} if test.phase in MAY_BE_AHEAD else changes
    tests = data.get("tests") if kind in _RESTS else None
    if not tests:
        return changes
    rests_on, ahead = before.rests_on, before.ahead
    for number in tests:
        # Of a damaged file, a number may be too large for a bit.
        if not 0 < whole(number) <= len(before.tests) or rests_on & (bit := 1 << number):
            continue
        test = before.tests[number - 1]
        rests_on |= bit
        ahead -= test.phase in MAY_BE_AHEAD and test.implied_by is None
    return {**changes, "rests_on": rests_on, "ahead": ahead}


# After these events decisions rest on their `tests`, whatever the number of workers.
_RESTS = ("candidate_judged", "trial_judged", "certificate_finished", "rate_lost")
