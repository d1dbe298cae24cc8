"""What one test may take, real time and memory; how often engines may die at once; and what is noted of the whole world.

The user's own numbers hold for all tests. Without a time, the runs of the whole world get a long one, and later tests a multiple
of what these took; the baseline's event holds it. Without a size, the workers share most of what this process may use.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from ddenv.engine.journal import Journal
from ddenv.errors import UserError
from ddenv.evidence.certificate import certificate_tests
from ddenv.evidence.ends import ends_of, groups_of, joining, of_baseline, one_place
from ddenv.runfile import events
from ddenv.runfile.state import RunState
from ddenv.runfile.store import Live
from ddenv.runs import processor
from ddenv.runs.programs import log_of
from ddenv.runs.tests_left import rough_run
from ddenv.settings import SETTINGS, read
from ddenv.text import between, count, duration
from ddenv.world.model import Model, World
from ddenv.world.placement import notes_on_start
from ddenv.world.scenario import Reduction, Scenario

# What a run of the whole world may take, s.
GENEROUS = 1800.0
# A later test may take so many times what the slowest of them would take for all of its simulated time, and never less than this,
# s: machines are several times slower for a while.
FACTOR = 10.0
LEAST = 120.0
# The part of the memory that is not left to all others: the engine, the workbench, the system.
SHARE = 0.9
GIGABYTE = 1e9
# A run is slow if it simulates less than `SLOW` s in each real second; that is known after so many real seconds.
SLOW = 1.0
KNOWN_AFTER = 10.0
# Where f shows in less than this share of the baseline, the failing runs themselves can be reduced at much lower cost.
RARE = 0.7
# Below this rate a certificate takes thousands of runs, so the user is asked first.
VERY_RARE = 0.05
# Where it shows in less than this share, a certificate takes many times the tests of the search.
DEAR = 0.3
# So many runs of the whole world may be too late before one has ended.
MOST_LATE = 3
# So many engines may die in a row, each before it has got anywhere: before it wrote anything but these, among the last events.
MOST_DEATHS, LAST = 3, 3000
NOWHERE = {"accept_mode_changed", "comparing", "supports_started", "leg_started", "environment_named"}
NOWHERE |= {"test_started", "test_lost"}
HELPS = "try fewer models that can move, a shorter --timeout, another simulation.time_step in the scenario"


def wall_limit(state: RunState) -> float:
    """What the next test of a run may take, s."""
    asked = read(state.scenario, SETTINGS["wall_timeout"])
    if isinstance(asked, int | float):
        return float(asked)
    measured = state.baseline.wall_limit if state.baseline is not None else None
    return GENEROUS if measured is None else measured


def limit_after(state: RunState, timeout: float) -> float:
    """What a test of `timeout` simulated s may take after the baseline, s."""
    sound = (test for test in state.tests if test.phase == "baseline" and not test.broke)
    slowest = max((test.wall_seconds / test.simulated_seconds for test in sound if test.simulated_seconds), default=0.0)
    return max(LEAST, math.ceil(FACTOR * slowest * timeout))


def memory_limit(scenario: Scenario, jobs: int) -> float:
    """What each of `jobs` workers may use with all that it starts, bytes; infinite where nothing is known of the machine."""
    asked = scenario.simulation.memory_limit
    return asked * GIGABYTE if asked is not None else SHARE * processor.usable_memory() / jobs


def check_crash_loop(journal: Journal) -> None:
    """Raises UserError if the last engines all died before they got anywhere."""
    path, last = journal.file.path, journal.state.revision
    deaths, place = 0, 0
    for event in journal.file.events(max(0, last - LAST)):
        if isinstance(event.event, events.EngineStarted):
            deaths += 1
        elif event.kind not in NOWHERE:
            deaths, place = 0, event.id
    if deaths >= MOST_DEATHS:
        raise UserError(
            f"{path}: the last {deaths} engines died after event {place}, before a test ended; {log_of(path)} may say why; "
            f"'ddenv resume {path} --anyway' tries once more, perhaps with fewer --jobs"
        )


def note_start(scenario: Scenario, world: World, robot: Model, journal: Journal) -> None:
    """Notes what the files alone show of the start, before the first test."""
    if journal.state.baseline is None:
        spawn, goal, epsilon = scenario.robot.spawn, scenario.goal, scenario.failure.epsilon
        for about, words in notes_on_start(world, robot, spawn, (goal.x, goal.y)):
            note(journal, about, words)
        way = math.hypot(goal.x - spawn.x, goal.y - spawn.y)
        if epsilon > way:
            words = (
                f"epsilon ({epsilon:g} m) is wider than the way to the goal ({way:.3g} m): every failure counts as f"
            )
            note(journal, "epsilon", words)


def note(journal: Journal, about: str, words: str) -> None:
    """Writes an event with a sentence, unless one `about` the same is there."""
    if about not in dict(journal.state.notes):
        journal.record(events.Noted(about, words))


def note_ends(journal: Journal) -> bool:
    """Notes where the ends of the baseline are those of two failures, or scatter so much that f, the part of them within epsilon of
    one, shows in less than half of the runs that failed. Returns whether they scatter: nothing would be found for such an f.
    """
    state = journal.state
    epsilon = float(str(read(state.scenario, SETTINGS["epsilon"])))
    tests = of_baseline(state)
    similar = ends_of(tests, "similar")
    failed = ends_of(tests, "similar", "other")
    if (groups := groups_of(similar, epsilon)) is not None:
        sizes = ", ".join(str(len(group)) for group in groups.groups)
        words = {2: "two"}.get(len(groups.groups), str(len(groups.groups)))
        note(
            journal,
            "two failures",
            f"the ends of f form {words} groups {groups.apart:.2g} m apart ({sizes} runs): these may be different failures; "
            f"--epsilon {groups.epsilon:g} tells them apart",
        )
    reach = one_place(failed, epsilon)
    if reach is None or 2 * len(similar) >= len(failed):
        return False
    near = f"all {len(failed)} runs that failed ended within {reach:.2g} m of one place"
    note(journal, "scatter", f"{near}: --epsilon {joining(reach):g} makes them one failure")
    return True


def note_rare(journal: Journal) -> bool:
    """Offers to reduce the failing runs themselves where f shows in few runs, with the costs of both ways. Returns whether f is so
    rare that the user should choose.
    """
    state, base = journal.state, journal.state.baseline
    asked = Reduction.model_validate(state.scenario["reduction"])
    if base is None or base.rate >= RARE or asked.accept_rate != "kept" or "scatter" in dict(state.notes):
        return False
    ways = asked, asked.model_copy(update={"accept_rate": "exact"})
    tests = (rough_run(len(state.elements), way, base.rate).tests for way in ways)
    kept, exact = (between(low, high) for low, _, high in tests)
    words = (
        f"f shows in {base.failures} of {count(base.runs, 'run')}: keeping its rate takes about {kept} tests; reducing "
    )
    note(journal, "rare", f"{words}the failing runs themselves takes about {exact} (accept_rate exact, --exact)")
    return base.rate < VERY_RARE


def note_alike(journal: Journal) -> None:
    """Offers to reduce a single run where all runs of the whole world have the same bits, with what is left of both ways."""
    state = journal.state
    base = state.baseline
    asked = Reduction.model_validate(state.scenario["reduction"])
    if base is None or not base.alike or asked.accept_rate == "exact":
        return
    models = len(state.elements)
    usual = rough_run(models, asked, base.rate)
    low, _, high = (search + fresh for search, fresh in zip(usual.search, usual.certificate, strict=True))
    one_run = asked.model_copy(update={"accept_rate": "exact", "exact_seeds": 1})
    fewest, _, most = rough_run(models, one_run, base.rate).search
    words = (
        f"all {base.runs} runs of the whole world are alike to the last bit: the search and its certificate take about "
        f"{between(low, high)} tests; reducing one of these runs says nothing of a rate, and takes the search, about "
        f"{between(fewest, most)} tests, one fresh run and some replays (--accept-rate exact --exact-seeds 1)"
    )
    note(journal, "alike", words)


def note_price(journal: Journal, certify_rate: float, at_least: int) -> None:
    """Says what a certificate takes before it begins, where f is so rare that it takes many times what the search took."""
    state, base = journal.state, journal.state.baseline
    asked = Reduction.model_validate(state.scenario["reduction"])
    if base is None or base.rate >= DEAR or asked.accept_rate != "kept":
        return
    low, _, high = certificate_tests(base.rate, certify_rate, len(state.environment), at_least, base.runs)
    exact = rough_run(len(state.environment), asked.model_copy(update={"accept_rate": "exact"}), base.rate)
    first, _, last = exact.tests
    words = (
        f"f shows in {base.failures} of {count(base.runs, 'run')}: the certificate takes about {between(low, high)} tests, "
        f"and may show too little; reducing the failing runs themselves takes about {between(first, last)} (--exact)"
    )
    note(journal, "price", words)


def note_slow(journal: Journal, running: Iterable[tuple[Live, float]]) -> None:
    """Writes an event once a run of the whole world on Drake turns out to be slow. `running` tests took so long, s."""
    state = journal.state
    if state.baseline is not None or state.scenario.get("oracle") is not None or "slow" in dict(state.notes):
        return
    timeout = float(str(read(state.scenario, SETTINGS["timeout"])))
    for live, real in running:
        if real >= KNOWN_AFTER and live.time < SLOW * real:
            # The first tenth of a second may not be over.
            rate = max(live.time, 0.1) / real
            words = f"this world is slow: {rate:.2g} s simulated per second; at this rate a {timeout:g} s test takes "
            note(journal, "slow", f"{words}{duration(timeout / rate)}; {HELPS}, more --jobs")


def give_up_if_late(journal: Journal, late: str) -> None:
    """After a test that was too `late`, in words. Raises UserError if several runs of the whole world were, and none has ended."""
    state = journal.state
    if state.baseline is None and state.tests_done == state.tally["timeout"] >= MOST_LATE:
        late = f"{count(state.tally['timeout'], 'run')} of the whole world {late}"
        raise UserError(f"{late}, and none has ended; {HELPS}")
