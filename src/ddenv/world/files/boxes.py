"""Finds the meshes that are boxes: contact with these is exact, and beams meet them faster."""

from __future__ import annotations

import math

import numpy as np

from ddenv.world.model import Box, Mesh
from ddenv.world.pose import Pose, pointing, vector

# A mesh that leaves at most this share of the box around it empty is that box.
EMPTY = 5e-4
SQUARE = 1e-3  # the maximum cosine of the angle between two faces of a box


def box_of(mesh: Mesh) -> tuple[Box, Pose] | None:
    """The box that a convex mesh is, and its pose in the frame of the mesh; None if it is another
    shape.
    """
    if len(mesh.vertices) != 8:
        return None
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.sqrt((normals * normals).sum(axis=1))
    normals = normals[areas > 0] / areas[areas > 0, None]
    # The axes of the box in the order of those of the mesh that they are nearest to, so that a box
    # along these is not turned.
    first = normals[normals[:, 0].argmax()]
    across = normals[np.abs(normals @ first) < SQUARE]
    if not len(across):
        return None
    second = across[across[:, 1].argmax()]
    upright = pointing(vector(np.cross(first, second)))
    x, y, _ = upright.inverse().rotate(vector(first))
    turn = upright @ Pose.from_rpy(0.0, 0.0, 0.0, 0.0, 0.0, math.atan2(y, x))
    places = mesh.vertices @ turn.rotation()
    size = np.ptp(places, axis=0)
    if volume(mesh) < (1 - EMPTY) * size.prod():
        return None
    return Box(vector(size)), turn @ Pose(vector(places.min(axis=0) + size / 2))


def volume(mesh: Mesh) -> float:
    """What the closed surface encloses, m^3."""
    # From its middle: far from it the sum would lose digits.
    first, second, third = np.moveaxis(mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0), 1, 0)
    return float(np.einsum("ij,ij->", first, np.cross(second, third))) / 6
