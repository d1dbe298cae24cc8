"""The events of a run file, and checks of the values in them.

The kinds of events with their data. Models are indices into the run's `elements`; fields marked ? may be missing:

    created              scenario {...}, elements [names]
    engine_started       pid, jobs, version (of ddenv), simulator (Drake and numpy with their versions, or the oracle), machine?
                         (Python and the processor)
    cluster              jobs (how many tests its workers can make at the same time now), words: what has happened to it
    comparing            test: it is made again, because this engine computes with something else than the earlier ones
    compared             same: whether its bits are the same; if not, the user goes on with mixed tests
    supports_started     the piles are being settled, to find what rests on what; only if that takes more than a second
    supports             pairs [[upper, lower]], why? (it is unknown): what rests on what once the whole world has settled; ties?
                         [[model, other]] or null: which model would move by itself without which other; null if that is unknown
    still                nothing in the world moves by itself: there are no ties
    noted                about, words: what is wrong with the whole world; a sentence about each thing, once
    test_started         test, phase, round, candidate, run, seed; if phase is "certify" or "audit" (of a slice): node, without?
                         (a model); if it is "hand": trial; if it is "isolate": removal; audits? (the test that implies it: it is
                         simulated to be compared)
    test_finished        test, outcome, failure, distance, end_pose, simulated_seconds, wall_seconds,
                         first_sensed [[model, s]], first_touched [[model, s]], cut, took_part? [models that can have
                         changed a bit of it], taken? (the run whose result was copied); trajectories beside it
    implied              as test_started, and by (a test): the result is that of this test, which has its trajectories
    sliced               environment [..], tests [ids] of which what took part is left, evidence_test, audit (whether one of
                         them is simulated there, too)
    slices_refuted       test, by, node: this audit does not repeat the test by, which implies it; slices are no longer used,
                         implied tests are void, and the run goes back to node
    test_lost            test: it was running when the engine died
    baseline_finished    the fields of `Baseline`, and outcomes {test: outcome}, distances {test: m}
    leg_started          round (number of the next one), n_partitions: a new search starts after a decision of the user
    round_started        round, n_partitions, environment [..], partitions [[..]], candidates [[kind, partition, distance or null]],
                         pinned? [..]
    forecast             round, tests [low, likely, high]: how many were left when tests_done of them were finished
    candidate_judged     candidate, verdict (similar, missed, dissimilar or unknown), tests [ids], known
    waiting              candidate
    decided              candidate, decision: accept or reject
    reduced              candidate, environment [..], evidence_test
    round_finished
    certificate_started  certificate, run (the number of its first), rate, keep_rate, error, at_least: full runs with fresh seeds
                         follow
    certificate_finished claims [{without (a model or null), verdict, shown, runs, low, high, outcomes {outcome: number}}], tests
                         [ids] that they rest on
    rate_lost            node (the run goes back to it), lost (the node after it), again [[models]] (to leave out at once, or in
                         halves), tests [ids] that this rests on
    left_out             without, environment [..], evidence_test: the certificate showed that this model is not needed
    isolation_started    isolation, run (the number of its first fresh run), block (fresh runs of a check), wanted, rather_than,
                         keep_rate, error, at_least, suspects [..], size, before: the fewest models are sought that have to go from
                         the whole world so that the robot reaches its goal
    removal_tried        removal, models [..]: tests of the whole world without these follow, with phase "isolate" and this removal
    removal_judged       removal, verdict (passes, fails or unknown), tests [ids]
    isolation_checked    removal, claims [{back (a model or null), verdict, reached, runs, low, high}], tests [ids]: fresh runs
    isolation_finished   removal (null if there is no such world)
    isolation_given_up
    confirm_started      (format 4) the rounds are over; full runs of what is left follow
    paused / resumed
    room                 enough, needed, free (bytes): without enough room on the disk no tests are started
    clock_jumped         seconds that Unix time went on or back at once: the machine slept, or its clock was set
    accept_mode          mode
    vetoed               candidate, verdict: vetoed; with `again`? also rejected or undone: the same models were refused so before
    unvetoed             round, candidate
    pinned / unpinned    models [..]
    trial_started        trial, models [..]: the user tries a selection
    trial_judged         trial, verdict, tests [ids], known
    adopted              trial, environment [..], evidence_test
    accepted_other       test, what, trial? or null, environment [..], outcomes {test: outcome}, distances {test: m}, instead? (a
                         branch: the failure is f from here on, in place of what was f)
    went_back            node, rejected (the node that is undone, or null), outcomes? and distances? of tests, if other failures
                         count as f there
    changed              settings {...}: keys of the scenario's section `reduction`
    command_refused      why
    command_handled      command: it caused no other event
    finished             minimal, reason
    engine_stopped       reason
    engine_failed        reason

An event caused by a viewer's command also holds `command`, its number.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

# The data of an event; the fields of the state that it changes, with their new values.
Data = dict[str, Any]
Changes = dict[str, Any]
Names = tuple[str, ...]
LATEST = 1e11  # maximum time, Unix time in s: the year 5138
# No robot comes so far, no test takes so long, and no run counts so far (m, s). Squares of these are still numbers.
LARGEST = 1e15


def number(value: Any) -> float:
    """A number that something in a run can have."""
    found = float(value)
    if not abs(found) <= LARGEST:
        raise ValueError(value)
    return found


def whole(value: Any) -> int:
    """A whole number that something in a run can have."""
    found = int(value)
    if not abs(found) <= LARGEST:
        raise ValueError(value)
    return found


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
    return str(value)


def vector(values: Iterable[Any], length: int) -> tuple[float, ...]:
    """`length` finite numbers."""
    numbers = tuple(number(value) for value in values)
    if len(numbers) != length:
        raise ValueError(values)
    return numbers


def names(elements: Names, numbers: list[int]) -> Names:
    """The models with these indices."""
    if min(numbers, default=0) < 0:
        raise IndexError(numbers)
    return tuple(elements[index] for index in numbers)


def moments(elements: Names, pairs: Iterable[Any]) -> tuple[tuple[str, float], ...]:
    """(name, s) for each pair of a model's index and a time since the start of a test, s."""
    found = [(index, number(time)) for index, time in pairs]
    if not all(index >= 0 and time >= 0 for index, time in found):
        raise ValueError(pairs)
    return tuple((elements[index], time) for index, time in found)


# What the robot did, by the `failure` of a test. Any other `failure` says why the simulation broke.
DEEDS = {
    "stuck": "got stuck",
    "tipped over": "tipped over",
    "fell": "fell",
    "lost": "was lost",
    "out of time": "ran out of time",
}


def deed(failure: str) -> str:
    """What the robot did, such as "tipped over"; "failed" if nothing more is known."""
    return DEEDS.get(failure, "failed")


def as_it_was(scenario: Data) -> Data:
    """A scenario of a run file, with what older versions of ddenv did without a setting for it."""
    reduction, failure = scenario.get("reduction"), scenario.get("failure")
    if isinstance(reduction, dict):
        before = {"accept_rate": "first", "keep_rate": 0.8, "early_stop": False, "slice": False}
        if isinstance(failure, dict) and "early_stop" in failure:
            before["early_stop"] = failure["early_stop"]
            scenario = {**scenario, "failure": {key: value for key, value in failure.items() if key != "early_stop"}}
        scenario = {**scenario, "reduction": {**before, **reduction}}
    return scenario
