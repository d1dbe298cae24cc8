"""What all parts of a world share, so that a run in one of them has the same bits wherever that
part was written.
"""

from __future__ import annotations

from ddenv.world.extent import corners, shape_bounds
from ddenv.world.model import World
from ddenv.world.scenario import Scenario, Whole

# A robot this far below everything that it could stand on has fallen out of the world, m.
FALL = 2.0


def whole_of(world: World, scenario: Scenario) -> Whole:
    """What all parts of `world` share; of a world that is itself a part, what the scenario says."""
    if scenario.whole is not None:
        return scenario.whole
    heights = [shape_bounds(one.shape, one.pose)[0][2] for one in world.collisions]
    return Whole(
        floor=float(min(heights, default=0.0)) - FALL,
        corners=corners(world),
        moving=sum(not model.static and bool(model.links) for model in world.models),
    )
