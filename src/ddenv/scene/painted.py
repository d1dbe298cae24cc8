"""The surfaces of models with their colours, and the objects that a browser makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from meshcat.geometry import (
    LineBasicMaterial,
    LineSegments,
    Mesh,
    MeshLambertMaterial,
    PointsGeometry,
    TriangularMeshGeometry,
)

from ddenv.scene import colors, mesh
from ddenv.scene.colors import Color
from ddenv.scene.mesh import Surface
from ddenv.world.model import Collision, Model, Plane, Visual

# Corners of a box, numbered by bits, that its twelve edges join.
_PAIRS = np.array([(a, a | 1 << axis) for axis in range(3) for a in range(8) if not a >> axis & 1]).ravel()


@dataclass(frozen=True)
class Painted:
    """A surface of one transparency; `tints` (N, 3) are the colours of its vertices."""

    surface: Surface
    tints: np.ndarray
    alpha: float

    def thing(self) -> Mesh:
        geometry = TriangularMeshGeometry(self.surface.vertices, self.surface.faces, color=self.tints)
        # Only the outside is drawn: two-sided faces would cast shadows on themselves.
        return Mesh(geometry, MeshLambertMaterial(vertexColors=True, side=0, opacity=self.alpha))


def paint(model: Model) -> list[Painted]:
    """All visuals of a model, in the frame of its poses. A link without visuals shows its collisions."""
    groups: dict[float, list[Painted]] = {}
    default = colors.default_color(model)
    shown: list[Visual | Collision] = [item for link in model.links for item in link.visuals or link.collisions]
    vary = len(shown) > 20
    for number, item in enumerate(shown):
        if isinstance(item.shape, Plane):
            continue
        color = (item.color if isinstance(item, Visual) else None) or default
        *tint, alpha = colors.varied(color, number) if vary else color
        surface = mesh.of_shape(item.shape).at(item.pose)
        groups.setdefault(alpha, []).append(Painted(surface, np.tile(tint, (len(surface.vertices), 1)), alpha))
    return [joined(parts) for alpha, parts in groups.items() if alpha > 0]


def joined(parts: Sequence[Painted]) -> Painted:
    """All `parts`, at least one, which have one transparency."""
    surface = mesh.merge([part.surface for part in parts])
    return Painted(surface, np.concatenate([part.tints for part in parts]), parts[0].alpha)


def plain(shape: Surface, color: Color, *, glow: float = 0.0, offset: int = 0) -> Mesh:
    """An object of one colour. `glow` 0..1 is its own light; with `offset` above 0, others in the same plane are drawn over it."""
    options: dict[str, Any] = {}
    if glow:
        red, green, blue, _ = color
        options["emissive"] = colors.hexadecimal((glow * red, glow * green, glow * blue, 1.0))
    if offset:
        options |= {"polygonOffset": True, "polygonOffsetFactor": offset, "polygonOffsetUnits": offset}
    material = MeshLambertMaterial(color=colors.hexadecimal(color), opacity=color[3], side=0, **options)
    return Mesh(TriangularMeshGeometry(shape.vertices, shape.faces), material)


def lines(ends: np.ndarray, color: Color) -> LineSegments:
    """Line segments between pairs of `ends` (2 N, 3)."""
    material = LineBasicMaterial(color=colors.hexadecimal(color), opacity=color[3])
    return LineSegments(PointsGeometry(np.asarray(ends, dtype=np.float32).T), material)


def outline(model: Model, shape: Surface) -> np.ndarray:
    """Ends (24, 3) of the 12 edges of the box around `shape` in the axes of the model; world frame."""
    own = shape.at(model.pose.inverse()).vertices
    low, high = own.min(axis=0), own.max(axis=0)
    return Surface(edges_of(low, high), shape.faces).at(model.pose).vertices


def edges_of(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Ends (24, 3) of the edges of a box."""
    corners = np.array([[(high if bit >> axis & 1 else low)[axis] for axis in range(3)] for bit in range(8)])
    ends: np.ndarray = corners[_PAIRS]
    return ends
