"""Remembers the cells on the terminal, and sends only cells that changed.

A running reduction of the ditch at 120 x 36 sends 3 kB a second with it, and 66 kB without: Textual
sends whole rows. This depends on two internal classes of Textual, which describe updates;
tests/workbench/terminal/test_written.py checks them.
"""

from __future__ import annotations

from collections.abc import Iterator

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.style import Style
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate
from textual.strip import Strip

# Fewer unchanged cells than this between changed ones are written again: moving the cursor takes as
# many bytes.
GAP = 8
# The errors of an update whose classes have changed.
STRANGE = (AttributeError, IndexError, KeyError, TypeError, ValueError)
# A character and its style; None is an unknown cell.
Cell = tuple[str, Style | None] | None


class CellDiff:
    """The cells of a terminal, as far as they are known."""

    def __init__(self) -> None:
        self._rows: dict[int, list[Cell]] = {}

    def forget(self) -> None:
        """Forgets all cells: something else was written, or the terminal was resized."""
        self._rows.clear()

    def fewer(self, update: RenderableType | None) -> RenderableType | None:
        """The same update, but it writes only changed cells. An update of an unknown kind is
        returned unchanged.
        """
        if type(update) is ChopsUpdate or type(update) is LayoutUpdate:
            return _Fewer(self, update)
        if update is not None:
            self.forget()
        return update

    def sequence(self, update: ChopsUpdate | LayoutUpdate, console: Console) -> str:
        """The codes to write, which then count as written."""
        found = []
        for x, y, strip in _pieces(update):
            width = strip.cell_length
            row = self._rows.setdefault(y, [])
            row += [None] * (x + width - len(row))
            cells: list[Cell] = [(char, style) for text, style, _ in strip for char in text]
            # Terminals do not agree on which characters are wide: a piece with these is always
            # written as a whole.
            single = all(char.isascii() or cell_len(char) == 1 for char in set(strip.text))
            plain = len(cells) == width and strip.text.isprintable() and single
            before = row[x : x + width]
            row[x : x + width] = cells if plain else [None] * width
            for first, last in _differing(before, cells) if plain else [(0, width)]:
                found.append(
                    f"\x1b[{y + 1};{x + first + 1}H{strip.crop(first, last).render(console)}"
                )
        return "".join(found)


class _Fewer(CompositorUpdate):
    """An update that writes fewer cells; if it cannot be read, Textual draws it in full."""

    def __init__(self, written: CellDiff, update: ChopsUpdate | LayoutUpdate) -> None:
        self._written = written
        self._update = update

    def render_segments(self, console: Console) -> str:
        try:
            return self._written.sequence(self._update, console)
        except STRANGE:
            self._written.forget()
            return self._update.render_segments(console)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield self._update


def _pieces(update: ChopsUpdate | LayoutUpdate) -> Iterator[tuple[int, int, Strip]]:
    """Column, row and cells of all pieces, or of those that lie in the spans to update."""
    if isinstance(update, LayoutUpdate):
        for y, line in enumerate(update.strips, update.region.y):
            x = update.region.x
            for strip in line:
                yield x, y, strip
                x += strip.cell_length
        return
    for y, left, right in update.spans:
        for end, (x, piece) in zip(update.chop_ends[y], update.chops[y].items(), strict=False):
            if piece is not None and x <= right and end > left:
                yield x, y, piece if end <= right else piece.crop(0, right - x)


def _differing(before: list[Cell], now: list[Cell]) -> list[tuple[int, int]]:
    found: list[tuple[int, int]] = []
    for place, (old, new) in enumerate(zip(before, now, strict=True)):
        if old == new:
            continue
        if found and place - found[-1][1] < GAP:
            found[-1] = found[-1][0], place + 1
        else:
            found.append((place, place + 1))
    return found
