"""The cheapest ways over a square grid whose cells have eight neighbours."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

# Steps from a cell in the order of their direction, counterclockwise from x; the axis of number k is k % 4.
STEPS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
AXES = np.arange(8) % 4
# Longer than any way: what cannot be passed is infinitely long.
LONGEST = 1e9


class Grid:
    """`count` x `count` cells, numbered row by row: the cell at column x and row y of x first has the number x * count + y."""

    def __init__(self, count: int) -> None:
        self.count = count
        cells = np.arange(count * count)
        x, y = np.divmod(cells, count)
        inside = [(x + dx >= 0) & (x + dx < count) & (y + dy >= 0) & (y + dy < count) for dx, dy in STEPS]
        # A step out of the grid leads nowhere.
        to = [np.where(there, cells + dx * count + dy, cells) for there, (dx, dy) in zip(inside, STEPS, strict=True)]
        to = np.stack(to, axis=1).astype(np.int32)
        # Where the factors (4, cells) of a step's two ends are, flat.
        self._here = (AXES * len(cells) + cells[:, None]).ravel()
        self._there = (AXES * len(cells) + to).ravel()
        self._lengths = np.tile([np.hypot(dx, dy) / 2 for dx, dy in STEPS], len(cells))
        starts = np.arange(0, to.size + 1, len(STEPS), dtype=np.int32)
        self._graph = csr_matrix((np.ones(to.size), to.ravel(), starts), shape=(len(cells), len(cells)))

    def search(self, factors: np.ndarray, start: int) -> tuple[np.ndarray, np.ndarray]:
        """How long, in cells, the cheapest way from `start` to each cell is, infinite if there is none, and from which it comes.

        `factors` (4, cells) is how much longer than it is a step along x, along the first diagonal, along y and along the
        second diagonal counts in each cell, at least 1, infinite where it cannot be; a step counts with the mean of its ends'.
        """
        flat = factors.ravel()
        self._graph.data = (flat[self._here] + flat[self._there]) * self._lengths
        return dijkstra(self._graph, indices=start, return_predecessors=True, limit=LONGEST)


def way_to(cell: int, sources: np.ndarray) -> list[int]:
    """The cells from the search's start to `cell`, both included."""
    way = [cell]
    while sources[way[-1]] >= 0:
        way.append(int(sources[way[-1]]))
    return way[::-1]
