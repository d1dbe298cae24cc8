"""The events of a run file, and the values in them.

The kinds of events, with their data (models are numbers into the run's `elements`):

    created              scenario {...}, elements [names]
    engine_started       pid, jobs, version (of ddenv), simulator (what computes); both absent in older files
    test_started         test, phase, round, candidate, run, seed; where phase is "confirm" also without: model or null,
                         where it is "hand" trial
    test_finished        test, outcome, failure, distance, end_pose, simulated_seconds, wall_seconds,
                         first_sensed [[model, s]], first_touched [[model, s]] (both absent in files of version 1),
                         cut (absent before version 3), taken: the run that it was taken over from (absent where it was
                         made); trajectories beside it
    test_lost            test: it was running when the engine died
    baseline_finished    the fields of `Baseline`, and outcomes {test: outcome}, distances {test: m}
    leg_started          round: the number of the next one, n_partitions: a new search begins after the user changed something
    round_started        round, n_partitions, environment [..], partitions [[..]], candidates [[kind, partition, distance or null]],
                         pinned [..] (absent where there are none)
    candidate_judged     candidate, verdict, tests [ids], known
    waiting              candidate
    decided              candidate, decision: accept or reject
    reduced              candidate, environment [..], evidence_test
    round_finished
    confirm_started      the rounds are over, and what is left is run in full
    paused / resumed
    accept_mode          mode
    vetoed               candidate, verdict: vetoed, or rejected if the same models were rejected in an earlier round, which
                         `again` says
    unvetoed             round, candidate
    pinned / unpinned    models [..]
    trial_started        trial, models [..]: the user's own selection is tried
    trial_judged         trial, verdict, tests [ids], known
    adopted              trial, environment [..], evidence_test
    accepted_other       test, what, trial or null, environment [..], outcomes {test: outcome}, distances {test: m}
    went_back            node, rejected: the node that is undone, or null; outcomes and distances of tests where other failures
                         count there
    changed              settings {...}: keys of the scenario's section `reduction`
    command_refused      why
    command_handled      command: no other event came of it
    finished             minimal, reason
    engine_stopped       reason
    engine_failed        reason

An event that a viewer's command became also holds `command`, its number.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

# What an event holds; which fields of the state it gives other values.
Data = dict[str, Any]
Changes = dict[str, Any]
Names = tuple[str, ...]
# In the year 5138, s.
LATEST = 1e11


def number(value: Any) -> float:
    """A finite number."""
    finite = float(value)
    if not math.isfinite(finite):
        raise ValueError(value)
    return finite


def chance(value: Any) -> float:
    """A number from 0 to 1."""
    part = number(value)
    if not 0 <= part <= 1:
        raise ValueError(value)
    return part


def moment(value: Any) -> float:
    """A Unix time, s, that a calendar can show."""
    time = number(value)
    if not 0 <= time < LATEST:
        raise ValueError(value)
    return time


def one_of(value: Any, *words: str) -> str:
    """One of these words."""
    if value not in words:
        raise ValueError(value)
    return value


def vector(values: Iterable[Any], length: int) -> tuple[float, ...]:
    """`length` finite numbers."""
    numbers = tuple(number(value) for value in values)
    if len(numbers) != length:
        raise ValueError(values)
    return numbers


def names(elements: Names, numbers: list[int]) -> Names:
    """The models with these numbers."""
    if min(numbers, default=0) < 0:
        raise IndexError(numbers)
    return tuple(elements[index] for index in numbers)


def moments(elements: Names, pairs: Iterable[Any]) -> tuple[tuple[str, float], ...]:
    """(name, s) for each pair of a model's number and a time, s, from the start of a test on."""
    found = [(index, float(time)) for index, time in pairs]
    if not all(index >= 0 and 0 <= time < math.inf for index, time in found):
        raise ValueError(pairs)
    return tuple((elements[index], time) for index, time in found)


# Each word that a test's `failure` may be, as what the robot did. What is none of them is why the simulation broke.
DEEDS = {
    "stuck": "got stuck",
    "tipped over": "tipped over",
    "fell": "fell",
    "lost": "was lost",
    "out of time": "ran out of time",
}
# What files of versions 1 and 2 say of every robot that did not fall.
_EARLIER = {"timeout": "out of time"}


def as_now(failure: str) -> str:
    """A word of an older file as it is today."""
    return _EARLIER.get(failure, failure)


def deed(failure: str) -> str:
    """What the robot did, such as "tipped over"; "failed" where nothing more is known."""
    return DEEDS.get(failure, "failed")
