"""What is noted of the whole world, before its runs, while they are made and after them; and which
other ways are offered then.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from ddenv.engine.journal import Journal
from ddenv.engine.judging import asked_of, known_failure, spec_of
from ddenv.engine.limits import HELPS
from ddenv.evidence.certificate import certificate_tests
from ddenv.evidence.ends import ends_of, groups_of, joining, of_baseline, one_place
from ddenv.runfile import events
from ddenv.runfile.state import RunState
from ddenv.runfile.store import Live
from ddenv.runs.tests_left import Rough, rough_run
from ddenv.text import between, count, duration
from ddenv.world.model import Model, World
from ddenv.world.placement import note_floor, notes_on_start
from ddenv.world.scenario import Scenario

# A run is slow if it simulates less than `SLOW` s in each real second; that is known after so many
# real seconds.
SLOW = 1.0
KNOWN_AFTER = 10.0
# Where f shows in less than this share of the baseline, the failing runs themselves can be reduced
# at much lower cost.
RARE = 0.7
# Below this rate a certificate takes thousands of runs, so the user is asked first.
VERY_RARE = 0.05
# Where it shows in less than this share, a certificate takes many times the tests of the search.
DEAR = 0.3


def note(journal: Journal, about: str, words: str) -> None:
    """Writes an event with a sentence, unless one `about` the same is there."""
    if about not in dict(journal.state.notes):
        journal.record(events.Noted(about=about, words=words))


def note_start(scenario: Scenario, world: World, robot: Model, journal: Journal) -> None:
    """Notes what the files alone show of the start, before the first test."""
    if journal.state.baseline is not None:
        return
    spawn = scenario.robot.spawn
    goal = scenario.goal
    epsilon = scenario.failure.epsilon
    for about, words in notes_on_start(world, robot, spawn, goal):
        note(journal, about, words)
    for about, words in note_floor(world, robot, spawn, journal.state.elements):
        note(journal, about, words)
    way = math.hypot(goal.x - spawn.x, goal.y - spawn.y)
    if epsilon > way:
        wider = f"epsilon ({epsilon:g} m) is wider than the way to the goal ({way:.3g} m)"
        note(journal, "epsilon", f"{wider}: every failure counts as f")


def note_slow(journal: Journal, running: Iterable[tuple[Live, float]]) -> None:
    """Writes an event once a run of the whole world on Drake turns out to be slow. `running` tests
    took so long, s.
    """
    state = journal.state
    if (
        state.baseline is not None
        or state.scenario.get("oracle") is not None
        or "slow" in dict(state.notes)
    ):
        return
    timeout = spec_of(state).timeout
    for live, real in running:
        if real >= KNOWN_AFTER and live.time < SLOW * real:
            # The first tenth of a second may not be over.
            rate = max(live.time, 0.1) / real
            words = (
                f"this world is slow: {rate:.2g} s simulated per second; at this rate a "
                f"{timeout:g} s test takes "
            )
            note(journal, "slow", f"{words}{duration(timeout / rate)}; {HELPS}, more --jobs")


def note_ends(journal: Journal) -> bool:
    """Notes where the ends of the baseline are those of two failures, or scatter so much that f,
    the part of them within epsilon of one, shows in less than half of the runs that failed. Returns
    whether they scatter: nothing would be found for such an f.
    """
    epsilon = spec_of(journal.state).epsilon
    tests = of_baseline(journal.state)
    similar = ends_of(tests, "similar")
    failed = ends_of(tests, "similar", "other")
    if (groups := groups_of(similar, epsilon)) is not None:
        sizes = ", ".join(str(len(group)) for group in groups.groups)
        number = {2: "two"}.get(len(groups.groups), str(len(groups.groups)))
        words = (
            f"the ends of f form {number} groups {groups.apart:.2g} m apart ({sizes} runs): "
            "these may be different failures"
        )
        note(journal, "two failures", f"{words}; --epsilon {groups.epsilon:g} tells them apart")
    reach = one_place(failed, epsilon)
    if reach is None or 2 * len(similar) >= len(failed):
        return False
    near = f"all {len(failed)} runs that failed ended within {reach:.2g} m of one place"
    note(journal, "scatter", f"{near}: --epsilon {joining(reach):g} makes them one failure")
    return True


def note_rare(journal: Journal) -> bool:
    """Offers to reduce the failing runs themselves where f shows in few runs, with the costs of
    both ways. Returns whether f is so rare that the user should choose.
    """
    state = journal.state
    rate = known_failure(state).rate
    if rate >= RARE or asked_of(state).accept_rate != "kept" or "scatter" in dict(state.notes):
        return False
    words = (
        f"{_shows_in(state)}: keeping its rate takes about {_tests(_rough(state).tests)} tests; "
        f"{_instead(state)}"
    )
    note(journal, "rare", f"{words} (accept_rate exact, --exact)")
    return rate < VERY_RARE


def note_alike(journal: Journal) -> None:
    """Offers to reduce a single run where all runs of the whole world have the same bits, with what
    is left of both ways.
    """
    state = journal.state
    base = known_failure(state)
    if not base.alike or asked_of(state).accept_rate == "exact":
        return
    usual = _rough(state)
    after_baseline = (each - usual.baseline for each in usual.tests)
    one_run = _rough(state, accept_rate="exact", exact_seeds=1)
    words = (
        f"all {base.runs} runs of the whole world are alike to the last bit: the search and its "
        "certificate take about "
        f"{_tests(after_baseline)} tests; reducing one of these runs says nothing of a rate, and "
        "takes the search, about "
        f"{_tests(one_run.search)} tests, one fresh run and some replays (--accept-rate exact "
        "--exact-seeds 1)"
    )
    note(journal, "alike", words)


def note_price(journal: Journal, certify_rate: float, at_least: int) -> None:
    """Says what a certificate takes before it begins, where f is so rare that it takes many times
    what the search took.
    """
    state = journal.state
    base = known_failure(state)
    if base.rate >= DEAR or asked_of(state).accept_rate != "kept":
        return
    takes = certificate_tests(base.rate, certify_rate, len(state.environment), at_least, base.runs)
    words = (
        f"{_shows_in(state)}: the certificate takes about {_tests(takes)} tests, and may show "
        "too little"
    )
    note(journal, "price", f"{words}; {_instead(state)} (--exact)")


def _shows_in(state: RunState) -> str:
    base = known_failure(state)
    return f"f shows in {base.failures} of {count(base.runs, 'run')}"


def _instead(state: RunState) -> str:
    tests = _tests(_rough(state, accept_rate="exact").tests)
    return f"reducing the failing runs themselves takes about {tests}"


def _rough(state: RunState, **other: object) -> Rough:
    """How many tests a reduction of what is left takes, with `other` settings."""
    asked = asked_of(state).model_copy(update=other)
    return rough_run(len(state.environment), asked, known_failure(state).rate)


def _tests(expected: Iterable[int]) -> str:
    """A number of tests, given as (low, likely, high), in words."""
    low, _, high = expected
    return between(low, high)
