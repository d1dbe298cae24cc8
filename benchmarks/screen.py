"""What a terminal shows: only as much as is needed to see when the answer to a key is on the screen."""

from __future__ import annotations

import re

from rich.cells import cell_len

# Numbers and a letter; a title or another string up to its end; one letter; or text.
TOKEN = re.compile(r"\x1b\[([0-9;:<=>?$ ]*)([@-~])|\x1b[\]P_][^\x07\x1b]*(?:\x07|\x1b\\)|\x1b[^\[\]P_]|([^\x1b]+)")
# An incomplete sequence.
BEGUN = re.compile(r"\x1b(?:\[[0-9;:<=>?$ ]*|[\]P_][^\x07\x1b]*\x1b?)?$")
BLANK = (" ", "")
Cell = tuple[str, str]


class Screen:
    """Cells of (character, style) in rows; a style is the text of the last sequence that set it."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns = columns
        self.cells: list[list[Cell]] = [[BLANK] * columns for _ in range(rows)]
        self._row = self._column = 0
        self._style = ""
        self._rest = ""

    def feed(self, text: str) -> None:
        """Adds what a program wrote; an incomplete sequence waits for its rest."""
        text = self._rest + text
        begun = BEGUN.search(text)
        self._rest = begun.group() if begun else ""
        for token in TOKEN.finditer(text, 0, len(text) - len(self._rest)):
            numbers, letter, words = token.groups()
            if words:
                self._write(words)
            elif letter == "m":
                self._style = "" if numbers in ("", "0") else f"{self._style};{numbers}"
            elif letter == "H":
                self._row, self._column = (int(number or 1) - 1 for number in (numbers or "1;1").split(";"))
            elif letter == "J":
                self.cells = [[BLANK] * self.columns for _ in self.cells]

    def _write(self, words: str) -> None:
        for char in words:
            if char == "\r":
                self._column = 0
            elif char == "\n":
                self._row += 1
            elif char.isprintable():
                self._put(char)

    def _put(self, char: str) -> None:
        if self._row < len(self.cells) and self._column < self.columns:
            self.cells[self._row][self._column] = (char, self._style)
        self._column += 1 if char.isascii() else cell_len(char)

    @property
    def lines(self) -> list[str]:
        return ["".join(char for char, _ in row) for row in self.cells]

    @property
    def filled(self) -> int:
        """How many cells hold a letter or a digit."""
        return sum(char.isalnum() for row in self.cells for char, _ in row)

    def copy(self) -> list[list[Cell]]:
        return [row[:] for row in self.cells]

    def changed(self, before: list[list[Cell]], columns: slice) -> int:
        """How many cells between these columns changed."""
        return sum(
            now != then
            for row, old in zip(self.cells, before, strict=True)
            if row != old
            for now, then in zip(row[columns], old[columns], strict=True)
        )
