"""Remembers the cells on the terminal, and sends only cells that changed.

This depends on two internal classes of Textual, which describe updates;
tests/workbench/terminal/test_written.py checks them. Textual itself draws all other updates.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import NamedTuple

from rich.cells import cell_len
from rich.color import ColorSystem
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.style import Style
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate
from textual.strip import Strip

# Fewer unchanged cells than this between changed ones are written again: moving the cursor takes as many bytes.
GAP = 4
# The maximum number of styles whose codes are remembered.
MOST_STYLES = 4096
# The errors of an update whose classes have changed.
STRANGE = (AttributeError, IndexError, KeyError, TypeError, ValueError)
SYSTEMS = {"standard": ColorSystem.STANDARD, "256": ColorSystem.EIGHT_BIT, "windows": ColorSystem.WINDOWS}
RESET = "\x1b[0m"
CLOSED = "\x1b]8;;\x1b\\"
# Attributes that are invisible on a blank.
UNSEEN = ("", "1", "2", "1;2")


class Pen(NamedTuple):
    """The codes of a style: attributes, the colours of text and background, and a link. "*" is any colour of text."""

    attributes: str = ""
    fore: str = "39"
    back: str = "49"
    link: str = ""

    @property
    def of_blanks(self) -> Pen:
        """The pen as seen on a blank."""
        return Pen("", "*", self.back) if self.attributes in UNSEEN and not self.link else self

    @property
    def hides_text(self) -> bool:
        """Whether text has the colour of its background."""
        return self.fore == self.back.replace("48;", "38;", 1) and not self.attributes and not self.link


PLAIN = Pen()


@dataclass(slots=True)
class _Row:
    """The cells of a row; "" in `chars` is an unknown cell, or the second half of a wide character."""

    chars: list[str] = field(default_factory=list)
    pens: list[Pen | None] = field(default_factory=list)

    def widen(self, columns: int) -> None:
        missing = columns - len(self.chars)
        self.chars += [""] * missing
        self.pens += [None] * missing


class Written:
    """The cells of a terminal, as far as they are known."""

    def __init__(self) -> None:
        self._rows: dict[int, _Row] = {}
        self._pens: dict[Style | None, Pen] = {}
        self._pen = PLAIN

    def forget(self) -> None:
        """Forgets all cells: something else was written, or the terminal was resized."""
        self._rows.clear()
        self._pen = PLAIN

    def fewer(self, update: RenderableType | None) -> RenderableType | None:
        """The same update, but it writes only changed cells. An update of an unknown kind is returned unchanged."""
        if type(update) is ChopsUpdate or type(update) is LayoutUpdate:
            return _Fewer(self, update)
        if update is not None:
            self.forget()
        return update

    def sequence(self, update: ChopsUpdate | LayoutUpdate, console: Console) -> str:
        """The codes to write, which then count as written."""
        strips = _of_layout(update) if isinstance(update, LayoutUpdate) else _of_chops(update)
        parts = [part for x, y, strip in strips for part in self._changes(x, y, strip, console)]
        return "".join([*parts, self._turn(PLAIN)])

    def _changes(self, x: int, y: int, strip: Strip, console: Console) -> Iterator[str]:
        chars, pens, simple = self._cells(strip, console)
        row = self._rows.setdefault(y, _Row())
        end = x + len(chars)
        row.widen(end)
        old_chars, old_pens = row.chars[x:end], row.pens[x:end]
        if old_chars == chars and old_pens == pens:
            return
        row.chars[x:end], row.pens[x:end] = chars, pens
        # Terminals do not agree on which characters are wide: a piece with these is written as a whole, from its first cell on.
        known = simple and "" not in old_chars
        for first, last in _differing(old_chars, chars, old_pens, pens) if known else [(0, len(chars))]:
            yield _move(x + first, y)
            cells = zip(chars[first:last], pens[first:last], strict=True)
            for pen, some in groupby(cells, key=lambda cell: cell[1]):
                yield self._turn(pen)
                yield "".join(char for char, _ in some)

    def _turn(self, pen: Pen) -> str:
        """The codes from the current pen to this one."""
        now, self._pen = self._pen, pen
        if pen == now:
            return ""
        if pen == PLAIN:
            return (CLOSED if now.link else "") + RESET
        if pen.fore == "*":
            self._pen = pen = Pen(pen.attributes, now.fore, pen.back, pen.link)
        codes = [pen.fore] if pen.fore != now.fore else []
        codes += [pen.back] if pen.back != now.back else []
        if pen.attributes != now.attributes:
            codes = ["0", *filter(None, [pen.attributes]), pen.fore, pen.back]
        link = f"\x1b]8;;{pen.link}\x1b\\" if pen.link != now.link else ""
        return link + (f"\x1b[{';'.join(codes)}m" if codes else "")

    def _cells(self, strip: Strip, console: Console) -> tuple[list[str], list[Pen], bool]:
        """Characters and pens by cell, and whether each character takes just one."""
        chars: list[str] = []
        pens: list[Pen] = []
        simple = True
        for segment in strip:
            text, width = segment.text, segment.cell_length
            pen = self._pen_of(segment.style, console)
            if pen.hides_text or not text.strip(" "):
                text, pen = " " * width, pen.of_blanks
            if text.isascii() or (width == len(text) and all(cell_len(char) == 1 for char in set(text))):
                chars += text
            else:
                # The first cell holds the whole text, so another text is a changed cell.
                chars += [text, *[""] * (width - 1)][:width]
                simple = False
            pens += [pen] * width
        return chars, pens, simple

    def _pen_of(self, style: Style | None, console: Console) -> Pen:
        pen = self._pens.get(style)
        if pen is None:
            if len(self._pens) >= MOST_STYLES:
                self._pens.clear()
            pen = self._pens[style] = _pen(style, SYSTEMS.get(console.color_system or "", ColorSystem.TRUECOLOR))
        return pen


class _Fewer(CompositorUpdate):
    """An update that writes fewer cells; if it cannot be read, Textual draws it in full."""

    def __init__(self, written: Written, update: ChopsUpdate | LayoutUpdate) -> None:
        self._written, self._update = written, update

    def render_segments(self, console: Console) -> str:
        try:
            return self._written.sequence(self._update, console)
        except STRANGE:
            self._written.forget()
            return self._update.render_segments(console)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield self._update


def _pen(style: Style | None, system: ColorSystem) -> Pen:
    if style is None:
        return PLAIN
    fore, back = style.color, style.bgcolor
    attributes = style.without_color.update_link(None).render(" ")
    return Pen(
        attributes.removeprefix("\x1b[").partition("m")[0].strip(),
        ";".join(fore.downgrade(system).get_ansi_codes()) if fore else PLAIN.fore,
        ";".join(back.downgrade(system).get_ansi_codes(foreground=False)) if back else PLAIN.back,
        style.link or "",
    )


def _of_layout(update: LayoutUpdate) -> Iterator[tuple[int, int, Strip]]:
    """Column, row and cells of all pieces."""
    for y, line in enumerate(update.strips, update.region.y):
        x = update.region.x
        for strip in line:
            yield x, y, strip
            x += strip.cell_length


def _of_chops(update: ChopsUpdate) -> Iterator[tuple[int, int, Strip]]:
    """Column, row and cells of the pieces that lie in the spans to update."""
    for y, left, right in update.spans:
        for end, (x, strip) in zip(update.chop_ends[y], update.chops[y].items(), strict=False):
            if strip is not None and x <= right and end > left:
                yield x, y, strip if end <= right else strip.crop(0, right - x)


def _differing(
    old_chars: list[str], chars: list[str], old_pens: list[Pen | None], pens: list[Pen]
) -> list[tuple[int, int]]:
    """The spans in which cells differ."""
    found: list[tuple[int, int]] = []
    cells = zip(old_chars, chars, old_pens, pens, strict=True)
    for place, (old_char, char, old_pen, pen) in enumerate(cells):
        if old_char == char and old_pen == pen:
            continue
        end = found[-1][1] if found else -GAP
        if place - end < GAP and pens[end:place] == [pens[end - 1]] * (place - end):
            found[-1] = found[-1][0], place + 1
        else:
            found.append((place, place + 1))
    return found


def _move(x: int, y: int) -> str:
    return f"\x1b[{y + 1};{x + 1}H"
