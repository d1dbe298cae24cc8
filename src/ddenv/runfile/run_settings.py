"""The settings of a run as its file records them, for views."""

from __future__ import annotations

from ddenv.runfile.state import RunState
from ddenv.settings import SETTINGS, Failure, Reduction, read
from ddenv.text import Data, plain


class Settings(Reduction, Failure):
    """A scenario's `name` and its settings; a damaged one has its default."""

    def __init__(self, scenario: Data) -> None:
        self.name = plain(scenario.get("name", "run"))
        for one in SETTINGS.values():
            setattr(self, one.name, read(scenario, one))

    @property
    def most_runs(self) -> int:
        """How many runs without f, and none with it, a candidate may have."""
        if self.accept_rate == "exact":
            return self.exact_seeds
        return 1 + self.iterations

    @property
    def reduces_one_run(self) -> bool:
        """Whether a single failing run is reduced exactly."""
        return self.accept_rate == "exact" and self.exact_seeds == 1


def settings(state: RunState) -> Settings:
    """What the run is asked to do now."""
    return Settings(state.scenario)
