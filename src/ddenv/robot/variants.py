"""Moving models that are not there cost nothing: for what is left of a world, a smaller plant is built where that pays.

A moving model is work for the simulator in every step, also when nothing touches it. A static one is not: that it is only
switched off costs nothing.
"""

from __future__ import annotations

import gc

from ddenv.robot.clock import Clock
from ddenv.robot.result import Progress, RunResult
from ddenv.robot.template import Template
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario

# What a moving model that is switched off costs in each step of a run, s.
HELD = 5e-6
# What building costs at least, s, and for each pair of shapes, whether they can meet or not; a pair also takes 0.15 kB.
BUILD = 0.05
PAIR = 1e-6
# A plant of more shapes than this has no smaller ones beside it: each would take more than 150 MB.
LARGEST = 1000
# How many smaller plants there are at a time.
MOST = 4


class Variants:
    """The simulator of one scenario, as `Template` is, with the same results to the last bit.

    It holds the template of the whole world and the last few smaller ones.
    """

    def __init__(self, world: World, robot: Model, scenario: Scenario) -> None:
        """Raises UserError as `Template` does."""
        self._whole = Template(world, robot, scenario)
        self._steps = Clock.of(scenario).last
        # The one that was used last stands last.
        self._smaller: list[Template] = []

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        full: bool = True,
    ) -> RunResult:
        """As `Template.run`."""
        return self._template(keep).run(keep, seed, progress, full)

    def _template(self, keep: frozenset[str]) -> Template:
        """One that has at least the models `keep`, at the least cost for one run."""
        removed = self._whole.removable - keep
        able = [one for one in (self._whole, *self._smaller) if keep <= one.names]
        template = min(able, key=lambda one: len(one.removable), default=self._whole)
        needless = template.removable & removed
        if self._pays(needless, template):
            self._forget()
            template = template.without(needless)
        if template is not self._whole:
            self._smaller = [*(one for one in self._smaller if one is not template), template]
        return template

    def _pays(self, needless: frozenset[str], template: Template) -> bool:
        """Whether building a plant without the models `needless` costs less than one run with them."""
        shapes = template.shapes_without(needless)
        return shapes <= LARGEST and BUILD + PAIR * shapes**2 < HELD * len(needless) * self._steps

    def _forget(self) -> None:
        """Makes room for one more."""
        if len(self._smaller) < MOST:
            return
        del self._smaller[0]
        # Drake's diagrams refer to themselves: without this they would stay, some 20 MB each.
        gc.collect()
