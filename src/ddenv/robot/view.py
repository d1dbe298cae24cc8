"""What lies within the view of a range sensor, by the boxes around it; what stands in between hides nothing."""

from __future__ import annotations

import math

import numpy as np

# Rows of a recording that are looked at together: enough to spread the cost of numpy's calls over.
TOGETHER = 32
# The least part of a direction along an axis: one that is along the other axis still has a crossing, far away.
PARALLEL = 1e-12


def distances(low: np.ndarray, high: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """How far (...) the boxes from `low` to `high` (..., 3) along the world's axes are from the points `eye` (..., 3), m."""
    return np.linalg.norm(np.maximum(np.maximum(low - eye, eye - high), 0.0), axis=-1)


def first_in_view(
    low: np.ndarray, high: np.ndarray, eyes: np.ndarray, headings: np.ndarray, view_range: float, view_angle: float
) -> np.ndarray:
    """In which row (N,) each of N boxes is in view for the first time, see `in_view`; -1 for those that never are.

    `low` and `high` (T, N, 3), `eyes` (T, 3), all in m, and `headings` (T,) in rad have a row for each instant.
    """
    first = np.full(low.shape[1], -1)
    for start in range(0, len(eyes), TOGETHER):
        rows = slice(start, start + TOGETHER)
        eye = eyes[rows]
        lowest, highest = low[rows].min(axis=0) - eye.max(axis=0), eye.min(axis=0) - high[rows].max(axis=0)
        least = np.linalg.norm(np.maximum(np.maximum(lowest, highest), 0.0), axis=1)
        near = np.flatnonzero((first < 0) & (least <= view_range))
        seen = in_view(low[rows, near], high[rows, near], eye[:, None], headings[rows, None], view_range, view_angle)
        ever = seen.any(axis=0)
        first[near[ever]] = start + seen.argmax(axis=0)[ever]
    return first


def in_view(
    low: np.ndarray, high: np.ndarray, eye: np.ndarray, heading: np.ndarray, view_range: float, view_angle: float
) -> np.ndarray:
    """Of which boxes (...) some part is in view of `eye`: within `view_range` (m) and, seen from above, the field of view.

    `low` and `high` (..., 3) are the boxes' corners, `eye` (..., 3) is where it is looked from, m, and `heading` (...) the middle
    of the field of view, rad, all in the world frame; `view_angle` is its full width, rad. A box that is above, below or
    around `eye` is in the field of view.
    """
    seen = distances(low, high, eye) <= view_range
    if view_angle >= math.tau:
        return seen
    eye, heading = np.broadcast_to(eye, low.shape)[seen], np.broadcast_to(heading, seen.shape)[seen]
    low, high = low[seen] - eye, high[seen] - eye
    drop = np.maximum(np.maximum(low[:, 2], -high[:, 2]), 0.0)
    x, y = np.clip(0.0, low[:, :2], high[:, :2]).T
    offset = np.arctan2(y, x) - heading
    # What is nearest within the field of view is the nearest of the whole box, or lies on an edge of the field.
    shown = np.abs(offset - math.tau * np.round(offset / math.tau)) <= view_angle / 2
    shown |= (x == 0) & (y == 0)
    for edge in (heading - view_angle / 2, heading + view_angle / 2):
        shown |= np.hypot(_ways(low[:, :2], high[:, :2], edge), drop) <= view_range
    seen[seen] = shown
    return seen


def _ways(low: np.ndarray, high: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """How far (N,) from the origin rectangles (N, 2) begin along `direction` (N,), rad; infinite for those beside it, m."""
    ray = np.column_stack([np.cos(direction), np.sin(direction)])
    ray = np.where(np.abs(ray) < PARALLEL, PARALLEL, ray)
    enter = np.maximum(np.minimum(low / ray, high / ray).max(axis=1), 0.0)
    leave = np.maximum(low / ray, high / ray).min(axis=1)
    return np.where(leave >= enter, enter, np.inf)
