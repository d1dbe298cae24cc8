"""Convex meshes for beams that lie in one plane: only the faces that the plane cuts can be met."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ddenv.robot.sensing.crossing import NEVER, Interval
from ddenv.world.model import Mesh


@dataclass(frozen=True)
class Facets:
    """A convex mesh as what is behind all of its faces, in the frame in which it is between -1 and 1 along each axis.

    `corners` (3, V) are its vertices and `faces` (3, M) numbers of them. Of a point behind a face the product with the face's
    column of `normals` (3, M) is at most that of `offsets` (M,).
    """

    corners: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray

    @classmethod
    def of(cls, mesh: Mesh, middle: np.ndarray, half: np.ndarray) -> Facets:
        """Those of `mesh`, which is around `middle` (3,) and as large as twice `half` (3,), m."""
        corners = (mesh.vertices - middle) / half
        start, second, third = (corners[mesh.faces[:, number]] for number in range(3))
        normals = np.cross(second - start, third - start)
        sizes = np.sqrt((normals * normals).sum(axis=1))
        faces, normals = mesh.faces[sizes > 0], normals[sizes > 0] / sizes[sizes > 0, None]
        # The normal of a sliver may be wrong: with this offset it still cuts off no corner.
        offsets = (normals @ corners.T).max(axis=1)
        return cls(corners.T.copy(), faces.T.copy(), normals.T.copy(), offsets)

    def cast(self, start: np.ndarray, way: np.ndarray, normal: np.ndarray) -> Interval:
        """Where beams from `start` (3,) along `way` (3, P), at right angles to `normal` (3,), enter and leave, see `crossing`."""
        corners = self.corners - start[:, None]
        heights = (normal[0] * corners[0] + normal[1] * corners[1] + normal[2] * corners[2])[self.faces]
        (cut,) = ((heights.min(axis=0) <= 0) & (heights.max(axis=0) >= 0)).nonzero()
        if not len(cut):
            return np.full(way.shape[1], np.inf), np.full(way.shape[1], -np.inf)
        out = self.normals.take(cut, axis=1)[:, :, None]
        above = out[0] * start[0] + out[1] * start[1] + out[2] * start[2] - self.offsets[cut, None]
        rise = out[0] * way[0] + out[1] * way[1] + out[2] * way[2] + NEVER
        crossing = -above / rise
        enter = np.where(rise < 0, crossing, -np.inf).max(axis=0)
        return enter, np.where(rise > 0, crossing, np.inf).min(axis=0)
