"""Where models are beside the path of the robot."""

from __future__ import annotations

import numpy as np

# So many models at a time are compared with the whole path: 5,000 at once would take hundreds of MB.
BLOCK = 256


def nearest_on_path(places: np.ndarray, times: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far each of `places` (M, 3) is from the path (N, 3), m, and when (s) the robot was at the nearest point: two (M,).

    The path is the segments between its points, which were reached at `times` (N,); of several nearest points the first counts.
    """
    if len(path) == 1:
        path, times = np.repeat(path, 2, axis=0), np.repeat(times, 2)
    distances, moments = np.empty(len(places)), np.empty(len(places))
    for first in range(0, len(places), BLOCK):
        block = slice(first, first + BLOCK)
        apart, fraction = to_segments(places[block], path)
        nearest = apart.argmin(axis=1)
        rows = np.arange(len(nearest))
        distances[block] = apart[rows, nearest]
        moments[block] = times[nearest] + fraction[rows, nearest] * (times[nearest + 1] - times[nearest])
    return distances, moments


def to_segments(places: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distance (m) of each place (M, 3) to each segment of the path (N, 3), and how far along it that is: two (M, N - 1)."""
    steps = np.diff(path, axis=0)
    lengths = np.einsum("ij,ij->i", steps, steps)
    along = places @ steps.T - np.einsum("ij,ij->i", path[:-1], steps)
    fraction = np.clip(along / np.where(lengths > 0, lengths, 1.0), 0.0, 1.0)
    gaps = [places[:, None, axis] - path[None, :-1, axis] - fraction * steps[None, :, axis] for axis in range(3)]
    return np.sqrt(sum(gap * gap for gap in gaps)), fraction
