"""What the why view lists: each model that is left, and at the end the nearest world that passes."""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.claims import current, meaning, rate
from ddenv.runfile.events import Names
from ddenv.runfile.progress import Claim
from ddenv.runfile.state import RunState, partition_letter
from ddenv.runfile.store import RunFile
from ddenv.runs.nearest import Nearest, nearest
from ddenv.runs.reasons import Parting, Reason, parting_sentence, reasons, sentence
from ddenv.workbench.playback.moving import snapshot_with
from ddenv.workbench.shared.poll import Snapshot

# The maximum number of models in the list.
LISTED = 200
NEAREST = "nearest world that passes"


@dataclass(frozen=True, slots=True)
class Entry:
    """Something that is left out of the environment of `snapshot`: the models `gone`, which have the sign `letter` on the map.

    `sentence` says what happens then, `more` the rates; `parting` compares two runs with one seed, whose ways are called `ways`;
    `rows` has these runs side by side: time, s, both places and how far apart they are. `claim` is that of a certificate.
    """

    name: str
    letter: str
    gone: Names
    sentence: str
    more: tuple[str, ...]
    parting: Parting | None
    ways: tuple[str, str]
    snapshot: Snapshot
    claim: Claim | None = None
    rows: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """All sentences, to be copied."""
        return " ".join(part for part in (self.sentence, *self.more) if part)


def entries(file: RunFile, state: RunState) -> tuple[tuple[Entry, ...], int]:
    """The entries, and how many models there are beyond those that are listed. Raises UserError for a damaged file."""
    found = reasons(file, state) if current(state) is not None else ()
    listed = found[:LISTED]
    snapshot = snapshot_with(state, state.environment, tuple(each.gone for each in listed))
    models = tuple(_of_model(state, number, each, snapshot) for number, each in enumerate(listed))
    return (*models, *_nearest(file, state)), len(found) - len(listed)


def _nearest(file: RunFile, state: RunState) -> tuple[Entry, ...]:
    passing = nearest(file, state)
    return () if passing is None else (_of_nearest(state, passing),)


def _of_model(state: RunState, number: int, reason: Reason, snapshot: Snapshot) -> Entry:
    certificate = current(state)
    claims = () if certificate is None else certificate.claims
    claim = next((each for each in claims if each.without == reason.without), None)
    rates = f"{rate(claim)}; {meaning(claim, certificate)}." if claim is not None and certificate is not None else ""
    return Entry(
        reason.without,
        partition_letter(number),
        reason.gone,
        sentence(reason),
        (rates, parting_sentence(reason)),
        reason.parting,
        ("with", "without"),
        snapshot,
        claim,
    )


def _of_nearest(state: RunState, one: Nearest) -> Entry:
    """The whole world fails, and without `gone` it passes."""
    rows = tuple(
        f"{each.seconds:6.1f} s   {_place(each.failing)}   {_place(each.passing)}   {each.apart:.2f} m"
        for each in one.instants
    )
    snapshot = snapshot_with(state, state.elements, (one.gone,) if one.gone else ())
    return Entry(NEAREST, "A", one.gone, one.sentences, (), one.parting, ("fails", "passes"), snapshot, rows=rows)


def _place(point: tuple[float, float]) -> str:
    return f"{point[0]:6.2f} {point[1]:6.2f}"
