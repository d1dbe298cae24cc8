"""The nearest world that passes, beside the whole world that fails.

`nearest(file, state)` is all that a view shows of it; `state.isolated` has the numbers alone, without a trajectory.
"""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.errors import UserError
from ddenv.evidence.claims import is_nearest
from ddenv.runfile.state import RunState, Test
from ddenv.runfile.store import RunFile
from ddenv.runs.reasons import GOAL, F, Parting, parting_of, parting_words
from ddenv.text import first_of
from ddenv.words.claims import of_passing


@dataclass(frozen=True, slots=True)
class Nearest:
    """The nearest world that passes: the whole world without the models `gone`.

    `words` say what fresh runs show of it, in one sentence. `shown`: they show that it passes, and that it does not with any one of
    `gone` put back. `parting` compares a run of the whole world, `with_test`, with one without `gone`; None where no pair of runs
    with one seed shows it; `lacks` says why, if the run file does not have what it takes. `first` of `gone` took part first there.
    """

    gone: tuple[str, ...]
    words: str
    shown: bool
    parting: Parting | None = None
    first: str = ""
    lacks: str = ""

    @property
    def sentences(self) -> str:
        """All of it in a few sentences."""
        said = f"{self.words[:1].upper()}{self.words[1:]}."
        met = f"Of what has to go, {first_of((self.first,), 1)} takes part first:"
        return f"{said} {parting_words(self.parting, self.lacks, met)}".rstrip()


def nearest(file: RunFile, state: RunState) -> Nearest | None:
    """What the last isolation found; None if there was none, or if it did not end."""
    one = state.isolated
    if one is None:
        return None
    words, shown = of_passing(state, one), is_nearest(one)
    if one.found is None:
        return Nearest((), words, shown)
    gone = state.removals[one.found - 1].models
    parting, first, lacks = parting_of(file, _pair(state, one.found), gone)
    return Nearest(gone, words, shown, parting, first, lacks)


def _pair(state: RunState, found: int) -> tuple[Test, Test] | None:
    """A run of the whole world that fails, if possible as in f, and one of its seed, in the passing world, that does not."""
    passing = {test.run: test for test in state.tests if test.removal == found and test.outcome == GOAL}
    whole = [test for test in state.tests if test.run in passing and test.environment == 0]
    failing = [test for test in whole if test.outcome in (F, "other")]
    chosen = min(failing, key=lambda test: (test.outcome != F, test.cut, test.id), default=None)
    return None if chosen is None else (chosen, passing[chosen.run])


def removed_in_passing(state: RunState, where: object) -> tuple[str, ...]:
    """The models that the nearest world that passes lacks. Raises UserError where there is no such world yet."""
    one = state.isolated
    if one is None:
        raise UserError(
            f"{where}: no world that passes is known yet; find the nearest one first: ddenv isolate {where}"
        )
    if one.found is None:
        raise UserError(f"{where}: {of_passing(state, one)}")
    return state.removals[one.found - 1].models
