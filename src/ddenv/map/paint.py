"""The layers of a map as arrays of character cells with colours, drawn on top of each other, then
cut into styled runs.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ddenv.map.colors import BLACK, RGB, WHITE, luminance, packed, readable

LEAST_APART = 70  # minimum difference in brightness between a dot and its background, of 255
# Blocks that fill their cells: text over them takes their colour as background.
FILLED = tuple(map(ord, "█▉▇"))


@dataclass(frozen=True, slots=True)
class Run:
    """Consecutive characters of one row in one style; `fore` and `back` are packed colours."""

    text: str
    fore: int
    back: int
    bold: bool


class Canvas:
    """`chars` are code points, `fore` and `back` packed colours (or PLAIN), all of shape (rows,
    columns).
    """

    def __init__(self, rows: int, columns: int, back: RGB | int) -> None:
        color = back if isinstance(back, int) else packed(back)
        self.chars = np.full((rows, columns), ord(" "), dtype="<u4")
        self.fore = np.full((rows, columns), color, dtype=np.int32)
        self.back = np.full((rows, columns), color, dtype=np.int32)
        self.bold = np.zeros((rows, columns), dtype=bool)

    def copy(self) -> Canvas:
        return deepcopy(self)

    def put(
        self,
        cell: tuple[int, int] | None,
        text: str,
        color: int | None = None,
        back: int | None = None,
    ) -> None:
        """Puts bold `text` from a cell (row, column) on; without `color` in a readable one."""
        if cell is None:
            return
        row, column = cell
        for offset, char in enumerate(text[: self.chars.shape[1] - column]):
            place = row, column + offset
            if back is not None:
                self.back[place] = back
            elif self.chars[place] in FILLED:
                self.back[place] = self.fore[place]
            self.chars[place] = ord(char)
            self.fore[place] = readable(int(self.back[place])) if color is None else color
            self.bold[place] = True

    def dots(self, bits: np.ndarray, color: int) -> None:
        """Puts braille dots over the cells, in black or white where `color` would not stand out."""
        touched = bits > 0
        filled = touched & np.isin(self.chars, FILLED)
        self.back[filled] = self.fore[filled]
        self.chars[touched] = 0x2800 + bits[touched].astype(np.uint32)
        # Black or white where `color` would not stand out.
        backs = self.back[touched]
        bright = luminance(backs)
        colors = np.full(len(backs), color, dtype=np.int32)
        near = (backs >= 0) & (abs(bright - luminance(color)) < LEAST_APART) & (color >= 0)
        colors[near] = np.where(bright[near] > 110, BLACK, WHITE)
        self.fore[touched] = colors
        self.bold[touched] = False

    def changed_rows(self, other: Canvas | None) -> list[int]:
        """The rows that differ from `other`."""
        if other is None or other.chars.shape != self.chars.shape:
            return list(range(self.chars.shape[0]))
        same = (
            (self.chars == other.chars)
            & (self.fore == other.fore)
            & (self.back == other.back)
            & (self.bold == other.bold)
        )
        rows: list[int] = np.flatnonzero(~same.all(axis=1)).tolist()
        return rows

    def text(self, row: int) -> str:
        """A row without its colours."""
        text: str = self.chars[row].tobytes().decode("utf-32-le")
        return text

    def runs(self, row: int) -> Iterator[Run]:
        """A row as text, cut where the style changes."""
        fore = self.fore[row]
        back = self.back[row]
        bold = self.bold[row]
        text = self.text(row)
        differs = (np.diff(fore) != 0) | (np.diff(back) != 0) | (bold[1:] != bold[:-1])
        cuts = [0, *(np.flatnonzero(differs) + 1).tolist(), len(text)]
        for start, end in pairwise(cuts):
            yield Run(text[start:end], int(fore[start]), int(back[start]), bool(bold[start]))
