"""Where letters stand on a map of cells: on every model while they can be read, else on some, and at least on one of each group."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from ddenv.map import arrays as np
from ddenv.map.raster import label_cells

Cell = tuple[int, int]
# One letter for so many cells can still be read; of more, one is left in each block of (rows, columns), and one of each group
# unless even those are too many.
ROOM, LEAST_ROOM = 20, 4
BLOCK = 3, 8


@dataclass(frozen=True, slots=True, eq=False)
class Signs:
    """What stands for each of N models: its `texts`, "" for none. Of each of its `groups` (N,) at least one is to be seen.

    Those with a lower `rank` (N,) come first; one that is `sure` (N,) is not left out for want of room.
    """

    texts: Sequence[str]
    groups: np.ndarray
    rank: np.ndarray
    sure: np.ndarray


def place_signs(grid: np.ndarray, centers: np.ndarray, signs: Signs, taken: Collection[Cell] = ()) -> dict[int, Cell]:
    """The cell where each model's sign begins, for as many models as can be read; no two share a cell.

    `grid` (2 rows, columns) are the owners of pixels, `centers` (N, 2) pixels of the models; `taken` cells stay free.
    """
    rows, columns = grid.shape[0] // 2, grid.shape[1]
    cells = label_cells(grid, centers)
    told = np.array([bool(text) for text in signs.texts], dtype=bool)
    seen = np.flatnonzero((cells[:, 0] >= 0) & told)
    sizes = np.bincount(grid[grid >= 0], minlength=len(centers))
    seen = seen[np.lexsort((-sizes[seen], signs.rank[seen], ~signs.sure[seen]))]
    if len(seen) * ROOM > rows * columns:
        kept = _readable(cells[seen] // BLOCK, signs.sure[seen])
        _, first = np.unique(signs.groups[seen], return_index=True)
        if sum(len(signs.texts[index]) for index in seen[first].tolist()) * LEAST_ROOM <= rows * columns:
            kept[first] = True
        seen = seen[kept]
    occupied, placed, missing = set(taken), {}, []
    for index, (row, column) in zip(seen.tolist(), cells[seen].tolist(), strict=True):
        if not _put(index, signs.texts[index], row, column, columns, occupied, placed):
            missing.append(index)
    groups = {int(signs.groups[index]) for index in placed}
    for index in missing:
        group = int(signs.groups[index])
        if (group not in groups or signs.sure[index]) and _elsewhere(index, signs.texts[index], grid, occupied, placed):
            groups.add(group)
    return placed


def _readable(blocks: np.ndarray, sure: np.ndarray) -> np.ndarray:
    """Which signs stay where there are too many: the sure ones, and the first of each block."""
    kept = sure.copy()
    kept[np.unique(blocks[:, 0] << 20 | blocks[:, 1], return_index=True)[1]] = True
    return kept


def _put(index: int, text: str, row: int, column: int, columns: int, occupied: set[Cell], placed: dict) -> bool:
    column = max(0, min(column, columns - len(text)))
    own = [(row, column + offset) for offset in range(len(text))]
    if not occupied.isdisjoint(own):
        return False
    occupied.update(own)
    placed[index] = row, column
    return True


def _elsewhere(index: int, text: str, grid: np.ndarray, occupied: set[Cell], placed: dict) -> bool:
    """Puts a sign on any other cell of its model, or beside one if there is no room."""
    rows, columns = np.nonzero((grid[0::2] == index) | (grid[1::2] == index))
    cells = list(zip(rows.tolist(), columns.tolist(), strict=True))
    beside = [(row, column + step) for row, column in cells for step in (1, -1, -len(text))]
    inside = [cell for cell in beside if 0 <= cell[1] < grid.shape[1]]
    return any(_put(index, text, *cell, grid.shape[1], occupied, placed) for cell in [*cells, *inside])
