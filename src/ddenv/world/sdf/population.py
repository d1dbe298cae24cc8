"""The copies that Gazebo Classic makes of the model in a `<population>`, at the places that its
`Population.cc` gives them.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from ddenv.world.pose import Vector
from ddenv.world.sdf.context import MOST_MODELS, Context, refuse
from ddenv.world.sdf.frames import FARTHEST, pose_of
from ddenv.world.sdf.includes import Part
from ddenv.world.sdf.xml import Element, complain, name_of, number, numbers, parse, text_of

# By distribution: what says how many copies stand along x, y and z; empty where it is one.
COUNTS = {
    "grid": ("distribution/cols", "distribution/rows", ""),
    "linear-x": ("model_count", "", ""),
    "linear-y": ("", "model_count", ""),
    "linear-z": ("", "", "model_count"),
}


def copies(population: Element, files: tuple[Path, ...], context: Context) -> list[Part]:
    """The models that `population` stands for. They share one text, so that none can be removed
    alone. Raises UserError.
    """
    if context.ignores("population"):
        context.note("ignored", population, "left out by --ignore population")
        return []
    places = _places(population)
    made = f"by {len(places)} copies of its model, as in Gazebo Classic"
    context.note(
        "replaced",
        population,
        f"{made}; they stay, unless 'ddenv world convert' writes them out first",
    )
    model = _child(population, "model")
    return [_copy(model, number, place, files) for number, place in enumerate(places)]


def _places(population: Element) -> list[Vector]:
    """Where the copies stand, in the world frame, m."""
    kind = text_of(population.find("distribution/type"))
    if kind not in COUNTS:
        why = (
            f"only Gazebo Classic knows the places of a '{kind[:40]}' distribution; write its "
            "models out"
        )
        raise refuse(population, "population", why)
    given = COUNTS[kind]
    counts = [int(number(population, path, 0)) if path else 1 for path in given]
    if min(counts) < 1 or math.prod(counts) > MOST_MODELS:
        raise complain(
            population,
            f"must stand for 1 to {MOST_MODELS} models; see its rows and cols, or model_count",
        )
    is_grid = kind == "grid"
    lengths = _child(population, "distribution/step" if is_grid else "box/size")
    size = step = np.array(numbers(lengths, 3))
    least = -FARTHEST if is_grid else 0.0
    if not least < step.min() <= step.max() < FARTHEST:
        raise complain(lengths, f"must be between {least:g} and {FARTHEST:g} m")
    if is_grid:
        size = step * np.subtract(counts, 1)
    else:
        step = size / counts
    first = np.where([path != "" for path in given], 0, size / 2)
    indices = [index[::-1] for index in np.ndindex(*reversed(counts))]
    offsets = first + step * indices
    pose = pose_of(_child(population, "pose"))
    # The pose turns the offsets, but not the way from the middle to where they begin.
    places: list[Vector] = (pose.position - size / 2 + offsets @ pose.rotation().T).tolist()
    return places


def _child(population: Element, path: str) -> Element:
    child = population.find(path)
    if child is None:
        raise complain(population, f"has no {path}")
    return child


def _copy(model: Element, number: int, place: Vector, files: tuple[Path, ...]) -> Part:
    name = f"{name_of(model)}_clone_{number}"
    position = " ".join(map(repr, place))
    at = parse(
        f"<model name={quoteattr(name)}><pose>{position} 0 0 0</pose></model>".encode(),
        model.source,
    )
    at.start = model.start
    at.end = model.end
    at.line = model.line
    at.parent = model.parent
    return Part(element=model, at=at, name=name, files=files)
