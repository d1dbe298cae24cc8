"""What a run found, in one paragraph for readers who know nothing of delta debugging: what failed, why, how sure, at what cost."""

from __future__ import annotations

from collections.abc import Iterator

from ddenv.amounts import count
from ddenv.evidence.claims import current, for_everyone
from ddenv.page.blocks import Name, Paragraph, Part, Strong, duration, plain, say, thousands
from ddenv.report.run_data import Record
from ddenv.runfile.events import deed
from ddenv.runfile.fold import spent
from ddenv.runfile.state import RunState

# Models are named up to this number.
MOST_NAMES = 6


def in_short(record: Record) -> list[Paragraph]:
    """The paragraph that a report begins with; none before a failure is known."""
    state, found = record.state, current(record.state)
    if state.baseline is None:
        return []
    sure = "Fresh runs have not checked that yet." if found is None else f"{for_everyone(found)}."
    runs = "1 simulated drive" if state.made == 1 else f"{thousands(state.made)} simulated drives"
    cost = f"This took {runs} and {duration(spent(state, state.updated_at))} of computing."
    what = f" The robot {deed(state.failure)} before it reached its goal. "
    return [say(Strong("In short:"), what, *_enough(state), f" {sure} {cost}")]


def _enough(state: RunState) -> Iterator[Part]:
    left, whole = state.environment, count(len(state.elements), "model")
    if not left:
        yield f"Without any of the {whole} of its world it fails, too: look at the robot, its goal and what always stays."
        return
    if len(left) == len(state.elements):
        yield f"Each of the {whole} of its world may have to do with it."
        return
    these = "1 is" if len(left) == 1 else f"{len(left)} are"
    yield f"Of the {whole} of its world, {these} enough to make it fail like that: "
    for number, name in enumerate(left[:MOST_NAMES]):
        yield "" if not number else " and " if number == len(left) - 1 else ", "
        yield Name(plain(name))
    yield f" and {len(left) - MOST_NAMES} more." if len(left) > MOST_NAMES else "."
