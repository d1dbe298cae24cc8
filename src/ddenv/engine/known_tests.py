"""Which tests need no run: those that a finished run implies."""

from __future__ import annotations

from collections import defaultdict

from ddenv.engine.subjects import Keep
from ddenv.runfile.state import BROKEN, RunState, Test
from ddenv.settings import SETTINGS, read
from ddenv.evidence.slices import Ties, implies


class KnownTests:
    """The simulated tests of a run, by seed, for what they imply.

    Nothing is implied where slices are not wanted, where ties are unknown, and after an audit has found a difference.
    """

    def __init__(self) -> None:
        self._made: dict[tuple[int, bool], list[tuple[Keep, Keep, int]]] = defaultdict(list)
        self._ties: tuple[object, Ties] = None, Ties.among(())

    def enter(self, test: Test, keep: Keep, full: bool) -> None:
        """Another finished test in a world of the models `keep`; `full`: it ran to its end."""
        if test.took_part is not None and test.implied_by is None and test.outcome not in BROKEN:
            self._made[test.run, full].append((test.took_part, keep, test.id))

    def ties(self, state: RunState) -> Ties | None:
        """The ties of the run; None where no slices may be used."""
        if state.ties is None or state.refuted is not None or not read(state.scenario, SETTINGS["slice"]):
            return None
        if self._ties[0] is not state.ties:
            self._ties = state.ties, Ties.among(state.ties)
        return self._ties[1]

    def implying(self, state: RunState, keep: Keep, run: int, full: bool) -> int | None:
        """The first test that implies the run number `run` of `keep`, if there is one."""
        ties = self.ties(state)
        if ties is None:
            return None
        made = self._made.get((run, full), ())
        return next((test for took_part, there, test in made if implies(took_part, there, keep, ties)), None)

    def took_part(self, state: RunState, test: Test, keep: Keep, there: Keep) -> Keep | None:
        """What took part in a test of the models `keep`, if that is or implies the run of `there` with its seed."""
        ties, found = self.ties(state), test.took_part
        return found if ties is not None and found is not None and implies(found, keep, there, ties) else None
