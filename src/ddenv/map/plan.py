"""The models of a world in the order in which they are drawn, with what is told of each: place, size and colour."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from ddenv.map.footprints import ROUND, Footprint, footprint
from ddenv.map.paint import RGB
from ddenv.world.extent import model_bounds, shape_bounds
from ddenv.world.model import Model, Plane, World, is_ground
from ddenv.world.pose import Vector

STATIC: RGB = (150, 156, 166)
DYNAMIC: RGB = (205, 140, 70)
# A model so many times larger than the median, and than this, is a floor that others stand on (or a roof over them).
FLOOR_FACTOR = 12.0
FLOOR_AREA = 4.0  # m^2


@dataclass(frozen=True, slots=True)
class Drawn:
    """A model from above. `center` and `size` are those of the box around it, m; `shade` 0..1 tells low from high ones.

    `color` is the one that covers most of it, or one for its kind where the file names none.
    """

    model: Model
    outline: Footprint
    center: Vector
    size: Vector
    color: RGB
    floor: bool
    shade: float

    @property
    def top(self) -> float:
        """Height of the highest point, m."""
        return self.center[2] + self.size[2] / 2


def plan(world: World, corners: int = ROUND) -> tuple[Drawn, ...]:
    """All models but the ground: floors first, the largest of them first, then the others from the lowest top to the highest.

    Where tops are equal the larger comes first. Circles are polygons with so many `corners`.
    """
    models = [model for model in world.models if not is_ground(model)]
    outlines = [footprint(model, corners) for model in models]
    boxes = [_box(model) for model in models]
    tops = np.array([center[2] + size[2] / 2 for center, size in boxes])
    limit = max(FLOOR_AREA, FLOOR_FACTOR * float(np.median([each.area for each in outlines]))) if models else 0.0
    floors = [len(models) > 2 and each.area > limit for each in outlines]
    shades = _shades(tops, np.array(floors, dtype=bool))
    drawn = [
        Drawn(model, outline, *box, _color(model), floor, shade)
        for model, outline, box, floor, shade in zip(models, outlines, boxes, floors, shades, strict=True)
    ]
    return tuple(sorted(drawn, key=_turn))


def _turn(each: Drawn) -> tuple[int, float, float]:
    """Floors come first, and last what has no shape to be seen by; heights are told apart in steps of 1 cm."""
    group = 0 if each.floor else 1 if each.outline.polygons else 2
    return group, 0.0 if each.floor else round(each.top, 2), -each.outline.area


def _box(model: Model) -> tuple[Vector, Vector]:
    """Centre and size of what a model fills."""
    bounds = model_bounds(model)
    if bounds is None:
        return model.pose.position, (0.0, 0.0, 0.0)
    low, high = bounds
    return tuple(((low + high) / 2).tolist()), tuple((high - low).tolist())


def _shades(tops: np.ndarray, floors: np.ndarray) -> list[float]:
    """Heights between the lowest and the highest of the models that are no floors, as 0..1; 1 where all are as high."""
    others = tops[~floors]
    if not len(others) or np.ptp(others) < 0.01:
        return [1.0] * len(tops)
    return np.clip((tops - others.min()) / np.ptp(others), 0.0, 1.0).tolist()


def _color(model: Model) -> RGB:
    areas: dict[RGB, float] = defaultdict(float)
    for link in model.links:
        for visual in link.visuals:
            if visual.color is None or visual.color[3] <= 0 or isinstance(visual.shape, Plane):
                continue
            low, high = shape_bounds(visual.shape, visual.pose)
            red, green, blue = (round(255 * min(1.0, max(0.0, part))) for part in visual.color[:3])
            areas[red, green, blue] += float(np.prod((high - low)[:2]))
    if areas:
        return max(areas, key=areas.get)
    return STATIC if model.static else DYNAMIC
