"""What an engine checks before its first test: whether earlier engines died at once, whether it gets the same results, and which
models support others.
"""

from __future__ import annotations

from ddenv.engine.bench import Bench
from ddenv.engine.journal import Journal
from ddenv.engine.limits import note
from ddenv.engine.worker import Broken
from ddenv.errors import UserError
from ddenv.robot.result import RunResult
from ddenv.robot.settled import notes_on
from ddenv.runfile import events
from ddenv.runfile.state import RunState, Test
from ddenv.runs.programs import log_of
from ddenv.world.model import Model, World
from ddenv.world.placement import notes_on_start
from ddenv.world.scenario import Scenario

# So many engines may die in a row, each before it has got anywhere.
MOST_DEATHS = 3
# What an engine writes again and again without getting anywhere.
NOWHERE = (
    events.AcceptModeChanged,
    events.Comparing,
    events.SupportsStarted,
    events.LegStarted,
    events.EnvironmentNamed,
    events.TestStarted,
    events.TestLost,
)
# The last events that are looked at.
LAST = 3000


def check_crash_loop(journal: Journal) -> None:
    """Raises UserError if the last engines all died before they got anywhere."""
    path, last = journal.file.path, journal.state.revision
    deaths, place = 0, 0
    for event in journal.file.events(max(0, last - LAST)):
        if isinstance(event.event, events.EngineStarted):
            deaths += 1
        elif not isinstance(event.event, NOWHERE):
            deaths, place = 0, event.id
    if deaths >= MOST_DEATHS:
        raise UserError(
            f"{path}: the last {deaths} engines died after event {place}, before a test ended; {log_of(path)} may say why; "
            f"'ddenv resume {path} --anyway' tries once more, perhaps with fewer --jobs"
        )


def check_repeats(journal: Journal, bench: Bench, mixed: bool) -> None:
    """Makes the first baseline run again if this engine computes with anything else than the earlier ones.

    Raises UserError if the bits differ, unless the run goes on `mixed`; and Stopped.
    """
    state = journal.state
    test = _comparable(state)
    if state.physics.now == state.physics.proven or test is None:
        return
    result = bench.made_again(test)
    if result is not None and not mixed:
        raise UserError(_differs(journal, result))
    journal.record(events.Compared(result is None))


def _comparable(state: RunState) -> Test | None:
    """The first run of the whole world that did not break."""
    baseline = (test for test in state.tests if test.phase == "baseline")
    return next((test for test in baseline if test.outcome in ("similar", "other", "pass", "failed")), None)


def _differs(journal: Journal, result: RunResult | Broken) -> str:
    run, physics = journal.file.path, journal.state.physics
    how = f"broke ({result.failure})" if isinstance(result, Broken) else "gives a different trajectory"
    return (
        f"{run}: repeated, the first run of the whole world {how}: the tests were made with {physics.proven}, and this is "
        f"{physics.now}; 'ddenv resume {run} --mixed' continues anyway, 'ddenv resume {run} --again' repeats all tests "
        "in a new run"
    )


def note_start(scenario: Scenario, world: World, robot: Model, journal: Journal) -> None:
    """Notes what the files alone show of the start, before the first test."""
    if journal.state.baseline is None:
        for about, words in notes_on_start(world, robot, scenario.robot.spawn, (scenario.goal.x, scenario.goal.y)):
            note(journal, about, words)


def settle(scenario: Scenario, world: World, journal: Journal, bench: Bench) -> None:
    """Finds which models support others, once. Raises UserError if stacks are to be kept together and this cannot be found out."""
    moves = any(model.links and not model.static for model in world.models)
    # A simulator in Python names the models that affected a run, and those that they rest on.
    in_python = scenario.oracle is not None and scenario.oracle.use is not None
    if (
        (not moves or (in_python and not scenario.reduction.keep_supports))
        and scenario.reduction.slice
        and journal.state.ties is None
    ):
        journal.record(events.Still())
    if journal.state.ties is not None or journal.state.unsettled or journal.state.supports or not moves:
        return
    needed = scenario.reduction.keep_supports
    if scenario.oracle is not None:
        if needed:
            raise UserError(
                "reduction.keep_supports: only ddenv's own simulator finds which models rest on which; leave it out, or 'oracle'"
            )
        return
    elements = journal.state.elements
    found = bench.settle(frozenset(elements), lambda: journal.record(events.SupportsStarted()))
    if not isinstance(found, Broken):
        for about, words in notes_on(world, found.settled):
            note(journal, about, words)
        ties = None if found.ties is None else journal.pairs(found.ties)
        journal.record(events.Supports(journal.pairs(found.supports), ties))
    elif needed:
        raise UserError(f"reduction.keep_supports: it is not known which models rest on which: {found.failure}")
    else:
        journal.record(events.Supports((), why=found.failure))
