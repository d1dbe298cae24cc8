"""Notes what is wrong with the whole world, once each: where it is slow, while its first run goes on; what is odd at its start."""

from __future__ import annotations

from collections.abc import Iterable

from ddenv.engine.journal import Journal
from ddenv.engine.pool import Pace
from ddenv.errors import UserError
from ddenv.runfile.events import Noted
from ddenv.runfile.state import RunState
from ddenv.runs.tests_left import rough_run
from ddenv.settings import SETTINGS, read
from ddenv.text import about, count, duration
from ddenv.world.scenario import Reduction

# A run is slow if it simulates less than `SLOW` s in each real second; that is known after so many real seconds.
SLOW = 1.0
KNOWN_AFTER = 10.0
# So many runs of the whole world may be too late before one has ended.
MOST_LATE = 3
SLOWNESS = "slow"
HELPS = "what helps: fewer models that can move, a shorter --timeout, another simulation.time_step in the scenario"


def note(journal: Journal, about: str, words: str) -> None:
    """Writes an event with a sentence, unless one `about` the same is there."""
    if not is_noted(journal, about):
        journal.record(Noted(about, words))


def is_noted(journal: Journal, about: str) -> bool:
    """Whether a sentence `about` this is written."""
    return any(about == known for known, _ in journal.state.notes)


def note_slow(journal: Journal, paces: Iterable[Pace]) -> None:
    """Writes an event once a run of the whole world turns out to be slow. Own simulators keep their own time."""
    state = journal.state
    if state.baseline is not None or state.scenario.get("oracle") is not None or is_noted(journal, SLOWNESS):
        return
    for pace in paces:
        if pace.real >= KNOWN_AFTER and pace.simulated < SLOW * pace.real:
            note(journal, SLOWNESS, _slow(state, pace.simulated / pace.real))
            return


def _slow(state: RunState, rate: float) -> str:
    """What a slow world will cost: its baseline in full, then what is left to test of it after the slice (`rough_run`)."""
    asked = Reduction.model_validate(state.scenario["reduction"])
    timeout = float(str(read(state.scenario, SETTINGS["timeout"])))
    if rate <= 0.0:
        return f"this world is slow: not even a tenth of a second was simulated in {KNOWN_AFTER:g} s; {HELPS}"
    each = timeout / rate
    runs, jobs = asked.baseline_runs, max(1, state.jobs)
    baseline = duration(each * -(-runs // jobs))
    whole = about(*(each * worlds / jobs for worlds in rough_run(len(state.elements), asked).worlds))
    return (
        f"this world is slow: {rate:.2g} s simulated in each second; at this rate a test of {timeout:g} s takes "
        f"{duration(each)}, the baseline of {count(runs, 'run')} about {baseline}, the whole run about {whole}; "
        f"{HELPS}, more --jobs"
    )


def give_up_if_late(journal: Journal, late: str) -> None:
    """After a test that was too `late`, in words. Raises UserError if several runs of the whole world were, and none has ended."""
    state = journal.state
    if state.baseline is None and state.tests_done == state.tally["timeout"] >= MOST_LATE:
        raise UserError(
            f"{count(state.tally['timeout'], 'run')} of the whole world {late}, and none has ended; {HELPS}"
        )
