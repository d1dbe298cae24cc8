"""The calls of a user's test, one after another: those of the search, and those that say how often the failure shows."""

from __future__ import annotations

from collections.abc import Callable

from ddenv.reduction.certificate import Subject
from ddenv.reduction.evidence import Trial

Test = Callable[[Subject], bool]


class Calls:
    """Calls `test`, and remembers what each call showed. `trials` are those of the search, `others` is the number of the others."""

    def __init__(self, test: Test) -> None:
        self._test = test
        self._known: dict[Subject, list[bool]] = {}
        self._tallies: dict[Subject, tuple[int, int]] = {}
        self.trials: list[Trial] = []
        self.others = 0

    def known(self, models: Subject, run: int) -> bool | None:
        """Whether a run of the search showed f; None if it was not made."""
        known = self._known.get(models, [])
        return known[run] if run < len(known) else None

    def shown(self, models: Subject, run: int) -> bool:
        """Whether a run of the search shows f. The runs of each selection are asked for in their order."""
        known = self._known.setdefault(models, [])
        if run == len(known):
            known.append(bool(self._test(models)))
            self.trials.append(Trial(models, known[run]))
        return known[run]

    def fresh(self) -> Callable[[Subject, int], bool]:
        """Runs that chose nothing; each is made when it is asked for."""
        made: dict[tuple[Subject, int], bool] = {}

        def shown(models: Subject, run: int) -> bool:
            if (models, run) not in made:
                made[models, run] = self.once(models)
            return made[models, run]

        return shown

    def once(self, models: Subject) -> bool:
        """Whether a run beside the search shows f."""
        shown = bool(self._test(models))
        self.others += 1
        hits, runs = self.tally(models)
        self._tallies[models] = (hits + shown, runs + 1)
        return shown

    def tally(self, models: Subject) -> tuple[int, int]:
        """How many runs beside the search showed f, and of how many."""
        return self._tallies.get(models, (0, 0))
